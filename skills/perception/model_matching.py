"""Recognition of imported objects: segments of a depth picture are matched against models in size, shape and colours.

An object rests on a surface, so its pose is one of its resting rotations, a turn about the vertical and a position. The
segment's points are compared with the model's surface at a set of turns; the best are refined by ICP (point to plane).
A pose is accepted when the segment's points lie on the model, the picture shows no farther surface through the model,
and the colours agree. A model made from photographs has no surface but its bounding box: the object must have its size,
and outline, colours and gradients as in one of the photographs. A histogram of gradient directions in each cell of a
view describes its edges and its shading (Dalal and Triggs, "Histograms of Oriented Gradients for Human Detection",
2005).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Detection, LocalisationEstimate
from skills.detection import Detector, DetectorWrapper
from skills.perception.detection_3d import Detection3D
from skills.perception.object_model import VIEW_SIDE, ObjectModel, read_model, view_of
from skills.perception.point_cloud import MIN_DEPTH_M, camera_pose_W, closed_mask, nearest_pixels, project
from skills.perception.surface_segmentation import Cluster, segment_3d
from skills.robot import FloatArray, Image
from skills.world_model import Tag

_TURNS: Final = 24
"""Number of turns about the vertical that are tried."""
_POSES: Final = 3
"""Number of the best poses that are refined."""
_STEPS: Final = 8
"""Number of steps of ICP."""
_POINTS: Final = 250
"""Number of a segment's points that a refinement uses, about."""
_HEIGHT_M: Final = 0.010
"""Largest difference of the height, plus the next fraction of the model's height."""
_HEIGHT_SHARE: Final = 0.06
_WIDER_M: Final = 0.015
"""Distance by which a segment may be wider than its model."""
_LEAST_WIDTH: Final = 0.6
"""Least width of a segment as a fraction of its model's width."""
_WIDER_THAN_BOX_M: Final = 0.010
"""The same for a model of photographs: what is hidden in part does not look as in them."""
_LEAST_WIDTH_OF_BOX: Final = 0.8
"""Least width of a segment as a fraction of the width of a model of photographs."""
_FAR_M: Final = 0.02
"""Distance from the model beyond which a point is not on it."""
_FAR_SIGMAS: Final = 10.0
"""Distance from the model beyond which a point counts no more, in sigmas of the depth."""
_IN_SEGMENT_M: Final = 0.01
"""Distance from a segment's points within which a point of the model belongs to the segment."""
_FRONT: Final = 0.15
"""Least cosine between a surface's normal and the view at which the camera sees the surface."""
_CELL_PX: Final = 8.0
"""Side of the cells in which the nearest points of a model hide the others."""
_LEAST: Final = 0.35
"""Least quality of a fit that identifies an object."""
_ALIKE: Final = 0.75
"""Quality of another fit, as a fraction of the best one's, from which on the object may be either."""
_MOST_HIDDEN: Final = 0.5
"""Largest fraction of a model's front that may be hidden."""
_OPAQUE: Final = 127
_LOW_M: Final = 0.02
"""Height below which points stand for the object's lowest part, too, which the surface's noise hides."""
_SMOOTH_PX: Final = 2.0
"""Standard deviation of the smoothing of colours."""
_PARTS: Final = 6
"""Parts along each side of a view that have a histogram of gradients."""
_DIRECTIONS: Final = 9
"""Directions in a histogram of gradients."""
_GAIN: Final = (0.6, 1.4)
"""Limits of the ratio of lightness to a photograph's."""
_FAR_LAB: Final = 60.0
"""Difference beyond which colours are only different."""
_COLOUR_LAB: Final = 20.0
"""Difference of colours that makes the likeness 1 / e; the next two do so for gradients and outlines (0 to 1)."""
_GRADIENTS: Final = 0.22
_OUTLINE: Final = 0.8


def seen_view(cluster: Cluster, image: Image, X_WC: RigidTransform) -> NDArray[np.uint8]:
    """View (24, 24, 4) of a segment, down to the surface, in a picture that is upright."""
    return view_of(segment_picture(cluster, image, X_WC))


