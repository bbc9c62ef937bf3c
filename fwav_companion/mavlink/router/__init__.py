"""Routes every frame of every link, delivers messages to us, and sends ours. Pure.

``node`` is the entry. The bytes of a link pass through its scanner (``wire``). Each frame updates the table of the link
on which its sender is heard (``peers``), copies from a second link are dropped (``duplicates``), and ``routing`` gives
the links that the frame goes to; frames are forwarded byte for byte. The result is kept per sender and message until a
table changes, so that most frames cost a few look-ups. A frame that a slow link cannot take is thinned or queued
(``mavlink.link_limiter``, with ``rate_limiter``).

Messages for us are decoded if the signature permits (``signing_policy``). Our own messages are numbered, signed and
addressed in ``sending``. ``coalescing`` joins the frames of one send, and ``statistics`` reports what each link carried
and lost.
"""
