"""Writer of glTF: one primitive for each material, buffers inside the file, pictures beside it."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errand_make.mesh import Material, Mesh
from skills.robot import FloatArray

_FLOAT, _UINT = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_CLAMP = 33071
_Z_UP_TO_Y_UP = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1]
"""glTF's y is up: readers turn it back (column-major)."""


def gltf_text(mesh: Mesh) -> str:
    """Writes a mesh as a glTF 2.0 text; its z axis is up after a reader has rotated glTF's y axis up."""
    file = _File()
    primitives = [file.primitive(mesh.materials[name], *arrays) for name, *arrays in mesh.groups()]
    return json.dumps(file.document(primitives), separators=(",", ":"))


class _File:
    """Builder of buffers, materials and pictures."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._images: list[str] = []

    def primitive(self, material: Material, points: FloatArray, normals: FloatArray, uvs: FloatArray) -> dict[str, Any]:
        """Adds triangles of one material: points and normals (N, 3), texture coordinates (N, 2), three rows each."""
        flipped = np.column_stack([uvs[:, 0], 1.0 - uvs[:, 1]])
        rows = np.round(np.column_stack([points, normals, flipped]), 5).astype(np.float32)
        unique, order = np.unique(rows, axis=0, return_inverse=True)
        attributes = {
            "POSITION": self._accessor(unique[:, :3], "VEC3", extent=True),
            "NORMAL": self._accessor(_unit(unique[:, 3:6]), "VEC3"),
            "TEXCOORD_0": self._accessor(unique[:, 6:], "VEC2"),
        }
        indices = self._accessor(order.reshape(-1).astype(np.uint32), "SCALAR")
        return {"attributes": attributes, "indices": indices, "material": self._material(material)}

    def _accessor(self, values: NDArray[Any], kind: str, extent: bool = False) -> int:
        data = np.ascontiguousarray(values).tobytes()
        whole = values.dtype == np.uint32
        target = _ELEMENT_BUFFER if whole else _ARRAY_BUFFER
        view = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": len(data), "target": target}
        self._views.append(view)
        self._bytes += data
        entry: dict[str, Any] = {"bufferView": len(self._views) - 1, "count": len(values), "type": kind}
        entry["componentType"] = _UINT if whole else _FLOAT
        if extent:
            entry["min"], entry["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        self._accessors.append(entry)
        return len(self._accessors) - 1

    def _material(self, material: Material) -> int:
        # A full mirror would be black: there is no environment to see in it.
        surface: dict[str, Any] = {"metallicFactor": 0.35 * material.metal, "roughnessFactor": 1.0 - material.shine}
        linear = [float(c) ** 2.2 for c in material.colour]
        surface["baseColorFactor"] = [*linear, 1.0]
        if material.texture is not None:
            if material.texture not in self._images:
                self._images.append(material.texture)
            surface["baseColorTexture"] = {"index": self._images.index(material.texture)}
        self._materials.append({"pbrMetallicRoughness": surface})
        return len(self._materials) - 1

    def document(self, primitives: list[dict[str, Any]]) -> dict[str, Any]:
        """Builds the whole glTF document of some primitives, with all bytes in it."""
        data = base64.b64encode(bytes(self._bytes)).decode("ascii")
        uri = f"data:application/octet-stream;base64,{data}"
        document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0, "matrix": _Z_UP_TO_Y_UP}],
            "meshes": [{"primitives": primitives}],
            "materials": self._materials,
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._bytes), "uri": uri}],
        }
        if self._images:
            document["images"] = [{"uri": name} for name in self._images]
            document["textures"] = [{"source": k, "sampler": 0} for k in range(len(self._images))]
            document["samplers"] = [{"wrapS": _CLAMP, "wrapT": _CLAMP}]
        return document


def _unit(vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    fallback = np.array([0.0, 0.0, 1.0], dtype=np.float32)
    return np.asarray(np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), fallback), dtype=np.float32)
