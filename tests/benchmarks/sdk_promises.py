"""What the examples of Spot's SDK 5.1.4 do against the server, as data; `deviation` judges a promise.

Each folder of examples stands in one of three tables: it does what it says (`PROGRAMS` move the robot, `SERVED` do
not), it is refused by name (`REFUSED`), or it is not run (`NOT_RUN`, with the reason). `tests.benchmarks.sdk_motion`
runs the first, `tests.benchmarks.sdk_examples` the second and the third.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import maximum_filter1d

PERIOD_S = 0.1
"""Time between two samples of a track."""
COLUMNS = (
    *("x", "y", "z", "roll", "pitch", "yaw"),
    *("hand_x", "hand_y", "hand_z"),
    *("in_body_x", "in_body_y", "in_body_z"),
)
"""Columns of a track in m and rad: the body and the hand in the pose in which the body first stands, the hand in it."""
_ANGLES = ("roll", "pitch", "yaw")
_STEP = 0.02


@dataclass(frozen=True)
class Promise:
    """Values that columns of the track pass in this order, to within `most` (m or rad).

    `along`: the robot keeps to the straight lines between the values. It stays at each value for `rests_s`.
    """

    columns: str
    passes: tuple[tuple[float, ...], ...]
    most: float
    along: bool = False
    rests_s: float = 0.0


@dataclass(frozen=True)
class Program:
    """Program with its arguments, what it promises, its exit code, and its start (x, y, yaw) if it needs another.

    Its output contains `says`. In the line, HOST stands for the robot's address, EMPTY for a file without content, and
    PAYLOAD for a file with a payload's credentials. A program without an exit code runs until it is ended. A program
    that waits otherwise than by sleeps of its main thread runs in `real_time` at any pace.
    """

    line: str
    promises: tuple[Promise, ...] = ()
    exit_code: int | None = 0
    start: tuple[float, float, float] | None = None
    says: str = ""
    real_time: bool = False


@dataclass(frozen=True)
class Refusal:
    """Program whose request the server refuses, and the name of what is refused."""

    program: Program
    name: str


def deviation(track, promise):
    """Error of a promise: its largest distance from the path that keeps it best (Frechet distance on samples)."""
    names = promise.columns.split()
    values = track[:, [COLUMNS.index(name) for name in names]]
    points = np.array(promise.passes, dtype=float)
    if promise.along:
        points = _densified(points)
    off = values[None] - points[:, None]
    angles = [k for k, name in enumerate(names) if name in _ANGLES]
    off[..., angles] = np.arctan2(np.sin(off[..., angles]), np.cos(off[..., angles]))
    errors = np.linalg.norm(off, axis=2)
    if (rest := round(promise.rests_s / PERIOD_S)) > 0:
        errors = maximum_filter1d(errors, rest + 1, axis=1, origin=-(rest // 2), mode="constant", cval=np.inf)
    reached = errors[0]
    for row in errors[1:]:
        reached = _kept(reached, row) if promise.along else np.maximum(row, np.minimum.accumulate(reached))
    return float(reached.min())


def _kept(before, row):
    """Errors at the next point of a path, by the errors at the point before and the samples' distances from it."""
    made, last = np.empty_like(row), (np.inf, np.inf)
    for t, error in enumerate(row):
        last = (before[t], max(error, min(before[t], *last)))
        made[t] = last[1]
    return made


def _densified(points):
    made = [points[:1]]
    for a, b in pairwise(points):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / _STEP)))
        made.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(made)


_CIRCLE = tuple(
    (1.0, 0.25 - 0.4 * float(np.cos(angle)), 0.4 * float(np.sin(angle))) for angle in np.linspace(0.0, np.pi * 2.0, 9)
)

