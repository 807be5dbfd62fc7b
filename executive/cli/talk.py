"""The conversation beside a run of the command line: how its sentences are parsed and compiled."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace

from executive.cli.feasibility import refuse_impossible
from executive.cli.plugins import usable_skills
from executive.cli.requests import Prepared
from executive.conversation import Conversation, Speech
from executive.language import Understanding, load_parser, understand
from executive.language.reference import Memory
from executive.mission.file.model import MissionStep
from executive.mission.mission import mission_from_steps
from executive.run.control import Control
from executive.tree.compiler import CompiledTree, compile_mission

__all__ = ["conversation_of", "load_ahead"]


def load_ahead() -> None:
    """Begin to load the parser, in a thread of its own."""
    threading.Thread(target=lambda: load_parser().parse("go"), name="errand-parser", daemon=True).start()


def conversation_of(prepared: Prepared, control: Control) -> Conversation:
    """A conversation with the robot of a request, in its world."""
    speech = Speech(
        knowledge=prepared.knowledge,
        robot_name=prepared.mission.robot_name,
        understand=lambda text, memory: _understood(text, memory, prepared),
        compile=lambda steps, taken: _compiled(steps, taken, prepared),
    )
    robot = prepared.knowledge.robot
    return Conversation(speech, control, require_wake=robot.require_wake, others=robot.others)


def _understood(text: str, memory: Memory | None, prepared: Prepared) -> Understanding:
    return understand(
        text,
        parser=load_parser(),
        knowledge=prepared.knowledge,
        require_wake=False,
        robot_name=prepared.mission.robot_name,
        memory=memory,
    )


def _compiled(steps: Sequence[MissionStep], taken: frozenset[str], prepared: Prepared) -> CompiledTree:
    """The tree of a mission of these steps, under a name that is not taken. Raises InputError, as `check` does."""
    mission = mission_from_steps(steps, world=prepared.world.name, robot_name=prepared.mission.robot_name)
    names = (mission.name, *(f"{mission.name} {number}" for number in range(2, len(taken) + 3)))
    name = next(each for each in names if each not in taken)
    tree = compile_mission(replace(mission, name=name), knowledge=prepared.knowledge, registry=usable_skills())
    refuse_impossible(replace(prepared, tree=tree))
    return tree
