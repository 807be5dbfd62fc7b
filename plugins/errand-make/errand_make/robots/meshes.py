"""Copies the meshes of a URDF into a package: appearances with their colours, and convex hulls for collisions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np

from errand_make.errors import ObjectImportError
from errand_make.objects.import_object import hull_text, write_appearance
from errand_make.objects.mesh_files import GREY, MeshContent, read_mesh
from plant.robots.urdf_robot.urdf_file import PACKAGE, UrdfFile
from skills.robot import FloatArray

MESHES: Final = "meshes"
_MESH: Final = re.compile(r"""<!--.*?-->|(<mesh\b[^>]*?\bfilename\s*=\s*)(?:"[^"]*"|'[^']*')""", re.DOTALL)


def copy_meshes(urdf: UrdfFile, packages: Mapping[str, Path], folder: Path) -> Iterator[str]:
    """Writes the URDF as `robot.urdf` with its meshes into a folder; yields the name of each mesh before it is read.

    Raises InputError with the line of a mesh that is missing or cannot be read.
    """
    (folder / MESHES).mkdir()
    known = dict[tuple[Path, str, str], str]()
    for link in urdf.links:
        for role in ("visual", "collision"):
            for shape in urdf.shapes(link, role):
                for mesh in shape.iter("mesh"):
                    path = _path(urdf, mesh, packages)
                    colour = shape.find("material/color")
                    key = (path, role, "" if colour is None else colour.get("rgba", ""))
                    if key not in known:
                        yield path.name
                        name = f"{path.stem}_{role}_{len(known)}"
                        known[key] = f"{name}/{name}.obj"
                        _convert(urdf, mesh, path, folder / MESHES / known[key], key[2])
                    mesh.set("filename", f"package://{PACKAGE}/{MESHES}/{known[key]}")
    _write(urdf, folder / "robot.urdf")


def _write(urdf: UrdfFile, path: Path) -> None:
    """Writes the text with the new names of its meshes; lines and comments stay, so that errors name the same lines."""
    names = iter([mesh.get("filename", "") for mesh in urdf.robot.iter("mesh")])
    text = _MESH.sub(lambda found: f'{found[1]}"{next(names)}"' if found[1] else found[0], urdf.text)
    path.write_text(text, encoding="utf-8")


def _path(urdf: UrdfFile, mesh: Element, packages: Mapping[str, Path]) -> Path:
    """File of a mesh. Raises InputError with the line when there is none."""
    name = mesh.get("filename", "")
    package, _, rest = name.removeprefix("package://").partition("/")
    if not name.startswith("package://"):
        path = urdf.path.parent / name.removeprefix("file://")
    elif package in packages:
        path = packages[package] / rest
    else:
        above = (folder / each for folder in urdf.path.resolve().parents for each in (package, "."))
        near = (folder for folder in above if folder.name == package or (folder / "package.xml").is_file())
        path = next((folder / rest for folder in near if (folder / rest).is_file()), Path())
        if path == Path():
            hint = f"give its folder: --package {package}=DIR"
            raise urdf.error(mesh, f"there is no folder of package '{package}' with {rest}", hint)
    if not path.is_file():
        raise urdf.error(mesh, f"there is no mesh {path}", "correct the name, or give the folder by --package NAME=DIR")
    return path


def _convert(urdf: UrdfFile, mesh: Element, path: Path, target: Path, rgba: str) -> None:
    """Writes a mesh as OBJ: its appearance, or its convex hull for collisions. Raises InputError."""
    target.parent.mkdir()
    try:
        content = read_mesh(path)
        if "_collision_" in target.name:
            target.write_text(hull_text(_points(content)), encoding="utf-8")
            return
        patches = content.patches
        if rgba and all(patch.colour == GREY and patch.picture is None for patch in patches):
            red, green, blue, *_ = map(float, rgba.split())
            patches = tuple(replace(patch, colour=(red, green, blue)) for patch in patches)
        write_appearance(target.parent, target.stem, patches)
    except ObjectImportError as error:
        raise urdf.error(mesh, f"{path}: {error.message}", error.hint) from error


def _points(content: MeshContent) -> FloatArray:
    return np.concatenate([patch.triangles.reshape(-1, 3) for patch in content.patches])