OWN = Program(
    "sdk_moves.py",
    (
        Promise("x y yaw", ((0, 0, 0), (0, 0, 0.4), (0, 0, 0)), 0.05, along=True),
        Promise("x y yaw", ((0, 0, 0), (0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0), (0, 0, 0)), 0.06, along=True),
        Promise("z", ((0.0,), (-0.08,)), 0.02),
        Promise("x y yaw", ((0, 0, 0), (0.5, 0.1, 0.4)), 0.06),
    ),
)
"""Our own program, beside this file."""

WRAPPER = Program(
    "spot_wrapper_moves.py",
    (
        Promise("x y yaw", ((0, 0, 0), (0.6, 0.1, 0.4), (0.03, -0.14, 0.4)), 0.1),
        Promise("in_body_x in_body_y in_body_z", ((0.54, 0, 0.31), (1.01, 0, 0.18), (0.75, 0.1, 0.3)), 0.05),
        Promise("in_body_x in_body_z", ((0.54, 0.31), (1.01, 0.18), (0.54, 0.31)), 0.05),
        Promise("z", ((0.0,), (-0.3,), (0.0,), (-0.3,)), 0.08, rests_s=0.5),
        Promise("x y yaw", ((2.62, 1.05, 3.1416),), 0.1, rests_s=1.0),
    ),
)
"""Our program beside this file that drives through `spot_wrapper`: walk, drive, arm, sit, dock."""

PROGRAMS = (
    Program(
        "hello_spot/hello_spot.py",
        (
            Promise("yaw", ((0.0,), (0.4,), (0.0,)), 0.05, rests_s=1.0),
            Promise("x", ((0.0,), (0.075,), (0.0,)), 0.02),
            Promise("pitch", ((0.0,), (0.349,), (0.0,)), 0.05),
        ),
    ),
    Program(
        "frame_trajectory_command/frame_trajectory_command.py --dx 0.6 --frame odom",
        (Promise("x y yaw", ((0.0, 0.0, 0.0), (0.6, 0.0, 0.0)), 0.06, along=True),),
    ),
    Program(
        "frame_trajectory_command/frame_trajectory_command.py --dyaw 45 --frame vision",
        (Promise("x y yaw", ((0.0, 0.0, 0.0), (0.0, 0.0, 0.785)), 0.06, along=True),),
    ),
    Program("arm_simple/arm_simple.py", (Promise("hand_x hand_y hand_z", ((0.75, 0, 0.25), (0.75, 0, 0)), 0.04),)),
    Program(
        "arm_stow_unstow/arm_stow_unstow.py",
        (Promise("in_body_x in_body_z", ((0.54, 0.31), (1.01, 0.18), (0.54, 0.31)), 0.05),),
    ),
    Program("arm_joint_move/arm_joint_move.py"),
    Program("arm_joint_move/arm_joint_long_trajectory.py", exit_code=1),
    Program(
        "arm_trajectory/arm_trajectory.py",
        (Promise("hand_x hand_y hand_z", ((0.75, 0, 0), (0.75, 0.4, 0), (0.75, -0.4, 0)), 0.05, along=True),),
    ),
    Program(
        "arm_trajectory/arm_long_cartesian_trajectory.py",
        (Promise("hand_y hand_z", ((0.25, 0), (0, 0.25), (-0.25, 0), (0, -0.25), (0.25, 0)), 0.06),),
        real_time=True,
    ),
    Program(
        "arm_and_mobility_command/arm_and_mobility_command.py",
        (
            Promise("x y", ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5), (0, 0)), 0.08, along=True),
            Promise("hand_x hand_y hand_z", _CIRCLE, 0.1),
        ),
    ),
    Program("arm_gaze/arm_gaze.py", (Promise("hand_x hand_y hand_z", ((0.75, 0, 0), (0.75, 0, 0.25)), 0.1),)),
    Program(
        "arm_with_body_follow/arm_with_body_follow.py",
        (
            Promise("hand_x hand_y hand_z", ((1.25, 0, 0.25),), 0.05),
            Promise("x y", ((0, 0), (0.5, 0)), 0.06, along=True),
        ),
    ),
    Program(
        "arm_freeze/arm_freeze_hand.py",
        (
            Promise("x hand_x hand_y", ((0, 0.75, -0.5), (1, 0.75, -0.5)), 0.08, along=True),
            Promise("x in_body_x in_body_y", ((1, 0.75, -0.5), (0, 0.75, -0.5), (0.75, 0.75, -0.5)), 0.08, along=True),
        ),
    ),
    Program(
        "frame_trajectory_command/frame_trajectory_command.py --dx 2.5 --frame odom",
        (Promise("x", ((0.75,),), 0.1, rests_s=3.0),),
        start=(8.6, 3.9, 1.5708),  # a wall stands 1.5 m ahead; the program takes any rest for the goal
    ),
    Program(
        "user_nogo_regions/user_nogo_regions.py",
        (Promise("x", ((0.25,),), 0.1, rests_s=2.0), Promise("x", ((0.3,), (2.0,), (0.0,)), 0.15)),
        start=(9.09, 3.79, -0.785),
    ),
    Program(
        "joint_control/wiggle_arm.py",
        (Promise("in_body_x in_body_z", ((0.54, 0.31), (0.46, 0.17), (0.54, 0.31), (0.44, 0.49), (0.54, 0.31)), 0.06),),
        real_time=True,
    ),
    Program(
        "docking/dock_my_robot.py --dock-id 520",
        (Promise("x y yaw", ((1.92, 0.35, 3.1416),), 0.1, rests_s=1.0),),
        start=(9.3, 4.6, 0.0),
    ),
)
"""Examples of the SDK that move the robot, with what they log."""

