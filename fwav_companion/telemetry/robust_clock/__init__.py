"""The autopilot's clock in terms of the host's. Built beside ``telemetry.clock``: no flight uses it yet. Pure.

``clock`` answers, with one estimate a link (``link_clock``): a robust
line through the TIMESYNC exchanges that agree (``exchange_clock``, ``exchange_fit``), which each message's arrival
watches (``arrival_watch``); where requests are not answered, the same line from the one-sided bounds of arrivals
(``arrivals``). ``clock_news`` reports a step or a rate. Methods: round-trip weighted offset and skew (Mills, NTP), and
the convex hull of delays (Zhang, Liu & Xia 2002).

``python tests/telemetry/clock_table.py`` prints its errors and claims over drawn exchanges, beside those of
the filter that PX4 and mavros use.
"""
