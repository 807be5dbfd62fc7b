"""Missions through Spot's API: adapter and server in lock-step, judged by the plant's referee."""

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

import bosdyn.client
import grpc
from bosdyn.api.graph_nav import graph_nav_pb2, nav_pb2
from bosdyn.client.graph_nav import GraphNavClient
from bosdyn.client.lease import LeaseClient
from call_faults import Fault
from lock_step import LockStep
from pydrake.math import RigidTransform

from errand_spot.messages import pose, timestamp
from errand_spot.perception import SpotPerception, world_map
from errand_spot.server.identity import credentials
from executive import Request
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.simulated import simulate
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from skills.robot import Pose2D
from tests.benchmarks.served_missions import MISSIONS, Cut
from tests.benchmarks.spot_missions import through_api

GRAPH_NAV = "graph-nav-service"
FREE = "the lease was given back"


@pytest.mark.mission
@pytest.mark.parametrize(
    "what",
    [
        {"file": MISSIONS / "go_to_pose.yaml", "given": {"x": 9.0, "y": 4.3, "yaw": 0.8}, "seed": 3},
        pytest.param({"sentence": "go to the kitchen", "seed": 3}, marks=pytest.mark.nightly),
        pytest.param({"file": MISSIONS / "fetch_drink.yaml", "seed": 1}, marks=pytest.mark.nightly),
    ],
    ids=["go half a metre", "go", "fetch"],
)
def test_a_mission_through_the_api_is_fulfilled(what, tmp_path):
    ended = through_api(Request(**what, record=False, out=tmp_path / "out"), tmp_path / "credentials")
    assert (ended.outcome, ended.verdict) == ("success", True), ended


def tablet_at(step):
    """The SDK's robot, as a tablet has it."""
    sdk = bosdyn.client.create_standard_sdk("tablet", cert_resource_glob=str(step.certificate))
    robot = sdk.create_robot("127.0.0.1")
    robot.update_secure_channel_port(step.server.port)
    robot.authenticate("user", "right")
    return robot


def localised_by_a_person(step, X_SB=None):
    """Uploads a map of the flat and localises the robot, by its pose at the start, as a person does with a tablet."""
    robot = tablet_at(step)
    client, flat = robot.ensure_client(GraphNavClient.default_service_name), world_map(open_world("flat"))
    client.upload_graph(graph=flat.graph)
    for snapshot in flat.waypoint_snapshots.values():
        client.upload_waypoint_snapshot(snapshot)
    at_start = nav_pb2.Localization(waypoint_id="start", waypoint_tform_body=pose(X_SB or RigidTransform()))
    client.set_localization(at_start, fiducial_init=graph_nav_pb2.SetLocalizationRequest.FIDUCIAL_INIT_NO_FIDUCIAL)
    return {}


@pytest.mark.mission
@pytest.mark.nightly
@pytest.mark.parametrize("localised", [True, False], ids=["localised", "not localised"])
def test_graph_nav_localises_the_robot_of_a_mission(localised, tmp_path):
    (tmp_path / "stack.yaml").write_text("localiser: {use: graph_nav}\n")
    what = {"sentence": "go to the kitchen", "seed": 3, "stack": tmp_path / "stack.yaml"}
    request = Request(**what, record=False, out=tmp_path / "out")
    ended = through_api(request, tmp_path / "credentials", localised_by_a_person if localised else lambda _: {})
    assert (ended.outcome == "success", ended.verdict) == (localised, localised), ended


