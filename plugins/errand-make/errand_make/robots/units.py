"""Units of a maker's URDF that are not those of URDF: degrees, grams and millimetres."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Final

import numpy as np

from errand_make.robots.checks import LONGEST_SLIDE_M
from errand_make.robots.inertia import link_mass_kg
from errand_make.robots.tree import KinematicTree
from plant.robots.urdf_robot.urdf_file import UrdfFile, UrdfJoint
from skills.inputs.errors import listing

_LARGEST_M: Final = 10.0
_LEAST_M: Final = 1e-3
"""Size that a shape gets instead of 0, as placeholders have it."""
_FURTHEST_RAD: Final = 4.0 * math.pi + 0.1
"""Largest limit of a joint that turns, two turns; larger ones are of joints without limits, or in degrees."""
_MOST_DEGREES: Final = 720.0
_TURN_RAD: Final = math.tau + 0.1
_DENSEST_KG_M3: Final = 25_000.0
"""More than the density of any matter."""
_HEAVY_KG: Final = 50.0
"""Mass from which a small shape of a link is no reason for its density."""
_HEAVIEST_KG: Final = 2000.0


def check_extent(urdf: UrdfFile) -> list[str]:
    """Gives primitive shapes of size 0 a millimetre; returns notes on their links.

    Raises InputError for a link that stands, or a primitive shape that reaches, too far for a robot in metres, and for
    a negative size. The pose of the whole robot in a world, on a root without shapes, does not count.
    """
    empty = not urdf.shapes(urdf.root, "visual") and not urdf.shapes(urdf.root, "collision")
    for joint in urdf.joints.values():
        far_m = float(np.abs(joint.X_PF.translation()).max())
        if far_m > _LARGEST_M and not (empty and joint.parent == urdf.root):
            what = f"joint {joint.name} is {far_m:g} m from {joint.parent}: its unit is probably the millimetre"
            raise urdf.error(joint.line, what, "write metres")
    sizes = (
        ("box", "size", "0 0 0"),
        ("cylinder", "length", "0"),
        ("cylinder", "radius", "0"),
        ("sphere", "radius", "0"),
    )
    empty_links = dict[str, None]()
    for link, element in urdf.links.items():
        for tag, key, default in sizes:
            for shape in element.iter(tag):
                sizes_m = urdf.numbers(shape, key, default)
                largest_m = max(sizes_m)
                if min(sizes_m) < 0.0:
                    raise urdf.error(shape, f"link {link} has a {tag} of {min(sizes_m):g} m", "write its size, above 0")
                if min(sizes_m) == 0.0:
                    shape.set(key, " ".join(f"{max(each, _LEAST_M):g}" for each in sizes_m))
                    empty_links[link] = None
                if largest_m > _LARGEST_M:
                    what = f"link {link} has a {tag} of {largest_m:g} m: its unit is probably the millimetre"
                    raise urdf.error(shape, what, "write metres, or remove what is no part of the robot")
    one = len(empty_links) == 1
    what = f"link{'s' * (not one)} {listing(list(empty_links))}: shapes of size 0 are taken as of 1 mm"
    return [what] if empty_links else []


def unit_notes(tree: KinematicTree, wheels: Collection[str]) -> Iterator[str]:
    """Notes on joints that are probably in degrees or millimetres, and links that are probably in grams."""
    urdf = tree.urdf
    moving = [each for each in tree.joint_of.values() if each.child not in wheels]
    degrees = [each for each in moving if each.kind == "revolute" and _FURTHEST_RAD < _limit(each) <= _MOST_DEGREES]
    if degrees:
        first = degrees[0]
        what = f"{_listed('joint', degrees)}: limits of {first.lower:g} to {first.upper:g} rad are probably degrees"
        yield f"{what}; write radians"
    slides = [each for each in moving if each.kind == "prismatic" and _limit(each) > LONGEST_SLIDE_M]
    if slides:
        first = slides[0]
        what = f"{_listed('joint', slides)}: limits of {first.lower:g} to {first.upper:g} m are probably millimetres"
        yield f"{what}; write metres"
    for element in urdf.robot.iter("origin"):
        turned = [each for each in urdf.numbers(element, "rpy", "0 0 0") if abs(each) > _TURN_RAD]
        if turned:
            yield f"line {element.get('line')}: rpy of {turned[0]:g} rad is probably in degrees; write radians"
            break
    masses_kg = {link: link_mass_kg(urdf, link) for link in urdf.links}
    heavy = [link for link, mass in masses_kg.items() if mass > _HEAVIEST_KG or _is_dense(tree, link, mass)]
    if heavy:
        largest = max(heavy, key=masses_kg.__getitem__)
        mass_kg = masses_kg[largest]
        why = "probably grams; write kilograms" if mass_kg > _HEAVIEST_KG else "too much for its shapes; check both"
        yield f"link {largest} weighs {mass_kg:g} kg, {why}"


def _limit(joint: UrdfJoint) -> float:
    """Larger of a joint's limits, without signs; 0 for one that is not finite."""
    largest = max(abs(joint.lower), abs(joint.upper))
    return largest if math.isfinite(largest) else 0.0


def _listed(word: str, joints: list[UrdfJoint]) -> str:
    return f"{word}{'s' * (len(joints) > 1)} {listing([each.name for each in joints])}"


def _is_dense(tree: KinematicTree, link: str, mass: float) -> bool:
    """True for a heavy link that is denser than any matter in the box about its shapes."""
    points = tree.local_points(link)
    volume_m3 = float(np.ptp(points, axis=0).prod()) if len(points) else 0.0
    return mass > _HEAVY_KG and 0.0 < volume_m3 < mass / _DENSEST_KG_M3
