"""Free spots on a surface for the held object, from all pictures of the surface, and arm angles to put it there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from pydrake.math import RigidTransform

from skills.api import PlanningError, Surface
from skills.geometry import SPOT_EDGE_M, grid_inside, inside_polygon, surface_spots
from skills.inputs.errors import listing
from skills.manipulation.arm.arm_skill import Goal
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.held_object import LEAST_ABOVE_M, OFF_SURFACE_M, HeldObject
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.motion import ArmPlanner
from skills.perception.detection_3d import Detection3D, has_attribute
from skills.perception.fitting import LevelPlane
from skills.perception.point_cloud import PointCloud
from skills.perception.surface_segmentation import SurfaceView
from skills.relations import Landmark, Relation, Scene, Standing, choose
from skills.robot import FloatArray, Pose2D

if TYPE_CHECKING:
    import shapely
    from shapely.geometry.base import BaseGeometry

CLEARANCE_M = 0.12
"""Distance of a comfortable spot from the objects on the surface."""
BESIDE_M = 0.03
"""Least gap between the object's outline and others, and the surface's edge."""
_SEEN_WITHIN_M = 0.04
"""Radius around a spot in which the surface must be seen."""
_LEAST_SEEN = 15
"""Number of points of the surface that must be exceeded around a spot."""
_UNSEEN_M = 0.1
"""Distance from all observed points beyond which a spot counts as in no picture."""
_ENOUGH_CLEARANCE_M = 0.3
"""Distance from objects beyond which a spot gets no better."""
_PER_CLEARANCE = 3.0
"""Distance to drive (m) that a metre of clearance is worth."""
_ANOTHER_M = 0.2
"""Least distance between two spots that are tried after each other."""
_SAME_OBJECT_M = 0.08
"""Distance between the centres of clusters in two pictures up to which they show the same object."""
_SAMPLE_M = 0.01
"""Distance between the points of a surface that no picture shows."""
_CELL_M = 0.01
"""Spacing of the objects' points for the comparison with an outline."""
_SURVEYED_M = 0.01
"""Uncertainty of a surveyed height."""
_LEAST_BACK_M = 0.08
"""The open hand must be able to draw back from a spot by this distance."""
_MARGIN_RAD = 0.05
"""Distance of the joints from their limits."""
_SURE_M = 0.02
"""Margin of a spot's relations, for the way the object takes when it is put down."""
_OVER_M = 0.1
"""Distance beyond a surface's edge within which an object counts as over the surface."""


def clear_spots(candidates: FloatArray, circles_W: Sequence[tuple[float, float, float]]) -> FloatArray:
    """Returns the candidates (N, 2) outside all circles (x, y, radius)."""
    for x, y, radius_m in circles_W:
        candidates = candidates[np.linalg.norm(candidates - [x, y], axis=1) > radius_m]
    return candidates


def free_spots(view: SurfaceView, candidates: FloatArray, clearance_m: float = CLEARANCE_M) -> FloatArray:
    """Returns the candidates (N, 2) on the observed surface with no object within clearance_m."""
    if len(candidates) == 0 or len(view.plane_points) == 0:
        return np.empty((0, 2))
    from scipy.spatial import cKDTree

    seen = cKDTree(view.plane_points.p_W[:, :2])
    around = np.array([len(found) for found in seen.query_ball_point(candidates, _SEEN_WITHIN_M)])
    return candidates[(around > _LEAST_SEEN) & (clearances_m(view, candidates) > clearance_m)]


def clearances_m(view: SurfaceView, points_W: FloatArray) -> FloatArray:
    """Distances (N,) from points (N, 2) to the nearest object in a view; infinite when the view has none."""
    return distances_m(objects_W(view), points_W)


def objects_W(view: SurfaceView | None) -> FloatArray:
    """Points (M, 2) on all objects in a view; none when there is no view."""
    clusters = () if view is None else view.clusters
    return np.concatenate([np.empty((0, 2)), *(cluster.points.p_W[:, :2] for cluster in clusters)])


