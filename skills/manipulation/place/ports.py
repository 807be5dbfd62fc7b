"""Ports of the place skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Skill, Surface
from skills.quantities import Coordinate, Height, Length


@dataclass(frozen=True)
class PlaceInputs:
    """Surface to put the object on.

    The object's centre comes to rest in none of the circles `clear_of` (x, y, radius) of the world.
    """

    surface: Surface
    clear_of: tuple[tuple[Coordinate, Coordinate, Length], ...] = ()


class PlacePorts(Skill[PlaceInputs]):
    """Puts the held object down on a surface and stows the arm. Goes nearer when no free spot is within reach.

    The output `released_W` is where the hand has let the object go, also after a failure; a failure before has none.
    """

    done_by: ClassVar[str] = "skills.manipulation.place.skill:Place"
    name = "place"
    Inputs = PlaceInputs
    outputs: ClassVar[Mapping[str, type]] = {"released_W": tuple[Coordinate, Coordinate, Height]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held",
        Cause.PLANNING: "no free spot of the surface is seen within reach, or the arm finds no path to it",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "it was let go and is not seen at rest where it was put down, or is still in the gripper",
    }
    default_timeout_s = 240.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False
