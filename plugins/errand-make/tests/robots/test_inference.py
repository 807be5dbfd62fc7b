"""What is what in a robot's description, what is not taken and why, and the posture in which the rest is held."""

import re
import time
from dataclasses import dataclass

import cart_urdf as cart
import numpy as np
import pytest
from rover_urdf import box, joint, link

from errand_make.robots.package import render_robot
from plant.robots.urdf_robot.kind import urdf_kind
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import read_yaml
from skills.robot import Capabilities

ARM = [f"arm_{k}_joint" for k in range(1, 7)]


@dataclass(frozen=True)
class Made:
    """A rendered robot: the data of its file, its capabilities, and the points to check in one text."""

    data: dict
    can: Capabilities
    notes: str


@pytest.fixture
def make(tmp_path):
    """Renders the robot with some parts."""

    def made(*parts):
        urdf = tmp_path / "cart.urdf"
        urdf.write_text(cart.robot(*parts))
        notes = render_robot("cart", urdf, tmp_path / "made", packages={})
        path = tmp_path / "made/errand_robot_cart/robot.yaml"
        return Made(read_yaml(path).data, urdf_kind(path).capabilities(), "\n".join(notes))

    return made


def width_m(made):
    """Extent (2,) of the footprint."""
    return np.ptp(np.array(made.data["base"]["footprint"]), axis=0)


def test_casters_belong_to_the_base_and_are_no_head(make):
    made = make(cart.base(), cart.wheels(), *(cart.caster(f"caster_{y}", -0.2, y) for y in (0.1, -0.1)))
    assert made.data["base"]["motion"] == "differential" and "head" not in made.data
    assert "2 casters belong to the base and do" in made.notes and "2 wheels were found" in made.notes


def test_a_joint_that_turns_very_far_is_a_wheel(make):
    far = {"kind": "revolute", "limit": (-1e16, 1e16, 10, 3)}
    made = make(cart.base(), cart.wheel("left", "0 0.22 0.1", **far), cart.wheel("right", "0 -0.22 0.1", **far))
    assert made.data["base"]["motion"] == "differential" and made.data["base"]["height"] == pytest.approx(0.0)


def test_wheels_of_type_revolute_without_limits_are_wheels(make):
    made = make(cart.base(), (part.replace('"continuous"', '"revolute"') for part in cart.wheels()))
    assert made.data["base"]["motion"] == "differential" and "2 wheels were found" in made.notes


def test_wheels_on_the_rotors_of_their_motors_are_wheels(make):
    made = make(cart.base(), cart.wheel("left_rotor", "0 0.22 0.1"), cart.wheel("right_rotor", "0 -0.22 0.1"))
    assert made.data["base"]["motion"] == "differential"


def test_wheels_about_x_turn_the_front_to_y(make):
    turned = {"axis": "1 0 0", "rpy": "0 1.5707963 0"}
    made = make(cart.base(), cart.wheel("left", "-0.22 0 0.1", **turned), cart.wheel("right", "0.22 0 0.1", **turned))
    assert "wheels turn about x, so the robot's front is y of base_link" in made.notes
    assert made.data["base"]["motion"] == "differential"
    (camera,) = made.can.cameras  # it stands 0.22 m along x of base_link, which is to the right of the robot
    assert np.allclose(camera.X_FC.translation(), [0.0, -0.22, 0.9], atol=1e-6)


def test_steered_wheels_are_named_as_those_of_a_car(make):
    steered = {"trail": 0.0, "kind": "revolute", "limit": (-0.6, 0.6, 5, 2)}
    front = (cart.caster(f"front_{y}", 0.2, y, **steered) for y in (0.2, -0.2))
    rear = (cart.wheel(f"rear_{y}", f"-0.2 {y} 0.05", radius=0.05) for y in (0.2, -0.2))
    made = make(cart.base(), *front, *rear)
    assert re.search(
        r"steered by front_0.2_swivel and front_-0.2_swivel as a car is; Errand has no such base", made.notes
    )


def test_wheels_whose_axes_cross_are_an_omnidirectional_guess(make):
    places = (("0.2 0 0.1", "1 0 0", "0 1.5707963 0"), ("-0.1 0.2 0.1", "0 1 0", "1.5707963 0 0"))
    parts = (cart.wheel(f"omni_{k}", place, axis, rpy) for k, (place, axis, rpy) in enumerate(places))
    made = make(cart.base(), *parts)
    assert made.data["base"]["motion"] == "omnidirectional" and "omnidirectional is a guess" in made.notes


