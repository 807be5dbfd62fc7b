"""The robot's hand in front of its camera: simple jaws of the robot's dimensions."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.math import RollPitchYaw

from errand_make.mesh import Material, Mesh
from errand_train.models.surfaces import add_rounded_box
from plant.robots.spot.description import spot_facts

_PALM, _FINGER = "arm_wr1", "arm_f1x"


def hand_mesh(opening_rad: float) -> Mesh:
    """Palm, fixed jaw and finger in the frame of the hand's link; the finger is open by an angle."""
    facts = spot_facts()
    links = {link["link"]: link for link in facts["arm"]}
    yellow, black = (tuple(facts["colours"][name][:3]) for name in ("yellow", "black"))
    mesh = Mesh({"yellow": Material(yellow), "black": Material(black), "pad": Material((0.16, 0.16, 0.17))})
    palm, *jaw = links[_PALM]["collision"]
    del palm  # The camera looks out of it.
    for shape in jaw:
        _add_box(mesh, "black", shape)
    finger = Mesh(mesh.materials)
    for shape in links[_FINGER]["collision"]:
        _add_box(finger, "black", shape)
    for link, part in ((_PALM, mesh), (_FINGER, finger)):
        for grid in links[link]["pads"]:
            for (x, z), y in itertools.product(grid["xz"], grid["y"]):
                part.add_box("pad", (x - 0.006, y - 0.006, z - 0.006), (x + 0.006, y + 0.006, z + 0.006))
    c, s = np.cos(-opening_rad), np.sin(-opening_rad)
    mesh.add_mesh(finger, [[c, 0, s], [0, 1, 0], [-s, 0, c]], links[_FINGER]["offset"])
    return mesh


def _add_box(mesh: Mesh, material: str, shape: Mapping[str, Any]) -> None:
    half = np.array(shape["box"]) / 2
    part = Mesh(mesh.materials)
    add_rounded_box(part, material, -half, half, float(half.min()) * 0.5)
    turn = RollPitchYaw(shape.get("rpy", [0, 0, 0])).ToRotationMatrix().matrix()
    mesh.add_mesh(part, turn, shape["xyz"])
