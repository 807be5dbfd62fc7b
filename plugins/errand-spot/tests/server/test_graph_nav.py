"""GraphNav: maps, localisation and navigation, by the SDK's client."""

import math
import time

import numpy as np
import pytest
from bosdyn.api import point_cloud_pb2, world_object_pb2
from bosdyn.api.geometry_pb2 import SE2Pose, SE2VelocityLimit
from bosdyn.api.graph_nav import graph_nav_pb2, map_pb2, nav_pb2
from bosdyn.client import graph_nav
from bosdyn.client.exceptions import InvalidRequestError, ResponseError
from bosdyn.client.frame_helpers import get_a_tform_b
from bosdyn.client.graph_nav import GraphNavClient
from bosdyn.client.lease import LeaseClient
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import pose
from errand_spot.server.computer import Pace
from errand_spot.server.graph_map import SeenTag
from errand_spot.server.state import WorldObjectService
from skills.robot import Pose2D
from tests.tables import table

Feedback = graph_nav_pb2.NavigationFeedbackResponse
Init = graph_nav_pb2.SetLocalizationRequest
PACE = Pace.CLIENT
AT = {"a": (0.0, 0.0, 0.0), "b": (0.9, 0.0, 0.0), "c": (0.9, 0.9, math.pi / 2), "beyond": (3.0, 0.0, 0.0)}
EDGES = (("a", "b"), ("c", "b"), ("b", "beyond"))


def graph_of(at=AT, edges=EDGES, anchored=True):
    made, poses = map_pb2.Graph(), {name: Pose2D(*xyt).transform(0.52) for name, xyt in at.items()}
    for name, X in poses.items():
        made.waypoints.add(id=name, snapshot_id=f"snapshot {name}", waypoint_tform_ko=pose(X.inverse()))
        if anchored:
            made.anchoring.anchors.add(id=name, seed_tform_waypoint=pose(X))
    for a, b in edges:
        edge = made.edges.add(from_tform_to=pose(poses[a].inverse() @ poses[b]), snapshot_id=f"edge {a}{b}")
        edge.id.from_waypoint, edge.id.to_waypoint = a, b
    return made


def localise(client, name="a"):
    where = nav_pb2.Localization(waypoint_id=name, waypoint_tform_body={"rotation": {"w": 1.0}})
    return client.set_localization(where, fiducial_init=Init.FIDUCIAL_INIT_NO_FIDUCIAL)


@pytest.fixture
def idle(served):
    """A client whose robot sits with its motors off, and the robot."""
    robot = served.login()
    robot.time_sync.wait_for_sync(timeout_sec=5.0)
    return robot.ensure_client(GraphNavClient.default_service_name), robot


@pytest.fixture
def nav(spot):
    """The client of a robot that stands, localised at waypoint `a`."""
    client = spot.robot.ensure_client(GraphNavClient.default_service_name)
    client.upload_graph(graph=graph_of())
    localise(client)
    return client


def ended(client, number, seconds=12.0):
    """Waits for the end of a navigation; returns its feedback."""
    until = time.monotonic() + seconds
    while (feedback := client.navigation_feedback(number)).status == Feedback.STATUS_FOLLOWING_ROUTE:
        assert time.monotonic() < until, feedback
        time.sleep(0.1)
    return feedback


def body(spot):
    pose_O = spot.served.scripted.odometry().pose
    return pose_O.x_m, pose_O.y_m, pose_O.yaw_rad


