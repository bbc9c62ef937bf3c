"""SHELL: the daemon: its event loop, its parts, and what it keeps from one run to the next.

``daemon`` moves bytes between the links and the pipeline. ``network`` is its place in the MAVLink network, ``alarm``
its clock and timer, ``parts`` what the configuration asks for, ``journal`` what is recorded. ``sayings`` writes the
log, ``status`` the status file and systemd's messages, ``board`` reads the board's load. ``calibration_memory`` and
``signing_memory`` keep state between runs. ``lean`` saves memory before all else is imported.
"""
