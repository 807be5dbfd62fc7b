"""Map of GraphNav: waypoints, edges, anchors and snapshots that clients upload, routes, and what localises on it.

Frame S is the map's frame: the seed frame of its anchors, or without anchors the frame of one waypoint.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from bosdyn.api import point_cloud_pb2
from bosdyn.api.graph_nav import graph_nav_pb2, map_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import InvalidRequestError, frame_tree, frames_of, pose, pose_between, transform
from skills.robot import FloatArray, Image, Pose2D, Robot, Scan

Poses = Mapping[str, RigidTransform]
"""Poses X_SW of waypoints by their ids."""
_SEEN_M: Final = 6.0
"""Largest distance of a snapshot's points from its waypoint."""
_FARTHEST_M: Final = 10_000.0
_Validation = graph_nav_pb2.UploadGraphResponse.ValidationStatus


class InvalidGraphError(ValueError):
    """A graph that cannot be used, with the API's report of why."""

    def __init__(self, report: Any) -> None:
        self.report = report
        super().__init__("the graph is not valid")


@dataclass(frozen=True)
class SeenTag:
    """AprilTag in a picture: its number, the side of its black square, and its pose."""

    number: int
    size_m: float
    X_OT: RigidTransform


class MapLocaliser(Protocol):
    """Localiser on the points of a map, in whose frame S poses are."""

    def start(self, X_SO: Pose2D, scan: Scan, reach_m: float) -> Pose2D | None:
        """Believes the pose of `odom` at which a scan fits, within reach_m of a guess; returns None when none does."""

    def update(self, robot: Robot) -> tuple[Pose2D, bool]:
        """Takes in the newest scan; returns the pose of `odom`, and whether it is sure."""


class Perception(Protocol):
    """Localisers for maps, and tags in pictures."""

    def localiser(self, points_S: FloatArray) -> MapLocaliser:
        """Creates a localiser on points (N, 3) of a map: x, y, and the height above the floor."""

    def tags(self, image: Image) -> Sequence[SeenTag]:
        """Finds the known tags in a picture."""


