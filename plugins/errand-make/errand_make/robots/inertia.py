"""Masses of links that no body has: repaired where a link is fixed, refused where a joint of the robot moves it."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np

from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfFile
from skills.inputs.errors import listing
from skills.robot import FloatArray

_AXES: Final = ("xx", "yy", "zz", "xy", "xz", "yz")
_LEAST_SIDE_M: Final = 0.02


def repair_masses(tree: KinematicTree, driven: Collection[str]) -> str:
    """Gives fixed links with impossible moments those of a box; returns a note that lists them, or "".

    `driven` are the names of the joints that parts of the robot drive. Raises InputError for a link behind one of them.
    """
    urdf = tree.urdf
    moving = {urdf.joints[name].child for name in driven}
    repaired = list[str]()
    for link, element in urdf.links.items():
        inertial = element.find("inertial")
        if inertial is None or not _impossible(urdf, inertial):
            continue
        (mass_kg,) = urdf.numbers(inertial.find("mass"), "value", "0")
        moments = box_moments(mass_kg, tree.local_points(link))
        if link in moving:
            what = f"link {link} moves, and its moments of inertia are those of no body"
            words = " ".join(f'i{axes}="{moments[axes]:.3g}"' for axes in _AXES)
            raise urdf.error(inertial, what, f"write for example those of its box: <inertia {words}/>")
        repaired.append(link)
        inertia, mass = inertial.find("inertia"), inertial.find("mass")
        if mass_kg > 0.0 and inertia is not None:
            for axes in _AXES:
                inertia.set(f"i{axes}", f"{moments[axes]:.6g}")
        elif mass is not None:
            mass.set("value", "0")
    if not repaired:
        return ""
    which = f"link{'s' * (len(repaired) > 1)} {listing(repaired)}"
    return f"{which}: no body has these moments of inertia; fixed links have those of their box instead"


def _impossible(urdf: UrdfFile, inertial: Element) -> bool:
    """True for moments that the plant refuses."""
    (mass_kg,) = urdf.numbers(inertial.find("mass"), "value", "0")
    inertia = inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (urdf.numbers(inertia, f"i{axes}", "0")[0] for axes in _AXES)
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass_kg < 0.0 or (mass_kg > 0.0 and not (0.0 < high <= (low + middle) * (1.0 + 1e-6)))


def box_moments(mass_kg: float, points: FloatArray) -> dict[str, float]:
    """Moments (kg m^2) of a box about points (N, 3), by axes such as "xx"."""
    size_m = np.maximum(np.ptp(points, axis=0) if len(points) else np.zeros(3), _LEAST_SIDE_M)
    x, y, z = (size_m**2).tolist()
    whole = {"xx": y + z, "yy": x + z, "zz": x + y}
    return {axes: mass_kg / 12.0 * whole.get(axes, 0.0) for axes in _AXES}
