"""Landmarks: what their sights show of the errors that all targets share, and the targets corrected by it.

In numpy, and imported only where the configuration has a landmark.
"""
