"""Masses of links that no body has: repaired where a link is fixed, refused where a joint of the robot moves it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np

from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfFile
from skills.inputs.errors import listing
from skills.robot import FloatArray

_AXES: Final = ("xx", "yy", "zz", "xy", "xz", "yz")
_LEAST_SIDE_M: Final = 0.02
_LEAST_KG: Final = 1e-6
_LEAST_MOMENT: Final = 1e-12
"""Mass (kg) and moment (kg m^2) of a driven body up to which they are no measured ones."""


def repair_masses(tree: KinematicTree, driven: Collection[str], wheels: Collection[str] = ()) -> list[str]:
    """Gives fixed links with impossible moments those of a box; returns notes that list them and links without mass.

    `driven` are the names of the joints that parts of the robot drive, `wheels` the links of the wheels.
    Raises InputError for a link behind one of these joints, and for a negative mass.
    """
    urdf = tree.urdf
    moving = {urdf.joints[name].child for name in driven}
    _refuse_tiny(tree, moving)
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
    notes = list[str]()
    if repaired:
        what = "no body has these moments of inertia; fixed links have those of their box instead"
        notes.append(f"{_links(repaired)}: {what}")
    massless = [link for link in _base_link(tree) if not link_mass_kg(urdf, link)]
    massless += [each for each in wheels if not any(link_mass_kg(urdf, link) for link in tree.links_of[each])]
    if massless:
        what = "no mass in the file, so the robot is too light in simulation; write <inertial> with mass and inertia"
        notes.append(f"{_links(massless)}: {what}")
    return notes


def _links(names: Sequence[str]) -> str:
    return f"link{'s' * (len(names) > 1)} {listing(list(names))}"


def _base_link(tree: KinematicTree) -> list[str]:
    """The link of the base's body whose shapes are the largest; none without shapes."""
    sizes = {
        link: float(np.ptp(points, axis=0).prod())
        for link in tree.links_of[tree.root]
        if len(points := tree.local_points(link))
    }
    return [max(sizes, key=sizes.__getitem__)] if sizes else []


def link_mass_kg(urdf: UrdfFile, link: str) -> float:
    """Mass of a link, 0 without one. Raises InputError for a negative mass."""
    inertial = urdf.links[link].find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    (mass_kg,) = urdf.numbers(mass, "value", "0")
    if mass is not None and mass_kg < 0.0:
        raise urdf.error(mass, f"link {link} has a negative mass of {mass_kg:g} kg", "write its mass, above 0")
    return mass_kg


def _refuse_tiny(tree: KinematicTree, moving: Collection[str]) -> None:
    """Raises InputError for a negative mass, and for a driven body that is too light to be simulated."""
    urdf = tree.urdf
    masses_kg = {link: link_mass_kg(urdf, link) for link in urdf.links}
    for body in (body for body in tree.links_of if body in moving):
        heavy = [link for link in tree.links_of[body] if masses_kg[link] > 0.0]
        if not heavy:
            continue
        whole_kg = sum(masses_kg[link] for link in heavy)
        inertial = urdf.links[heavy[0]].find("inertial")
        assert inertial is not None
        largest = float(_principal_moments(urdf, inertial)[-1])
        what = f"weighs {whole_kg:g} kg" if whole_kg <= _LEAST_KG else ""
        if not what and len(heavy) == 1 and 0.0 < largest <= _LEAST_MOMENT:
            what = f"has moments of inertia of {largest:g} kg m^2"
        if what:
            hint = "write its mass in kg, and its moments in kg m^2"
            raise urdf.error(inertial, f"link {heavy[0]} moves, and {what}, which no part of a robot has", hint)


def _impossible(urdf: UrdfFile, inertial: Element) -> bool:
    """True for moments that the plant refuses."""
    (mass_kg,) = urdf.numbers(inertial.find("mass"), "value", "0")
    low, middle, high = _principal_moments(urdf, inertial)
    return mass_kg > 0.0 and not (0.0 < high <= (low + middle) * (1.0 + 1e-6))


def _principal_moments(urdf: UrdfFile, inertial: Element) -> FloatArray:
    """Principal moments (3,) of an element, the smallest first (kg m^2)."""
    inertia = inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (urdf.numbers(inertia, f"i{axes}", "0")[0] for axes in _AXES)
    return np.asarray(np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def box_moments(mass_kg: float, points: FloatArray) -> dict[str, float]:
    """Moments (kg m^2) of a box about points (N, 3), by axes such as "xx"."""
    size_m = np.maximum(np.ptp(points, axis=0) if len(points) else np.zeros(3), _LEAST_SIDE_M)
    x, y, z = (size_m**2).tolist()
    whole = {"xx": y + z, "yy": x + z, "zz": x + y}
    return {axes: mass_kg / 12.0 * whole.get(axes, 0.0) for axes in _AXES}
