"""Textured triangle meshes of simple surfaces, and their OBJ form.

The renderer clamps texture coordinates to [0, 1], so a surface larger than its texture is cut into tiles.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skills.robot import FloatArray

Colour = tuple[float, float, float]
UV = tuple[tuple[float, float], tuple[float, float]]
WHOLE: UV = ((0.0, 0.0), (1.0, 1.0))
PALETTE_COLUMNS = 16
SMOOTH_COSINE = 0.75
IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Material:
    """Appearance of a surface: colour (RGB, 0..1), a texture file beside the mesh, and the size of the texture (m).

    A `tile_m` of None stretches the texture once over each surface. `shine` (0 rough, 1 mirror) and `metal` (0 or 1)
    count only in the glTF form, with physically based rendering.
    """

    colour: Colour = (1.0, 1.0, 1.0)
    texture: str | None = None
    tile_m: tuple[float, float] | None = None
    shine: float = 0.0
    metal: float = 0.0


@dataclass
class _Triangles:
    points: list[FloatArray] = field(default_factory=list)
    normals: list[FloatArray] = field(default_factory=list)
    uvs: list[FloatArray] = field(default_factory=list)


@dataclass(frozen=True)
class _Ring:
    """Edge of a band of a lathe: (radius, z), the (radial, z) of the normal, and the v of the texture."""

    place: FloatArray
    facing: FloatArray
    v: float


def _smoothed(facing: FloatArray, neighbour: FloatArray) -> FloatArray:
    """Normal shared with the neighbouring band, unless an edge lies between them."""
    if facing @ neighbour < SMOOTH_COSINE:
        return facing
    both = facing + neighbour
    return np.asarray(both / np.linalg.norm(both))


class Mesh:
    """Triangles by material. All `add_` methods take metres in the mesh's frame and outward normals."""

    def __init__(self, materials: Mapping[str, Material]) -> None:
        self.materials = materials
        self._groups: dict[str, _Triangles] = {}

    def _material(self, name: str) -> Material:
        if name not in self.materials:
            raise KeyError(f"no material {name!r}; there are {', '.join(sorted(self.materials))}")
        return self.materials[name]

    def add_triangles(self, material: str, points: ArrayLike, normals: ArrayLike, uvs: ArrayLike) -> None:
        """Adds (N, 3, 3) corner points and normals with (N, 3, 2) texture coordinates. Raises KeyError."""
        self._material(material)
        group = self._groups.setdefault(material, _Triangles())
        group.points.append(np.asarray(points, dtype=float).reshape(-1, 3))
        group.normals.append(np.asarray(normals, dtype=float).reshape(-1, 3))
        group.uvs.append(np.asarray(uvs, dtype=float).reshape(-1, 2))

    def add_rectangle(self, material: str, corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike) -> None:
        """Adds the rectangle from `corner` along two edges; its normal is edge_u x edge_v."""
        p, u, v = (np.asarray(a, dtype=float) for a in (corner, edge_u, edge_v))
        tile = self._material(material).tile_m
        lengths = np.linalg.norm(u), np.linalg.norm(v)
        spans = (1.0, 1.0) if tile is None else (float(lengths[0] / tile[0]), float(lengths[1] / tile[1]))
        for u0, u1 in _cuts(spans[0]):
            for v0, v1 in _cuts(spans[1]):
                origin = p + u * (u0 / spans[0]) + v * (v0 / spans[1])
                sides = u * ((u1 - u0) / spans[0]), v * ((v1 - v0) / spans[1])
                base = np.floor([u0 + 1e-9, v0 + 1e-9])
                uv = ((u0 - base[0], v0 - base[1]), (u1 - base[0], v1 - base[1]))
                self._add_patch(material, origin, *sides, uv)

    def _add_patch(self, material: str, p: FloatArray, u: FloatArray, v: FloatArray, uv: UV) -> None:
        n = np.array([u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)])  # u x v, faster than np.cross
        n /= np.linalg.norm(n)
        (s0, t0), (s1, t1) = uv
        a, b, c, d = (p, (s0, t0)), (p + u, (s1, t0)), (p + u + v, (s1, t1)), (p + v, (s0, t1))
        corners = [a, b, c, a, c, d]
        self.add_triangles(material, [q for q, _ in corners], [n] * 6, [t for _, t in corners])

    def add_box(
        self,
        material: str,
        low: ArrayLike,
        high: ArrayLike,
        *,
        faces: Mapping[str, str | None] | None = None,
    ) -> None:
        """Adds the box between two corners; `faces` gives other materials, or None for no face, to -x, +x, ... +z."""
        a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        x, y, z = np.diag(b - a)
        rectangles = {
            "-x": (a + y, -y, z),
            "+x": (a + x, y, z),
            "-y": (a, x, z),
            "+y": (a + x + y, -x, z),
            "-z": (a + y, x, -y),
            "+z": (a + z, x, y),
        }
        for face, (corner, u, v) in rectangles.items():
            chosen = (faces or {}).get(face, material)
            if chosen is not None:
                self.add_rectangle(chosen, corner, u, v)

    def add_lathe(
        self, material: str, profile: Sequence[tuple[float, float]], *, centre: ArrayLike = (0, 0, 0), sides: int = 24
    ) -> None:
        """Adds a surface of revolution: a profile (radius, z), from the bottom up, about the vertical at `centre`."""
        outline = np.asarray(profile, dtype=float)
        steps = np.diff(outline, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        v = np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
        facing = np.column_stack([steps[:, 1], -steps[:, 0]]) / lengths[:, None]
        for k in range(len(steps)):
            before, after = facing[max(k - 1, 0)], facing[min(k + 1, len(steps) - 1)]
            lower = _Ring(outline[k], _smoothed(facing[k], before), float(v[k]))
            upper = _Ring(outline[k + 1], _smoothed(facing[k], after), float(v[k + 1]))
            self._add_band(material, lower, upper, np.asarray(centre, dtype=float), sides)

    def _add_band(self, material: str, low: _Ring, high: _Ring, centre: FloatArray, sides: int) -> None:
        angle = np.linspace(0, 2 * np.pi, sides + 1)
        around = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        rings = (low, high)
        points = [centre + around * r.place[0] + [0, 0, r.place[1]] for r in rings]
        normals = [around * r.facing[0] + [0, 0, r.facing[1]] for r in rings]
        ends, steps = np.array([0, 0, 1, 0, 1, 1]), np.arange(sides)[:, None] + [0, 1, 1, 0, 1, 0]
        uvs = np.stack(np.broadcast_arrays(steps / sides, np.array([low.v, high.v])[ends]), axis=-1)
        self.add_triangles(material, np.stack(points)[ends, steps], np.stack(normals)[ends, steps], uvs)

    def add_cylinder(
        self, material: str, radius: float, low: ArrayLike, height: float, *, cap: str | None = None, sides: int = 20
    ) -> None:
        """Adds an upright closed cylinder on the point `low`; its top may have another material."""
        centre = np.asarray(low, dtype=float)
        self.add_lathe(material, [(0, 0), (radius, 0), (radius, height)], centre=centre, sides=sides)
        self.add_lathe(cap or material, [(radius, height), (0, height)], centre=centre, sides=sides)

    def add_mesh(self, other: Mesh, R: ArrayLike = IDENTITY, p: ArrayLike = (0, 0, 0)) -> None:
        """Adds another mesh, transformed by the (3, 3) matrix R, scaling included, then moved by p."""
        matrix, offset = np.asarray(R, dtype=float), np.asarray(p, dtype=float)
        to_normal = np.linalg.inv(matrix)
        for material, points, normals, uvs in other.groups():
            turned = normals @ to_normal
            turned /= np.linalg.norm(turned, axis=1, keepdims=True)
            self.add_triangles(material, points @ matrix.T + offset, turned, uvs)

    def groups(self) -> Iterator[tuple[str, FloatArray, FloatArray, FloatArray]]:
        """Iterates over material names with points (3N, 3), normals (3N, 3) and texture coordinates (3N, 2)."""
        for material in sorted(self._groups):
            g = self._groups[material]
            yield material, np.concatenate(g.points), np.concatenate(g.normals), np.concatenate(g.uvs)


def _cuts(span: float) -> list[tuple[float, float]]:
    """Intervals of whole tiles and the rest of a length of `span` textures."""
    edges = [*np.arange(0.0, span - 1e-6, 1.0), span]
    return [(float(a), float(b)) for a, b in itertools.pairwise(edges)]


def obj_text(mesh: Mesh, material_file: str, shared_texture: str = "palette", places: int = 4) -> str:
    """Returns the Wavefront OBJ form. Plain colours share one material, which uses `shared_texture`; see `mtl_text`.

    Points have `places` decimal places of a metre.
    """
    colours = plain_colours(mesh.materials)
    lines, merged = [f"mtllib {material_file}"], dict[str, list[tuple[FloatArray, FloatArray, FloatArray]]]()
    for material, points, normals, uvs in mesh.groups():
        if material in colours:
            uvs = np.tile(palette_uv(colours.index(material)), (len(points), 1))
        name = shared_texture if material in colours else material
        merged.setdefault(name, []).append((points, normals, uvs))
    counts = [0, 0, 0]
    for name, parts in sorted(merged.items()):
        points, normals, uvs = (np.concatenate([part[k] for part in parts]) for k in range(3))
        lines += _obj_group(name, points, normals, uvs, counts, places)
    return "\n".join(lines) + "\n"


def _obj_group(
    name: str, points: FloatArray, normals: FloatArray, uvs: FloatArray, counts: list[int], places: int
) -> list[str]:
    """Lines of one material; increases `counts` (vertices, texture coordinates, normals so far)."""
    lines, index = [], []
    for k, (key, rows, digits) in enumerate((("v", points, places), ("vt", uvs, 4), ("vn", normals, 3))):
        rounded = np.round(rows, digits) + 0.0
        first, inverse = unique_rows(rounded)
        form = f"{key}{f' %.{digits}f' * rows.shape[1]}"
        lines += [form % tuple(row) for row in rounded[first].tolist()]
        index.append(inverse + counts[k] + 1)
        counts[k] += len(first)
    lines.append(f"usemtl {name}")
    faces = np.column_stack(index).reshape(-1, 9).tolist()
    return lines + ["f {}/{}/{} {}/{}/{} {}/{}/{}".format(*face) for face in faces]


def unique_rows(rows: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices (U,) of the first of equal rows (N, K), in lexicographic order, and the place of each row (N,) there."""
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = np.logical_or.reduce([column[1:] != column[:-1] for column in ordered.T])
    inverse = np.empty(len(rows), dtype=np.int64)
    inverse[order] = np.cumsum(begins) - 1
    return np.asarray(order[begins]), inverse


def plain_colours(materials: Mapping[str, Material]) -> list[str]:
    """Names of the materials without a texture, in a fixed order."""
    return sorted(name for name, material in materials.items() if material.texture is None)


def palette_uv(index: int) -> tuple[float, float]:
    """Texture coordinates of a colour in the palette picture."""
    row, column = divmod(index, PALETTE_COLUMNS)
    return ((column + 0.5) / PALETTE_COLUMNS, 1.0 - (row + 0.5) / PALETTE_COLUMNS)


def palette_picture(materials: Mapping[str, Material], cell: int = 4) -> NDArray[np.uint8]:
    """Palette as an RGB picture. Raises ValueError when there are too many colours."""
    names = plain_colours(materials)
    if len(names) > PALETTE_COLUMNS**2:
        raise ValueError(f"{len(names)} plain colours do not fit into the palette")
    cells = np.full((PALETTE_COLUMNS, PALETTE_COLUMNS, 3), 255, np.uint8)
    for index, name in enumerate(names):
        cells[divmod(index, PALETTE_COLUMNS)] = np.round(np.array(materials[name].colour) * 255)
    return cells.repeat(cell, axis=0).repeat(cell, axis=1)


def mtl_text(mesh: Mesh, palette_file: str, shared_texture: str = "palette") -> str:
    """Returns the material file for `obj_text`, with only the used materials, because viewers load every texture."""
    used = {name: mesh.materials[name] for name, *_ in mesh.groups()}
    entries = {name: material for name, material in used.items() if material.texture is not None}
    if len(entries) < len(used):
        entries[shared_texture] = Material(texture=palette_file)
    text = ""
    for name, material in entries.items():
        colour = " ".join(f"{value:.3f}" for value in material.colour)
        text += f"newmtl {name}\nKd {colour}\nmap_Kd {material.texture}\n\n"
    return text


def write_text(path: Path, text: str) -> None:
    """Writes a text file with Unix line ends, making its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
