"""Walks to objects and picks by pixel, ray and point; a client's word on the item in the gripper.

The robot stands before a wall, 1.7 m ahead of it.
"""

import math
import time
from dataclasses import dataclass, field

import numpy as np
import pytest
from bosdyn.api import geometry_pb2, manipulation_api_pb2, robot_state_pb2
from bosdyn.client.exceptions import InvalidRequestError
from bosdyn.client.frame_helpers import get_a_tform_b, get_odom_tform_body
from bosdyn.client.image import build_image_request
from bosdyn.client.robot_command import RobotCommandBuilder as Build
from bosdyn.client.robot_command import block_until_arm_arrives, blocking_sit
from google.protobuf.wrappers_pb2 import FloatValue
from pydrake.math import RotationMatrix

from errand_spot.server.computer import Pace
from errand_spot.server.manipulation import grasp_test, is_only_from_above
from errand_spot.server.rays import first_hit_m
from tests.tables import table

Api = manipulation_api_pb2
PACE, SHARED = Pace.CLIENT, True
ENDS = (
    Api.MANIP_STATE_DONE,
    Api.MANIP_STATE_GRASP_SUCCEEDED,
    Api.MANIP_STATE_GRASP_FAILED,
    Api.MANIP_STATE_GRASP_PLANNING_NO_SOLUTION,
    Api.MANIP_STATE_GRASP_FAILED_TO_RAYCAST_INTO_MAP,
)
State = robot_state_pb2.ManipulatorState


@dataclass
class Scripted:
    """A picker whose outcome the test sets."""

    held: bool | None = None
    no_plan: bool = False
    begun: list = field(default_factory=list)
    ended: int = 0

    def begin(self, lease, point_O, points_O, allows):
        self.begun.append((point_O, allows))

    def step(self):
        return self.held

    def end(self):
        self.ended += 1


@pytest.fixture
def picker(spot):
    """A picker of the server."""
    service = next(each for each in spot.served.server.services if each.name == "manipulation")
    service._picker = made = Scripted()
    yield made
    service._picker = None


def client(spot):
    return spot.robot.ensure_client("manipulation")


def started(spot, **request):
    return client(spot).manipulation_api_command(Api.ManipulationApiRequest(**request)).manipulation_cmd_id


def feedback(spot, number):
    request = Api.ManipulationApiFeedbackRequest(manipulation_cmd_id=number)
    return client(spot).manipulation_api_feedback_command(request)


def outcome(spot, number, states=ENDS, seconds=10.0):
    """Waits for one of the states; returns it with those before it."""
    seen, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        state = feedback(spot, number).current_state
        if not seen or seen[-1] != state:
            seen.append(state)
        if state in states:
            return seen
        time.sleep(0.05)
    raise AssertionError(f"still {Api.ManipulationFeedbackState.Name(seen[-1])}")


def pixel(spot, source="frontleft_fisheye_image", resized=None):
    """The middle of a picture."""
    request = build_image_request(source, resize_ratio=resized)
    image = spot.robot.ensure_client("image").get_image([request])[0]
    return {
        "pixel_xy": geometry_pb2.Vec2(x=image.source.cols / 2, y=image.source.rows / 2),
        "transforms_snapshot_for_camera": image.shot.transforms_snapshot,
        "frame_name_image_sensor": image.shot.frame_name_image_sensor,
        "camera_model": image.source.pinhole,
    }


def ray(x, y, z, frame="body"):
    start, end = geometry_pb2.Vec3(x=0.4), geometry_pb2.Vec3(x=0.4 + x, y=y, z=z)
    return {"ray_start_rt_frame": start, "ray_end_rt_frame": end, "frame_name": frame}


@pytest.mark.parametrize(("offset", "distance_m"), [({}, 0.9), ({"offset_distance": FloatValue(value=1.3)}, 1.3)])
def test_the_robot_walks_to_the_wall_that_a_ray_meets_up_to_the_clients_distance(spot, offset, distance_m):
    states = outcome(spot, started(spot, walk_to_object_ray_in_world={**ray(1.0, 0.0, 0.0), **offset}))
    assert states[-2:] == [Api.MANIP_STATE_WALKING_TO_OBJECT, Api.MANIP_STATE_DONE]
    assert get_odom_tform_body(spot.tree).x == pytest.approx(1.7 - distance_m, abs=0.06)


