"""Implements our MAVLink components: identity, TIMESYNC, answers to commands, and requests for message rates. Pure.

``identity`` adopts one autopilot from its heartbeats and times our own heartbeats. Every other file here takes the
adopted autopilot. ``timesync`` exchanges clock readings with it; the clock estimate itself is in ``telemetry/clock``.
``commands`` acknowledges each command to our components once, and answers PING and REQUEST_MESSAGE.

Message rates. ``subscriptions`` derives the wanted messages from the configuration. ``rates`` is the entry: it measures
what arrives, and requests again a rate that fell. ``rate_table`` has a row for each message: the desired rate, what was
there, and the state of the request; it holds a ``rate_search`` for the highest rate that the autopilot accepts.
``rate_reconciler`` learns what is there (``arrivals_before`` counts it) and requests the difference, one question of
``rate_dialogue`` at a time, by SET_MESSAGE_INTERVAL or REQUEST_DATA_STREAM; ``ack_order`` matches acknowledgements to
commands. ``rate_merging`` lists our requests that must follow a station's request, and ``rate_competitors`` finds the
station that changed a rate. ``one_shot_requests`` requests rare messages and parameters; ``requests`` addresses
messages to the autopilot.
"""