def test_a_map_comes_back_as_it_was_uploaded(idle):
    client, _ = idle
    assert set(client.upload_graph(graph=graph_of()).unknown_waypoint_snapshot_ids) == {
        f"snapshot {name}" for name in AT
    }
    large = map_pb2.WaypointSnapshot(id="snapshot a")
    large.point_cloud.data = np.random.default_rng(1).bytes(3_000_000)
    client.upload_waypoint_snapshot(large)
    client.upload_edge_snapshot(map_pb2.EdgeSnapshot(id="edge ab"))
    client.upload_snapshots(graph_nav_pb2.UploadSnapshotsRequest.Snapshots(waypoint_snapshots=[{"id": "snapshot b"}]))
    again = client.upload_graph(graph=graph_of())
    assert set(again.loaded_waypoint_snapshot_ids) == {"snapshot a", "snapshot b"}
    assert (list(again.loaded_edge_snapshot_ids), client.download_graph()) == (["edge ab"], graph_of())
    assert client.download_waypoint_snapshot("snapshot a") == large
    assert not client.download_waypoint_snapshot("snapshot a", do_not_download_point_cloud=True).HasField("point_cloud")
    assert client.download_edge_snapshot("edge ab").id == "edge ab"
    for download in (client.download_waypoint_snapshot, client.download_edge_snapshot):
        with pytest.raises(graph_nav.UnknownMapInformationError):
            download("none")
    client.clear_graph()
    assert client.download_graph() == map_pb2.Graph()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda g: g.waypoints.add(id="a"), "duplicate_waypoint_ids"),
        (lambda g: g.waypoints.add(), "has_empty_waypoint_ids"),
        (lambda g: g.edges.add(id={"from_waypoint": "a", "to_waypoint": "x"}), "missing_waypoint_ids_in_edges"),
        (lambda g: g.edges.add(id={"from_waypoint": "a", "to_waypoint": "a"}), "invalid_waypoint_ids_self_edges"),
        (lambda g: setattr(g.edges[0].from_tform_to.position, "x", math.nan), "edge_ids_invalid_transform"),
        (lambda g: g.anchoring.anchors.add(id="x"), "missing_waypoint_ids_in_anchors"),
        (lambda g: g.edges.add().CopyFrom(g.edges[0]), "duplicate_edge_ids"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_an_invalid_graph_is_refused_with_a_report_and_changes_nothing(idle, change, field):
    client, _ = idle
    change(graph := graph_of())
    with pytest.raises(graph_nav.InvalidGraphError) as refused:
        client.upload_graph(graph=graph)
    assert getattr(refused.value.response.validation_status, field)
    assert not client.download_graph().waypoints


def test_an_upload_that_is_no_message_is_an_invalid_request(idle, monkeypatch):
    client, _ = idle
    monkeypatch.setattr(map_pb2.WaypointSnapshot, "SerializeToString", lambda _: b"\xff\xff")
    with pytest.raises(InvalidRequestError, match="WaypointSnapshot"):
        client.upload_waypoint_snapshot(map_pb2.WaypointSnapshot())


def test_a_graph_without_anchors_gets_them_on_request(idle):
    client, _ = idle
    client.upload_graph(graph=graph_of(anchored=False), generate_new_anchoring=True)
    anchors = {each.id: each.seed_tform_waypoint for each in client.download_graph().anchoring.anchors}
    assert (anchors["c"].position.x, anchors["c"].position.y) == pytest.approx((0.9, 0.9))


def refusal(call, *arguments, **options):
    """Status of the refusal of a call."""
    with pytest.raises(ResponseError) as refused:
        call(*arguments, **options)
    return refused.value.response.status


def test_the_robot_cannot_be_localised_without_a_map_waypoint_or_tag(idle):
    client, _ = idle
    assert refusal(localise, client) == graph_nav_pb2.SetLocalizationResponse.STATUS_NO_MAP_LOADED
    client.upload_graph(graph=graph_of())
    with pytest.raises(graph_nav.UnknownMapInformationError):
        localise(client, "x")
    status = refusal(client.set_localization, nav_pb2.Localization())
    assert status == graph_nav_pb2.SetLocalizationResponse.STATUS_NO_MATCHING_FIDUCIAL
    assert not client.get_localization_state().localization.waypoint_id


def test_the_state_has_place_and_live_readings(idle):
    client, _ = idle
    client.upload_graph(graph=graph_of())
    assert localise(client, "b").waypoint_id == "b"
    wanted = {f"request_live_{name}": True for name in ("point_cloud", "robot_state", "terrain_maps")}
    state = client.get_localization_state(**wanted, waypoint_id="a")
    place, live = state.localization, state.live_data
    assert (place.waypoint_id, place.waypoint_tform_body.position.x) == ("a", pytest.approx(0.9, abs=0.01))
    assert place.seed_tform_body.position.x == pytest.approx(0.9, abs=0.01)
    assert live.point_cloud.encoding == point_cloud_pb2.PointCloud.ENCODING_XYZ_32F and live.point_cloud.num_points
    assert live.robot_state.battery_states and live.robot_local_grids
    client.upload_graph(graph=graph_of())
    assert not client.get_localization_state().localization.waypoint_id


def test_the_robot_stands_up_and_goes_round_a_corner(spot):
    spot.commands.robot_command(Build.synchro_sit_command())
    client = spot.robot.ensure_client(GraphNavClient.default_service_name)
    client.upload_graph(graph=graph_of())
    localise(client)
    number = client.navigate_to("c", 20.0)
    first = client.navigation_feedback()
    assert list(first.remaining_route.waypoint_id)[-2:] == ["b", "c"] and first.command_id == number
    last = first.remaining_route.edge_id[-1]
    assert (last.from_waypoint, last.to_waypoint) == ("c", "b")
    assert ended(client, number, 20.0).status == Feedback.STATUS_REACHED_GOAL
    assert body(spot) == pytest.approx((0.9, 0.9, math.pi / 2), abs=0.1)
    assert client.get_localization_state().localization.waypoint_id == "c"


def test_a_goal_may_lie_beside_a_waypoint_or_be_a_pose(spot, nav):
    limit = SE2VelocityLimit(max_vel={"linear": {"x": 0.3, "y": 0.3}, "angular": 1.0})
    goal = {"travel_params": nav.generate_travel_params(0.1, 0.2, limit)}
    goal["destination_waypoint_tform_body_goal"] = SE2Pose(position={"x": -0.3})
    assert ended(nav, nav.navigate_to("b", 10.0, **goal)).status == Feedback.STATUS_REACHED_GOAL
    assert body(spot)[0] == pytest.approx(0.6, abs=0.12)
    number = nav.navigate_to_anchor(pose(Pose2D(0.2, 0.2, 0.5).transform(0.52)), 10.0)
    assert ended(nav, number).status == Feedback.STATUS_REACHED_GOAL
    assert body(spot) == pytest.approx((0.2, 0.2, 0.5), abs=0.1)


def test_a_route_is_driven_from_where_the_robot_is(nav):
    edges = [map_pb2.Edge.Id(from_waypoint="a", to_waypoint="b"), map_pb2.Edge.Id(from_waypoint="c", to_waypoint="b")]
    route = nav.build_route(["a", "b", "c"], edges)
    for _ in range(40):
        number = nav.navigate_route(route, 1.0)
        time.sleep(0.3)
        if nav.navigation_feedback(number).status == Feedback.STATUS_REACHED_GOAL:
            return
    raise AssertionError("the robot did not arrive by commands that replace each other")


@pytest.mark.parametrize(*table(__file__, "routes"))
def test_a_route_that_is_none_is_refused(nav, waypoints, edges, error):
    route = nav.build_route(waypoints, [map_pb2.Edge.Id(from_waypoint=a, to_waypoint=b) for a, b in edges])
    with pytest.raises(getattr(graph_nav, error)):
        nav.navigate_route(route, 1.0)


def test_a_navigation_ends_with_its_time_unless_it_is_put_off(spot, nav):
    number = nav.navigate_to("c", 0.4)
    assert nav.navigate_to("c", 1.0, command_id=number) == number
    begun = time.monotonic()
    assert ended(nav, number).status == Feedback.STATUS_COMMAND_TIMED_OUT
    assert 0.6 < time.monotonic() - begun < 3.0
    time.sleep(0.3)
    x_m, *_ = body(spot)
    time.sleep(0.3)
    assert body(spot)[0] == pytest.approx(x_m, abs=0.005)


def test_an_obstacle_stops_the_robot(spot, nav):
    params = graph_nav_pb2.TravelParams(blocked_path_wait_time={"seconds": 1})
    feedback = ended(nav, nav.navigate_to("beyond", 20.0, travel_params=params), 20.0)
    assert (feedback.status, feedback.stuck_reason) == (Feedback.STATUS_STUCK, Feedback.STUCK_REASON_OBSTACLE)
    assert body(spot)[0] < 1.7 - 0.55


def test_the_cause_of_an_early_end_is_reported(spot, nav):
    number = nav.navigate_to("c", 20.0)
    spot.commands.robot_command(Build.stop_command())
    assert ended(nav, number).status == Feedback.STATUS_COMMAND_OVERRIDDEN
    number = nav.navigate_to("c", 20.0)
    spot.served.login().ensure_client(LeaseClient.default_service_name).take("body")
    assert ended(nav, number).status == Feedback.STATUS_LEASE_ERROR


def test_a_docked_robot_does_not_leave_its_dock(spot, nav, monkeypatch):
    monkeypatch.setattr(spot.served.server.computer, "docked", lambda: True)
    with pytest.raises(graph_nav.RouteNotUpdatingError):
        nav.navigate_to("c", 5.0)


def test_a_navigation_with_an_option_that_the_api_lacks_is_an_invalid_request(nav):
    with pytest.raises(InvalidRequestError, match="planner_mode: the API has no option 99"):
        nav.navigate_to("c", 5.0, travel_params=graph_nav_pb2.TravelParams(planner_mode=99))


def test_a_navigation_that_cannot_begin_is_refused_with_its_status(spot, nav):
    Response = graph_nav_pb2.NavigateToResponse
    nav.upload_graph(graph=graph_of({**AT, "alone": (5.0, 5.0, 0.0)}))
    assert refusal(nav.navigate_to, "c", 5.0) == Response.STATUS_NOT_LOCALIZED_TO_MAP
    localise(nav)
    for error, arguments in (
        (graph_nav.UnknownWaypointError, ("x", 5.0)),
        (graph_nav.NoPathError, ("alone", 5.0)),
        (graph_nav.CommandExpiredError, ("c", -1.0)),
        (graph_nav.TooDistantError, ("c", 90000.0)),
    ):
        with pytest.raises(error):
            nav.navigate_to(*arguments)
    assert refusal(nav.navigate_to, "c", 5.0, command_id=99) == Response.STATUS_UNRECOGNIZED_COMMAND
    with pytest.raises(InvalidRequestError):
        nav.navigation_feedback(99)
    spot.robot.power_off(timeout_sec=10.0)
    with pytest.raises(graph_nav.RobotImpairedError):
        nav.navigate_to("c", 5.0)


class Seeing:
    """Perception that sees a tag 1 m in front of the robot's start."""

    def __init__(self, served):
        served.server.computer.robot = scripted = served.scripted
        scripted.image = lambda source, **_: source
        for service in served.server.services:
            if isinstance(service, WorldObjectService):
                service._perception = self

    def tags(self, source):
        return [SeenTag(7, 0.1, Pose2D(1.0, 0.0, 0.0).transform(0.5))] if source == "frontleft" else []


def test_a_tag_in_sight_is_listed_and_localises_the_robot(served, idle):
    client, robot = idle
    Seeing(served)
    objects = robot.ensure_client("world-objects")
    (tag,) = objects.list_world_objects([world_object_pb2.WORLD_OBJECT_APRILTAG]).world_objects
    seen = tag.apriltag_properties
    assert (seen.tag_id, seen.dimensions.x) == (7, 0.1)
    assert get_a_tform_b(tag.transforms_snapshot, "odom", seen.frame_name_fiducial).x == pytest.approx(1.0)
    assert not objects.list_world_objects([world_object_pb2.WORLD_OBJECT_DOCK]).world_objects
    graph = graph_of()
    graph.anchoring.objects.add(id="7", seed_tform_object=pose(Pose2D(1.9, 0.0, 0.0).transform(0.5)))
    client.upload_graph(graph=graph)
    assert client.set_localization(nav_pb2.Localization()).waypoint_id == "b"
    assert client.get_localization_state().localization.seed_tform_body.position.x == pytest.approx(0.9, abs=0.02)
