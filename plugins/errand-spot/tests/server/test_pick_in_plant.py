"""A can on a table of the flat is picked up by a ray, by a robot that walks up to it; the referee sees it lifted."""

import math

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from bosdyn.api import lease_pb2, manipulation_api_pb2, robot_command_pb2
from bosdyn.client.robot_command import RobotCommandBuilder as Build

from errand_spot.messages import vec3
from errand_spot.picking import PointPicker
from errand_spot.server.calls import Call
from errand_spot.server.computer import Motors, Pace
from errand_spot.server.server import Options, SpotServer
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.simulated import simulate
from skills.manipulation.arm.kinematics import arm_model
from skills.robot import Pose2D

Api = manipulation_api_pb2
CALL = Call("user", "test", 0.0)
START = Pose2D(9.6, 6.5, 0.0)
HAND_M = (0.6, 0.0, 0.55)

pytestmark = pytest.mark.mission


@pytest.fixture
def at_the_table(credentials, monkeypatch):
    """A robot before the kitchen table, the server's calls on it, and the simulation; nothing runs by itself."""
    monkeypatch.setattr("errand_spot.server.leases.STALE_S", math.inf)  # wall time: a slow step is no silent client
    world = open_world("flat")
    simulation = simulate(world, {"Alice": only_robot("Alice", world, seed=1, start=START)}, seed=1, record=False)
    robot = simulation.robots["Alice"]
    options = Options({"user": "right"}, pace=Pace.CLIENT, picker=PointPicker(robot, simulation.clock))
    server = SpotServer(robot, simulation.clock, arm_model(robot.capabilities()), credentials, options)
    return simulation, server, {each.name: each for each in server.services}


def look_down(point_O):
    half = 0.5 * math.atan2(HAND_M[2] + 0.52 - point_O[2], point_O[0] - HAND_M[0])
    return Build.arm_pose_command(*HAND_M, math.cos(half), 0.0, math.sin(half), 0.0, "body", 2.0)


def look_level(point_O):
    return Build.arm_gaze_command(*point_O, "odom")


@pytest.mark.parametrize("look_at", [pytest.param(look_down, marks=pytest.mark.nightly), look_level])
def test_the_can_is_picked_up_and_carried(at_the_table, look_at):
    simulation, server, services = at_the_table
    computer = server.computer
    lease = services["lease"].AcquireLease(lease_pb2.AcquireLeaseRequest(resource="body"), CALL).lease

    def until(true, most_s):
        until_s = computer.clock.now() + most_s
        while not true() and computer.clock.now() < until_s:
            services["lease"].RetainLease(lease_pb2.RetainLeaseRequest(lease=lease), CALL)
            computer.step()
        assert true()

    def command(message):
        request = robot_command_pb2.RobotCommandRequest(lease=lease, command=message)
        number = services["robot-command"].RobotCommand(request, CALL).robot_command_id
        return robot_command_pb2.RobotCommandFeedbackRequest(robot_command_id=number)

    def arm_done(asked):
        told = services["robot-command"].RobotCommandFeedback(asked, CALL).feedback.synchronized_feedback
        return getattr(told.arm_command_feedback, told.arm_command_feedback.WhichOneof("feedback")).status == 1

    computer.do(computer.switch_on)
    until(lambda: computer.snapshot.motors is Motors.ON, 3.0)
    command(Build.synchro_stand_command())
    until(lambda: computer.snapshot.odometry.X_OB.translation()[2] > 0.5, 5.0)
    can_W = next(each.rests_W[0] for each in simulation.referee.objects.values() if each.class_name == "coke")
    can_O = START.transform().inverse() @ can_W
    asked = command(Build.build_synchro_command(look_at(can_O), Build.claw_gripper_open_command()))
    until(lambda: arm_done(asked) and computer.snapshot.gripper.opening > 1.4, 8.0)
    start_O = computer.snapshot.X_AB("odom", "hand_color_image_sensor").translation()
    ray = {"ray_start_rt_frame": vec3(start_O), "ray_end_rt_frame": vec3(can_O), "frame_name": "odom"}
    pick = Api.ManipulationApiRequest(lease=lease, pick_object_ray_in_world=Api.PickObjectRayInWorld(**ray))
    number = services["manipulation"].ManipulationApi(pick, CALL).manipulation_cmd_id
    told = Api.ManipulationApiFeedbackRequest(manipulation_cmd_id=number)
    states = list[int]()

    def ended():
        states.append(services["manipulation"].ManipulationApiFeedback(told, CALL).current_state)
        return states[-1] in (Api.MANIP_STATE_GRASP_SUCCEEDED, Api.MANIP_STATE_GRASP_FAILED)

    until(ended, 60.0)
    assert states[-1] == Api.MANIP_STATE_GRASP_SUCCEEDED
    passed = ("WALKING_TO_OBJECT", "SEARCHING_FOR_GRASP", "MOVING_TO_GRASP", "GRASPING_OBJECT")
    assert {Api.ManipulationFeedbackState.Value(f"MANIP_STATE_{name}") for name in passed} <= set(states)
    assert simulation.referee.lifts("Alice") and computer.snapshot.gripper.holding
