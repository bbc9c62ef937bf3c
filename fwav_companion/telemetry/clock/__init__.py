"""Estimates the autopilot's clock in terms of the host's. Pure.

``boot_time`` unwraps stamps and finds reboots. ``clock`` answers, from TIMESYNC where it is answered (``exchanges``,
with ``round_trip_weights``, ``envelopes`` and ``hard_bound``), else from arrivals alone (``arrivals``). A clock that
slips or runs at another rate than a crystal's is followed (``followed``) and reported (``clock_news``). Methods:
round-trip weighted offset and skew (Mills, NTP), and the convex hull of delays (Zhang, Liu & Xia 2002).
"""
