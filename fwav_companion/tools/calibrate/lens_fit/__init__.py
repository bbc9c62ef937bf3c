"""A lens from pictures of a flat board, by bundle adjustment in numpy. PURE; the daemon never loads it.

``fit_lens`` of :mod:`fwav_companion.tools.calibrate.lens_fit.lens_fit` is the entry point. Its steps, a module each:

1. ``initial_estimate``: an equidistant lens and the board poses in closed form.
2. ``outliers``: corners and pictures that disagree with the most flexible lens are removed.
3. ``polynomial_order``: the fewest radial coefficients that the corners support.
4. ``lens_accuracy``: covariance of the lens and of its rays, and the angle up to which the fit is valid.

``reprojection`` holds the observations and the projection with its derivatives, ``bundle_adjustment`` the optimizer.
"""
