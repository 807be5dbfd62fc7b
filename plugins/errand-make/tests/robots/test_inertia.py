"""Impossible masses: one note for all fixed links, and an error with line and link for one that moves."""

import re

import cart_urdf as cart
import pytest
from rover_urdf import joint, link

from errand_make.robots.package import render_robot
from skills.inputs.errors import InputError

ZERO = '<inertial><mass value="{}"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
BROKEN = ZERO.replace('ixx="0" iyy="0"', 'ixx="1" iyy="0.1"')


def on_base(name, inertial):
    return f'<link name="{name}">{inertial}</link>' + joint(f"{name}_mount", "fixed", "base_link", name)


@pytest.fixture
def render(tmp_path):
    """Renders the cart with further parts; returns the notes."""

    def rendered(*parts):
        (tmp_path / "cart.urdf").write_text(cart.robot(*parts))
        return "\n".join(render_robot("cart", tmp_path / "cart.urdf", tmp_path / "made", packages={}))

    return rendered


def test_fixed_links_are_repaired_with_one_note(render):
    notes = render(cart.base(), cart.wheels(), on_base("sticker", ZERO.format(4e-6)), on_base("hook", BROKEN.format(1)))
    assert "links sticker and hook: no body has these moments of inertia" in notes and notes.count("urdf:") == 1


def test_a_held_chain_counts_as_fixed(render):
    head = [part.replace("ixx=", 'ixx="9" was=') for part in cart.head() if "camera" not in part]
    assert "links pan and tilt: no body has" in render(cart.base(), cart.wheels(), head)


def test_a_driven_link_is_refused_with_its_line_and_the_moments_of_its_box(render, tmp_path):
    arm = list(cart.arm())
    arm[4] = arm[4].replace("ixx=", 'ixx="9" was=')
    with pytest.raises(InputError, match=r"link arm_3 moves.* of no body") as refused:
        render(cart.base(), cart.wheels(), arm)
    line = (tmp_path / "cart.urdf").read_text().splitlines()[refused.value.line - 1]
    assert 'name="arm_3"' in line and '<inertia ixx="' in refused.value.hint
    assert refused.value.file == tmp_path / "cart.urdf"


def test_a_base_without_any_mass_is_named_as_the_file_names_it(render):
    bare = [re.sub("<inertial>.*</inertial>", "", part) for part in (*cart.base(), *cart.wheels())]
    with pytest.raises(InputError, match="link base_link has no mass") as refused:
        render(bare, cart.arm())
    assert refused.value.line == 3 and "body" not in refused.value.message


def massless(part):
    return re.sub("<inertial>.*</inertial>", "", part)


def test_a_base_and_wheels_without_mass_are_noted(render):
    left, *others = cart.wheels()
    body, *sensors = cart.base()
    notes = render(massless(body), *sensors, massless(left), *others)
    assert "links base_link and left_wheel: no mass in the file" in notes


def test_a_plate_without_mass_on_the_base_is_not_noted(render):
    body, laser, *sensors = cart.base()
    assert "no mass in the file" not in render(body, massless(laser), *sensors, cart.wheels())


def test_a_driven_link_with_moments_of_a_speck_is_refused(render):
    arm = list(cart.arm())
    arm[4] = re.sub('(ixx|iyy|izz)="[^"]*"', r'\1="1e-12"', arm[4])
    with pytest.raises(InputError, match=r"link arm_3 moves, and has moments of inertia of 1e-12") as refused:
        render(cart.base(), cart.wheels(), arm)
    assert refused.value.line and "kg m" in refused.value.hint


def test_a_driven_link_without_mass_of_its_own_may_carry_a_heavy_one(render):
    arm = list(cart.arm())
    arm[4] = re.sub('<mass value="[^"]*"', '<mass value="1e-7"', arm[4])
    ballast = [link("ballast", 1, "<sphere radius='0.02'/>"), joint("ballast_mount", "fixed", "arm_3", "ballast")]
    assert "arm_3" not in render(cart.base(), cart.wheels(), arm, ballast)
