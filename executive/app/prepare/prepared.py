"""Prepared request: understood and compiled, and ready to be checked and run."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from executive.app.prepare.placed_robots import reported_classes
from executive.mission.request import TIME_LIMIT_S, Request
from executive.tree.board import LastKnown
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import Knowledge
from executive.words.mission import Mission
from executive.words.steps import lines_of_steps
from plant.robots.robot_kind import PlacedRobot
from plant.worlds.world import World
from skills.quantities import clock_s
from skills.robot import Pose2D

if TYPE_CHECKING:
    from executive.language.understand import Understanding


@dataclass(frozen=True)
class Prepared:
    """Compiled request with its mission, world and knowledge.

    `meant` is the meaning of the sentence, if the request has a sentence. `robots` are all robots of the run by name.

    In a run with several robots, `others` are the missions of the other robots. This mission begins when the missions
    of the robots `after` have ended. The speaker stands at `speaker_W` (None: beside this robot). `last_known` is where
    another robot last knew the mission's object.
    """

    request: Request
    mission: Mission
    world: World
    knowledge: Knowledge
    tree: CompiledTree
    robots: Mapping[str, PlacedRobot]
    meant: Understanding | None = None
    others: tuple[Prepared, ...] = ()
    after: tuple[str, ...] = ()
    speaker_W: Pose2D | None = None
    last_known: LastKnown | None = None

    @property
    def all(self) -> tuple[Prepared, ...]:
        """The missions of all robots, this one first."""
        return (replace(self, others=()), *self.others)

    @property
    def robot(self) -> PlacedRobot:
        """The robot of this mission."""
        return self.robots[self.mission.robot_name]

    def with_mission(self, mission: Mission) -> Prepared:
        """Compiles another mission in place of this one. Raises InputError if it cannot be compiled."""
        tree = compile_mission(
            mission,
            knowledge=self.knowledge,
            registry=installed_skills(),
            last_known=self.last_known,
            reported=reported_classes(self.robot),
        )
        return replace(self, mission=mission, meant=None).with_tree(tree)

    def with_tree(self, tree: CompiledTree) -> Prepared:
        """Returns a copy with another tree, whose name, commands and fingerprint go into the request."""
        nodes = "\n".join(f"{node.kind} {node.path_id}" for node in tree.root.walk())
        fingerprint = hashlib.sha256(nodes.encode()).hexdigest()[:16]
        named = replace(
            self.request, name=tree.mission_name, commands=lines_of_steps(tree.steps), fingerprint=fingerprint
        )
        return replace(self, request=named, tree=tree)

    @property
    def time_limit_s(self) -> float:
        """Time limit of the run (s): the given one, else `TIME_LIMIT_S` beyond the waits of which its missions tell."""
        if self.request.time_limit_s is not None:
            return self.request.time_limit_s
        begin_s = clock_s(self.request.time_of_day or time.strftime("%H:%M"))
        roots = [each.tree.root for each in self.all]
        return TIME_LIMIT_S + max(root.behaviour.waiting_s(root, begin_s) for root in roots)

    @property
    def several(self) -> bool:
        """True if the run has several robots."""
        return len(self.robots) > 1


def combine(every: Sequence[Prepared]) -> Prepared:
    """Combines the missions of several robots into one object: the first mission, with the rest as its `others`."""
    first = every[0].request
    commands = tuple(command for each in every for command in each.request.commands)
    prints = "+".join(each.request.fingerprint for each in every)
    return replace(every[0], request=replace(first, commands=commands, fingerprint=prints), others=tuple(every[1:]))
