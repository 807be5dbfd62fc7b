"""Moving another object aside that stands in the way of the one to be taken, on the surface where it stands."""

from __future__ import annotations

from typing import Final

from executive.tree.behaviours.board import FromBoard
from executive.tree.compiling.builder import PlanBuilder
from executive.tree.node import NodeSpec
from executive.words.command import Thing
from skills.api import Cause, Surface

SETTLE_S: Final = 0.5


def can_move_aside(builder: PlanBuilder) -> bool:
    """Whether the mission allows it, and the skills tell what is in the way and can be told where not to put it."""
    told = builder.has_ports("grasp", (), ("in_the_way",)) and builder.has_ports("place", ("clear_of",))
    return builder.move_aside > 0 and told


def move_aside_plan(
    below: PlanBuilder,
    thing: Thing,
    wanted: str,
    blocking: str,
    surfaces: tuple[Surface, ...] | FromBoard,
    tuck: NodeSpec,
) -> NodeSpec:
    """Take the first object under the key `blocking`, and put it where it is not in the way of the one under `wanted`.

    `tuck` draws the arm in between. What finds no room there is set down again anywhere on its surface, so that the
    gripper is free. In the end the robot goes back to where it stood, since from there a grasp was found without it.
    """
    obstacle, surface, clear, pose = map(below.key, ("obstacle", "surface", "clear", "pose"))
    what = below.node(
        "in the way",
        f"what is in the way of the {thing}?",
        part="what",
        thing=str(thing),
        blocking_key=blocking,
        wanted_key=wanted,
        obstacle_key=obstacle,
        surface_key=surface,
        clear_key=clear,
        pose_key=pose,
        surfaces=tuple(map(below.surface, below.knowledge.surfaces)),
    )
    before = below.skill(
        "approach", {"observation": FromBoard(obstacle), "surfaces": surfaces}, {"observation": obstacle}
    )
    stay = below.pause("stay", "take it from here", SETTLE_S)
    put = below.skill("place", {"surface": FromBoard(surface), "clear_of": FromBoard(clear)})
    back = below.at("back").skill("place", {"surface": FromBoard(surface)})
    near = below.node("selector", "stand before it, or stay", before, stay, part="near")
    grasp = below.skill("grasp", {"observation": FromBoard(obstacle)})
    take = below.node("sequence", "take it", near, grasp, part="take")
    causes = frozenset({Cause.EXECUTION, Cause.POSTCONDITION})
    twice = below.node("retry", "take it, twice if need be", take, part="twice", attempts=2, causes=causes)
    there = below.navigate(FromBoard(pose), "where it stood", exactly=True)
    here = below.pause("here", "go on from here", SETTLE_S)
    return below.sequence(
        "move it aside",
        what,
        twice,
        tuck,
        below.node(
            "afterwards", "set it down again if there is no room", put, back, part="put", only_after_failure=True
        ),
        below.node("selector", "go back to where it stood, or go on from here", there, here, part="there"),
    )
