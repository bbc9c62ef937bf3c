"""Estimates the autopilot's clock in terms of the host's. Pure.

``boot_time`` unwraps stamps and finds reboots. ``clock`` answers, with one estimate a link (``link_clock``): a robust
line through the TIMESYNC exchanges that agree (``exchange_clock``, ``exchange_fit``), which each message's arrival
watches (``arrival_watch``); where requests are not answered, the same line from the one-sided bounds of arrivals
(``arrivals``). ``clock_news`` reports a step or a rate. Methods: round-trip weighted offset and skew (Mills, NTP), and
the convex hull of delays (Zhang, Liu & Xia 2002).
"""
