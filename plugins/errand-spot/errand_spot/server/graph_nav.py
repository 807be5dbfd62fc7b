"""GraphNav: maps that clients upload, the robot's place on them, and navigation along their waypoints."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, pairwise
from threading import Lock
from typing import Any, Final

import numpy as np
from bosdyn.api import estop_pb2, lease_pb2, robot_command_pb2, robot_state_pb2
from bosdyn.api.graph_nav import graph_nav_pb2, map_pb2, nav_pb2
from pydrake.math import RigidTransform

from errand_spot.messages import InvalidRequestError, pose, timestamp, transform, vector
from errand_spot.server.calls import Call, Service, chunks, joined
from errand_spot.server.computer import Computer, Motors, Snapshot
from errand_spot.server.graph_map import GraphMap, InvalidGraphError, MapLocaliser, Perception, Poses
from errand_spot.server.identity import DOMAIN, TimeSyncService
from errand_spot.server.leases import MOBILITY, LeaseService
from errand_spot.server.mobility import planar
from errand_spot.server.pictures import LocalGridService, PointCloudService
from errand_spot.server.refusals import RefusedError, check_values, end_of
from errand_spot.server.route import Course, Feedback, FollowRoute, Place
from errand_spot.server.state import RobotStateService, WorldObjectService, kinematic_state
from skills.robot import Pose2D

_AROUND_M, _ASTRAY_M = 2.5, 3.0
"""Length along edges within which the next waypoint may lie, and distance at which all others count, too."""
_REACH_M, _REACH_RAD = 1.0, 0.6
"""Usual distance and turn from the first guess within which the scan may place the robot."""
_GOAL_M: Final = 3.0
"""Usual distance between a goal in the seed frame and the nearest waypoint."""
_WAIT_S: Final = 5.0
_REMEMBERED: Final = 100
_OK: Final = lease_pb2.LeaseUseResult.STATUS_OK
_Request, _Set = graph_nav_pb2.SetLocalizationRequest, graph_nav_pb2.SetLocalizationResponse
_Impaired = robot_state_pb2.RobotImpairedState
_Params = graph_nav_pb2.RouteFollowingParams
Plan = Callable[[GraphMap, Place], tuple[Sequence[str], Pose2D]]
"""Waypoints from where the robot is to a goal in frame S; raises CannotError."""


class CannotError(Exception):
    """A navigation that cannot begin: the name of the API's status, and the waypoints and edges at fault."""

    def __init__(self, status: str, waypoints: Sequence[str] = (), edges: Sequence[Any] = ()) -> None:
        super().__init__(status)
        self.status, self.waypoints, self.edges = status, waypoints, edges


@dataclass(frozen=True)
class Live:
    """Services whose readings the localisation state repeats."""

    states: RobotStateService
    clouds: PointCloudService
    grids: LocalGridService
    objects: WorldObjectService