def test_four_wheels_skid_unless_a_person_says_that_they_are_mecanum(make):
    parts = [cart.wheel(f"wheel_{x}_{y}", f"{x} {y} 0.1") for x in (0.2, -0.2) for y in (0.22, -0.22)]
    made = make(cart.base(), *parts)
    assert made.data["base"]["motion"] == "differential" and "with mecanum wheels, write motion" in made.notes


def test_four_wheels_of_a_file_that_names_mecanum_are_omnidirectional(make):
    parts = [cart.wheel(f"wheel_{x}_{y}", f"{x} {y} 0.1") for x in (0.2, -0.2) for y in (0.22, -0.22)]
    made = make(cart.base(), "<!-- mecanum -->", *parts)
    assert made.data["base"]["motion"] == "omnidirectional" and "4 mecanum or omni wheels" in made.notes


def test_legs_that_touch_the_ground_in_pairs_are_held(make):
    legs = [cart.leg(f"leg_{x}_{y}", x, y) for x in (0.2, -0.2) for y in (0.15, -0.15)]
    made = make(cart.base(), *legs)
    assert "4 legs were found" in made.notes and made.data["base"]["motion"] == "omnidirectional"
    assert made.data["base"]["height"] == pytest.approx(0.35) and "arm" not in made.data


def test_an_arm_fixed_to_the_world_needs_a_base(make):
    stand = [link("base_link", 5, box("0.2 0.2 0.2"), "0 0 0.1")]
    with pytest.raises(InputError, match="nothing drives: no wheel turns and no leg stands on the floor") as refused:
        make(stand, cart.arm(height=0.2))
    assert "give a base" in refused.value.hint and refused.value.line


def pivots(names, places, axis="0 0 1", kind="continuous"):
    """Flat plates of 0.2 m that turn on the base."""
    for name, place in zip(names, places, strict=True):
        yield link(name, 0.05, box("0.2 0.02 0.005"), size=0.05)
        yield joint(f"{name}_joint", kind, "base_link", name, place, axis=axis)


CORNERS = ["0.3 0.3 0.3", "-0.3 0.3 0.3", "0.3 -0.3 0.3", "-0.3 -0.3 0.3"]
PROPELLERS = ["propeller_1", "propeller_2"]
#   parts beside a base without wheels                                                what is refused
STANDING = [
    (cart.arm(joints=3), "nothing drives"),
    (cart.arm(joints=2), "nothing drives"),
    (pivots(["m1", "m2", "m3", "m4"], CORNERS), "it flies or swims by m1, m2, m3 and m4"),
    (pivots(PROPELLERS, CORNERS[:2], "1 0 0"), "it flies or swims by propeller_1 and propeller_2"),
    ([*pivots(PROPELLERS, CORNERS[:2], kind="fixed"), *cart.arm()], "it flies or swims by propeller_1 and propeller_2"),
]


@pytest.mark.parametrize(("parts", "what"), STANDING, ids=["arm 3", "arm 2", "rotors", "thrusters", "fixed"])
def test_a_machine_that_stands_flies_or_swims_is_refused_by_this_reason(make, parts, what):
    with pytest.raises(InputError, match=what):
        make(cart.base(), parts)


def test_a_robot_named_quadrotor_flies(make):
    body = [part.replace("laser", "quadrotor_shell.stl") for part in cart.base()]
    with pytest.raises(InputError, match="it flies or swims by rotors"):
        make(body)


def test_a_base_without_wheels_and_its_head_are_a_guess(make):
    made = make(cart.base(), cart.head())
    assert made.data["head"] == ["pan_joint", "tilt_joint"] and "omnidirectional is a guess" in made.notes


def test_a_plugin_that_moves_the_base_makes_it_one(make):
    plugin = '<gazebo><plugin name="move" filename="libgazebo_ros_planar_move.so"/></gazebo>'
    made = make(cart.base(), plugin, cart.arm())
    assert made.data["arm"]["joints"] == ARM and "omnidirectional is a guess" in made.notes