def segment_picture(cluster: Cluster, image: Image, X_WC: RigidTransform) -> NDArray[np.uint8]:
    """Picture (H, W, 4) of a segment, down to the surface, within its bounds and transparent around it."""
    low_W = cluster.points.p_W[cluster.points.p_W[:, 2] < cluster.base_m + _LOW_M]
    u, v = project((X_WC.inverse() @ (low_W * [1, 1, 0] + [0, 0, cluster.base_m]).T).T, image.intrinsics)
    pixels = np.concatenate([cluster.points.pixels, nearest_pixels(u, v, image.intrinsics)])
    mask = closed_mask(pixels, *image.grey.shape).astype(np.uint8)
    left, top, width, height = cv2.boundingRect(mask)
    colour = np.repeat(image.grey[..., None], 3, axis=2) if image.colour is None else image.colour
    return np.dstack([colour, 255 * mask])[top : top + height, left : left + width]


def likeness(seen: NDArray[np.uint8], views: NDArray[np.uint8]) -> float:
    """Similarity (0 to 1) between a view (24, 24, 4) and the most similar of others (V, 24, 24, 4)."""
    own, other = seen[..., 3] > _OPAQUE, views[..., 3] > _OPAQUE
    both = own & other
    outline = both.sum(axis=(1, 2)) / np.maximum((own | other).sum(axis=(1, 2)), 1)
    a, b = lab_of(_smoothed(seen[None])), lab_of(_smoothed(views))
    light, of_view = ((each[..., 0] * both).sum(axis=(1, 2)) for each in (a, b))
    b[..., 0] *= np.clip(light / np.maximum(of_view, 1.0), *_GAIN)[:, None, None]
    off = np.minimum(np.linalg.norm(a - b, axis=-1), _FAR_LAB)
    colour = (off * both).sum(axis=(1, 2)) / np.maximum(both.sum(axis=(1, 2)), 1)
    gradients = _gradients(views) @ _gradients(seen[None])[0]
    terms = (colour / _COLOUR_LAB, (1.0 - gradients) / _GRADIENTS, (1.0 - outline) / _OUTLINE)
    return float(np.exp(-sum(term**2 for term in terms)).max())


def lab_of(colours: NDArray[Any]) -> FloatArray:
    """Converts RGB colours to Lab (..., 3)."""
    scaled = (colours.reshape(-1, 1, 3) / np.float32(255.0)).astype(np.float32)
    return cv2.cvtColor(scaled, cv2.COLOR_RGB2LAB).reshape(colours.shape).astype(np.float64)


def _smoothed(views: NDArray[np.uint8]) -> FloatArray:
    """Low-pass filtered colours (V, 24, 24, 3) of views."""
    opacity = views[..., 3:] / 255.0
    premultiplied = np.concatenate([views[..., :3] * opacity, opacity], axis=-1)
    smooth = np.array([cv2.GaussianBlur(each, (0, 0), _SMOOTH_PX) for each in premultiplied])
    return np.asarray(smooth[..., :3] / np.maximum(smooth[..., 3:], 1e-3))


def _gradients(views: NDArray[np.uint8]) -> FloatArray:
    """Unit vectors (V, N): histograms of gradient directions in each cell of a view, as square roots."""
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


@dataclass(frozen=True)
class Sight:
    """A depth picture, and the pose of its camera in the world."""

    image: Image
    X_WC: RigidTransform

    def sigma_m(self, z: FloatArray) -> FloatArray:
        """Standard deviation of depths (m)."""
        return 0.002 + 0.0015 * z**2


@dataclass(frozen=True)
class Fit:
    """Hypothesis: pose X_WM of a model that may explain a segment, and its agreement with the picture.

    `on_model`: fraction of the segment's points on the model; `off`: their mean distance from it in sigmas of the
    depth. `shown`: fraction of the model's visible front that the segment covers; `hidden`: fraction of the front that
    is occluded or part of another object. `colour`: mean difference in Lab. `likeness`: similarity to the nearest
    photograph, the only measure of a model made from photographs.
    """

    model: ObjectModel
    X_WM: RigidTransform
    on_model: float
    off: float
    shown: float
    hidden: float
    colour: float
    likeness: float = 1.0


def fits(cluster: Cluster, sight: Sight, models: Iterable[ObjectModel]) -> list[Fit]:
    """Fits of those models whose size a segment has."""
    return [fit for model in models if (fit := _best(cluster, sight, model)) is not None]


