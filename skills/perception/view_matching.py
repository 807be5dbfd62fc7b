"""Likeness of a segment to photographs of an object: its outline, colours and gradients must agree with one of them.

The segment is cut out of the picture as the object is out of a photograph (`view_of`). A histogram of the directions of
gradients in each part of a view tells its edges and its shading (Dalal and Triggs, "Histograms of Oriented Gradients
for Human Detection", 2005).
"""

from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.perception.object_model import VIEW_SIDE, view_of
from skills.perception.point_cloud import closed_mask, nearest_pixels, project
from skills.perception.surface_segmentation import Cluster
from skills.robot import FloatArray, Image

_OPAQUE: Final = 127
_LOW_M: Final = 0.02
"""Height below which points stand for the object's lowest part, too, which the surface's noise hides."""
_SMOOTH_PX, _PARTS, _DIRECTIONS = 2.0, 6, 9
"""Deviation of the smoothing of colours, parts along each side of a view, and directions of gradients."""
_GAIN, _FAR_LAB = (0.6, 1.4), 60.0
"""Limits of the ratio of lightness to a photograph's, and difference beyond which colours are only different."""
_COLOUR, _GRADIENTS, _OUTLINE = 20.0, 0.22, 0.8
"""Differences of colours (Lab), gradients and outlines (0 to 1) that each make the likeness 1 / e."""


def seen_view(cluster: Cluster, image: Image, X_WC: RigidTransform) -> NDArray[np.uint8]:
    """View (24, 24, 4) of a segment, down to the surface, in a picture that is not turned about the camera's axis."""
    low_W = cluster.points.p_W[cluster.points.p_W[:, 2] < cluster.base_m + _LOW_M]
    u, v = project((X_WC.inverse() @ (low_W * [1, 1, 0] + [0, 0, cluster.base_m]).T).T, image.intrinsics)
    pixels = np.concatenate([cluster.points.pixels, nearest_pixels(u, v, image.intrinsics)])
    mask = closed_mask(pixels, *image.grey.shape).astype(np.uint8)
    left, top, width, height = cv2.boundingRect(mask)
    colour = np.repeat(image.grey[..., None], 3, axis=2) if image.colour is None else image.colour
    return view_of(np.dstack([colour, 255 * mask])[top : top + height, left : left + width])


def likeness(seen: NDArray[np.uint8], views: NDArray[np.uint8]) -> float:
    """Likeness (0 to 1) of a view (24, 24, 4) to the nearest of others (V, 24, 24, 4)."""
    own, other = seen[..., 3] > _OPAQUE, views[..., 3] > _OPAQUE
    both = own & other
    outline = both.sum(axis=(1, 2)) / np.maximum((own | other).sum(axis=(1, 2)), 1)
    a, b = lab_of(_smoothed(seen[None])), lab_of(_smoothed(views))
    light, of_view = ((each[..., 0] * both).sum(axis=(1, 2)) for each in (a, b))
    b[..., 0] *= np.clip(light / np.maximum(of_view, 1.0), *_GAIN)[:, None, None]
    off = np.minimum(np.linalg.norm(a - b, axis=-1), _FAR_LAB)
    colour = (off * both).sum(axis=(1, 2)) / np.maximum(both.sum(axis=(1, 2)), 1)
    gradients = _gradients(views) @ _gradients(seen[None])[0]
    terms = (colour / _COLOUR, (1.0 - gradients) / _GRADIENTS, (1.0 - outline) / _OUTLINE)
    return float(np.exp(-sum(term**2 for term in terms)).max())


def lab_of(colours: NDArray[Any]) -> FloatArray:
    """Lab colours (..., 3) of RGB ones."""
    scaled = (colours.reshape(-1, 1, 3) / np.float32(255.0)).astype(np.float32)
    return cv2.cvtColor(scaled, cv2.COLOR_RGB2LAB).reshape(colours.shape).astype(np.float64)


def _smoothed(views: NDArray[np.uint8]) -> FloatArray:
    """Colours (V, 24, 24, 3) of views without their details."""
    opacity = views[..., 3:] / 255.0
    premultiplied = np.concatenate([views[..., :3] * opacity, opacity], axis=-1)
    smooth = np.array([cv2.GaussianBlur(each, (0, 0), _SMOOTH_PX) for each in premultiplied])
    return np.asarray(smooth[..., :3] / np.maximum(smooth[..., 3:], 1e-3))


def _gradients(views: NDArray[np.uint8]) -> FloatArray:
    """Unit vectors (V, N): the square root of the strength of each direction of gradients in each part of a view."""
    opacity = views[..., 3] / 255.0
    light = lab_of(views[..., :3])[..., 0] * opacity
    mean = light.sum(axis=(1, 2)) / np.maximum(opacity.sum(axis=(1, 2)), 1.0)
    down, right = np.gradient(_FAR_LAB * light / np.maximum(mean, 1.0)[:, None, None], axis=(1, 2))
    directions = np.arange(_DIRECTIONS) * np.pi / _DIRECTIONS
    along = np.abs(np.cos(np.arctan2(down, right)[..., None] - directions)) ** 8
    strength = np.minimum(np.hypot(down, right), _FAR_LAB)[..., None] * along
    side = VIEW_SIDE // _PARTS
    parts = np.sqrt(strength.reshape(-1, _PARTS, side, _PARTS, side, _DIRECTIONS).mean(axis=(2, 4)))
    parts = parts.reshape(len(views), -1)
    return np.asarray(parts / np.maximum(np.linalg.norm(parts, axis=1, keepdims=True), 1e-6))
