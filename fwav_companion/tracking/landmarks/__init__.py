"""Landmarks: their sights estimate the errors that all targets share, and the estimate corrects the targets.

In numpy, and imported only where the configuration has a landmark.
"""
