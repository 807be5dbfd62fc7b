"""Close view of the object to grasp and of its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, InputsT, LocalisationEstimate, ObjectKind, ObjectObservation, Surface
from skills.class_forms import ANY_OBJECT
from skills.detect.viewpoints import cluster_boxes, part_box, surface_boxes
from skills.manipulation.arm.collision import Box
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import TALL_M, close_viewpoints, overview_viewpoints, sees_closely
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.planning import Obstacle
from skills.perception.detection_3d import Detection3D, detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.perception.point_cloud import camera_pose_W
from skills.perception.surface_segmentation import (
    HIGHEST_M,
    LONGEST_M,
    Cluster,
    SurfaceView,
    matching_cluster,
    segment_surface,
    split_detected,
    split_touching,
)
from skills.robot import FloatArray, Image
from skills.routine import Routine, SkillFailure

LOOK_HALF_SIDE_M = 0.4
"""Half side of the patch of surface that is viewed."""
SURFACE_AROUND_M = 0.2
"""Half side of the patch around the object that counts as surface, because the camera may miss its edge."""
_SURFACE_YIELDS_M = 0.003
"""Depth by which the surface is taken lower than it was seen."""
_NEIGHBOUR_GROWN_M = 0.005
"""Excess of neighbours' boxes over their true size, by the noise of the depth."""
_TALLER_M = 0.05
"""Height that an observation from afar may miss."""
WIDE = 0.9
"""Opening of a hinged gripper for the approach, as a fraction of the maximum; it does not occlude the view."""
OWN_M = 0.05
"""Margin around an object within which cells are its own."""
_SURFACE_BAND_M = 0.06
"""Depth below the object's base down to which cells are the surface's own."""
_KNOWN_ABOVE_M = 0.34
"""Height above the object's base up to which the space around it is known."""
_ASIDE_RAD = (0.0, 0.8, -0.8)
"""Angles of the viewpoints about a partly hidden object."""
_MOST_OF_LENGTH = 0.7
"""A view that shows this part of the object's length is enough."""


@dataclass(frozen=True)
class CloseView:
    """Close view of an object and its obstacles, with X_WB at that time.

    `others` are the objects among the boxes, without long ones such as walls.
    """

    target: Target
    boxes: tuple[Box, ...]
    target_box: Box
    X_WB: RigidTransform
    others: tuple[Obstacle, ...] = ()

    def shift(self, offset_B: FloatArray) -> CloseView:
        """Returns the view with the object shifted horizontally by offset_B (3,)."""
        x, y = np.array(self.target.centre_B) + offset_B[:2]
        target = replace(self.target, points_B=self.target.points_B + offset_B, centre_B=(float(x), float(y)))
        box = Box(RigidTransform(offset_B) @ self.target_box.X_FG, self.target_box.size_m)
        return replace(self, target=target, target_box=box)


def square(
    position_W: tuple[float, float, float], height_m: float, name: str, half: float = LOOK_HALF_SIDE_M
) -> Surface:
    """Returns a square surface around a point."""
    x, y, _ = position_W
    corners = ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
    return Surface(name, corners, height_m)


def examine(
    image: Image,
    X_WB: RigidTransform,
    surface: Surface,
    seen: ObjectObservation,
    place: LocalisationEstimate,
    found: tuple[Detection3D, ...],
    within_m: float,
) -> CloseView | None:
    """Finds the object within a distance (m) of its last position; None when it is not there."""
    highest_m = max(HIGHEST_M, seen.size_m[2] + _TALLER_M)
    view = segment_surface(image, place.X_WO, surface, margin_m=0.0, highest_m=highest_m)
    if view is None:
        return None
    own = [each for each in found if seen.kind.name in (ANY_OBJECT, each.detection.class_name)]
    view = reduce(split_detected, own, view)
    own = [] if seen.kind.name == ANY_OBJECT else own
    view = _split_others(view, own, camera_pose_W(image, place.X_WO).translation())
    cluster = _same_object(view, seen, own, within_m)
    if cluster is None:
        return None
    names = {id(matching_cluster(view.clusters, each)): each.class_name for each in found}
    others = tuple(
        Obstacle(
            _observed(each, names.get(id(each), ANY_OBJECT), seen, image),
            tuple(cluster_boxes([each], X_WB, _NEIGHBOUR_GROWN_M)),
        )
        for each in view.clusters
        if each is not cluster
    )
    surfaces = surface_boxes([_seen_surface(view, surface, cluster.shape.centre)], X_WB)
    boxes = (*surfaces, *(box for other in others for box in other.boxes))
    objects = tuple(other for other in others if max(other.seen.size_m) < LONGEST_M)
    own_box = part_box(cluster, cluster.points.p_W[:, :2], X_WB)
    return CloseView(_target(cluster, X_WB), boxes, own_box, X_WB, objects)


