"""SHELL: the demonstration: mock autopilot and rendered camera in their own processes, and the service as it flies.

Reading order: ``flight_setup`` makes the configuration of the flight, ``flight`` runs and watches it, ``scoreboard``
compares targets with the truth, ``live_table`` shows them, ``demo_report`` writes the report, with
``calibration_flight`` as the second flight in it.
"""
