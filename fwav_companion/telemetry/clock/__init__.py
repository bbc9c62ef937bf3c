"""Estimates the autopilot's clock in terms of the host's. Pure.

``boot_time`` unwraps stamps and finds reboots. ``clock`` answers, with one estimate a link: a robust line through the
TIMESYNC exchanges that agree (``exchange_clock``, fitted in ``exchange_window``), which each message's arrival watches;
where requests are not answered, a line from the one-sided bounds of arrivals (``arrivals`` has both). ``clock_news``
reports a step or a rate. Methods: round-trip weighted offset and skew (Mills, NTP), and the convex hull of delays
(Zhang, Liu & Xia 2002).
"""
