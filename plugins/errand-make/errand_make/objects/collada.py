"""Reads COLLADA files (.dae): triangles with colours and pictures, in metres by the unit of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from errand_make.errors import ObjectImportError
from errand_make.mesh import Colour
from skills.inputs.outside import read_text
from skills.robot import FloatArray

MOST_BYTES: Final = 100_000_000
MOST_NODES: Final = 10_000
MOST_DEPTH: Final = 50
_UP: Final = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
_AGAIN: Final = "export it once more, for example as GLB"
_LINKS: Final = frozenset({"source", "init_from", "instance_image"})
_FILES: Final = frozenset({"init_from", "ref"})
MOST_LINKS: Final = 4
_SEVERAL: Final = ("triangles", "polylist", "polygons")


@dataclass(frozen=True)
class Surface:
    """Appearance of triangles: a colour or the file of a picture, None without one."""

    colour: Colour | None = None
    picture: str | None = None


@dataclass(frozen=True)
class Part:
    """Triangles (T, 3, 3) in metres with texture coordinates (T, 3, 2) and their colour or picture."""

    triangles: FloatArray
    uvs: FloatArray
    colour: Colour | None = None
    picture: str | None = None


@dataclass(frozen=True)
class Collada:
    """Parts of a file, and the axis that is up."""

    parts: tuple[Part, ...]
    up: str


def read_collada(path: Path) -> Collada:
    """Reads a COLLADA file whose XML is checked already.

    Raises:
        ObjectImportError: the file is no COLLADA, or damaged.
        InputError: the file cannot be read.
    """
    try:
        return _Document(ElementTree.fromstring(read_text(path, most_bytes=MOST_BYTES))).read()
    except (ValueError, IndexError, KeyError, RecursionError, OverflowError, ElementTree.ParseError) as error:
        raise ObjectImportError(f"it is damaged ({type(error).__name__})", _AGAIN) from error


def _name(element: Element) -> str:
    return element.tag.rpartition("}")[2]


def _children(element: Element, *names: str) -> Iterator[Element]:
    return (child for child in element if _name(child) in names)


def _child(element: Element, name: str) -> Element:
    found = next(_children(element, name), None)
    if found is None:
        raise KeyError(name)
    return found


def _input(element: Element, semantic: str) -> Element:
    found = next((each for each in _children(element, "input") if each.get("semantic") == semantic), None)
    if found is None:
        raise KeyError(semantic)
    return found


def _numbers(element: Element) -> FloatArray:
    return np.array((element.text or "").split(), dtype=np.float64)


@dataclass
class _Document:
    root: Element
    by_id: dict[str, Element] = field(default_factory=dict)
    nodes: int = 0

    def read(self) -> Collada:
        """Reads all triangles of the scene."""
        if _name(self.root) != "COLLADA":
            raise ObjectImportError("it is no COLLADA file", _AGAIN)
        self.by_id = {identifier: each for each in self.root.iter() if (identifier := each.get("id"))}
        asset = next(_children(self.root, "asset"), None)
        unit = None if asset is None else next(_children(asset, "unit"), None)
        axis = None if asset is None else next(_children(asset, "up_axis"), None)
        unit_m = 1.0 if unit is None else float(unit.get("meter", "1"))
        if not (np.isfinite(unit_m) and unit_m > 0.0):
            raise ObjectImportError(f"its unit is {unit_m:g} m", "correct <unit meter=...> in it")
        up = _UP.get("Y_UP" if axis is None else (axis.text or "").strip(), "y")
        scale = np.diag([unit_m, unit_m, unit_m, 1.0])
        parts = [part for scene in self._scenes() for node in scene for part in self._node(node, scale, 0)]
        return Collada(tuple(parts), up)

    def _scenes(self) -> list[Element]:
        """Scenes that the file instances, else all its scenes."""
        named = [each.get("url", "") for each in self.root.iter() if _name(each) == "instance_visual_scene"]
        shown = [self._found(url) for url in named]
        return shown or [each for each in self.root.iter() if _name(each) == "visual_scene"]

    def _found(self, url: str) -> Element:
        return self.by_id[url.removeprefix("#")]

    def _node(self, node: Element, X: FloatArray, depth: int) -> Iterator[Part]:
        """Triangles of a node and the nodes below it, transformed by X."""
        self.nodes += 1
        if self.nodes > MOST_NODES or depth > MOST_DEPTH:
            raise ObjectImportError("it has too many nodes", _AGAIN)
        if _name(node) != "node":
            return
        for child in node:
            X = X @ _transform(child)
        for child in node:
            if _name(child) == "instance_geometry":
                surfaces = dict(self._surfaces(child))
                step = -1 if np.linalg.det(X[:3, :3]) < 0.0 else 1
                for triangles, uvs, symbol in self._geometry(self._found(child.get("url", ""))):
                    moved, surface = triangles @ X[:3, :3].T + X[:3, 3], surfaces.get(symbol, Surface())
                    yield Part(moved[:, ::step], uvs[:, ::step], surface.colour, surface.picture)
            elif _name(child) == "instance_node":
                yield from self._node(self._found(child.get("url", "")), X, depth + 1)
            elif _name(child) == "node":
                yield from self._node(child, X, depth + 1)

    def _geometry(self, geometry: Element) -> Iterator[tuple[FloatArray, FloatArray, str]]:
        """Triangles (T, 3, 3) of a geometry, their texture coordinates, and the name of their material."""
        for mesh in _children(geometry, "mesh"):
            for group in _children(mesh, *_SEVERAL):
                corners, places = _corners(group)
                if len(corners):
                    vertices = self._found(_input(group, "VERTEX").get("source", ""))
                    points = self._values(_input(vertices, "POSITION"), 3)[corners[..., places["VERTEX"]]]
                    uvs = np.zeros((len(corners), 3, 2))
                    if "TEXCOORD" in places:
                        uvs = self._values(_input(group, "TEXCOORD"), 2)[corners[..., places["TEXCOORD"]]]
                    yield points, uvs, group.get("material", "")

    def _values(self, named: Element, width: int) -> FloatArray:
        """Rows (N, width) of the source that an input names."""
        source = self._found(named.get("source", ""))
        accessor = next((each for each in source.iter() if _name(each) == "accessor"), None)
        stride = width if accessor is None else int(accessor.get("stride", str(width)))
        return _numbers(_child(source, "float_array")).reshape(-1, stride)[:, :width]

    def _surfaces(self, instance: Element) -> Iterator[tuple[str, Surface]]:
        """Diffuse surfaces of the materials that an instance binds, by their names there."""
        for bound in (each for each in instance.iter() if _name(each) == "instance_material"):
            material = self.by_id.get(bound.get("target", "").removeprefix("#"))
            effect = None if material is None else next(_children(material, "instance_effect"), None)
            found = None if effect is None else self.by_id.get(effect.get("url", "").removeprefix("#"))
            diffuse = None if found is None else next((each for each in found.iter() if _name(each) == "diffuse"), None)
            if found is not None and diffuse is not None:
                yield bound.get("symbol", ""), self._surface(found, diffuse)

    def _surface(self, effect: Element, diffuse: Element) -> Surface:
        texture, colour = next(_children(diffuse, "texture"), None), next(_children(diffuse, "color"), None)
        if texture is not None:
            return Surface(picture=self._picture(effect, texture.get("texture", "")))
        if colour is None:
            return Surface()
        r, g, b = np.clip(_numbers(colour)[:3], 0.0, 1.0)
        return Surface((float(r), float(g), float(b)))

    def _picture(self, effect: Element, name: str) -> str | None:
        """File of a texture's picture: by a sampler, its surface and the image, or by the image."""
        parameters = {each.get("sid", ""): each for each in effect.iter() if _name(each) == "newparam"}
        for _ in range(MOST_LINKS):
            if name not in parameters:
                break
            linked = (each for each in parameters[name].iter() if _name(each) in _LINKS)
            name = next(((each.get("url") or each.text or "").strip().removeprefix("#") for each in linked), "")
        image = self.by_id.get(name)
        texts = () if image is None else ((each.text or "").strip() for each in image.iter() if _name(each) in _FILES)
        return next((unquote(text).removeprefix("file://") for text in texts if text), None)


