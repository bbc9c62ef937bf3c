"""Attitude at any instant, and the quality of the attitude stream. Pure.

``history`` stores samples and interpolates with ``interpolation``; ``quality`` measures the stream and chooses the
interpolation, with ``leave_one_out`` and ``rate_fit``; ``sources`` chooses the message; ``pitch_trim`` and
``stamp_delay`` correct errors that autopilots are known to make.
"""
