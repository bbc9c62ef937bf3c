"""Reads, routes and writes MAVLink messages. Pure: the time is passed in, and there are no sockets.

``wire`` turns bytes into messages and back. ``router`` decides for each frame of each link where it goes. ``client`` is
the behaviour of our own components: heartbeats, TIMESYNC, commands, message rates.

The modules here serve ``router`` and ``client``, which do not import each other. They do two things:

- Merging of rate requests. ``rate_messages`` reads a station's request and holds what this service requested.
  ``asked_rates`` remembers requests per link, ``merged_rates`` derives the rate of each message on each link, and
  ``rate_merging`` lists the requests that must follow a station's request. ``own_rates`` reads the autopilot's default
  rates, ``stream_groups`` lists ArduPilot's message groups, ``ack_order`` matches acknowledgements to commands.
- Limiting of slow links. ``link_limiter`` decides on each frame, with a token bucket and the radio's feedback
  (``byte_budget``), a fair common rate (``link_load``), a queue for transfers (``held_transfers``) and a list of what
  is never dropped (``never_thinned``).
"""
