"""A lens from pictures of a flat board: numpy, and so never loaded by the daemon. Pure.

``fit_lens`` in :mod:`fwav_companion.tools.calibrate.lens_fit.fit` is the way in.
"""
