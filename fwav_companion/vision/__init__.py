"""SHELL: receives detections from other processes or from the vision process of this package.

``detections_in`` receives datagrams, ``supervisor`` runs the vision process (``worker``), and both pass what they
receive to ``frame_receiver``, which stamps the arrival (``wall_clock``) and parses the wire format (``wire``). The
daemon and the vision process share ``task``; only the vision process loads ``images``, ``sources`` and ``detectors``.
"""
