"""Makes the household objects of `objects.yaml` as `errand object import` does: `python make_objects.py [NAME ...]`."""

import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from trimesh import creation

from errand_make.objects import ImportOptions, ImportReports, import_object
from skills.inputs.yaml_source import read_yaml

HERE = Path(__file__).resolve().parent
OUT = HERE.parent / "errand_home" / "objects"
SECTIONS = 32
"""Edges around a turned part."""


def revolve(*profile: tuple[float, float]) -> trimesh.Trimesh:
    """Solid that a profile of radius and height bounds."""
    return creation.revolve(np.array(profile, dtype=float), sections=SECTIONS)


def ring(radius: float, thickness: float) -> trimesh.Trimesh:
    """Standing ring: a handle."""
    upright = trimesh.transformations.rotation_matrix(np.radians(90), (1, 0, 0))
    return creation.torus(radius, thickness, major_sections=24, minor_sections=12).apply_transform(upright)


def roof(half_x: float, half_y: float, low: float, high: float) -> trimesh.Trimesh:
    """Prism of a gable roof."""
    points = [[x, y, low] for x in (-half_x, half_x) for y in (-half_y, half_y)]
    return trimesh.convex.convex_hull(np.array([*points, [-half_x, 0, high], [half_x, 0, high]]))


def arc(radius: float, thick: float, degrees: float, thinner: float) -> trimesh.Trimesh:
    """Lying bow whose ends are thinner."""
    angles = np.radians(np.linspace(-degrees / 2, degrees / 2, 17))
    turns = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rings = [
        [
            [np.cos(a) * (radius + r * np.cos(t)) - radius, np.sin(a) * (radius + r * np.cos(t)), thick + r * np.sin(t)]
            for t in turns
        ]
        for a in angles
        if (r := thick * (1 - thinner * abs(a / angles[-1]) ** 2.5)) > 0
    ]
    points, n = np.array(rings).reshape(-1, 3), len(turns)
    faces = [
        face
        for i in range(len(rings) - 1)
        for j in range(n)
        for face in (
            (i * n + j, (i + 1) * n + j, (i + 1) * n + (j + 1) % n),
            (i * n + j, (i + 1) * n + (j + 1) % n, i * n + (j + 1) % n),
        )
    ]
    for first, sign in ((0, 1), ((len(rings) - 1) * n, -1)):
        faces += [(first, *(first + k for k in ((j, j + 1)[::sign]))) for j in range(1, n - 1)]
    bow = trimesh.Trimesh(points, faces)
    bow.fix_normals()
    return bow


SHAPES: Mapping[str, Callable[..., trimesh.Trimesh]] = {
    "revolve": revolve,
    "ring": ring,
    "roof": roof,
    "arc": arc,
    "box": lambda low, high: creation.box(bounds=[low, high]),
    "rod": lambda radius, length: creation.cylinder(radius, length, sections=SECTIONS),
    "ball": lambda radius: creation.icosphere(3, radius),
}


def part(colours: Mapping[str, Any], row: Mapping[str, Any]) -> trimesh.Trimesh:
    """Part of an object, with its colour, in mm."""
    ((kind, sizes),) = ((key, value) for key, value in row.items() if key in SHAPES)
    mesh = SHAPES[kind](*sizes) if isinstance(sizes, list) else SHAPES[kind](sizes)
    mesh.apply_transform(np.diag([*row.get("scale", (1, 1, 1)), 1.0]))
    degrees, *axis = row.get("turn", (0, 0, 0, 1))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(degrees), axis))
    mesh.apply_translation(row.get("by", (0, 0, 0)))
    mesh.visual.face_colors = [*colours[row["colour"]], 255]
    return mesh


def make(name: str, table: Mapping[str, Any]) -> None:
    """Imports an object into its folder, which is made again."""
    row = table["objects"][name]
    whole = trimesh.util.concatenate([part(table["colours"], each) for each in row["parts"]])
    whole.apply_scale(0.001)
    shutil.rmtree(OUT / name, ignore_errors=True)
    (OUT / name).mkdir(parents=True)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.ply"
        whole.export(file)
        options = ImportOptions(name, row["mass"], None, 1.0, "z", close_holes=False)
        import_object(file, options, OUT / name, ImportReports(lambda _: None, lambda note: print(name, note)))


if __name__ == "__main__":
    recipes = read_yaml(HERE / "objects.yaml").data
    for wanted in sys.argv[1:] or recipes["objects"]:
        make(wanted, recipes)
        print(wanted)
