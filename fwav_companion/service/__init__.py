"""SHELL: the daemon: its event loop, its parts, and what it keeps from one run to the next.

``daemon`` moves bytes between the links and the pipeline. ``network`` is its place in the MAVLink network, ``timer``
its clock and timer, ``service_factory`` makes the optional parts, ``journal`` records. ``log`` writes the log,
``status`` the status file and systemd's messages, ``board`` reads the board's load. ``calibration_store`` and
``signing_store`` keep state between runs. ``lean`` saves memory before any other module is imported.
"""