def test_motors_of_legs_are_no_rotors(make):
    legs = [cart.leg(f"leg_{x}_{y}", x, y) for x in (0.2, -0.2) for y in (0.15, -0.15)]
    made = make(cart.base(), *legs, pivots(["hip_rotor_1", "hip_rotor_2"], CORNERS[:2], kind="fixed"))
    assert "4 legs were found" in made.notes


def test_a_force_sensor_inside_an_arm_is_fixed_and_noted(make):
    sensor = [link("cell", 0.1, box("0.02 0.05 0.05"))]
    sensor += [joint("cell_joint", "revolute", "arm_6", "cell", "0.08 0 0", axis="1 0 0", limit=(0, 0, 1, 1))]
    made = make(cart.base(), cart.wheels(), cart.arm(), sensor, cart.palm("cell"), cart.fingers())
    assert made.data["arm"]["joints"] == ARM and "gripper" in made.data and "held" not in made.data
    assert "joint cell_joint: lower and upper are both 0, so taken as fixed" in made.notes


def test_load_cells_between_joints_do_not_cut_an_arm(make):
    arm = [part.replace('parent link="arm_3"', 'parent link="cell"') for part in cart.arm()]
    cell = [link("cell", 0.1, box("0.02 0.05 0.05"))]
    cell += [joint("cell_slide", "prismatic", "arm_3", "cell", axis="1 0 0", limit=(-1e-6, 1e-6, 1, 1))]
    assert make(cart.base(), cart.wheels(), arm, cell).data["arm"]["joints"] == ARM


def test_a_file_whose_joints_all_have_limits_of_zero_is_refused(make):
    arm = [part.replace('lower="-2.8" upper="2.8"', 'lower="0" upper="0"') for part in cart.arm()]
    with pytest.raises(InputError, match=r"no joint moves: lower and upper of arm_1_joint, .* are both 0"):
        make(cart.base(), arm)


def hand(length):
    """Two hinged fingers, each with a tip that mimics, behind an arm of four joints."""
    for side in (1, -1):
        for part, parent, place in (("knuckle", "arm_4", f"{length} {0.03 * side} 0"), ("tip", "knuckle", "0.05 0 0")):
            name = f"{part}_{side}"
            above = parent if part == "knuckle" else f"{parent}_{side}"
            mimic = f'<mimic joint="knuckle_{side}_joint"/></joint>' if part == "tip" else "</joint>"
            yield link(name, 0.05, box("0.05 0.01 0.02"), "0.025 0 0", size=0.03)
            text = joint(f"{name}_joint", "revolute", above, name, place, axis="0 0 1", limit=(-1, 1, 5, 1))
            yield text.replace("</joint>", mimic)


def test_a_hand_may_be_as_long_as_its_arm(make):
    made = make(cart.base(), cart.wheels(), cart.arm(joints=4), hand(0.5))
    assert made.data["arm"]["joints"] == ARM[:4]


#   parts beside base and wheels                       why there is no arm
NO_ARM = [
    (cart.arm(joints=3), "arm_1_joint, arm_2_joint and arm_3_joint have 3 joints in a row that turn"),
    ([*cart.arm(joints=4), *hand(1.5)], "too large for the hand of arm_1_joint, arm_2_joint"),
]


@pytest.mark.parametrize(("parts", "why"), NO_ARM, ids=["three", "hand"])
def test_a_line_says_why_a_chain_is_no_arm(make, parts, why):
    notes = make(cart.base(), cart.wheels(), parts).notes
    assert "no arm is taken" in notes and why in notes


def test_joints_that_move_the_whole_robot_over_the_floor_are_its_drive(make):
    virtual = ["world", "along", "across"]
    parts = [f'<link name="{each}"/>' for each in virtual]
    slides = (("slide_x", "world", "along", "1 0 0"), ("slide_y", "along", "across", "0 1 0"))
    parts += [joint(name, "prismatic", a, b, axis=axis, limit=(-9, 9, 9, 1)) for name, a, b, axis in slides]
    parts += [joint("turn", "continuous", "across", "base_link", axis="0 0 1")]
    made = make(cart.base(), parts, cart.arm())
    assert made.data["base"]["link"] == "base_link" and made.data["arm"]["joints"] == ARM
    assert made.data["base"]["motion"] == "omnidirectional"


