"""What a camera and its mount are, found by shaking: a tag's four corners against the autopilot's attitude.

Pure, and in numpy: ``check --shake`` alone loads this, the daemon never.
"""
