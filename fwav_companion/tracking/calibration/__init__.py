"""Self-calibration: the camera's delay, its mount and the height, from targets that are seen again and again."""
