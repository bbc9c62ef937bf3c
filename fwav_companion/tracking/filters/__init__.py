"""Filters of one target: Kalman (static, moving) and the paper's low-pass. Pure."""
