"""PURE: finds the camera's delay, the mount and wrong signs from a tag's four corners while the vehicle is shaken.

Arrays (numpy), rotations and least squares (scipy), the square's pose (OpenCV): only ``check --shake`` loads this
package, the daemon never.
"""