def distances_m(of_W: FloatArray, points_W: FloatArray) -> FloatArray:
    """Distances (N,) from points (N, 2) to the nearest of `of_W` (M, 2); infinite when that is empty."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(of_W).query(points_W)[0]) if len(of_W) else np.full(len(points_W), np.inf)


def unseen_view(surface: Surface, standing_W: FloatArray) -> SurfaceView:
    """Returns a level view of a surface that no picture shows, with objects at the points (N, 3) that stand on it.

    The surface counts as seen except within CLEARANCE_M of those points.
    """
    inside = grid_inside(surface.polygon_W, _SAMPLE_M, margin_m=0.0)
    if len(standing_W):
        inside = inside[np.min(np.linalg.norm(inside[:, None] - standing_W[None, :, :2], axis=2), axis=1) > CLEARANCE_M]
    points = np.column_stack([inside, np.full(len(inside), surface.height_m)])
    plane = LevelPlane((0.0, 0.0), surface.height_m, (0.0, 0.0), _SURVEYED_M)
    unseen = np.zeros((len(points), 2), dtype=np.int64), np.zeros((len(points), 3), dtype=np.uint8)
    return SurfaceView(plane, PointCloud(points, *unseen), ())


def merged(views: Sequence[SurfaceView]) -> SurfaceView:
    """Returns the union of several views of a surface, with the plane of the last one."""
    clouds = [view.plane_points for view in views]
    whole = PointCloud(
        np.concatenate([cloud.p_W for cloud in clouds]),
        np.concatenate([cloud.pixels for cloud in clouds]),
        np.concatenate([cloud.colours for cloud in clouds]),
    )
    return SurfaceView(views[-1].plane, whole, tuple(cluster for view in views for cluster in view.clusters))


def spaced_spots(free: FloatArray, apart_m: float = _ANOTHER_M) -> list[FloatArray]:
    """Returns spots (N, 2) in their order, without those within apart_m of an earlier one."""
    spaced = list[FloatArray]()
    for spot in free:
        if all(float(np.linalg.norm(spot - other)) > apart_m for other in spaced):
            spaced.append(spot)
    return spaced


@dataclass(frozen=True)
class FreeArea:
    """Area for the held object: inside `top` (None: anywhere), clear of the points `objects`."""

    top: shapely.Polygon | None
    objects: shapely.MultiPoint
    corners_H: FloatArray

    def takes(self, X_WH: RigidTransform) -> bool:
        """Returns whether the outline, from above, of the object in a hand at X_WH lies in the area."""
        import shapely

        outline = self._outline(X_WH)
        if self.top is not None and not self.top.covers(outline):
            return False
        return not shapely.dwithin(outline, self.objects, BESIDE_M)

    def _outline(self, X_WH: RigidTransform) -> BaseGeometry:
        import shapely

        return shapely.MultiPoint(X_WH.multiply(self.corners_H.T)[:2].T).convex_hull


def free_area(surface: Surface, held: HeldObject, view: SurfaceView | None = None) -> FreeArea:
    """Returns the area of a surface inside its edges, clear of the objects in a view.

    Too large an object may extend over the edge.
    """
    import shapely

    cells = np.unique(np.round(objects_W(view) / _CELL_M), axis=0) * _CELL_M
    top = shapely.Polygon(surface.polygon_W).buffer(-BESIDE_M, join_style="mitre")
    inside = FreeArea(top, shapely.MultiPoint(cells), held.corners_H)
    X_WM = RigidTransform([*np.mean(surface.polygon_W, axis=0), surface.height_m])
    empty = replace(inside, objects=shapely.MultiPoint())
    middle = (X_WM @ X_MH for X_MH in held.above(np.zeros(3), np.zeros(3), 0.0, along_rad=longest_edge_rad(surface)))
    return inside if any(empty.takes(X_WH) for X_WH in middle) else replace(inside, top=None)


def longest_edge_rad(surface: Surface) -> float:
    """Direction of a surface's longest edge in the world."""
    corners = np.array(surface.polygon_W)
    edges = np.roll(corners, -1, axis=0) - corners
    x, y = edges[int(np.argmax(np.linalg.norm(edges, axis=1)))]
    return float(np.arctan2(y, x))


