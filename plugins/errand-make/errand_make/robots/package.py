"""Installable package with a robot from a URDF: its parts, meshes, tests and registration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from errand_make.robots.checks import fix_still_joints
from errand_make.robots.inference import write_robot_file
from errand_make.robots.meshes import MESHES, MeshCopies
from errand_make.robots.source import edited_text, read_source
from errand_make.robots.units import check_extent
from executive.cli.new_command import PackageTemplates
from executive.cli.output import console_for, progress_bar
from plant.robots.robot_kind import robot_kinds
from skills.inputs.errors import InputError, listing
from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import arm_model
from skills.manipulation.arm.poses import compact_configuration
from skills.robot import Capabilities, FloatArray, Mount

_TEMPLATES: Final = PackageTemplates("robot", Path(__file__).parent / "templates")
_BAND_M: Final = 0.05
"""Half the height band of a planar LiDAR's returns, which small tilts of the robot smear."""
_TABLE_M, _BEFORE_TABLE_M, _IN_VIEW_RAD = 0.75, 1.0, 0.5
"""Table's height in the tests, distance of the can on it from the robot that looks, half the camera's view."""


def check_robot_name(name: str) -> None:
    """Raises InputError if a robot cannot have a name, or is installed under it."""
    _TEMPLATES.check(name, robot_kinds())


def render_robot(name: str, urdf: Path, folder: Path, *, packages: Mapping[str, Path]) -> list[str]:
    """Writes a package with the robot `name` into a folder; returns the points for a person to check.

    Raises:
        InputError: the URDF or a mesh cannot be used; with file and line.
    """
    home = folder / _TEMPLATES.package(name)
    home.mkdir(parents=True)
    source = read_source(urdf, packages)
    still = fix_still_joints(source)
    empty = check_extent(source)
    copies = MeshCopies(source, packages, home)
    (home / MESHES).mkdir()
    meshes = copies.meshes()
    with progress_bar(console_for(as_json=True), "meshes", len(meshes)) as advance:
        for role, shape, mesh in meshes:
            copies.copy(role, shape, mesh)
            advance()
    (home / "robot.urdf").write_text(edited_text(source), encoding="utf-8")
    try:
        can, notes = write_robot_file(source, name, home, _stowed)
    except InputError as error:
        if error.file not in (home / "robot.urdf", home / "robot.yaml"):
            raise
        line = error.line if error.file == home / "robot.urdf" else None
        raise InputError(error.message, hint=error.hint, file=urdf, line=line) from error
    height_m = can.lidar_height_m or 0.0
    words = {"low": f"{height_m - _BAND_M:.2f}", "high": f"{height_m + _BAND_M:.2f}"}
    lacking = [] if can.arm is not None else ["look", "stow"]
    sees = can.object_camera is not None and _sees_table(can)
    lacking += [] if sees else ["look"]
    lacking += [] if sees and can.gripper is not None else ["take", "grasp"]
    if can.object_camera is not None and not sees:
        table = f"the top of a table {_TABLE_M} m high from {_BEFORE_TABLE_M:g} m before it"
        why = f"does not move, and does not see {table}; so no test looks or grasps"
        notes.append(f"cameras: {can.object_camera.source} {why}")
    _TEMPLATES.render(name, folder, words=words, without={f"{each}.skilltest.yaml" for each in lacking})
    if still:
        what = f"joint{'s' * (len(still) > 1)} {listing(still)}: lower and upper are both 0, so taken as fixed"
        notes.append(f"urdf: {what}; write the range of one that moves")
    return [*notes, *(f"urdf: {note}" for note in empty), *(f"meshes: {note}" for note in copies.all_notes())]


def _sees_table(can: Capabilities) -> bool:
    """True when the camera for objects moves, or has the top of a table before the robot in view, and is higher."""
    camera = can.object_camera
    if camera is None or camera.mount is not Mount.BODY:
        return True
    over_m = _TABLE_M - can.standing_height_m
    x, y, z = camera.X_FC.inverse() @ np.array([_BEFORE_TABLE_M, 0.0, over_m])
    return bool(camera.X_FC.translation()[2] > over_m and math.hypot(x, y) < math.tan(_IN_VIEW_RAD) * z)


def _stowed(can: Capabilities, tries: Sequence[FloatArray]) -> FloatArray:
    """The first of some arm configurations (J,) that is free of contact, else a compact one."""
    scene = ArmScene(can, arm_model(can), {})
    found = next((q for q in tries if scene.free(q)), None)
    return compact_configuration(can) if found is None else found