def test_the_robot_walks_to_what_a_pixel_shows_and_tells_where_it_is(spot):
    number = started(spot, walk_to_object_in_image=pixel(spot))
    outcome(spot, number)
    tree = feedback(spot, number).transforms_snapshot_manipulation_data
    found = get_a_tform_b(tree, "odom", "walkto_raycast_intersection")
    body = get_odom_tform_body(spot.tree)
    assert found.x == pytest.approx(1.7, abs=0.05) or found.z == pytest.approx(0.0, abs=0.05)
    assert math.hypot(found.x - body.x, found.y - body.y) == pytest.approx(0.9, abs=0.06)
    assert math.atan2(found.y - body.y, found.x - body.x) == pytest.approx(body.rot.to_yaw(), abs=0.06)


def test_a_ray_that_meets_nothing_moves_nothing(spot):
    number = started(spot, walk_to_object_ray_in_world=ray(0.0, 0.0, 1.0))
    assert outcome(spot, number)[-1] == Api.MANIP_STATE_GRASP_FAILED_TO_RAYCAST_INTO_MAP
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.0, abs=0.01)


def test_another_command_ends_a_walk(spot):
    number = started(spot, walk_to_object_ray_in_world=ray(1.0, 0.0, 0.0))
    outcome(spot, number, (Api.MANIP_STATE_WALKING_TO_OBJECT,))
    spot.commands.robot_command(Build.stop_command())
    assert outcome(spot, number)[-1] == Api.MANIP_STATE_GRASP_FAILED
    time.sleep(0.3)
    assert not any(spot.served.scripted.velocity)


@pytest.mark.parametrize(*table(__file__, "picks"))
def test_a_pick_ends_as_its_attempt(spot, picker, held, no_plan, state):
    number = started(spot, pick_object_in_image={**pixel(spot), "walk_gaze_mode": Api.PICK_NO_AUTO_WALK_OR_GAZE})
    outcome(spot, number, (Api.MANIP_STATE_SEARCHING_FOR_GRASP,))
    picker.held, picker.no_plan = held, no_plan
    assert (Api.ManipulationFeedbackState.Name(outcome(spot, number)[-1]), picker.ended) == (state, 1)


def test_an_object_out_of_reach_is_walked_to_before_it_is_picked(spot, picker):
    number = started(spot, pick_object={"frame_name": "odom", "object_rt_frame": {"x": 1.5, "z": 0.3}})
    states = outcome(spot, number, (Api.MANIP_STATE_SEARCHING_FOR_GRASP,))
    assert Api.MANIP_STATE_WALKING_TO_OBJECT in states
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.6, abs=0.06)
    assert picker.begun[0][0] == pytest.approx([1.5, 0.0, 0.3])


def test_an_object_without_a_plan_is_tried_once_more_from_nearer_at_the_same_point(spot, picker):
    picker.held, picker.no_plan = False, True
    states = outcome(spot, started(spot, pick_object_ray_in_world=ray(1.0, 0.0, 0.0)), seconds=30.0)
    assert states[-1] == Api.MANIP_STATE_GRASP_PLANNING_NO_SOLUTION
    (first_O, _), (again_O, _) = picker.begun
    assert again_O == pytest.approx(first_O)
    assert get_odom_tform_body(spot.tree).x == pytest.approx(first_O[0] - 0.76, abs=0.06)


def test_an_object_without_a_plan_is_not_approached_when_the_client_forbids_walking(spot, picker):
    picker.held, picker.no_plan = False, True
    request = {**ray(1.0, 0.0, 0.0), "walk_gaze_mode": Api.PICK_NO_AUTO_WALK_OR_GAZE}
    states = outcome(spot, started(spot, pick_object_ray_in_world=request))
    assert states[-1] == Api.MANIP_STATE_GRASP_PLANNING_NO_SOLUTION and len(picker.begun) == 1
    assert get_odom_tform_body(spot.tree).x == pytest.approx(0.0, abs=0.02)


def test_a_defect_of_the_picker_ends_the_pick_and_not_the_server(spot, picker, caplog):
    def fail():
        raise RuntimeError("a defect")

    picker.step = fail
    number = started(spot, pick_object_ray_in_world={**ray(1.0, 0.0, 0.0), "walk_gaze_mode": Api.PICK_AUTO_GAZE})
    assert (outcome(spot, number)[-1], picker.ended) == (Api.MANIP_STATE_GRASP_FAILED, 1)
    assert "a defect" in caplog.text
    block_until_arm_arrives(spot.commands, spot.commands.robot_command(Build.arm_ready_command()), timeout_sec=8.0)