@dataclass(frozen=True)
class GraphMap:
    """A map. It and its messages never change: an upload makes another map."""

    graph: Any = field(default_factory=map_pb2.Graph)
    waypoint_snapshots: Mapping[str, Any] = field(default_factory=dict)
    edge_snapshots: Mapping[str, Any] = field(default_factory=dict)

    def with_graph(self, graph: Any, *, alone: bool, anchor: bool) -> GraphMap:
        """Returns the map with a graph added, or `alone`; `anchor` makes new anchors. Raises InvalidGraphError."""
        graphs, made = ((graph,) if alone else (self.graph, graph)), map_pb2.Graph()
        for listed, key in _LISTS:
            listed(made).extend({key(each): each for one in graphs for each in listed(one)}.values())
        _refuse_invalid(graph, made)
        if anchor and made.waypoints:
            made.anchoring.Clear()
            for name, X_SW in replace(self, graph=made).poses(made.waypoints[0].id).items():
                made.anchoring.anchors.add(id=name, seed_tform_waypoint=pose(X_SW))
        return replace(self, graph=made)

    def with_snapshots(self, waypoints: Iterable[Any] = (), edges: Iterable[Any] = ()) -> GraphMap:
        """Returns the map with snapshots added."""
        return replace(
            self,
            waypoint_snapshots={**self.waypoint_snapshots, **{each.id: each for each in waypoints}},
            edge_snapshots={**self.edge_snapshots, **{each.id: each for each in edges}},
        )

    @cached_property
    def waypoints(self) -> Mapping[str, Any]:
        """The waypoints by id."""
        return {each.id: each for each in self.graph.waypoints}

    @cached_property
    def edges(self) -> Mapping[str, Mapping[str, tuple[RigidTransform, float]]]:
        """Edges from each waypoint to others, both ways: where the other is, and the cost. Stairs are left out."""
        made: dict[str, dict[str, tuple[RigidTransform, float]]] = {name: {} for name in self.waypoints}
        for edge in self.graph.edges:
            if edge.annotations.stairs.state == map_pb2.ANNOTATION_STATE_SET:
                continue
            (a, b), X_AB = _ends(edge), transform(edge.from_tform_to, "edge.from_tform_to")
            cost = edge.annotations.cost.value or float(np.linalg.norm(X_AB.translation()))
            made[a][b], made[b][a] = (X_AB, max(cost, 0.0)), (X_AB.inverse(), max(cost, 0.0))
        return made

    def edge_id(self, a: str, b: str) -> Any:
        """The id of the edge between two waypoints, in the direction in which it is stored."""
        stored = {_ends(edge) for edge in self.graph.edges}
        start, end = (a, b) if (a, b) in stored else (b, a)
        return map_pb2.Edge.Id(from_waypoint=start, to_waypoint=end)

    def poses(self, root: str) -> Poses:
        """Poses of the waypoints connected with one by anchors and edges; without anchors in its frame."""
        anchors = {
            each.id: transform(each.seed_tform_waypoint, "anchor.seed_tform_waypoint")
            for each in self.graph.anchoring.anchors
        }
        found = self._joined(anchors)
        return found if root in found else self._joined({root: RigidTransform()})

    def _joined(self, placed: Poses) -> Poses:
        """The given poses, and those of all waypoints connected to them by edges."""
        found, waiting = dict(placed), deque(placed)
        while waiting:
            here = waiting.popleft()
            for there, (X_HT, _) in self.edges[here].items():
                if there not in found:
                    found[there] = found[here] @ X_HT
                    waiting.append(there)
        return found

    def route(self, start: str, goals: Collection[str]) -> Sequence[str]:
        """The cheapest route from a waypoint to one of `goals`; empty when there is none."""
        costs, before = self._reached(start, math.inf)
        route = [name for name in sorted(goals, key=lambda goal: costs.get(goal, math.inf))[:1] if name in costs]
        while route and before[route[-1]]:
            route.append(before[route[-1]])
        return route[::-1]

    def around(self, start: str, most: float) -> Collection[str]:
        """The waypoints that a waypoint reaches at a cost of `most` at the most."""
        return self._reached(start, most)[0]

    def _reached(self, start: str, most: float) -> tuple[Mapping[str, float], Mapping[str, str]]:
        """Costs of the cheapest routes from a waypoint to others, and the waypoint before each on its route."""
        costs, before, waiting = {start: 0.0}, {start: ""}, [(0.0, start)]
        while waiting:
            cost, here = heapq.heappop(waiting)
            for there, (_, more) in self.edges.get(here, {}).items():
                if cost + more < min(costs.get(there, math.inf), most):
                    costs[there], before[there] = cost + more, here
                    heapq.heappush(waiting, (cost + more, there))
        return costs, before

    def points(self, poses: Poses) -> FloatArray:
        """The snapshots' points (N, 3): x, y in frame S and the height above the floor, by the robot's odometry."""
        made = [np.empty((0, 3))]
        for X_SK, snapshot in self._snapshots(poses):
            if (p_K := _points_K(snapshot.point_cloud)) is not None:
                made.append(np.column_stack([(X_SK @ p_K.T).T[:, :2], p_K[:, 2]]))
        return np.concatenate(made)

    def tags(self, poses: Poses) -> Mapping[int, RigidTransform]:
        """Poses X_ST of the AprilTags in snapshots or anchors, by their numbers."""
        made: dict[int, RigidTransform] = {}
        for X_SK, snapshot in self._snapshots(poses):
            for each in snapshot.objects:
                tag, frames = each.apriltag_properties, frames_of(each.transforms_snapshot)
                if tag.tag_id and {"odom", tag.frame_name_fiducial} <= frames.keys():
                    made[tag.tag_id] = X_SK @ pose_between(frames, "odom", tag.frame_name_fiducial)
        anchored = [each for each in self.graph.anchoring.objects if each.id.isdecimal()]
        return {**made, **{int(each.id): transform(each.seed_tform_object, "object") for each in anchored}}

    def _snapshots(self, poses: Poses) -> Iterator[tuple[RigidTransform, Any]]:
        """Yields the waypoints' snapshots with the poses of `odom` at the time of each."""
        for name, X_SW in poses.items():
            snapshot = self.waypoint_snapshots.get(self.waypoints[name].snapshot_id)
            if snapshot is not None:
                yield X_SW @ transform(self.waypoints[name].waypoint_tform_ko, "waypoint_tform_ko"), snapshot


def _ends(edge: Any) -> tuple[str, str]:
    return edge.id.from_waypoint, edge.id.to_waypoint