def _best(cluster: Cluster, sight: Sight, model: ObjectModel) -> Fit | None:
    step = max(1, len(cluster.points) // _POINTS)
    p_W = cluster.points.p_W[::step]
    poses = _first_poses(cluster, p_W, sight, model)
    if len(model.views) and poses:
        alike = likeness(seen_view(cluster, sight.image, sight.X_WC), model.views)
        return Fit(model, poses[0], 1.0, 0.0, 1.0, 0.0, 0.0, alike)
    found = [_judged(cluster, sight, model, _refined(p_W, model, X_WM)) for X_WM in poses]
    return max(found, key=quality, default=None)


def _first_poses(cluster: Cluster, p_W: FloatArray, sight: Sight, model: ObjectModel) -> list[RigidTransform]:
    """Poses of the model whose surface lies nearest to a segment's points, one for each of several directions."""
    along, across = _view(cluster, sight)
    height_m = float(np.percentile(p_W[:, 2] - cluster.plane.z(p_W[:, :2]), 99.5))
    left, right = np.percentile(p_W @ across, [1, 99])
    near = float(np.percentile(p_W @ along, 2))
    tried = list[tuple[float, RigidTransform]]()
    some = p_W[:: max(1, len(p_W) // 120)]
    least, wider_m = (_LEAST_WIDTH_OF_BOX, _WIDER_THAN_BOX_M) if len(model.views) else (_LEAST_WIDTH, _WIDER_M)
    for R in model.rests:
        rest = model.points @ R.T
        top_m = float(np.ptp(rest[:, 2]))
        if abs(top_m - height_m) > _HEIGHT_M + _HEIGHT_SHARE * top_m:
            continue
        # only a body with edges is wider across than its sides
        widest_m = float(np.ptp(rest[:, :2], axis=0).max()) if len(model.views) and cluster.shape.round else math.inf
        for turn in np.arange(_TURNS) * (2.0 * math.pi / _TURNS):
            R_WM = RotationMatrix.MakeZRotation(float(turn)).matrix() @ R
            turned = model.points @ R_WM.T
            low, high = (turned @ across).min(), (turned @ across).max()
            if not least * (high - low) - wider_m < right - left < min(high - low, widest_m) + wider_m:
                continue
            xy = (near - (turned @ along).min()) * along + 0.5 * (left + right - low - high) * across
            p_WM = np.array([xy[0], xy[1], cluster.base_m - rest[:, 2].min()])
            off = model.tree.query((some - p_WM) @ R_WM)[0]
            cost = float(np.minimum(off, _FAR_M).mean())
            tried.append((cost, RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_WM), p_WM)))
    return _apart(sorted(tried, key=lambda one: one[0]))


def _apart(tried: list[tuple[float, RigidTransform]]) -> list[RigidTransform]:
    """The best poses that differ clearly from each other."""
    chosen = list[RigidTransform]()
    for _, X in tried:
        if all((X.rotation().inverse() @ other.rotation()).ToAngleAxis().angle() > 0.5 for other in chosen):
            chosen.append(X)
        if len(chosen) == _POSES:
            break
    return chosen


def _view(cluster: Cluster, sight: Sight) -> tuple[FloatArray, FloatArray]:
    """Horizontal unit vectors (3,) along and across the line of sight to a segment."""
    off = np.array(cluster.shape.centre) - sight.X_WC.translation()[:2]
    x, y = off / max(float(np.linalg.norm(off)), 1e-6)
    return np.array([x, y, 0.0]), np.array([-y, x, 0.0])


def _refined(p_W: FloatArray, model: ObjectModel, X_WM: RigidTransform) -> RigidTransform:
    """Pose after several steps of ICP, point to plane, about the vertical."""
    R_WM, p_WM = X_WM.rotation().matrix(), np.array(X_WM.translation())
    base_m = p_WM[2]
    for _ in range(_STEPS):
        q_M = (p_W - p_WM) @ R_WM
        far, index = model.tree.query(q_M)
        near = far < _FAR_M
        if np.count_nonzero(near) < 10:
            break
        n_W = model.normals[index[near]] @ R_WM.T
        residual = np.einsum("ij,ij->i", q_M[near] - model.points[index[near]], model.normals[index[near]])
        lever = p_W[near] - p_WM
        moved = np.column_stack([n_W, n_W[:, 1] * lever[:, 0] - n_W[:, 0] * lever[:, 1]])
        weight = 1.0 / np.maximum(1.0, np.abs(residual) / 0.004)
        normal = (moved * weight[:, None]).T @ moved + np.diag([1e-3, 1e-3, len(residual), 1e-5])
        step = np.linalg.solve(
            normal, (moved * weight[:, None]).T @ residual + [0, 0, len(residual) * (base_m - p_WM[2]), 0]
        )
        p_WM = p_WM + step[:3]
        R_WM = RotationMatrix.MakeZRotation(float(step[3])).matrix() @ R_WM
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_WM), p_WM)