_UNKNOWN, _UNSUPPORTED = "UnimplementedError", "UnsupportedError"


def _refused(line, name, says=_UNKNOWN, exit_code=1):
    return Refusal(Program(line, exit_code=exit_code, says=says), name)


REFUSED = {
    "animation_recorder": _refused("animation_recorder.py HOST", "ChoreographyService"),
    "arm_force_control": _refused("force_trajectory.py HOST", "an axis in force mode", _UNSUPPORTED),
    "arm_impedance_control": _refused("arm_impedance_control_simple.py HOST", "a feed-forward wrench", _UNSUPPORTED),
    "arm_surface_contact": _refused("arm_surface_contact.py HOST", "an axis in force mode", "AXIS_MODE_FORCE"),
    "audio_visual": _refused(
        "audio_visual_params/audio_visual_params.py HOST", "AudioVisualService", 'Service name "audio-visual"'
    ),
    "auto_return": _refused("force_start_auto_return.py HOST", "AutoReturnService"),
    "data_service": _refused("get_index.py HOST text", "DataService"),
    "disable_ir_emission": _refused(
        "disable_ir_emission.py HOST --disable", "IREnableDisableService", 'Service name "ir-enable-disable-service"'
    ),
    "joint_control": _refused("noarm_squat.py HOST", "a stream for 12 joints", "19 are needed", exit_code=0),
    "payloads": _refused(
        "payloads.py HOST --payload-credentials-file-1 PAYLOAD --payload-credentials-file-2 PAYLOAD",
        "PayloadRegistrationService",
    ),
    "replay_mission": _refused("replay_mission.py HOST simple EMPTY", "MissionService"),
    "reset_safety_stop": _refused("reset_primary_safety_stop.py HOST", "ResetSafetyStop"),
    "self_registration": _refused(
        "self_register_payload.py HOST --name a --description b --payload-credentials-file PAYLOAD",
        "PayloadRegistrationService",
    ),
    "upload_choreographed_sequence": _refused("upload_choreographed_sequence.py HOST", "ChoreographyService"),
}
"""Programs that the server refuses, by folder."""