def test_joints_that_mimic_are_fingers_and_no_arm(make):
    parts, parent = [], "arm_5"
    for k in range(7):
        parts.append(link(f"f{k}", 0.02, box("0.02 0.01 0.01"), "0.01 0 0"))
        text = joint(f"f{k}_joint", "revolute", parent, f"f{k}", "0.02 0 0", axis="0 1 0", limit=(0, 1, 5, 1))
        parts.append(text if k == 0 else text.replace("</joint>", '<mimic joint="f0_joint"/></joint>'))
        parent = f"f{k}"
    parts += [link("thumb", 0.02, box("0.02 0.01 0.01"), "0.01 0 0")]
    parts += [joint("thumb_joint", "revolute", "arm_5", "thumb", "0.05 0.03 0", axis="0 0 1", limit=(0, 1, 5, 1))]
    made = make(cart.base(), cart.wheels(), cart.arm(joints=5), parts)
    assert made.data["arm"]["joints"] == ARM[:5] and "head" not in made.data and "gripper" not in made.data
    assert "no gripper is taken: its fingers turn" in made.notes


def test_a_jaw_that_turns_beside_a_fixed_one_is_no_joint_of_the_arm(make):
    fixed = [
        link("jaw", 0.1, box("0.1 0.03 0.02"), "0.05 0 -0.02"),
        joint("jaw_mount", "fixed", "arm_6", "jaw", "0.08 0 0"),
    ]
    moving = [link("mover", 0.1, box("0.1 0.03 0.02"), "0.05 0 0.02")]
    moving += [joint("jaw_joint", "revolute", "jaw", "mover", "0 0 0", axis="0 1 0", limit=(-1.5, 0, 10, 2))]
    made = make(cart.base(), cart.wheels(), cart.arm(), fixed, moving)
    assert made.data["arm"]["joints"] == ARM and "its fingers turn (jaw_joint)" in made.notes


def test_fingers_that_slide_are_measured(make):
    made = make(cart.base(), cart.wheels(), cart.arm(), cart.palm(), cart.fingers())
    assert made.data["gripper"]["widest"] == pytest.approx(0.09) and made.data["gripper"]["tip_x"] == pytest.approx(0.2)


def test_a_motor_that_spins_beside_sliding_fingers_is_no_finger(make):
    motor = [link("crank", 0.02, box("0.03 0.01 0.01"), size=0.02)]
    motor += [joint("crank_joint", "continuous", "palm", "crank", "0.02 0 0", axis="1 0 0")]
    made = make(cart.base(), cart.wheels(), cart.arm(), cart.palm(), motor, cart.fingers())
    assert made.data["gripper"]["widest"] == pytest.approx(0.09) and made.data["held"] == {"crank_joint": 0.0}


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        ([cart.fingers(kind="revolute")], "its fingers turn"),
        (
            [[link("span", 0.01, "").split("<visual>")[0] + "</link>"]
             + [joint("span_joint", "prismatic", "palm", "span", axis="1 0 0", limit=(0, 0.09, 100, 0.2))]],
            "span_joint moves no shape",
        ),
        ([], "nothing moves on the arm's tip"),
    ],
)  # fmt: skip
def test_a_gripper_that_is_not_taken_has_its_reason(make, parts, reason):
    made = make(cart.base(), cart.wheels(), cart.arm(), cart.palm(), *parts)
    assert "gripper" not in made.data and made.data["arm"]["joints"] == ARM
    assert f"no gripper is taken: {reason}" in made.notes and "the axes of the hand are a guess" in made.notes


def test_a_second_arm_is_held_where_it_does_not_stick_out(make):
    made = make(cart.base(), cart.wheels(), cart.arm("right", -0.15), cart.arm("left", 0.15))
    assert made.data["arm"]["joints"] == [f"right_{k}_joint" for k in range(1, 7)] and "head" not in made.data
    assert "a further arm (left_1_joint" in made.notes and any(made.data["held"].values())
    assert width_m(made)[0] < 0.7


def test_the_footprint_contains_an_arm_that_cannot_be_drawn_in(make):
    stiff = [part.replace('lower="-2.8" upper="2.8"', 'lower="-0.1" upper="0.1"') for part in cart.arm("left", 0.15)]
    made = make(cart.base(), cart.wheels(), cart.arm("right", -0.15), stiff)
    assert width_m(made)[0] > 1.0


