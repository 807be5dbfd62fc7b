"""Descriptions in degrees, grams or millimetres: what is noted, and what is refused."""

import cart_urdf as cart
import pytest
from rover_urdf import box, joint, link

from errand_make.robots.package import render_robot
from skills.inputs.errors import InputError


@pytest.fixture
def render(tmp_path):
    """Renders the cart with further parts; returns the notes."""

    def rendered(*parts):
        (tmp_path / "cart.urdf").write_text(cart.robot(*parts))
        return "\n".join(render_robot("cart", tmp_path / "cart.urdf", tmp_path / "made", packages={}))

    return rendered


def changed(parts, old, new):
    return [part.replace(old, new) for part in parts]


def test_limits_in_degrees_are_noted(render):
    arm = changed(cart.arm(), 'lower="-2.8" upper="2.8"', 'lower="-170" upper="170"')
    notes = render(cart.base(), cart.wheels(), arm)
    assert "arm_5_joint and arm_6_joint: limits of -170 to 170 rad are probably degrees; write radians" in notes


def test_two_turns_and_limits_without_end_are_no_degrees(render):
    arm = [part.replace("-2.8", "-12.6").replace('"2.8"', '"12.6"') for part in cart.arm()]
    far = joint("spin", "revolute", "base_link", "beacon", "0 0 1", axis="0 0 1", limit=(-1e16, 1e16, 1, 1))
    assert "degrees" not in render(cart.base(), cart.wheels(), arm, [link("beacon", 0.1, box("0.05 0.05 0.05")), far])


def test_orientations_in_degrees_are_noted_with_their_line(render):
    plate = [link("plate", 0.1, box("0.1 0.1 0.01")), joint("mount", "fixed", "base_link", "plate", rpy="0 0 90")]
    assert "line 13: rpy of 90 rad is probably in degrees" in render(cart.base(), cart.wheels(), plate)


def test_a_base_in_grams_is_noted(render):
    body, *sensors = cart.base()
    notes = render(body.replace('mass value="20"', 'mass value="20000"'), *sensors, cart.wheels())
    assert "link base_link weighs 20000 kg, probably grams" in notes


def test_a_finger_in_grams_is_noted_by_its_density(render):
    fingers = changed(cart.fingers(), 'mass value="0.05"', 'mass value="55"')
    notes = render(cart.base(), cart.wheels(), cart.arm(), cart.palm(), fingers)
    assert "left_finger weighs 55 kg, too much for its shapes; check both" in notes


def test_a_base_of_lead_is_no_base_in_grams(render):
    body, *sensors = cart.base()
    assert "grams" not in render(body.replace('mass value="20"', 'mass value="300"'), *sensors, cart.wheels())


def test_a_lift_in_millimetres_is_noted(render):
    lift = changed(cart.lift(), 'upper="0.4"', 'upper="400"')
    notes = render(cart.base(), cart.wheels(), lift, cart.arm(parent="torso", height=0.3))
    assert "joint lift_joint: limits of 0 to 400 m are probably millimetres" in notes


def test_fingers_in_millimetres_are_refused(render):
    fingers = changed(cart.fingers(), 'upper="0.045"', 'upper="45"')
    with pytest.raises(InputError, match="left_finger_joint: it slides from 0 to 45 m, probably millimetres"):
        render(cart.base(), cart.wheels(), cart.arm(), cart.palm(), fingers)


#   box and place of a mast                          what is refused
FAR = [
    ("0.1 0.1 1", "0 0 250", "joint mast_mount is 250 m from base_link: its unit is probably the millimetre"),
    ("100 100 1000", "0 0 1", "link mast has a box of 1000 m: its unit is probably the millimetre"),
]


@pytest.mark.parametrize(("size", "place", "what"), FAR, ids=["joint", "box"])
def test_joints_and_shapes_in_millimetres_are_refused_with_their_line(render, size, place, what):
    mast = [link("mast", 1, box(size)), joint("mast_mount", "fixed", "base_link", "mast", place)]
    with pytest.raises(InputError, match=what) as refused:
        render(cart.base(), cart.wheels(), mast)
    assert refused.value.line in (12, 13)


def test_a_shape_without_size_is_taken_as_tiny(render):
    dot = [link("dot", 0.1, box("0.0 0.0 0.0")), joint("dot_mount", "fixed", "base_link", "dot")]
    assert "link dot: shapes of size 0 are taken as of 1 mm" in render(cart.base(), cart.wheels(), dot)


def test_a_shape_of_negative_size_is_refused(render):
    dot = [link("dot", 0.1, box("0.1 -0.1 0.1")), joint("dot_mount", "fixed", "base_link", "dot")]
    with pytest.raises(InputError, match=r"link dot has a box of -0.1 m") as refused:
        render(cart.base(), cart.wheels(), dot)
    assert refused.value.line == 12


def test_a_robot_may_stand_far_out_in_its_world(render):
    place = ['<link name="world"/>', joint("spawn", "fixed", "world", "base_link", "100 20 0")]
    assert "millimetre" not in render(place, cart.base(), cart.wheels())