def test_another_command_stops_a_pick(spot, picker):
    number = started(spot, pick_object_ray_in_world={**ray(1.0, 0.0, 0.0), "walk_gaze_mode": Api.PICK_AUTO_GAZE})
    outcome(spot, number, (Api.MANIP_STATE_SEARCHING_FOR_GRASP,))
    spot.commands.robot_command(Build.arm_ready_command())
    assert (outcome(spot, number)[-1], picker.ended) == (Api.MANIP_STATE_GRASP_FAILED, 1)


def oriented(**constraint):
    return Api.GraspParams(allowable_orientation=[Api.AllowableOrientation(**constraint)])


# source, share of its size -> pixels beyond the picture
@pytest.mark.parametrize(("source", "resized"), [("frontleft_fisheye_image", None), ("hand_color_image", 0.5)])
@pytest.mark.parametrize("beyond", [(-1.0, 10.0), (10.0, -0.5), (1.0, 10.0), (10.0, 1.0)])
def test_a_pixel_outside_of_its_picture_is_an_invalid_request(spot, picker, source, resized, beyond):
    request = pixel(spot, source, resized)
    cols, rows = 2.0 * request["pixel_xy"].x, 2.0 * request["pixel_xy"].y
    x, y = beyond[0] + cols * (beyond[0] == 1.0), beyond[1] + rows * (beyond[1] == 1.0)
    with pytest.raises(InvalidRequestError, match=r"pixel_xy.[xy] is .* it must be 0 to (640|480|320|240), within"):
        started(spot, pick_object_in_image={**request, "pixel_xy": geometry_pb2.Vec2(x=x, y=y)})
    assert not picker.begun
    corner = geometry_pb2.Vec2(x=cols, y=rows)
    assert started(spot, walk_to_object_in_image={**request, "pixel_xy": corner})


def test_a_robot_that_sits_stands_up_before_it_picks(spot, picker):
    blocking_sit(spot.commands, timeout_sec=5.0, update_frequency=20.0)
    request = {**ray(1.0, 0.0, 0.0, "odom"), "walk_gaze_mode": Api.PICK_NO_AUTO_WALK_OR_GAZE}
    started(spot, pick_object_ray_in_world=request)
    time.sleep(0.3)
    assert not picker.begun
    time.sleep(2.0)
    assert picker.begun and spot.served.scripted.height_m > 0.5


def test_a_pixel_outside_of_a_picture_of_another_camera_is_an_invalid_request(spot):
    request = pixel(spot)
    request["camera_model"].intrinsics.focal_length.x *= 1.5
    with pytest.raises(InvalidRequestError, match=r"pixel_xy\.x is 1000"):
        started(spot, walk_to_object_in_image={**request, "pixel_xy": geometry_pb2.Vec2(x=1000.0, y=10.0)})


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_a_task_that_cannot_be_done_is_an_invalid_request(spot, picker, request_, said):
    with pytest.raises(InvalidRequestError, match=said):
        started(spot, **request_)
    assert not picker.begun


def test_a_camera_frame_that_is_its_own_parent_is_an_invalid_request(spot):
    given = pixel(spot)
    given["transforms_snapshot_for_camera"].child_to_parent_edge_map["odom"].parent_frame_name = "odom"
    with pytest.raises(InvalidRequestError, match="circle"):
        started(spot, walk_to_object_in_image=given)


def test_a_server_without_a_picker_refuses_picks(spot):
    with pytest.raises(InvalidRequestError, match="plans grasps"):
        started(spot, pick_object={"frame_name": "odom"})


def test_a_task_with_motors_off_is_an_invalid_request(spot):
    spot.robot.power_off(cut_immediately=True, timeout_sec=10, update_frequency=20.0)
    with pytest.raises(InvalidRequestError, match="motors are off"):
        started(spot, walk_to_object_ray_in_world=ray(1.0, 0.0, 0.0))


def test_feedback_of_an_unknown_task_is_an_invalid_request(spot):
    with pytest.raises(InvalidRequestError):
        feedback(spot, 4711)


