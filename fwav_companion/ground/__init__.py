"""The ground picture: vehicles and targets of one or many vehicles on one map, served as a web page.

A process of its own, never loaded by `run`. PURE modules are handed the time and do no I/O: ``views`` are the structs
that the page receives, ``picture`` joins all inputs, ``vehicle_messages`` and ``target_messages`` decode MAVLink into
it, ``text_chunks`` joins STATUSTEXT, ``footprint`` is the ground in a camera's view, ``recorded_lines`` reads recorded
lines, ``exports`` writes GeoJSON, KML, CSV and Cursor on Target, ``access`` decides which requests are answered.
SHELL modules: ``station`` (links and heartbeats), ``server`` (HTTP and events), ``tiles`` (MBTiles), ``status_reader``,
``replay_reader``, ``picture_recorder``, and ``ground_process``, which joins them.
"""