@dataclass
class SpotSearch:
    """Searches a surface for a free spot for an object, outside all circles `clear_of` (x, y, radius).

    Spots with much clearance come first, then those that no picture shows yet, and at the end `tight` ones, on which
    the object only just fits. With `relations`, no spot is free before all landmarks are seen, and then only where the
    relations hold as the `robot` sees the surface, or the surface's own viewer.
    """

    surface: Surface
    held: HeldObject
    clear_of: Sequence[tuple[float, float, float]] = ()
    tight: bool = False
    relations: tuple[Relation, ...] = ()
    robot: Pose2D = field(default_factory=lambda: Pose2D(0.0, 0.0, 0.0))
    _seen: dict[Landmark, list[Standing]] = field(default_factory=dict)
    _views: list[SurfaceView] = field(default_factory=list)
    _tried: list[FloatArray] = field(default_factory=list)

    def spots(self) -> FloatArray:
        """Spots (N, 2) on the surface, free or not; of a bin its middle."""
        if self.surface.is_bin:
            return np.asarray([np.mean(self.surface.polygon_W, axis=0)])
        edge_m = min(SPOT_EDGE_M, self.held.half_width_m + BESIDE_M) if self.tight else SPOT_EDGE_M
        found = clear_spots(surface_spots(self.surface.polygon_W, edge_m), self.clear_of)
        if not self.relations or self.missing():
            return found
        scene = Scene(self.surface.polygon_W, self.surface.viewer or self.robot, self._seen)
        sides_m = (2.0 * self.held.half_width_m, 2.0 * self.held.half_width_m, 0.0)
        return found[[bool(choose(self.relations, [Standing((x, y), sides_m)], scene, -_SURE_M)) for x, y in found]]

    def missing(self) -> tuple[Landmark, ...]:
        """Landmarks of which too few objects are seen yet."""
        wanted = [one for each in self.relations for one in each.landmarks if one.classes]
        return tuple(each for each in wanted if len(self._seen.get(each, ())) < wanted.count(each))

    def see(self, found: Sequence[Detection3D]) -> None:
        """Adds the landmarks among detections in 3D of objects on the surface."""
        for landmark, one in itertools.product(self.missing(), found):
            is_landmark = one.class_name in landmark.classes and one.surface == self.surface.name
            if is_landmark and all(has_attribute(one, word) for word in landmark.attributes):
                at = Standing((float(one.position_W[0]), float(one.position_W[1])), one.size_m)
                known = self._seen.setdefault(landmark, [])
                if all(math.dist(each.p_W, at.p_W) > _SAME_OBJECT_M for each in known):
                    known.append(at)

    def free(self, view: SurfaceView) -> FloatArray:
        """Spots (N, 2) that a view shows to be free."""
        if self.missing():
            return np.empty((0, 2))
        clearance_m = min(CLEARANCE_M, self.held.half_width_m + BESIDE_M) if self.tight else CLEARANCE_M
        return free_spots(view, self.spots(), clearance_m)

    def seen(self) -> SurfaceView | None:
        """Union of all views of the surface; None before the first picture."""
        return merged(self._views) if self._views else None

    def area(self) -> FreeArea:
        """Free area of the surface according to all views."""
        return free_area(self.surface, self.held, self.seen())

    def add(self, view: SurfaceView, spot_W: FloatArray) -> None:
        """Adds a view taken where the arm tries to put the object down on a spot (2,) or near it."""
        self._views.append(view)
        self._tried.append(spot_W)

    def pass_over(self, spots_W: Sequence[FloatArray]) -> None:
        """Discards spots (2,) that no base placement serves."""
        self._tried.extend(spots_W)

    def others(self, here_W: FloatArray) -> list[FloatArray]:
        """Returns spots (2,) that are worth a drive from a point (2,), best first, tight ones last."""
        ranked = self._ranked(here_W)
        if not ranked and not self.tight:
            self.tight, self._tried = True, []
            ranked = self._ranked(here_W)
        return ranked

    def _ranked(self, here_W: FloatArray) -> list[FloatArray]:
        seen, candidates = merged(self._views), self.spots()
        free, shown = self.free(seen), np.concatenate([seen.plane_points.p_W[:, :2], objects_W(seen)])
        unseen = candidates[distances_m(shown, candidates) > _UNSEEN_M]
        lacks_m = _ENOUGH_CLEARANCE_M - np.minimum(clearances_m(seen, free), _ENOUGH_CLEARANCE_M)
        drive_m, other_m = (np.linalg.norm(each - here_W, axis=1) for each in (free, unseen))
        costs = [drive_m + _PER_CLEARANCE * lacks_m, other_m]
        both = zip((free, unseen), costs, strict=True)
        spots = np.concatenate([spots_W[np.argsort(cost, kind="stable")] for spots_W, cost in both])
        for tried in self._tried:
            spots = spots[np.linalg.norm(spots - tried, axis=1) > _ANOTHER_M]
        return spaced_spots(spots)

    def why_none(self) -> str:
        """Reason why the search found no spot, according to all views."""
        seen, name = merged(self._views), self.surface.name
        if self.missing():
            return f"no {listing((each.name for each in self.missing()), last='or')} is seen on the {name}"
        middles = np.array([cluster.shape.centre for cluster in seen.clusters]).reshape(-1, 2)
        count = len(spaced_spots(middles, _SAME_OBJECT_M))
        if not count or len(self.free(seen)):
            return f"no free spot of the {name} is within the arm's reach"
        if self.relations:
            return f"no free spot of the {name} is {' and '.join(map(str, self.relations))}"
        import shapely

        inside = grid_inside(self.surface.polygon_W, _CELL_M)
        edge_m = shapely.distance(shapely.Polygon(self.surface.polygon_W).exterior, shapely.points(inside))
        room_m = np.minimum(clearances_m(seen, inside), edge_m)
        objects = "1 object" if count == 1 else f"{count} objects"
        return f"the {name} is full: {objects}, the largest free spot is {200.0 * float(room_m.max()):.0f} cm"


