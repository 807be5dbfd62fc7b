"""Detections in 3D made by hand."""

import numpy as np

from skills.api import Detection
from skills.perception.detection_3d import Detection3D


def detected_3d(x=1.0, y=0.0, name="coke", score=0.9, eye=(0.0, 0.0, 1.0), sigma=0.01, stamp=1.0, alternatives=()):
    covariance = sigma**2 * np.eye(3)
    return Detection3D(
        stamp_s=stamp,
        detection=Detection(name, score, (0.0, 0.0, 10.0, 10.0), alternatives),
        position_W=np.array([x, y, 0.8]),
        covariance=covariance,
        place_covariance=covariance,
        size_m=(0.07, 0.07, 0.12),
        yaw_rad=0.0,
        eye_W=np.array(eye),
        pixels=np.empty((0, 2), np.int64),
        colours=np.empty((0, 3), np.uint8),
        surface="table",
    )