SERVED = {
    "data_acquisition_service": Program("data_acquisition_example.py HOST", exit_code=1, says="STATUS_COMPLETE"),
    "data_buffer": Program("data_buffer.py HOST operator hello", says="Added operator comment"),
    "directory": Program("directory_modification.py HOST", says="robot-command"),
    "fan_command": Program("basic_fan_command.py HOST", exit_code=1, says="STATUS_COMPLETE"),
    "get_depth_plus_visual_image": Program("get_depth_plus_visual_image.py HOST --camera hand --to-depth"),
    "get_image": Program("get_image.py --image-sources hand_color_image HOST"),
    "get_mission_state": Program("get_mission_state.py HOST", says="STATUS_NONE"),
    "get_robot_state": Program("get_robot_state.py HOST state", says="STATE_NOT_READY"),
    "get_robot_state_async": Program("get_robot_state_async.py HOST", says="SUCCESS"),
    "get_world_objects": Program("get_world_objects.py HOST", says="Fiducial objects"),
    "gripper_camera_params": Program("set_gripper_camera_params.py HOST --brightness 0.5", says="0.5"),
    "log_status": Program("log_status.py HOST active", says="Active Logs"),
    "logging": Program("log_spot_data.py HOST", says="Added robot command log blob"),
    "mission_question_answerer": Program("mission_question_answerer.py HOST", exit_code=None),
    "ray_cast": Program("cast_single_ray.py HOST -o 0 0 0 -d 1 0 0", says="TYPE_VOXEL_MAP"),
    "service_faults": Program("service_faults.py HOST", exit_code=1, says="Shutting down live-service-test"),
    "tester_programs": Program("image_service_tester.py HOST --service-name image", says="SUCCESS"),
    "time_sync": Program("time_sync_client.py HOST", says="STATUS_OK"),
    "world_object_mutations": Program("mutate_world_objects.py HOST", says="Found sphere named debug_sphere"),
    "world_object_with_image_coordinates": Program("world_object_with_image_coordinates.py HOST", says="image_proper"),
}
"""Programs that are served and move nothing, by folder. Two end with 1 on a robot, too: they return nothing."""

NOT_RUN = {
    **dict.fromkeys(("arm_grasp", "arm_walk_to_object", "arm_door"), "waits for a click into a picture"),
    "arm_grasp_carry_overrides": "waits for a person who puts an object into the gripper",
    "arm_constrained_manipulation": "needs a handle in the gripper; its command is refused by name",
    **dict.fromkeys(
        ("arm_wasd", "wasd", "xbox_controller", "network_compute_bridge", "mission_recorder", "estop"),
        "waits for keys of a person",
    ),
    **dict.fromkeys(("graph_nav_command_line", "graph_nav_anchoring_optimization"), "waits for lines of a person"),
    **dict.fromkeys(
        ("visualizer", "graph_nav_view_map", "graph_nav_view_gps", "stitch_front_images", "velodyne_client"),
        "opens a window",
    ),
    **dict.fromkeys(("edit_autowalk", "record_autowalk"), "opens a window (Qt)"),
    **dict.fromkeys(("orbit", "cloud_upload", "access_controlled_doors", "comms_test"), "needs another server"),
    "bddf_download": "downloads logs by HTTPS; the simulated robot writes none",
    "stance": "runs until Ctrl-C; its stance, wider than the robot stands, is STATUS_TOO_FAR_AWAY",
    **dict.fromkeys(
        ("spot_cam", "core_io_gpio", "spot_light", "gps_service", "metrics_over_coreio"), "needs a payload"
    ),
    "fiducial_follow": "follows a person who carries a fiducial",
    **dict.fromkeys(("area_callback", "network_request_callback", "remote_mission_service"), "is itself a service"),
    **dict.fromkeys(("service_customization", "extensions", "post_docking_callbacks"), "is itself a service"),
    **dict.fromkeys(("graph_nav_extract_point_cloud", "extract_images_from_walk"), "reads files, no robot"),
    "comms_mapping": "is itself a service, for a payload",
    "docs": "no program",
    "arm_gcode": "needs a pen in the gripper",
    "inverse_kinematics": "draws thousands of poses for an hour",
    "spot_tensorflow_detector": "needs a network's weights",
}
"""Folders that are not run, and why."""
