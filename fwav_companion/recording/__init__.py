"""SHELL: recordings of flights, written and read back.

A recording is a folder (``folder``): telemetry as .tlog (``tlog``), detections and targets as JSON lines (``lines``,
``events``). ``recorder`` writes it in a thread of its own; ``spans`` decides where a folder begins and ends.
``ardupilot_log`` and ``ulog`` read autopilots' own logs into one ``flight_log``; ``log_messages`` turns that into
telemetry. ``time_checks`` finds damaged times, ``truth`` reads true positions, ``exports`` writes other tools' formats.
"""
