"""Lens models, and the content of calibration files. PURE.

A lens maps pixels to unit rays in the camera frame and back: ``KannalaBrandt`` for fisheyes, ``BrownConrady`` for
pinholes, ``SphereLens`` for the models that go through a sphere. ``parse_calibration`` reads the camera files of this
project, Kalibr, Basalt, ROS, camodocal, OpenCV, OCamCalib, mrcal and gyroflow. numpy is loaded only by ``batch`` (many
pixels at once). ``tools/calibrate/lens_fit`` fits a lens to pictures of a board.
"""

from fwav_companion.camera.brown_conrady import BrownConrady
from fwav_companion.camera.calibration import Calibration, file_and_camera, parse_calibration
from fwav_companion.camera.kannala_brandt import KannalaBrandt

__all__ = ["BrownConrady", "Calibration", "KannalaBrandt", "file_and_camera", "parse_calibration"]
