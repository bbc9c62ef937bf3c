"""``calibrate``: a camera file from pictures of a printed board. SHELL: reads pictures, and draws how good it is.

Boards and pictures are here; the fit itself is in :mod:`fwav_companion.tools.calibrate.lens_fit`.
"""
