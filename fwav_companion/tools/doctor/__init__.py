"""``check``: what is wrong with a set-up, and what to change.

SHELL: ``board`` (with ``board_files``) reads the operating system, ``gathering`` reads the configured files and the
service's status, ``shake_session`` runs ``check --shake``. The rest judges what they found and does no I/O.

Reading order: ``finding``, ``evidence``, ``run_status``; one ``*_findings`` module a topic (links, autopilot, landing,
camera, detections, mount, board); ``causes`` lists what follows from what, ``examination`` joins the topics,
``report_text`` prints.
"""