class GraphNavService(Service):
    """Stores one map. Scans localise the robot on the snapshots' points, or odometry on a map without points."""

    name, type, authority = "graph-nav-service", "bosdyn.api.graph_nav.GraphNavService", f"api.{DOMAIN}"
    checks_values = True

    def __init__(
        self,
        computer: Computer,
        leases: LeaseService,
        clocks: TimeSyncService,
        perception: Perception | None,
        live: Live,
    ) -> None:
        """Maps are localised on by odometry alone without `perception`."""
        self._computer, self._leases, self._clocks, self._perception = computer, leases, clocks, perception
        self._live, self._lock, self._ids, self._map = live, Lock(), count(1), GraphMap()
        self._place: Place | None = None
        self._localiser: MapLocaliser | None = None
        self._routes: dict[int, FollowRoute] = {}
        computer.watchers.append(self._watch)

    # -- map ---------------------------------------------------------------------------------------------------------

    def UploadGraph(self, request: Any, _call: Call) -> Any:
        """Adds a graph to the map, or replaces it; the robot must be localised again."""
        Response = graph_nav_pb2.UploadGraphResponse
        used = self._used(request.lease)
        if used.status != _OK:
            return Response(lease_use_result=used)
        alone, anchor = request.replace_graph, request.generate_new_anchoring
        try:
            with self._lock:
                known = self._map = self._map.with_graph(request.graph, alone=alone, anchor=anchor)
        except InvalidGraphError as invalid:
            status = Response.STATUS_INVALID_GRAPH
            return Response(lease_use_result=used, status=status, validation_status=invalid.report)
        self._believe(None, None)
        made = Response(lease_use_result=used, status=Response.STATUS_OK, replaced_graph=alone)
        waypoints, edges = ({each.snapshot_id for each in some} for some in (known.graph.waypoints, known.graph.edges))
        made.loaded_waypoint_snapshot_ids.extend(sorted(waypoints & known.waypoint_snapshots.keys()))
        made.unknown_waypoint_snapshot_ids.extend(sorted(waypoints - known.waypoint_snapshots.keys() - {""}))
        made.loaded_edge_snapshot_ids.extend(sorted(edges & known.edge_snapshots.keys()))
        made.unknown_edge_snapshot_ids.extend(sorted(edges - known.edge_snapshots.keys() - {""}))
        return made

    def UploadGraphStreaming(self, requests: Any, call: Call) -> Any:
        """Adds a graph that comes in chunks."""
        return self.UploadGraph(joined(requests, graph_nav_pb2.UploadGraphRequest), call)

    def UploadWaypointSnapshot(self, requests: Any, _call: Call) -> Any:
        """Adds a snapshot of a waypoint."""
        Response = graph_nav_pb2.UploadWaypointSnapshotResponse
        return self._added(Response(status=Response.STATUS_OK), [joined(requests, map_pb2.WaypointSnapshot)], [])

    def UploadEdgeSnapshot(self, requests: Any, _call: Call) -> Any:
        """Adds a snapshot of an edge."""
        return self._added(graph_nav_pb2.UploadEdgeSnapshotResponse(), [], [joined(requests, map_pb2.EdgeSnapshot)])

    def UploadSnapshots(self, requests: Any, _call: Call) -> Any:
        """Adds many snapshots."""
        Response, given = graph_nav_pb2.UploadSnapshotsResponse, graph_nav_pb2.UploadSnapshotsRequest.Snapshots
        both = joined(requests, given)
        return self._added(Response(status=Response.STATUS_OK), both.waypoint_snapshots, both.edge_snapshots)

    def _added(self, made: Any, waypoints: Sequence[Any], edges: Sequence[Any]) -> Any:
        """Adds snapshots, and returns the answer."""
        with self._lock:
            self._map = self._map.with_snapshots(waypoints, edges)
        return made

    def _used(self, lease: Any) -> Any:
        """The result of using a lease; the SDK sends none with maps, which is allowed."""
        return self._leases.use(lease, ()) if lease.resource else lease_pb2.LeaseUseResult(status=_OK)

    def ClearGraph(self, request: Any, _call: Call) -> Any:
        """Forgets map and place."""
        Response = graph_nav_pb2.ClearGraphResponse
        used = self._used(request.lease)
        if used.status != _OK:
            return Response(lease_use_result=used)
        with self._lock:
            self._map = GraphMap()
        self._believe(None, None)
        return Response(lease_use_result=used, status=Response.STATUS_OK)

    def ValidateGraph(self, _request: Any, _call: Call) -> Any:
        """Answers that the map is valid, because uploads of invalid maps are refused."""
        Response = graph_nav_pb2.ValidateGraphResponse
        return Response(status=Response.STATUS_OK)

    def DownloadGraph(self, _request: Any, _call: Call) -> Any:
        """Returns the graph."""
        return graph_nav_pb2.DownloadGraphResponse(graph=self._map.graph)

    def DownloadGraphStreaming(self, request: Any, call: Call) -> Iterator[Any]:
        """Yields the graph in chunks."""
        for chunk in chunks(self.DownloadGraph(request, call)):
            yield graph_nav_pb2.DownloadGraphStreamingResponse(chunk=chunk)

    def DownloadWaypointSnapshot(self, request: Any, _call: Call) -> Iterator[Any]:
        """Yields a waypoint's snapshot in chunks, without pictures and points where they are not wanted."""
        stored, name = map_pb2.WaypointSnapshot(), request.waypoint_snapshot_id
        stored.CopyFrom(self._map.waypoint_snapshots.get(name, stored))
        for field, wanted in (
            ("images", request.download_images),
            ("point_cloud", not request.do_not_download_point_cloud),
        ):
            if not wanted:
                stored.ClearField(field)
        return _streamed(graph_nav_pb2.DownloadWaypointSnapshotResponse, stored, waypoint_snapshot_id=name)

    def DownloadEdgeSnapshot(self, request: Any, _call: Call) -> Iterator[Any]:
        """Yields an edge's snapshot in chunks."""
        name, none = request.edge_snapshot_id, map_pb2.EdgeSnapshot()
        stored = self._map.edge_snapshots.get(name, none)
        return _streamed(graph_nav_pb2.DownloadEdgeSnapshotResponse, stored, edge_snapshot_id=name)

    # -- place -------------------------------------------------------------------------------------------------------

    def SetLocalization(self, request: Any, _call: Call) -> Any:
        """Localises the robot by a tag of the map, or near a waypoint; then a scan places it exactly."""
        check_values(request)
        known, snapshot, guess = self._map, self._computer.snapshot, request.initial_guess
        by_tag = request.fiducial_init > _Request.FIDUCIAL_INIT_NO_FIDUCIAL
        if not known.waypoints:
            return _Set(status=_Set.STATUS_NO_MAP_LOADED)
        if snapshot.faults:
            return _Set(status=_Set.STATUS_ROBOT_IMPAIRED, impaired_state=_impaired(self._computer))
        if guess.waypoint_id not in known.waypoints and (guess.waypoint_id or not by_tag):
            return _Set(status=_Set.STATUS_UNKNOWN_WAYPOINT, error_report=f"{guess.waypoint_id!r} is not in the map")
        poses = known.poses(guess.waypoint_id or next(iter(known.waypoints)))
        if by_tag:
            X_SO = self._by_tag(request, known.tags(poses), snapshot)
            if X_SO is None:
                return _Set(status=_Set.STATUS_NO_MATCHING_FIDUCIAL, error_report="no tag of the map is in sight")
        else:
            X_OB = snapshot.odometry.X_OB
            if request.HasField("ko_tform_body"):
                X_OB = transform(request.ko_tform_body, "ko_tform_body")
            X_SB = poses[guess.waypoint_id] @ transform(guess.waypoint_tform_body, "waypoint_tform_body")
            X_SO = Pose2D.from_transform(X_SB @ X_OB.inverse())
        localiser, points = None, known.points(poses)
        if self._perception is not None and len(points):
            localiser = self._perception.localiser(points)
            reach_m, reach_rad = request.max_distance or _REACH_M, request.max_yaw or _REACH_RAD
            X_SO = _exact(localiser, X_SO, snapshot, reach_m, reach_rad)
            if X_SO is None:
                return _Set(status=_Set.STATUS_FAILED, error_report="the scan fits nowhere near the first guess")
        waypoint = guess.waypoint_id or _nearest(X_SO.transform() @ snapshot.odometry.X_OB, poses, poses)
        over_m = float(poses[waypoint].translation()[2]) - self._computer.capabilities.standing_height_m
        place = Place(X_SO.transform(over_m), poses, waypoint)
        self._believe(place, localiser)
        return _Set(status=_Set.STATUS_OK, localization=self._localization(place, place.waypoint, snapshot))

    def _by_tag(self, request: Any, tags: Mapping[int, RigidTransform], snapshot: Snapshot) -> Pose2D | None:
        """Pose X_SO by the nearest visible tag of the map, or by the requested one."""
        only = request.fiducial_init == _Request.FIDUCIAL_INIT_SPECIFIC
        seen = [each for each in self._live.objects.tags() if each.number in tags]
        seen = [each for each in seen if not only or each.number == request.use_fiducial_id]
        p_OB = snapshot.odometry.X_OB.translation()
        nearest = min(seen, key=lambda each: float(np.linalg.norm(each.X_OT.translation() - p_OB)), default=None)
        return None if nearest is None else Pose2D.from_transform(tags[nearest.number] @ nearest.X_OT.inverse())

    def _believe(self, place: Place | None, localiser: MapLocaliser | None) -> None:
        """Changes the place between two steps."""

        def change() -> None:
            self._place, self._localiser = place, localiser

        self._computer.do(change).result(_WAIT_S)

    def _watch(self) -> None:
        """Follows the robot's place before each step."""
        place = self._place
        if place is None:
            return
        if self._localiser is not None:
            X_SO, sure = self._localiser.update(self._computer.robot)
            place = replace(place, X_SO=X_SO.transform(float(place.X_SO.translation()[2])), lost=not sure)
        X_SB = place.X_SO @ self._computer.snapshot.odometry.X_OB
        near = _nearest(X_SB, place.poses, self._map.around(place.waypoint, _AROUND_M))
        if np.linalg.norm((X_SB.translation() - place.poses[near].translation())[:2]) > _ASTRAY_M:
            near = _nearest(X_SB, place.poses, place.poses)
        self._place = replace(place, waypoint=near)

    def GetLocalizationState(self, request: Any, call: Call) -> Any:
        """Returns the robot's pose on the map, and the requested present readings, except pictures."""
        made, snapshot, place = graph_nav_pb2.GetLocalizationStateResponse(), self._computer.snapshot, self._place
        made.robot_kinematics.CopyFrom(kinematic_state(snapshot))
        if place is not None:
            waypoint = request.waypoint_id if request.waypoint_id in place.poses else place.waypoint
            made.localization.CopyFrom(self._localization(place, waypoint, snapshot))
            made.lost_detector_state.is_lost = place.lost
        if request.request_live_robot_state:
            made.live_data.robot_state.CopyFrom(self._live.states.GetRobotState(request, call).robot_state)
        if request.request_live_point_cloud and snapshot.scan is not None:
            self._live.clouds.fill(made.live_data.point_cloud, snapshot.scan)
        if request.request_live_terrain_maps and snapshot.scan is not None:
            self._live.grids.fill(made.live_data.robot_local_grids.add(), snapshot, snapshot.scan)
        if request.request_live_world_objects:
            made.live_data.objects.extend(self._live.objects.objects())
        return made

    def _localization(self, place: Place, waypoint: str, snapshot: Snapshot) -> Any:
        """The message of a place, relative to a waypoint, and to the seed frame when there are anchors."""
        X_SB = place.X_SO @ snapshot.odometry.X_OB
        made = nav_pb2.Localization(waypoint_id=waypoint, timestamp=timestamp(snapshot.time_s))
        made.waypoint_tform_body.CopyFrom(pose(place.poses[waypoint].inverse() @ X_SB))
        if self._map.graph.anchoring.anchors:
            made.seed_tform_body.CopyFrom(pose(X_SB))
        return made

    # -- navigation --------------------------------------------------------------------------------------------------

    def NavigateTo(self, request: Any, _call: Call) -> Any:
        """Goes to a waypoint along the cheapest route."""

        def plan(known: GraphMap, place: Place) -> tuple[Sequence[str], Pose2D]:
            there = request.destination_waypoint_id
            if there not in known.waypoints:
                raise CannotError("UNKNOWN_WAYPOINT", [there])
            return _route(known, place, [there]), _goal(request, place, there)

        return self._navigate(request, graph_nav_pb2.NavigateToResponse, plan)

    def NavigateRoute(self, request: Any, _call: Call) -> Any:
        """Goes along a route, from its nearest point unless the request says otherwise."""

        def plan(known: GraphMap, place: Place) -> tuple[Sequence[str], Pose2D]:
            names = list(request.route.waypoint_id)
            strange = [name for name in names if name not in known.waypoints]
            if strange or not names:
                raise CannotError("UNKNOWN_ROUTE_ELEMENTS", strange)
            ends = [{edge.from_waypoint, edge.to_waypoint} for edge in request.route.edge_id]
            pairs = [{a, b} for a, b in pairwise(names) if b in known.edges[a]]
            if ends != pairs or len(pairs) != len(names) - 1:
                raise CannotError("INVALID_EDGE", edges=list(request.route.edge_id))
            begin = request.route_follow_params.new_cmd_behavior
            if begin == _Params.START_FAIL_WHEN_NOT_ON_ROUTE and place.waypoint not in names:
                raise CannotError("NOT_LOCALIZED_TO_ROUTE")
            to = _route(known, place, names[:1] if begin == _Params.START_GOTO_START else names)
            return [*to, *names[names.index(to[-1]) + 1 :]], _goal(request, place, names[-1])

        return self._navigate(request, graph_nav_pb2.NavigateRouteResponse, plan)

    def NavigateToAnchor(self, request: Any, _call: Call) -> Any:
        """Goes to a pose in the seed frame, along the cheapest route to the waypoint nearest to it."""

        def plan(known: GraphMap, place: Place) -> tuple[Sequence[str], Pose2D]:
            if request.WhichOneof("goal") != "seed_tform_goal":
                raise CannotError("INVALID_GPS_COMMAND")
            if not known.graph.anchoring.anchors:
                raise CannotError("NO_ANCHORING")
            X_SG, most_m = transform(request.seed_tform_goal, "seed_tform_goal"), _GOAL_M
            if request.HasField("goal_waypoint_rt_seed_ewrt_seed_tolerance"):
                most_m = max(vector(request.goal_waypoint_rt_seed_ewrt_seed_tolerance, "tolerance")[:2])
            there = _nearest(X_SG, place.poses, place.poses)
            if np.linalg.norm((place.poses[there].translation() - X_SG.translation())[:2]) > most_m:
                raise CannotError("NO_PATH")
            return _route(known, place, [there]), Pose2D.from_transform(X_SG)

        return self._navigate(request, graph_nav_pb2.NavigateToAnchorResponse, plan)

    def _navigate(self, request: Any, Response: Any, plan: Plan) -> Any:
        check_values(request)
        used = [self._leases.use(lease, (MOBILITY,)) for lease in request.leases or [lease_pb2.Lease()]]
        made, held = Response(lease_use_results=used), [each.attempted_lease for each in used if each.status == _OK]
        if not held:
            return made
        try:
            made.command_id = self._begin(request, plan, held[0])
            made.status = Response.STATUS_OK
        except CannotError as cannot:
            made.status = Response.Status.Value(f"STATUS_{cannot.status}")
            made.error_waypoint_ids.extend(cannot.waypoints)
            if cannot.edges:
                made.error_edge_ids.extend(cannot.edges)
            if made.status == Response.STATUS_ROBOT_IMPAIRED:
                made.impaired_state.CopyFrom(_impaired(self._computer))
        return made

    def _begin(self, request: Any, plan: Plan, lease: Any) -> int:
        """Starts a navigation, or extends a running one; returns its number. Raises CannotError."""
        known, place, number = self._map, self._place, int(request.command_id)
        if not self._clocks.knows(request.clock_identifier):
            raise CannotError("NO_TIMESYNC")
        try:
            end_s = end_of(request, self._computer.now_s(), "the request")
        except RefusedError as refused:
            name = robot_command_pb2.RobotCommandResponse.Status.Name(refused.status)
            raise CannotError(name.removeprefix("STATUS_")) from refused
        if number and number not in self._routes:
            raise CannotError("UNRECOGNIZED_COMMAND")
        if number and self._routes[number].status in (Feedback.STATUS_FOLLOWING_ROUTE, Feedback.STATUS_REACHED_GOAL):
            self._routes[number].end_s = end_s
            return number
        if _impaired(self._computer).impaired_status != _Impaired.IMPAIRED_STATUS_OK:
            raise CannotError("ROBOT_IMPAIRED")
        if self._computer.docked():  # the API has no status of its own for that
            raise CannotError("COULD_NOT_UPDATE_ROUTE")
        if place is None or place.waypoint not in known.waypoints:
            raise CannotError("NOT_LOCALIZED_TO_MAP")
        if place.lost:
            raise CannotError("LOST")
        course, number = Course.of(*plan(known, place), place.poses, request.travel_params), number or next(self._ids)
        motion = FollowRoute(course, end_s, known, lambda: self._place, lambda: self._cause(lease))
        self._routes[number] = motion
        self._routes.pop(number - _REMEMBERED, None)
        self._computer.do(lambda: self._computer.move({MOBILITY: motion}))
        return number

    def _cause(self, lease: Any) -> int:
        """Status of a navigation that something else has ended."""
        if self._computer.estop.level() != estop_pb2.ESTOP_LEVEL_NONE:
            return int(Feedback.STATUS_ROBOT_IMPAIRED)
        holds = self._leases.holds(lease, MOBILITY)
        return int(Feedback.STATUS_COMMAND_OVERRIDDEN if holds else Feedback.STATUS_LEASE_ERROR)

    def NavigationFeedback(self, request: Any, _call: Call) -> Any:
        """Returns the progress of a navigation, by default the last one."""
        number = request.command_id or max(list(self._routes), default=0)
        if not number:
            return Feedback(status=Feedback.STATUS_NO_ROUTE)
        if number not in self._routes:
            raise InvalidRequestError(f"command_id: there is no command {number}")
        made = self._routes[number].feedback(number)
        made.impaired_state.CopyFrom(_impaired(self._computer))
        return made