def _judged(cluster: Cluster, sight: Sight, model: ObjectModel, X_WM: RigidTransform) -> Fit:
    """Agreement of a pose with the segment and the picture."""
    step = max(1, len(cluster.points) // (3 * _POINTS))
    points = cluster.points.p_W[::step]
    q_M = (points - X_WM.translation()) @ X_WM.rotation().matrix()
    far, index = model.tree.query(q_M)
    plane = np.abs(np.einsum("ij,ij->i", q_M - model.points[index], model.normals[index]))
    off = np.where(far < _FAR_M, np.minimum(plane, far), far)
    z = (points - sight.X_WC.translation()) @ sight.X_WC.rotation().matrix()[:, 2]
    sigma_m = sight.sigma_m(z)
    on = off < 0.003 + 2.5 * sigma_m
    agree, through, hidden = _shown(points, sight, model, X_WM)
    seen = max(agree + through, 1)
    colour = _colour_difference(cluster.points.colours[::step][on], model.colours[index[on]])
    return Fit(
        model,
        X_WM,
        float(on.mean()),
        float(np.minimum(off / sigma_m, _FAR_SIGMAS).mean()),
        agree / seen,
        hidden / max(seen + hidden, 1),
        colour,
    )


def _shown(p_W: FloatArray, sight: Sight, model: ObjectModel, X_WM: RigidTransform) -> tuple[int, int, int]:
    """Counts of points on the model's front: in the segment p_W (N, 3), looked through, and part of another object."""
    from scipy.spatial import cKDTree

    X_CM = sight.X_WC.inverse() @ X_WM
    p_C = model.points @ X_CM.rotation().matrix().T + X_CM.translation()
    n_C = model.normals @ X_CM.rotation().matrix().T
    facing = -np.einsum("ij,ij->i", n_C, p_C) > _FRONT * np.linalg.norm(p_C, axis=1)
    above = (model.points @ X_WM.rotation().matrix()[2]) + X_WM.translation()[2] > p_W[:, 2].min()
    p_C = p_C[facing & above & (p_C[:, 2] > MIN_DEPTH_M)]
    lens, depth = sight.image.depth_intrinsics, sight.image.depth_m
    u, v = project(p_C, lens)
    inside = (u > 1) & (v > 1) & (u < lens.width - 2) & (v < lens.height - 2)
    p_C, u, v = p_C[inside], u[inside], v[inside]
    if not len(p_C):
        return 0, 0, 1
    front = _front(u, v, p_C[:, 2])
    z, p_WS = p_C[front, 2], sight.X_WC @ p_C[front].T
    own = cKDTree(p_W).query(p_WS.T)[0] < _IN_SEGMENT_M
    (columns, rows), reach = nearest_pixels(u[front], v[front], lens).T, (-1, 0, 1)
    around = np.stack([depth[rows + j, columns + i] for i in reach for j in reach]).astype(np.float64)
    around[around < MIN_DEPTH_M] = np.nan
    known = ~np.isnan(around).all(axis=0)
    off = around[:, known] - z[known]
    tolerance = 0.006 + 3.0 * sight.sigma_m(z[known])
    agree = (np.abs(off) < tolerance).any(axis=0)  # a comparison with NaN is false
    behind = np.nanmin(off, axis=0) > 0.0
    shown = agree & own[known]
    through = ~agree & behind
    return int(shown.sum()), int(through.sum()), int((~shown & ~through).sum())


def _front(u: FloatArray, v: FloatArray, z: FloatArray) -> NDArray[np.bool_]:
    """Mask of the points that no other point of the model occludes, on a coarse grid of pixels."""
    cells = np.floor(np.column_stack([u, v]) / _CELL_PX).astype(np.int64)
    _, index = np.unique(cells, axis=0, return_inverse=True)
    nearest = np.full(int(index.max()) + 1, np.inf)
    np.minimum.at(nearest, index.reshape(-1), z)
    return np.asarray(z < nearest[index.reshape(-1)] + 0.02)


def _colour_difference(seen: NDArray[np.uint8], of_model: NDArray[np.uint8]) -> float:
    """Mean difference between colours (N, 3) in Lab, after their lightness is equalised within limits."""
    if len(seen) == 0:
        return 100.0
    a, b = (lab_of(colours) for colours in (seen, of_model))
    gain = float(np.clip(a[:, 0].mean() / max(b[:, 0].mean(), 1.0), 0.6, 1.4))
    return float(np.minimum(np.linalg.norm(a - b * [gain, 1.0, 1.0], axis=1), 60.0).mean())


def quality(fit: Fit) -> float:
    """Similarity that a fit reaches, 0 to 1."""
    shape = max(0.0, 1.0 - 4.0 * (1.0 - fit.on_model)) * max(0.0, 1.0 - 3.0 * (1.0 - fit.shown))
    return float(fit.likeness * shape * math.exp(-((fit.colour / 30.0) ** 2)) * math.exp(-(fit.off**4)))


def identified(
    clusters: Iterable[Cluster], image: Image, place: LocalisationEstimate, models: Mapping[str, ObjectModel]
) -> tuple[Detection3D, ...]:
    """Detections, one for each segment, with the name of the model that fits; `ANY_OBJECT` when none fits.

    A segment that fits two models almost equally well has both as `alternatives`.
    """
    sight = Sight(image, camera_pose_W(image, place.X_WO))
    return tuple(_identified(each, sight, place, models) for each in clusters)


def _identified(
    cluster: Cluster, sight: Sight, place: LocalisationEstimate, models: Mapping[str, ObjectModel]
) -> Detection3D:
    unknown = segment_3d(cluster, sight.image, place)
    found = sorted(fits(cluster, sight, models.values()), key=quality, reverse=True)
    good = [fit for fit in found if quality(fit) >= _LEAST and fit.hidden <= _MOST_HIDDEN]
    if not good:
        return unknown
    first, others = good[0], [fit for fit in good[1:] if quality(fit) > _ALIKE * quality(good[0])]
    if others:
        alternatives = tuple((fit.model.name, 0.5) for fit in (first, *others))
        return replace(unknown, detection=replace(unknown.detection, score=0.5, alternatives=alternatives))
    return _detected(first, unknown)


def _detected(fit: Fit, segment: Detection3D) -> Detection3D:
    """Detection of a segment with the name, the position and the extents of the model that fits it."""
    R_WM, p_WM = fit.X_WM.rotation(), fit.X_WM.translation()
    turned = fit.model.points @ R_WM.matrix().T
    (x, y), (length, width), angle_deg = cv2.minAreaRect(turned[:, :2].astype(np.float32))
    yaw = math.radians(angle_deg) + (0.0 if length >= width else 0.5 * math.pi)
    z = 0.5 * float(turned[:, 2].min() + turned[:, 2].max())
    return replace(
        segment,
        detection=Detection(fit.model.name, 0.55 + 0.4 * quality(fit), segment.detection.box),
        position_W=p_WM + [x, y, z],
        size_m=(max(length, width), min(length, width), float(np.ptp(turned[:, 2]))),
        yaw_rad=yaw,
    )


def with_models(detector: Detector, folders: Iterable[Path], tags: Sequence[Tag] = ()) -> Detector:
    """Adds the models in these folders to a detector; the same detector for no folder. Raises InputError."""
    models = [read_model(folder) for folder in folders]
    return ModelDetector(detector, models) if models else detector


class ModelDetector(DetectorWrapper):
    """Detector that detects as the wrapped one does, and provides models of imported objects."""

    def __init__(self, detector: Detector, models: Iterable[ObjectModel]) -> None:
        super().__init__(detector)
        self.models = MappingProxyType({**self.models, **{model.name: model for model in models}})
