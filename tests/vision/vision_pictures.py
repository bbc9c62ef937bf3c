"""Pictures with targets at known places, drawn by OpenCV's own warps."""

import json

import cv2
import numpy as np


def tag_picture(
    centre=(320.0, 240.0),
    *,
    side_px=60.0,
    turn_deg=20.0,
    tilt=0.0,
    number=7,
    dictionary=cv2.aruco.DICT_APRILTAG_36h11,
    modules=8,
    blur_px=0,
) -> np.ndarray:
    """640x480, one marker whose centre is seen at ``centre``; ``tilt`` foreshortens by perspective."""
    marker = cv2.aruco.generateImageMarker(cv2.aruco.getPredefinedDictionary(dictionary), number, modules)
    board = np.pad(marker, 1, constant_values=255)
    edge = modules + 2.0
    to_unit = np.array([[2 / modules, 0, -(edge - 1) / modules], [0, 2 / modules, -(edge - 1) / modules], [0, 0, 1]])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    half = side_px / 2.0
    place = np.array([[half * c, -half * s, 0], [half * s, half * c, 0], [0, tilt, 1.0]])
    shift = np.array([[1, 0, centre[0]], [0, 1, centre[1]], [0, 0, 1]])
    # Eight times as large, then averaged: edges as a sensor has them.
    fine = np.array([[8, 0, 3.5], [0, 8, 3.5], [0, 0, 1.0]])
    size = (640 * 8, 480 * 8)
    matrix = fine @ shift @ place @ to_unit
    drawn = cv2.warpPerspective(board, matrix, size, flags=cv2.INTER_NEAREST, borderValue=200)
    inside = cv2.warpPerspective(np.full_like(board, 255), matrix, size, flags=cv2.INTER_NEAREST)
    drawn[inside == 0] = 110
    picture = cv2.resize(drawn, (640, 480), interpolation=cv2.INTER_AREA)
    if blur_px:
        picture = cv2.blur(picture, (1, blur_px))
    noise = np.random.default_rng(1).normal(0.0, 2.0, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


def pipe_bytes(picture: np.ndarray, **reported) -> bytes:
    """As a picture travels in a pipe."""
    height, width = picture.shape[:2]
    header = {"size": [width, height], "format": "gray8" if picture.ndim == 2 else "bgr8", **reported}
    return json.dumps(header).encode() + b"\n" + picture.tobytes()
