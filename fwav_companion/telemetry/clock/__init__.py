"""Estimates the autopilot's clock in terms of the host's. Pure.

``boot_time`` unwraps stamps and finds reboots. ``clock`` answers, from TIMESYNC where it is answered (``exchanges``,
with ``round_trip_weights``, ``envelopes`` and ``hard_bound``), else from arrivals alone (``arrivals``). Methods:
round-trip weighted offset and skew (Mills, NTP), and the convex hull of delays (Zhang, Liu & Xia 2002).
"""