def _refuse_invalid(upload: Any, graph: Any) -> None:
    """Raises InvalidGraphError for repeated ids in an upload, ids without a waypoint, and invalid poses."""
    report, known = _Validation(), {each.id for each in graph.waypoints}
    twice = [[key for key, n in Counter(map(key_of, listed(upload))).items() if n > 1] for listed, key_of in _LISTS]
    report.duplicate_waypoint_ids.extend(twice[0])
    report.duplicate_edge_ids.extend(map_pb2.Edge.Id(from_waypoint=a, to_waypoint=b) for a, b in twice[1])
    report.duplicate_waypoint_anchor_ids.extend(twice[2])
    report.duplicate_object_anchor_ids.extend(twice[3])
    edges, anchors, objects = graph.edges, graph.anchoring.anchors, graph.anchoring.objects
    report.has_empty_waypoint_ids = "" in known
    report.missing_waypoint_ids_in_edges.extend({name for edge in edges for name in _ends(edge)} - known)
    report.missing_waypoint_ids_in_anchors.extend({each.id for each in anchors} - known)
    report.invalid_waypoint_ids_self_edges.extend(a for a, b in map(_ends, edges) if a == b)
    report.edge_ids_invalid_transform.extend(each.id for each in edges if not _is_pose(each.from_tform_to))
    report.waypoint_anchors_invalid_transform.extend(e.id for e in anchors if not _is_pose(e.seed_tform_waypoint))
    report.object_anchors_invalid_transform.extend(e.id for e in objects if not _is_pose(e.seed_tform_object))
    if report.ByteSize():
        raise InvalidGraphError(report)


_LISTS: Final[Sequence[tuple[Callable[[Any], Any], Callable[[Any], Any]]]] = (
    (lambda graph: graph.waypoints, lambda each: each.id),
    (lambda graph: graph.edges, _ends),
    (lambda graph: graph.anchoring.anchors, lambda each: each.id),
    (lambda graph: graph.anchoring.objects, lambda each: each.id),
)
"""Lists of a graph, and the key of each of their messages."""


def _is_pose(message: Any) -> bool:
    try:
        transform(message, "pose")
    except InvalidRequestError:
        return False
    return True


def _points_K(cloud: Any) -> FloatArray | None:
    """The points (N, 3) of a cloud in `odom`; None for an empty cloud, or another encoding."""
    frames, size = frames_of(cloud.source.transforms_snapshot), 12 * cloud.num_points
    coded = cloud.encoding == point_cloud_pb2.PointCloud.ENCODING_XYZ_32F and len(cloud.data) == size > 0
    if not coded or not {"odom", cloud.source.frame_name_sensor} <= frames.keys():
        return None
    p_C = np.frombuffer(cloud.data, np.float32).reshape(-1, 3).astype(np.float64)
    near = np.linalg.norm(p_C, axis=1) < _FARTHEST_M  # no number is none
    return np.asarray((pose_between(frames, "odom", cloud.source.frame_name_sensor) @ p_C[near].T).T)


def map_of(
    waypoints: Mapping[str, Pose2D],
    edges: Iterable[tuple[str, str]],
    points_S: FloatArray,
    tags: Mapping[int, RigidTransform],
    height_m: float,
) -> GraphMap:
    """Returns a map of waypoints by name, with the points (N, 3; x, y, height) and the anchored tags around each.

    `height_m` is the height of the body at each waypoint. The map's frame is that of `odom` in all snapshots.
    """
    made, snapshots = map_pb2.Graph(), list[Any]()
    X_SW = {name: pose_W.transform(height_m) for name, pose_W in waypoints.items()}
    for name, X in X_SW.items():
        added = made.waypoints.add(id=name, snapshot_id=f"snapshot_{name}", waypoint_tform_ko=pose(X.inverse()))
        added.annotations.name = name
        made.anchoring.anchors.add(id=name, seed_tform_waypoint=pose(X))
        snapshot = map_pb2.WaypointSnapshot(id=added.snapshot_id)
        near = np.linalg.norm(points_S[:, :2] - X.translation()[:2], axis=1) < _SEEN_M
        cloud, p_S = snapshot.point_cloud, points_S[near].astype(np.float32)
        cloud.source.name, cloud.source.frame_name_sensor, cloud.num_points = "map", "odom", len(p_S)
        cloud.encoding, cloud.data = point_cloud_pb2.PointCloud.ENCODING_XYZ_32F, p_S.tobytes()
        cloud.source.transforms_snapshot.CopyFrom(frame_tree({"odom": ("", RigidTransform()), "body": ("odom", X)}))
        snapshots.append(snapshot)
    for number, X_ST in tags.items():
        made.anchoring.objects.add(id=str(number), seed_tform_object=pose(X_ST))
    for a, b in edges:
        edge = made.edges.add(from_tform_to=pose(X_SW[a].inverse() @ X_SW[b]))
        edge.id.from_waypoint, edge.id.to_waypoint = a, b
    return GraphMap(made).with_snapshots(snapshots)


def write_map(known: GraphMap, folder: Path) -> None:
    """Writes a map in the SDK's form: `graph`, `waypoint_snapshots` and `edge_snapshots`. Raises OSError."""
    for name, snapshots in (("waypoint_snapshots", known.waypoint_snapshots), ("edge_snapshots", known.edge_snapshots)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for each in snapshots.values():
            (folder / name / each.id).write_bytes(each.SerializeToString())
    (folder / "graph").write_bytes(known.graph.SerializeToString())
