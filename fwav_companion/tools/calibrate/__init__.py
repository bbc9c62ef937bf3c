"""SHELL: `calibrate`, a camera file from pictures of a printed board.

``pictures`` reads files, folders and videos; ``board_finders`` finds the board that ``board_spec`` describes, and
``missing_board`` says why it was not found. The fit itself is :mod:`fwav_companion.tools.calibrate.lens_fit`.
``calibration_verdict`` judges its result; the other modules show it, write it, and compare it with other camera files.
"""
