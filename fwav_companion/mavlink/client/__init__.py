"""Implements our MAVLink components: identity, TIMESYNC, answers to commands, and requests for message rates. Pure.

``identity`` adopts one autopilot from its heartbeats and times our own heartbeats. Every other file here takes the
adopted autopilot. ``timesync`` exchanges clock readings with it; the clock estimate itself is in ``telemetry/clock``.
``commands`` acknowledges each command to our components once, and answers PING and REQUEST_MESSAGE.

Message rates. ``subscriptions`` derives the wanted messages from the configuration. ``rates`` is the entry: it measures
what arrives, requests again a rate that fell, and names the station that changed it. ``rate_table`` has a row for each
message: the desired rate, what was there, and the state of the request; it uses ``rate_search`` for the highest rate
that the autopilot accepts, and to measure. ``rate_reconciler`` learns what is there and requests the difference, one
question of ``rate_dialogue`` at a time, by SET_MESSAGE_INTERVAL or REQUEST_DATA_STREAM, and what a station's request
lowers in the same write. ``one_shot_requests`` requests rare messages and parameters; ``requests`` addresses messages
to the autopilot.
"""
