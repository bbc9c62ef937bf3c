"""SHELL: the daemon: its event loop, its parts, and its state that is kept between runs.

``daemon`` puts the parts together, ``dispatcher`` moves bytes between the links and the pipeline. ``network`` has the
node of the MAVLink network, ``timer`` the clock and the timer, ``service_factory`` makes the optional parts,
``journal`` records. ``log`` writes the log, ``status`` the status file and systemd's messages, ``board`` reads the
board's load. ``calibration_store`` and ``signing_store`` keep state between runs. ``lean`` saves memory before any
other module is imported.
"""
