"""SHELL: recordings of flights, written and read back.

A recording is a folder (``folder``): telemetry as .tlog (``tlog``), detections and targets as JSON lines.
``line_types`` has a Struct for each type of line of a targets file, ``lines`` makes them of the pipeline's results,
``line_decoder`` reads them; ``events`` are the lines among the detections. ``recorder`` writes the folder in a thread
of its own; ``spans`` decides where one begins and ends.
``ardupilot_log`` and ``ulog`` read autopilots' own logs into one ``flight_log``; ``log_messages`` turns that into
telemetry. ``time_checks`` finds damaged times, ``truth`` reads true positions, ``exports`` writes other tools' formats.
"""
