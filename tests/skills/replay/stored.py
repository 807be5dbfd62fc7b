"""Robot data as plain arrays and JSON in one file."""

import json

import cv2
import numpy as np
from pydrake.math import RigidTransform

from skills.api import Detection, LocalisationEstimate, Surface
from skills.grid_map import GridMap
from skills.manipulation.grasp.planning import Box, Surroundings, Target
from skills.robot import FrameTree, Image, Intrinsics, Odometry, Pose2D, Scan

SEEN = (FrameTree, Image, Intrinsics, Odometry, Pose2D, Scan, GridMap, LocalisationEstimate)
KINDS = {each.__name__: each for each in (*SEEN, Box, Detection, Surface, Surroundings, Target)}


def save(file, given):
    """Writes dataclasses, transforms, arrays and plain values; equal arrays once."""
    arrays = {}

    def plain(value):
        if isinstance(value, RigidTransform):
            return {"transform": value.GetAsMatrix34().tolist()}
        if isinstance(value, np.ndarray):
            packed = pack(value)
            return {"array": arrays.setdefault((packed.shape, packed.tobytes()), (str(len(arrays)), packed))[0]}
        return {"is": type(value).__name__, **{name: getattr(value, name) for name in type(value).__match_args__}}

    np.savez_compressed(file, text=json.dumps(given, default=plain), **dict(arrays.values()))


def load(file):
    """Reads what `save` wrote; tuples become lists."""
    with np.load(file) as arrays:

        def restored(value):
            if "transform" in value:
                return RigidTransform(np.array(value["transform"]))
            return unpack(arrays[value["array"]]) if "array" in value else KINDS.get(value.pop("is", ""), dict)(**value)

        return json.loads(str(arrays["text"]), object_hook=restored)


def pack(array):
    """Colour as JPEG; ranges and depth in mm as PNG, with 65535 for no return; many points in tenths of mm."""
    if array.ndim == 3:
        return cv2.imencode(".jpg", array[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    if array.dtype == np.float32:
        return cv2.imencode(".png", np.rint(1000.0 * np.nan_to_num(array, nan=65.535)).astype(np.uint16))[1]
    return np.rint(10_000.0 * array).astype(np.int16) if array.dtype == np.float64 and array.size > 1000 else array


def unpack(array):
    if array.dtype != np.uint8 or array.ndim != 1:
        return array / 10_000.0 if array.dtype == np.int16 else array
    picture = cv2.imdecode(array, cv2.IMREAD_UNCHANGED)
    return picture[..., ::-1].copy() if picture.ndim == 3 else picture.astype(np.float32) / 1000.0
