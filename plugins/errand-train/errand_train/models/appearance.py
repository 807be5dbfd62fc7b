"""Appearance of the loose objects: textured meshes and the pictures on them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from errand_make.mesh import Material, Mesh
from errand_train.models import objects as o
from errand_train.models.pictures import noise, to_picture, wood
from skills.robot import FloatArray, Picture

LABEL_SHAPE = (192, 384)


@dataclass(frozen=True)
class Appearance:
    """A mesh in the frame of its model, the pictures that its materials name, and the meshes of parts by file name."""

    mesh: Mesh
    pictures: dict[str, Picture] = field(default_factory=dict)
    parts: dict[str, Mesh] = field(default_factory=dict)


def coke_appearance() -> Appearance:
    """A red can with a white wave and a silver lid."""
    mesh = Mesh(
        {
            "label": Material(texture="label.png"),
            "lid": Material((0.80, 0.81, 0.83)),
            "rim": Material((0.66, 0.67, 0.69)),
            "tab": Material((0.52, 0.53, 0.55)),
        }
    )
    bottom, top, r = -o.CAN_HEIGHT_M / 2, o.CAN_HEIGHT_M / 2, o.CAN_RADIUS_M
    mesh.add_lathe("rim", [(0, bottom + 0.002), (0.026, bottom + 0.001), (0.029, bottom), (r - 0.001, bottom + 0.006)])
    mesh.add_lathe("label", [(r - 0.001, bottom + 0.006), (r, bottom + 0.009), (r, top - 0.012)], sides=32)
    mesh.add_lathe("label", [(r, top - 0.012), (r - 0.0005, top - 0.011)], sides=32)
    mesh.add_lathe("rim", [(r - 0.0005, top - 0.011), (0.0275, top - 0.001), (0.0270, top), (0.0258, top)])
    mesh.add_lathe("lid", [(0.0258, top), (0.0250, top - 0.003), (0, top - 0.003)])
    mesh.add_box("tab", (-0.004, -0.008, top - 0.003), (0.016, 0.008, top - 0.0015))
    return Appearance(mesh, {"label.png": to_picture(_can_label())})


def _can_label() -> FloatArray:
    height, width = LABEL_SHAPE
    image = np.zeros((height, width, 3)) + np.array([0.80, 0.04, 0.06])
    rows, columns = np.indices(LABEL_SHAPE)
    wave = height * (0.52 + 0.13 * np.sin(columns * 4 * np.pi / width))
    image[np.abs(rows - wave) < 11] = (0.96, 0.96, 0.95)
    image[np.abs(rows - wave - 22) < 3] = (0.86, 0.86, 0.86)
    for x in (24, 216):
        image[_lettering("cola", (x, 70), cv2.FONT_HERSHEY_SCRIPT_COMPLEX, 4)] = 0.96
    return np.asarray(image)


def _lettering(text: str, corner: tuple[int, int], font: int, thick: int) -> NDArray[np.bool_]:
    """Mask of the pixels of a label that a word covers."""
    canvas = np.zeros(LABEL_SHAPE, np.uint8)
    cv2.putText(canvas, text, corner, font, 1.7, 255, thick, cv2.LINE_AA)
    return np.asarray(canvas > 127)


def beer_appearance() -> Appearance:
    """A green bottle with a cream label, a collar and a crown cap."""
    mesh = Mesh(
        {
            "glass": Material((0.06, 0.27, 0.10)),
            "glass_light": Material((0.12, 0.36, 0.15)),
            "label": Material(texture="label.png"),
            "collar": Material((0.86, 0.76, 0.42)),
            "cap": Material((0.78, 0.66, 0.30)),
        }
    )
    b, r, neck = -o.BOTTLE_HEIGHT_M / 2, o.BOTTLE_RADIUS_M, o.BOTTLE_NECK_RADIUS_M
    mesh.add_lathe("glass", [(0, b + 0.003), (0.024, b), (0.027, b), (r, b + 0.006), (r, b + 0.03)], sides=32)
    mesh.add_lathe("label", [(r, b + 0.03), (r, b + 0.10)], sides=32)
    shoulder = [(r, 0.10), (r, 0.125), (0.0285, 0.138), (0.024, 0.150), (0.0185, 0.162), (0.015, 0.172)]
    mesh.add_lathe("glass", [(radius, b + z) for radius, z in shoulder], sides=32)
    mesh.add_lathe("collar", [(0.015, b + 0.172), (neck, b + 0.205)], sides=32)
    mesh.add_lathe("glass_light", [(neck, b + 0.205), (neck, b + 0.218)])
    cap = [(neck, 0.218), (0.0148, 0.2185), (0.0135, 0.228), (0.012, 0.23), (0, 0.23)]
    mesh.add_lathe("cap", [(radius, b + z) for radius, z in cap])
    return Appearance(mesh, {"label.png": to_picture(_bottle_label())})


def _bottle_label() -> FloatArray:
    height, width = LABEL_SHAPE
    image = np.zeros((height, width, 3)) + np.array([0.93, 0.90, 0.80])
    for edge in (slice(0, 10), slice(-10, None)):
        image[edge] = (0.72, 0.58, 0.22)
    for x in (20, 212):
        image[_lettering("BEER", (x, 112), cv2.FONT_HERSHEY_DUPLEX, 4)] = (0.10, 0.26, 0.14)
        image[138:142, x : x + 150] = (0.72, 0.58, 0.22)
    image[:, width // 2 - 6 : width // 2 + 6] = (0.06, 0.27, 0.10)
    return np.asarray(image)


def cube_appearance() -> Appearance:
    """A cube of blue painted wood with worn edges."""
    mesh = Mesh({"paint": Material(texture="paint.png")})
    half = o.CUBE_M / 2
    mesh.add_box("paint", (-half,) * 3, (half,) * 3)
    rng = np.random.default_rng(11)
    image = wood(rng, (128, 128), (0.10, 0.27, 0.78), 0.06)
    rows, columns = np.indices((128, 128))
    to_edge = np.minimum.reduce([rows, columns, 127 - rows, 127 - columns])
    worn = to_edge < 3 + noise(rng, (128, 128), (4, 4))
    image[worn] = image[worn] * 0.6 + np.array([0.12, 0.18, 0.32])
    return Appearance(mesh, {"paint.png": to_picture(image)})


def hammer_appearance() -> Appearance:
    """A claw hammer: ash handle, dark steel head."""
    mesh = Mesh(
        {
            "ash": Material(texture="ash.png", tile_m=(0.15, 0.06)),
            "grip": Material((0.55, 0.36, 0.16)),
            "steel": Material((0.20, 0.21, 0.23)),
            "face": Material((0.46, 0.47, 0.49)),
        }
    )
    half, thick = o.HAMMER_LENGTH_M / 2, o.HAMMER_THICKNESS_M / 2
    head_x = half - o.HEAD_WIDTH_M / 2
    for part, (low, high) in _handle_parts(half, head_x).items():
        mesh.add_mesh(_bar(mesh, part, low, high))
    face = Mesh(mesh.materials)
    face.add_lathe("steel", [(0.0, 0.012), (0.011, 0.012), (0.011, 0.036), (0.015, 0.042), (0.015, 0.059)])
    face.add_lathe("face", [(0.015, 0.059), (0.013, 0.060), (0, 0.060)])
    mesh.add_mesh(face, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], (head_x, 0, 0))
    mesh.add_box("steel", (head_x - 0.016, -0.016, -thick + 0.001), (half, 0.016, thick - 0.001))
    for sign in (-1, 1):
        mesh.add_mesh(_claw(mesh, sign), p=(head_x, 0, 0))
    image = wood(np.random.default_rng(12), (96, 240), (0.83, 0.60, 0.30), 0.07)
    return Appearance(mesh, {"ash.png": to_picture(image)})


def _handle_parts(half: float, head_x: float) -> dict[str, tuple[tuple[float, float], tuple[float, float]]]:
    """Returns (x, half width) at both ends by material."""
    return {"grip": ((-half, 0.015), (-half + 0.02, 0.015)), "ash": ((-half + 0.02, 0.0148), (head_x, 0.0115))}


def _bar(mesh: Mesh, material: str, low: tuple[float, float], high: tuple[float, float]) -> Mesh:
    """An eight-sided bar along x from low to high (x, half width), as thick as the hammer."""
    bar, thick = Mesh(mesh.materials), o.HAMMER_THICKNESS_M / 2
    angle = (np.arange(9) + 0.5) * np.pi / 4
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1) / np.cos(np.pi / 8)
    for i in range(8):
        points = []
        for (x, half_width), k in ((low, i), (high, i), (high, i + 1), (low, i + 1)):
            points.append(np.array([x, ring[k, 0] * half_width, ring[k, 1] * thick]))
        a, b, _, d = points
        bar.add_rectangle(material, d, points[2] - d, a - d) if np.allclose(points[2] - d, b - a) else _patch(
            bar, material, points
        )
    for (x, half_width), sign in ((low, -1), (high, 1)):
        corners = [np.array([x, p[0] * half_width, p[1] * thick]) for p in ring[:8]][:: int(sign)]
        for i in range(1, 7):
            triangle = [corners[0], corners[i], corners[i + 1]]
            bar.add_triangles(material, triangle, [(sign, 0, 0)] * 3, [(0.1, 0.1)] * 3)
    return bar


def _patch(mesh: Mesh, material: str, p: list[FloatArray]) -> None:
    """A quadrilateral whose corners run clockwise as seen from outside."""
    n = np.cross(p[3] - p[0], p[1] - p[0])
    n /= np.linalg.norm(n)
    uv = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    order = [0, 2, 1, 0, 3, 2]
    mesh.add_triangles(material, [p[k] for k in order], [n] * 6, [uv[k] for k in order])


def _claw(mesh: Mesh, sign: int) -> Mesh:
    """One of the two prongs, which narrow towards -y."""
    claw = Mesh(mesh.materials)
    inner, outer = sign * 0.001, sign * 0.0145
    steps = [(-0.012 - 0.004 * k, 0.0150 - 0.001 * k) for k in range(13)]
    for (y0, w0), (y1, w1) in itertools.pairwise(steps):
        x0 = sorted((inner, np.sign(sign) * min(abs(outer), w0)))
        low = (x0[0], y1, -0.014 + (0.015 - w1) * 0.4)
        high = (x0[1], y0, 0.014 - (0.015 - w1) * 0.9)
        claw.add_box("steel", low, high)
    return claw
