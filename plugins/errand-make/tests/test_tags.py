"""AprilTags as files: to print, as plates, and on imported models."""

import math
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_make.errors import ObjectImportError
from errand_make.tags import SIDES, stick_on, tag_picture, tag_svg, write_plate
from executive import load_world
from executive.app.runs.simulated import simulate
from plant.models.catalogue import ImportedObject
from plant.scene_pictures import render_view
from skills.perception.fiducials import find_tags
from skills.robot import FrameTree, Image, Intrinsics

LENS = Intrinsics(640, 480, 552.0, 552.0, 319.5, 239.5)
WORLD = """\
directives:
- add_model: {{name: model, file: "package://world/{file}"}}
- add_weld:
    parent: world
    child: model::{link}
    X_PC: {{translation: {translation}, rotation: !Rpy {{deg: {rpy_deg}}}}}
"""


def test_a_printed_tag_has_its_size_and_a_white_margin():
    drawn = ET.fromstring(tag_svg(7, 0.1))
    assert (drawn.get("width"), drawn.get("viewBox")) == ("125mm", "0 0 10 10")
    path = next(each for each in drawn if each.tag.endswith("path")).get("d")
    assert path.count("M") == int((tag_picture(7, 1) == 0).sum())
    assert (tag_picture(7, 1)[0] == 255).all()


def seen(model, X_WM, X_WC, tag, size_m):
    """Tags in a clean picture of one model, with their poses in the world."""
    rpy_deg = np.degrees(RollPitchYaw(X_WM.rotation()).vector()).tolist()
    where = {"translation": X_WM.translation().tolist(), "rpy_deg": rpy_deg}
    link = ET.parse(model).find("model/link").get("name")
    (model.parent / "world.dmd.yaml").write_text(WORLD.format(file=model.name, link=link, **where))
    (model.parent / "knowledge.yaml").write_text("start: {x: 0.0, y: 0.0, yaw: 0.0}\n")
    simulation = simulate(load_world(str(model.parent)), {}, seed=1, record=True)
    simulation.clock.advance(0.1)
    query = simulation.query_at(0.1)
    fov_y_rad = 2.0 * math.atan(0.5 * LENS.height / LENS.fy)
    colour = render_view(query, X_WC, (LENS.width, LENS.height), fov_y_rad=fov_y_rad)
    grey = cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY)
    frames = FrameTree({"camera": ("odom", X_WC)})
    image = Image(0.0, "camera", "camera", LENS, LENS, None, grey, np.zeros((0, 0), np.float32), frames)
    return find_tags(image, {tag: size_m})


def before(X_WT, distance_m):
    """Camera that looks at a tag from some distance, a little from aside and above."""
    X_TC = RigidTransform(RotationMatrix(np.diag([1.0, -1.0, -1.0])), [0.0, 0.0, distance_m])
    return X_WT @ RigidTransform(RotationMatrix.MakeYRotation(0.5) @ RotationMatrix.MakeXRotation(-0.3)) @ X_TC


def test_the_plate_of_a_tag_is_seen_where_it_stands(tmp_path):
    R_WT = RotationMatrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    X_WT = RigidTransform(R_WT, [1.0, 0.5, 0.4])
    (found,) = seen(write_plate(tmp_path, 520, 0.146), X_WT, before(X_WT, 1.0), 520, 0.146)
    assert found.X_OT.IsNearlyEqualTo(X_WT, 0.02)


@pytest.fixture
def crate(tmp_path):
    """Folder of an imported box of 0.2 x 0.16 x 0.3 m."""
    shutil.copy(Path(__file__).with_name("crate.sdf"), tmp_path)
    facts = {"mass_kg": 1.0, "com_m": (0.0, 0.0, 0.0), "inertia_kg_m2": (0.01, 0.01, 0.01, 0.0, 0.0, 0.0)}
    size = {"size_m": (0.2, 0.16, 0.3), "collision_parts": 1, "triangles": 12}
    ImportedObject(name="crate", class_name="crate", **facts, **size).write(tmp_path)
    return tmp_path


@pytest.mark.parametrize("side", SIDES)
def test_a_tag_on_a_model_faces_outwards_in_the_middle_of_its_side(crate, side):
    outward = np.array(SIDES[side], dtype=float)
    stick_on(crate, 7, 0.1, side)
    p_WT = 0.5 * outward * [0.2, 0.16, 0.3]
    up = np.array([0.0, 1.0, 0.0]) if side == "top" else np.array([0.0, 0.0, 1.0])
    X_WT = RigidTransform(RotationMatrix(np.column_stack([np.cross(up, outward), up, outward])), p_WT)
    (found,) = seen(crate / "crate.sdf", RigidTransform(), before(X_WT, 0.8), 7, 0.1)
    assert found.X_OT.IsNearlyEqualTo(X_WT, 0.03)


def test_a_tag_is_stuck_on_each_side_once(crate):
    stick_on(crate, 7, 0.1, "front")
    stick_on(crate, 7, 0.1, "back")
    with pytest.raises(ObjectImportError, match="the front of crate has tag 7 already"):
        stick_on(crate, 7, 0.1, "front")


def test_a_tag_wider_than_its_side_is_refused(crate):
    with pytest.raises(ObjectImportError, match=r"wider than the front of crate; --size 0\.128 at most"):
        stick_on(crate, 7, 0.15, "front")


def test_an_unknown_side_is_refused_with_the_sides(crate):
    with pytest.raises(ObjectImportError, match="no side 'below'; give front, back, left, right or top"):
        stick_on(crate, 7, 0.1, "below")