@pytest.mark.mission
def test_graph_nav_takes_the_robot_into_another_room(tmp_path):
    world, made, before_door = open_world("flat"), [], Pose2D(9.0, 4.6, 1.57)

    def build():
        placed = only_robot("Alice", world, seed=1, start=before_door)
        made.append(simulate(world, {"Alice": placed}, seed=1, record=False))
        return made[0].robots["Alice"], made[0].clock

    step = LockStep(build, credentials(tmp_path / "credentials"), SpotPerception({}))
    try:
        step.stand_up()
        localised_by_a_person(step, world.start.transform().inverse() @ before_door.transform())
        spot = step.connection
        by = {"clock_identifier": spot.clock_identifier, "end_time": timestamp(spot.robot_time_s() + 60.0)}
        request = graph_nav_pb2.NavigateToRequest(destination_waypoint_id="waypoint_13", leases=[spot.lease], **by)
        number = spot.call(GRAPH_NAV, "NavigateTo", request).command_id

        def status():
            request = graph_nav_pb2.NavigationFeedbackRequest(command_id=number)
            return spot.call(GRAPH_NAV, "NavigationFeedback", request, checked=False).status

        Status = graph_nav_pb2.NavigationFeedbackResponse
        step.until(lambda: status() != Status.STATUS_FOLLOWING_ROUTE, 60.0, every_s=0.2)
        truth, there = made[0].true_pose("Alice"), world_map(world).poses("start")["waypoint_13"].translation()
        assert status() == Status.STATUS_REACHED_GOAL
        assert (truth.x_m, truth.y_m) == pytest.approx((there[0], there[1]), abs=0.14)  # 0.2 m in all
    finally:
        made.clear()
        step.close()


class Tablet(RunVisitor):
    """Person with a tablet: takes the lease at tick 140, gives it back at 200, and resumes the run when it is free."""

    def __init__(self, step, control):
        self._client, self._control = tablet_at(step).ensure_client(LeaseClient.default_service_name), control
        self._lease, self.seen, self.poses = None, [], {}

    def tick(self, progress):
        if progress.ticks == 140:
            self._lease = self._client.take()
        elif progress.ticks == 200:
            self._client.return_lease(self._lease)
        mode, reason = self._control.state.mode, self._control.state.reason
        if reason == FREE and self.seen[-1] == (mode, reason):
            self._control.resume()
        if self.seen[-1:] != [(mode, reason)]:
            self.seen.append((mode, reason))
        self.poses[progress.ticks] = progress.robots["Alice"].pose


@pytest.mark.mission
@pytest.mark.nightly
def test_a_run_whose_robot_is_silent_for_a_while_goes_on_by_itself(tmp_path):
    control, cuts = Control(attended=True, pace=None), []

    def with_cut(step):
        silent = Fault(code=grpc.StatusCode.UNAVAILABLE)
        cuts.append(Cut(lambda: step.server.faults.fault("*", silent), control, tick=140))
        return {"visitors": cuts, "control": control}

    request = Request(sentence="go to the kitchen", seed=3, record=False, out=tmp_path / "out")
    ended = through_api(request, tmp_path / "credentials", with_cut)
    seen = [(mode.value, reason) for mode, reason in cuts[0].seen]
    assert seen == [("running", ""), ("paused", "Alice has not answered for 3 s"), ("running", "")]
    assert (ended.outcome, ended.verdict) == ("success", True), ended


@pytest.mark.mission
@pytest.mark.nightly
def test_a_run_whose_lease_is_taken_goes_on_when_the_operator_resumes_it(tmp_path):
    control = Control(attended=True, pace=None)
    tablets = []

    def with_tablet(step):
        tablets.append(Tablet(step, control))
        return {"visitors": tablets, "control": control}

    request = Request(sentence="go to the kitchen", seed=3, record=False, out=tmp_path / "out")
    ended = through_api(request, tmp_path / "credentials", with_tablet)
    tablet = tablets[0]
    assert [mode.value for mode, _ in tablet.seen] == ["running", "paused", "paused", "running"]
    assert tablet.seen[1][1].startswith("tablet") and tablet.seen[1][1].endswith("holds the lease of Alice")
    assert tablet.poses[170].x_m == pytest.approx(tablet.poses[200].x_m, abs=0.02)
    assert (ended.outcome, ended.verdict) == ("success", True), ended