def test_a_telescopic_arm_is_held_and_said_to_be_one(make):
    made = make(cart.base(), cart.wheels(), cart.telescope(), cart.palm("wrist"), cart.fingers())
    assert "arm" not in made.data and "gripper" not in made.data
    assert "extend_0, extend_1, extend_2, extend_3 slide (a telescopic arm)" in made.notes


def test_a_lift_is_held_with_its_shoulder_at_a_counter_and_the_line_that_drives_it(make):
    made = make(
        cart.base(), cart.wheels(), cart.lift(), cart.arm(parent="torso", height=0.3), cart.head(parent="torso")
    )
    assert made.data["held"]["lift_joint"] == pytest.approx(0.35) and made.data["arm"]["joints"] == ARM
    assert "lift: {joint: lift_joint, travelling: 0.35}" in made.notes


def test_a_head_whose_tilt_turns_about_minus_y_is_turned_round(make):
    made = make(cart.base(), cart.wheels(), cart.head("0 -1 0", (-1.2, 0.5)))
    can = made.can
    assert can.head is not None and can.head.tilt_range_rad == pytest.approx((-0.5, 1.2))
    assert "the axis of tilt_joint is turned round" in made.notes


def test_a_trunk_that_turns_an_arm_is_no_pan_of_a_head(make):
    waist = [link("waist", 3, box("0.1 0.1 0.1")), joint("waist_joint", "revolute", "base_link", "waist", "0 0 0.3",
             axis="0 0 1", limit=(-1, 1, 50, 1))]  # fmt: skip
    nod = [
        link("nod", 0.3, box("0.05 0.05 0.05")),
        '<link name="eye_camera"/>',
        joint("eye", "fixed", "nod", "eye_camera"),
    ]
    nod.append(joint("nod_joint", "revolute", "waist", "nod", "0 0 0.6", axis="0 1 0", limit=(-1, 1, 5, 1)))
    made = make(cart.base(), cart.wheels(), waist, nod, cart.arm(parent="waist"))
    assert "head" not in made.data and made.data["arm"]["joints"] == ARM


def test_a_chain_without_a_camera_is_no_head(make):
    made = make(cart.base(), cart.wheels(), [part.replace("head_camera_optical_frame", "nose") for part in cart.head()])
    assert "head" not in made.data and "pan_joint" in made.data["held"]


def test_a_camera_inside_a_chain_is_left_out(make):
    camera = ['<link name="elbow_camera"/>', joint("elbow_eye", "fixed", "arm_3", "elbow_camera")]
    made = make(cart.base(), cart.wheels(), cart.arm(), camera)
    assert [each["link"] for each in made.data["cameras"].values()] == ["camera_link"]
    assert "left out, since no part points them: elbow_camera" in made.notes


def test_a_marker_for_a_camera_is_no_camera(make):
    marker = ['<link name="link_aruco_d405"/>', joint("tag", "fixed", "base_link", "link_aruco_d405", "-0.2 0 0.5")]
    made = make(cart.base(), cart.wheels(), marker)
    assert [each["link"] for each in made.data["cameras"].values()] == ["camera_link"]


def test_a_robot_without_cameras_is_said_to_find_no_objects(make):
    made = make([part.replace("camera", "mast") for part in cart.base()], cart.wheels())
    assert "cameras" not in made.data and "no link looks like a camera, so the robot finds no objects" in made.notes


def test_a_lidar_is_added_where_no_link_looks_like_one(make):
    bare = [part.replace("laser", "bumper") for part in cart.base()]
    made = make(bare, cart.wheels())
    assert made.data["lidar"]["link"] == "errand_lidar" and made.can.lidar_height_m == pytest.approx(0.25)


def test_a_sonar_that_is_simulated_by_rays_is_no_lidar(make):
    bare = [part.replace("laser", "sonar_0") for part in cart.base()]
    made = make(bare, cart.wheels(), '<gazebo reference="sonar_0"><sensor type="ray" name="range"/></gazebo>')
    assert made.data["lidar"]["link"] == "errand_lidar"


def test_thousands_of_links_take_seconds(make):

    parts = [
        f'<link name="stud_{k}"/>' + joint(f"stud_{k}_mount", "fixed", "base_link", f"stud_{k}") for k in range(1500)
    ]
    start = time.process_time()
    make(cart.base(), cart.wheels(), parts)
    assert time.process_time() - start < 15.0
