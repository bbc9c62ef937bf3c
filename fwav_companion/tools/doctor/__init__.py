"""``check``: what is wrong with a set-up, and what to change.

SHELL: ``board`` (with ``board_files``) reads the operating system, ``gathering`` reads the configured files and the
service's status, ``shake_session`` runs ``check --shake``. All other modules judge this evidence and do no I/O.

Reading order: ``finding``, ``evidence``, ``run_status``; one ``*_findings`` module a topic (links, autopilot, landing,
camera, detections, mount, board); ``causes`` lists which findings follow from which, ``examination`` joins the topics,
``report_text`` prints.
"""
