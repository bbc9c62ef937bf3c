"""What is kept of a flight: telemetry as .tlog, detections and targets as JSON lines, and how they are read back."""
