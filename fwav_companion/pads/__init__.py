"""A landing pad of several tags as one measurement: all corners of all tags that a picture shows, solved together.

:mod:`pad_pose` is the mathematics (Gauss-Newton over the pad's pose), :mod:`pad_measurement` decides which tags count,
:mod:`pad_sights` replaces the sightings of a pad's tags by one of its landing point. Pure, in numpy: only a flight with
[[pad]], or with a tag of known size, loads it.
"""
