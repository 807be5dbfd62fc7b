"""A request that was understood, ready to be checked, shown and run."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from executive.app.placed_robots import PlacedRobot
from executive.mission.request import Request
from executive.tree.compiler import CompiledTree, compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import Knowledge
from executive.words.mission import Mission
from executive.words.yaml_steps import lines_of_steps
from plant.worlds.world import World
from skills.robot import Pose2D

if TYPE_CHECKING:
    from executive.language.understand import Understanding


@dataclass(frozen=True)
class Prepared:
    """A request that was understood: its mission, compiled, the world that it runs in, and what is known of that.

    `meant` is what its sentence means, where it has one. `robots` are all robots of the run by their names.

    In a run with several robots, `others` are what the rest of them do meanwhile; this mission begins when those of
    the robots `after` are done, and whoever asked for it stands at `speaker_W` (None: by this robot).
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

    @property
    def all(self) -> tuple[Prepared, ...]:
        """This, and what the other robots do."""
        return (replace(self, others=()), *self.others)

    @property
    def robot(self) -> PlacedRobot:
        """The robot of this mission."""
        return self.robots[self.mission.robot_name]

    def with_mission(self, mission: Mission) -> Prepared:
        """Another mission in the place of the robot's own. Raises InputError: it cannot be carried out."""
        tree = compile_mission(mission, knowledge=self.knowledge, registry=installed_skills())
        return replace(self, mission=mission, meant=None).with_tree(tree)

    def with_tree(self, tree: CompiledTree) -> Prepared:
        """With a tree: the request gets its name and commands, and a fingerprint that trees of equal nodes share."""
        nodes = "\n".join(f"{node.kind} {node.path_id}" for node in tree.root.walk())
        fingerprint = hashlib.sha256(nodes.encode()).hexdigest()[:16]
        named = replace(
            self.request, name=tree.mission_name, commands=lines_of_steps(tree.steps), fingerprint=fingerprint
        )
        return replace(self, request=named, tree=tree)

    @property
    def several(self) -> bool:
        """Returns whether there are several robots in the run."""
        return len(self.robots) > 1


def together(every: Sequence[Prepared]) -> Prepared:
    """The parts of one request as one, of which the first stands for all."""
    first = every[0].request
    commands = tuple(command for each in every for command in each.request.commands)
    prints = "+".join(each.request.fingerprint for each in every)
    return replace(every[0], request=replace(first, commands=commands, fingerprint=prints), others=tuple(every[1:]))
