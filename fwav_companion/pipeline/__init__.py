"""The pipeline: messages and frames in; messages, recorded lines and notices out. PURE: it is handed the time.

``pipeline`` handles the events. ``sight`` takes a camera's frames to tracks. ``consequences`` applies what one room
found to the others, and reports readiness. ``wiring`` makes the rooms from a configuration, ``rooms`` holds them.
``ledger`` counts and writes the targets file; ``outlet`` buffers the outputs. ``sayings`` and ``calibration_news`` word
the notices; ``expectation`` predicts the accuracy of a fix.
"""