def _streamed(Response: Any, stored: Any, **named: str) -> Iterator[Any]:
    """Yields a snapshot in chunks; one without id does not exist."""
    if not stored.id:
        yield Response(status=Response.STATUS_SNAPSHOT_DOES_NOT_EXIST)
        return
    for chunk in chunks(stored):
        yield Response(status=Response.STATUS_OK, chunk=chunk, **named)


def _exact(
    localiser: MapLocaliser, X_SO: Pose2D, snapshot: Snapshot, reach_m: float, reach_rad: float
) -> Pose2D | None:
    """Pose X_SO of the scan's fit near a first guess; None without a fit."""
    found = None if snapshot.scan is None else localiser.start(X_SO, snapshot.scan, reach_m)
    if found is None or abs(math.remainder(found.yaw_rad - X_SO.yaw_rad, math.tau)) > reach_rad:
        return None
    return found


def _nearest(X_SB: RigidTransform, poses: Poses, names: Collection[str]) -> str:
    """The waypoint among `names` that is nearest to a pose."""
    p_SB = X_SB.translation()[:2]
    known = (name for name in names if name in poses)
    return min(known, key=lambda name: float(np.linalg.norm(poses[name].translation()[:2] - p_SB)))


def _route(known: GraphMap, place: Place, goals: Sequence[str]) -> Sequence[str]:
    """The cheapest route from where the robot is. Raises CannotError."""
    found = known.route(place.waypoint, goals)
    if not found:
        raise CannotError("NO_PATH", goals[:1])
    return found


def _goal(request: Any, place: Place, waypoint: str) -> Pose2D:
    """Goal in frame S at a waypoint, with the offset of the request."""
    given = request.destination_waypoint_tform_body_goal
    return Pose2D.from_transform(place.poses[waypoint] @ planar(given))


def _impaired(computer: Computer) -> Any:
    """The message of what keeps the robot from navigating."""
    made, snapshot = _Impaired(impaired_status=_Impaired.IMPAIRED_STATUS_OK), computer.snapshot
    if computer.fault is not None:
        made.impaired_status = _Impaired.IMPAIRED_STATUS_BEHAVIOR_FAULT
        made.behavior_faults.append(computer.fault)
    if snapshot.motors is not Motors.ON:
        made.impaired_status = _Impaired.IMPAIRED_STATUS_NO_MOTOR_POWER
    if snapshot.faults:
        made.impaired_status = _Impaired.IMPAIRED_STATUS_SYSTEM_FAULT
        for fault in snapshot.faults:
            made.system_faults.add(name=fault, error_message=fault)
    return made