@dataclass(frozen=True)
class PrePlacePose:
    """Joint angles (J,) with the object above its spot, and the height (m) of its lowest point above the surface."""

    q_rad: FloatArray
    height_m: float


def above_goal(
    on_top_B: Sequence[FloatArray],
    held: HeldObject,
    planner: ArmPlanner,
    beside: Sequence[Box],
    opening: float,
    takes: Callable[[RigidTransform], bool] = lambda X_BH: True,
    along_rad: float | None = None,
) -> Goal:
    """Returns a goal with the object, upright as before, above the first point on a surface within reach.

    `takes` returns whether the object fits below a hand pose X_BH; a long object may lie along `along_rad` (B). The
    hand, open to `opening`, must be able to leave the object without contact with the boxes `beside` (B). The goal
    raises PlanningError when no point is within reach.
    """

    def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
        for (above_m, tilt_rad), p_BT in itertools.product(held.approaches(), on_top_B):
            for X_BH in held.above(p_BT, scene.model.p_BS, above_m, tilt_rad, along_rad):
                solutions = scene.model.inverse(X_BH, margin_rad=_MARGIN_RAD)
                for solution in solutions if len(solutions) and takes(X_BH) else ():
                    q_above = scene.model.turned_near(solution, q)
                    if scene.free(q_above) and _can_put_down(scene, q_above, above_m, planner, beside, opening):
                        return q_above
        raise PlanningError("no free spot is within the arm's reach")

    return goal


def hold_on_path(goal: Goal, box_H: Box) -> Goal:
    """Returns the goal with the object's box in the hand on the path, unless the box is in contact at either end."""

    def chosen(scene: ArmScene, q: FloatArray) -> FloatArray:
        q_goal = goal(scene, q)
        scene.hold([box_H])
        if not (scene.free(q) and scene.free(q_goal)):
            scene.hold(())
        return q_goal

    return chosen


def reaches(model: ArmModel, X_BH: RigidTransform) -> bool:
    """Returns whether the arm reaches a hand pose above a spot and the pose in which the object stands."""
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, LEAST_ABOVE_M])
    return model.reaches(X_BH, _MARGIN_RAD) and model.reaches(lowered, _MARGIN_RAD)


def _can_put_down(
    scene: ArmScene, q_rad: FloatArray, above_m: float, planner: ArmPlanner, beside: Sequence[Box], opening: float
) -> bool:
    """Returns whether the hand can go down to the surface and, with its finger open, draw back again."""
    X_BH = scene.model.X_BH(q_rad)
    lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, above_m])
    back = lowered @ RigidTransform([-_LEAST_BACK_M, 0.0, 0.0])
    try:
        down = planner.line(scene.model, q_rad, lowered)
        with scene.with_only(beside, opening):
            planner.line(scene.model, down[-1], back, scene)
    except PlanningError:
        return False
    return True


def clear_heights(heights_m: Sequence[float], now_m: float, held_W: FloatArray, surface: Surface) -> Sequence[float]:
    """Returns the body heights (m) at which the held object presses on no surface, always including the first.

    `held_W` are the object's corners (N, 3) while the body is `now_m` high; the arm stays in its posture. Only an
    object above the surface or its edge can press on it.
    """
    clearance_m = float(held_W[:, 2].min()) - surface.height_m
    if clearance_m < 0.0 or not inside_polygon(held_W[:, :2], surface.polygon_W, _OVER_M).any():
        return heights_m
    lowest_m = now_m - clearance_m + OFF_SURFACE_M
    return [*heights_m[:1], *(height_m for height_m in heights_m[1:] if height_m > lowest_m)]