def _split_others(view: SurfaceView, own: Sequence[Detection3D], p_WC: FloatArray) -> SurfaceView:
    """Splits clusters of touching objects, but keeps together what the object's own detections cover."""
    own_clusters = [each for one in own if (each := matching_cluster(view.clusters, one)) is not None]
    rest = tuple(each for each in view.clusters if not any(each is one for one in own_clusters))
    split = split_touching(replace(view, clusters=rest), p_WC)
    return replace(view, clusters=(*{id(each): each for each in own_clusters}.values(), *split.clusters))


def _seen_surface(view: SurfaceView, surface: Surface, centre: tuple[float, float]) -> Surface:
    """Returns the observed surface, extended around the object, because the camera may miss the surface's edge.

    It lies a little low: fingers at a thin object come within a millimetre of the surface and feel for it.
    """
    xy = view.plane_points.p_W[:, :2]
    low, high = np.percentile(xy, [0.2, 99.8], axis=0)
    low = np.minimum(low, np.array(centre) - SURFACE_AROUND_M)
    high = np.maximum(high, np.array(centre) + SURFACE_AROUND_M)
    corners = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    top_m = view.plane.height_m - _SURFACE_YIELDS_M
    return Surface(surface.name, tuple((float(x), float(y)) for x, y in corners), top_m)


def _same_object(
    view: SurfaceView, seen: ObjectObservation, found: Sequence[Detection3D], within_m: float
) -> Cluster | None:
    """Returns the nearest cluster of the object's class, else the nearest of any class; None when all are far."""
    expected = np.array(seen.position_W[:2])

    def off(cluster: Cluster) -> float:
        return float(np.linalg.norm(np.array(cluster.shape.centre) - expected))

    classed = [cluster for each in found if (cluster := matching_cluster(view.clusters, each)) is not None]
    for clusters in (classed, view.clusters):
        near = [cluster for cluster in clusters if off(cluster) < within_m]
        if near:
            return min(near, key=off)
    return None


def _observed(cluster: Cluster, name: str, beside: ObjectObservation, image: Image) -> ObjectObservation:
    """Returns an observation of a neighbour, an object on the same surface."""
    (x, y), shape = cluster.shape.centre, cluster.shape
    return ObjectObservation(
        stamp_s=image.stamp_s,
        kind=ObjectKind(name),
        position_W=(float(x), float(y), cluster.base_m + 0.5 * shape.height_m),
        size_m=(shape.length_m, shape.width_m, shape.height_m),
        yaw_rad=shape.yaw_rad,
        score=1.0,
        surface=beside.surface,
    )


def _target(cluster: Cluster, X_WB: RigidTransform) -> Target:
    X_BW = X_WB.inverse()
    shape = cluster.shape
    points_B = cluster.points.p_W @ X_BW.rotation().matrix().T + X_BW.translation()
    centre_B = X_BW @ np.array([*shape.centre, cluster.base_m])
    axis_B = X_BW.rotation().matrix() @ np.array([np.cos(shape.yaw_rad), np.sin(shape.yaw_rad), 0.0])
    return Target(
        points_B=points_B,
        centre_B=(float(centre_B[0]), float(centre_B[1])),
        yaw_rad=float(np.arctan2(axis_B[1], axis_B[0])),
        length_m=shape.length_m,
        width_m=shape.width_m,
        height_m=shape.height_m,
        base_m=float(centre_B[2]),
        round=shape.round,
    )