def _corners(group: Element) -> tuple[NDArray[np.int64], dict[str, int]]:
    """Indices (T, 3, inputs) of the corners of a group's triangles, and the column of each input; polygons are fans."""
    inputs = list(_children(group, "input"))
    places = {each.get("semantic", ""): int(each.get("offset", "0")) for each in reversed(inputs)}
    stride = 1 + max(int(each.get("offset", "0")) for each in inputs)
    counts = next(_children(group, "vcount"), None)
    indices = [_numbers(each).astype(np.int64).reshape(-1, stride) for each in _children(group, "p")]
    if _name(group) == "polygons":
        sizes = [len(each) for each in indices]
    elif counts is not None:
        sizes = [int(size) for size in _numbers(counts)]
    else:
        sizes = [3] * (sum(map(len, indices)) // 3)
    every, starts = np.concatenate([*indices, np.empty((0, stride), np.int64)]), np.cumsum([0, *sizes])
    if starts[-1] != len(every) or any(size < 3 for size in sizes):
        raise ValueError("corners are missing")
    fans = [
        (start, start + step, start + step + 1)
        for start, size in zip(starts, sizes, strict=False)
        for step in range(1, size - 1)
    ]
    return every[np.array(fans, dtype=np.int64).reshape(-1, 3)], places


def _transform(element: Element) -> FloatArray:
    """Matrix (4, 4) of an element that transforms a node; the unit matrix for any other element."""
    X, kind = np.eye(4), _name(element)
    if kind == "matrix":
        X = _numbers(element).reshape(4, 4)
    elif kind == "translate":
        X[:3, 3] = _numbers(element)
    elif kind == "scale":
        X[:3, :3] = np.diag(_numbers(element))
    elif kind == "rotate":
        x, y, z, degrees = _numbers(element)
        axis, turn = np.array([x, y, z]) / max(float(np.hypot(np.hypot(x, y), z)), 1e-12), np.radians(degrees)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        X[:3, :3] += np.sin(turn) * cross + (1.0 - np.cos(turn)) * (cross @ cross)
    return X
