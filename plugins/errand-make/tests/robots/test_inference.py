"""What is what in a robot's description, what is not taken and why, and the posture in which the rest is held."""

import re
import time
from dataclasses import dataclass

import cart_urdf as cart
import numpy as np
import pytest
from rover_urdf import box, joint, link

from errand_make.robots.package import render_robot
from plant.robots.urdf_robot.description import Description
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import read_yaml

ARM = [f"arm_{k}_joint" for k in range(1, 7)]


@dataclass(frozen=True)
class Made:
    """A rendered robot: the data of its file, its capabilities, and the points to check in one text."""

    data: dict
    description: Description
    notes: str


@pytest.fixture
def make(tmp_path):
    """Renders the robot with some parts."""

    def made(*parts):
        urdf = tmp_path / "cart.urdf"
        urdf.write_text(cart.robot(*parts))
        notes = render_robot("cart", urdf, tmp_path / "made", packages={})
        path = tmp_path / "made/errand_robot_cart/robot.yaml"
        return Made(read_yaml(path).data, Description(path), "\n".join(notes))

    return made


def width_m(made):
    """Extent (2,) of the footprint."""
    return np.ptp(np.array(made.data["base"]["footprint"]), axis=0)


def test_casters_belong_to_the_base_and_are_no_head(make):
    made = make(cart.base(), cart.wheels(), *(cart.caster(f"caster_{y}", -0.2, y) for y in (0.1, -0.1)))
    assert made.data["base"]["motion"] == "differential" and "head" not in made.data
    assert "2 casters belong to the base" in made.notes and "2 wheels were found" in made.notes


def test_a_joint_that_turns_very_far_is_a_wheel(make):
    far = {"kind": "revolute", "limit": (-1e16, 1e16, 10, 3)}
    made = make(cart.base(), cart.wheel("left", "0 0.22 0.1", **far), cart.wheel("right", "0 -0.22 0.1", **far))
    assert made.data["base"]["motion"] == "differential" and made.data["base"]["height"] == pytest.approx(0.0)


def test_wheels_about_x_turn_the_front_to_y(make):
    turned = {"axis": "1 0 0", "rpy": "0 1.5707963 0"}
    made = make(cart.base(), cart.wheel("left", "-0.22 0 0.1", **turned), cart.wheel("right", "0.22 0 0.1", **turned))
    assert "wheels turn about x, so the robot's front is y of base_link" in made.notes
    assert made.data["base"]["motion"] == "differential"
    X_BL = made.description.assembly.X_BL["base_link"]
    assert np.allclose(X_BL.rotation().inverse() @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-6)


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
    can = made.description.capabilities
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


def test_a_lidar_is_added_where_no_link_looks_like_one(make):
    bare = [part.replace("laser", "bumper") for part in cart.base()]
    made = make(bare, cart.wheels())
    assert made.data["lidar"][
        "link"
    ] == "errand_lidar" and made.description.capabilities.lidar_height_m == pytest.approx(0.25)


def test_thousands_of_links_take_seconds(make):

    parts = [
        f'<link name="stud_{k}"/>' + joint(f"stud_{k}_mount", "fixed", "base_link", f"stud_{k}") for k in range(1500)
    ]
    start = time.process_time()
    make(cart.base(), cart.wheels(), parts)
    assert time.process_time() - start < 15.0
