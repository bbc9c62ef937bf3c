"""Estimates the autopilot's clock in terms of the host's. Pure.

``boot_time`` unwraps stamps and finds reboots. ``clock`` answers, with one estimate a link: the middle of the
widest band between the bounds of the TIMESYNC exchanges that agree (``exchange_clock`` locks and suspects,
``exchange_window`` keeps, ``band`` fits, ``agreement`` chooses), which each message's arrival watches; where requests
are not answered, a line from the one-sided bounds of arrivals (``arrivals`` has both). ``clock_news`` reports a step or
a rate. Methods: agreement and popcorn filter (Marzullo 1984; Mills, NTP), and the convex hull of delays (Zhang, Liu &
Xia 2002).
"""