def test_a_grasp_from_above_is_told_from_one_from_the_side(spot):
    snapshot = spot.served.server.computer.snapshot

    def aligned(axis, to):
        axes = {"axis_on_gripper_ewrt_gripper": axis, "axis_to_align_with_ewrt_frame": to}
        return grasp_test(oriented(vector_alignment_with_tolerance={**axes, "threshold_radians": 0.17}), snapshot)

    top, side = aligned({"x": 1}, {"z": -1}), aligned({"y": 1}, {"z": 1})
    down, rolled = RotationMatrix.MakeYRotation(math.pi / 2), RotationMatrix.MakeXRotation(math.pi / 2)
    assert (top(down), top(rolled), side(down), side(rolled)) == (True, False, False, True)
    either = grasp_test(Api.GraspParams(), snapshot)
    assert list(map(is_only_from_above, (top, side, either))) == [True, False, False]


def test_a_rotation_with_tolerance_allows_rotations_near_it(spot):
    down = {"rotation_ewrt_frame": {"w": math.sqrt(0.5), "y": math.sqrt(0.5)}, "threshold_radians": 0.2}
    allows = grasp_test(oriented(rotation_with_tolerance=down), spot.served.server.computer.snapshot)
    rotations = [RotationMatrix.MakeYRotation(math.pi / 2 + off_rad) for off_rad in (0.15, 0.25)]
    assert list(map(allows, rotations)) == [True, False]


def test_a_ray_meets_the_first_points_beside_it():
    wall = np.array([[2.0, y, z] for y in np.linspace(-1, 1, 101) for z in np.linspace(-1, 1, 101)])
    both, ahead = np.concatenate([wall, wall - [1.0, 0.5, 0.0]]), np.array([1.0, 0.0, 0.0])
    found_m = [first_hit_m(np.zeros(3), ahead, *each) for each in ((wall,), (both,), (both, 1.5))]
    assert found_m == pytest.approx([2.0, 1.0, 2.0]) and first_hit_m(np.zeros(3), -ahead, wall) is None


def said(spot, holding, carry=None):
    """A client's word on the item in the gripper."""
    Override = Api.ApiGraspOverride
    word = Override.OVERRIDE_HOLDING if holding else Override.OVERRIDE_NOT_HOLDING
    carried = {} if carry is None else {"carry_state_override": {"override_request": carry}}
    request = Api.ApiGraspOverrideRequest(api_grasp_override={"override_request": word}, **carried)
    client(spot).grasp_override_command(request)


def held(spot):
    state = spot.states.get_robot_state().manipulator_state
    return state.is_gripper_holding_item, state.carry_state


def test_the_word_of_a_client_counts_until_the_gripper_opens(spot):
    assert held(spot) == (False, State.CARRY_STATE_NOT_CARRIABLE)
    said(spot, holding=True)
    assert held(spot) == (True, State.CARRY_STATE_CARRIABLE)
    spot.commands.robot_command(Build.claw_gripper_open_command())
    time.sleep(0.3)
    assert held(spot) == (False, State.CARRY_STATE_NOT_CARRIABLE)


def test_an_item_is_stowed_only_when_a_client_says_that_it_may_be(spot):
    block_until_arm_arrives(spot.commands, spot.commands.robot_command(Build.arm_ready_command()), timeout_sec=8.0)
    said(spot, holding=True, carry=State.CARRY_STATE_CARRIABLE)
    stow = spot.commands.robot_command(Build.arm_stow_command())
    assert not block_until_arm_arrives(spot.commands, stow, timeout_sec=3.0)
    assert spot.served.scripted.q_rad[2] == pytest.approx(1.8, abs=0.05)
    said(spot, holding=True, carry=State.CARRY_STATE_CARRIABLE_AND_STOWABLE)
    stow = spot.commands.robot_command(Build.arm_stow_command())
    assert block_until_arm_arrives(spot.commands, stow, timeout_sec=8.0)


def test_nothing_is_carried_by_an_empty_gripper(spot):
    with pytest.raises(InvalidRequestError, match="no item"):
        said(spot, holding=False, carry=State.CARRY_STATE_CARRIABLE)


@pytest.mark.parametrize(
    ("state", "carries"), [(State.CARRY_STATE_CARRIABLE, True), (State.CARRY_STATE_NOT_CARRIABLE, False)]
)
def test_the_robot_is_told_what_it_must_keep(spot, state, carries):
    for carry in (State.CARRY_STATE_CARRIABLE, state):
        said(spot, holding=True, carry=carry)
        time.sleep(0.1)
    assert spot.served.scripted.carries is carries
