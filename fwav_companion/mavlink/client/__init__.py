"""Implements our MAVLink components: identity, TIMESYNC, answers to commands, and requests for message rates. Pure.

``identity`` adopts one autopilot from its heartbeats and times our own heartbeats. Every other file here takes the
adopted autopilot. ``timesync`` exchanges clock readings with it; the clock estimate itself is in ``telemetry/clock``.
``commands`` acknowledges each command to our components once, and answers PING and REQUEST_MESSAGE.

Message rates. ``subscriptions`` derives the wanted messages from the configuration. ``rates`` is the entry: it measures
what arrives, and requests again a rate that fell. ``rate_stream`` is the state of one message; it holds a
``rate_search`` for the highest rate that the autopilot accepts. ``rate_requests`` sends one request at a time and
repeats it, by SET_MESSAGE_INTERVAL or, for an older autopilot, REQUEST_DATA_STREAM. ``attitude_sharing`` divides the
rate between the two attitude messages, and ``rate_competitors`` finds the station that changed a rate. ``rate_merging``
lists our requests that must follow a station's request, ``own_rates`` reads the autopilot's default rates, and
``ack_order`` matches acknowledgements to commands. ``one_shot_requests`` requests rare messages and parameters;
``requests`` addresses messages to the autopilot.
"""