def space_about(
    seen: ObjectObservation, half_m: float = SURFACE_AROUND_M
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Lowest and highest corners (world, m) of the space around an object on its surface, and of its own space.

    A tall object's own space is taller than the known space: the cells at its top are no obstacle.
    """
    x, y, z = seen.position_W
    length_m, width_m, height_m = seen.size_m
    low_m, own_m = z - 0.5 * height_m - _SURFACE_BAND_M, 0.5 * max(length_m, width_m) + OWN_M
    corners = ((half_m, low_m + _SURFACE_BAND_M + _KNOWN_ABOVE_M), (own_m, z + 0.5 * height_m + OWN_M))
    about, own = (
        (np.array([x - side_m, y - side_m, low_m]), np.array([x + side_m, y + side_m, top_m]))
        for side_m, top_m in corners
    )
    return about, own


class CloseLookingSkill(LookingSkill[InputsT]):
    """Routine that views an object closely before it is grasped."""

    def look_closely(self, seen: ObjectObservation, same_object_m: float) -> Routine[CloseView]:
        """Views the object and its neighbours from 0.4 m, and also from aside if a part of the object is occluded.

        `same_object_m` is the search radius around the object's last position.
        Raises SkillFailure with cause PRECONDITION when the object is not in view.
        """
        base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
        best: CloseView | None = None
        for aside_rad in _ASIDE_RAD if self.object_camera.on_hand else _ASIDE_RAD[:1]:
            self.boxes = surface_boxes([square(seen.position_W, base_m, "guess", 0.25)], self.X_WB())
            self.known_W = space_about(seen)
            try:
                view = yield from self._view_from(seen, base_m, aside_rad, same_object_m)
            except SkillFailure as failure:
                if best is None or failure.cause is not Cause.PLANNING:
                    raise
                continue
            if view is not None and (best is None or view.target.length_m > best.target.length_m):
                best = view
            if best is not None and (best.target.upright or best.target.length_m > _MOST_OF_LENGTH * seen.size_m[0]):
                break
        if best is None:
            raise SkillFailure(Cause.PRECONDITION, f"the {seen.kind} is no longer where it was seen")
        self.known_W = space_about(seen, LOOK_HALF_SIDE_M)
        return best

    def _view_from(
        self, seen: ObjectObservation, base_m: float, aside_rad: float, same_object_m: float
    ) -> Routine[CloseView | None]:
        """Views the object with the camera rotated about it by an angle; None when the object is not there."""
        message = f"looking closely at the {seen.kind}"
        surface = square(seen.position_W, base_m, seen.surface or "surface")
        p_BT = self.X_WB().inverse() @ np.array(seen.position_W)
        if aside_rad != 0.0 or not self._looks_closely(p_BT):
            height_m = seen.size_m[2]
            near = close_viewpoints(self.model.p_BS, p_BT, aside_rad) if height_m < TALL_M else []
            far = overview_viewpoints(self.model.p_BS, p_BT, aside_rad, height_m)
            yield from self.look_at(p_BT, [*near, *far], message)
        image = yield from self.picture(message)
        place, X_WB, detector = self.context.localiser.estimate(), self.X_WB(), self.context.detector

        def look() -> CloseView | None:
            found = detect_in_image(detector, image)
            named = [each for each in found if seen.kind.name in (ANY_OBJECT, each.class_name)]
            rest = [each for each in found if each not in named]
            placed = tuple(one for some in (named, rest) for one in detections_3d(image, place, some, [surface]))
            return examine(image, X_WB, surface, seen, place, placed, same_object_m)

        return (yield from self.compute(look, latency_s=DETECTION_LATENCY_S, name="detect closely", message=message))

    def _looks_closely(self, p_BT: FloatArray) -> bool:
        """Returns whether the hand camera views a point closely already, past an open gripper."""
        camera = self.object_camera
        open_wide = self.context.robot.gripper().opening > WIDE * self.gripper.widest
        return camera.on_hand and open_wide and sees_closely(self.model.X_BH(self.q_rad()) @ camera.X_FC, p_BT)
