"""Routes every frame of every link, delivers messages to us, and sends ours. Pure.

``node`` is the entry. The bytes of a link pass through its scanner (``wire``). Each frame updates the table of the link
on which its sender is heard (``peers``), copies from a second link are dropped (``duplicates``), and ``routing`` gives
the destination links; frames are forwarded byte for byte. The result is kept per sender and message until a table
changes, so that most frames cost a few look-ups. A frame that a slow link cannot carry is thinned or queued.

Limits. ``link_limiter`` decides on each frame by message rates (``rate_limiter``), a token bucket with the radio's
feedback (``byte_budget``), a fair common rate (``link_load``), a queue for transfers (``held_transfers``), and a list
of messages that are never dropped (``never_thinned``). ``station_rates`` remembers the rates that stations request on a
link and derives the rate of each message on each link from them; ``ration`` limits the requests.

Messages for us are decoded if the signature permits (``signing_policy``). Our own messages are numbered, signed and
addressed in ``sending``. ``coalescing`` joins the frames of one send, and ``statistics`` reports what each link carried
and lost.
"""
