"""Context that the running nodes of one robot's tree share."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Final

from py_trees.behaviour import Behaviour

from executive.tree.behaviour import Hook
from executive.tree.board import Board
from skills.api import Part, Skill, SkillContext
from skills.robot import Pose2D
from skills.world_model import ExcludesRobots

ANSWER_TOPIC: Final = "answer"
DAY_S: Final = 86_400.0


def time_ahead_s(clock_s: float, now_s: float) -> float:
    """Time from now until a time of day, in s; both are s after midnight; 0 if it passed at most 12 hours ago."""
    return ahead_s if (ahead_s := (clock_s - now_s) % DAY_S) <= DAY_S / 2 else 0.0


def leaf_seed(run_seed: int, path_id: str) -> int:
    """Derives a 32-bit seed from the run's seed and a path id; the same on every machine."""
    digest = hashlib.sha256(f"{run_seed}:{path_id}".encode()).digest()
    return int.from_bytes(digest[:4], "big")


class Endings:
    """Queue of steps under `always` that the run must still execute after their nodes were stopped from outside.

    The run takes these steps over, and ticks them before anything else.
    """

    def __init__(self) -> None:
        self._due: list[Behaviour] = []
        self._closed = False

    @property
    def due(self) -> Behaviour | None:
        """Node to be ticked now; None when the queue is empty."""
        return self._due[0] if self._due else None

    def take(self, node: Behaviour) -> bool:
        """Accepts a node, which may be in the middle of its work; returns False after `close`."""
        if not self._closed:
            self._due.append(node)
        return not self._closed

    def has(self, node: Behaviour) -> bool:
        """Returns whether a node was taken over and has not ended yet."""
        return any(each is node for each in self._due)

    def pop(self) -> None:
        """Removes the first node, which has ended."""
        self._due.pop(0)

    def close(self) -> tuple[Behaviour, ...]:
        """Closes the queue; returns the nodes that were still due."""
        left, self._due, self._closed = tuple(self._due), [], True
        return left


@dataclass
class ArmOrder:
    """State of the arm between skills: `anywhere` after a skill that failed, was stopped, or leaves it extended."""

    anywhere: bool = False

    def note_end(self, skill: type[Skill[Any]], *, succeeded: bool) -> None:
        """Records the end of a skill: only the success of a skill for the arm alone leaves the arm in a known pose."""
        if Part.ARM in skill.uses:
            self.anywhere = not succeeded or Part.BASE in skill.uses


@dataclass(frozen=True, kw_only=True)
class RunContext(SkillContext):
    """Context of all nodes of a robot's tree: the context of skills, the blackboard, the stop button.

    `seed` is the seed of the run. `stop_pressed` returns why nothing may move while a stop button is pressed, else
    None. `presses` counts the presses of each button. `day_began_s` is the time of day (s after midnight) at clock 0.
    """

    board: Board
    stop_pressed: Callable[[], str | None] = lambda: None
    presses: Callable[[], Mapping[str, int]] = dict
    day_began_s: float = 0.0
    endings: Endings = field(default_factory=Endings)
    hook: Hook = field(default_factory=Hook)
    arm_order: ArmOrder = field(default_factory=ArmOrder)

    @cached_property
    def robot_excluders(self) -> tuple[ExcludesRobots, ...]:
        """Estimators that can exclude readings of other robots, whose poses are known."""
        return tuple(each for each in (self.localiser, self.costmap) if isinstance(each, ExcludesRobots))

    def known_pose(self) -> Pose2D | None:
        """Returns the robot's estimated pose, the planar part of X_WB; None while it is not localised."""
        return self.pose() if self.localiser.estimate().localised else None

    def for_skill(self, path_id: str) -> SkillContext:
        """Returns those parts of the context that a skill may use, with a seed of the skill's own."""
        lent = {each.name: getattr(self, each.name) for each in fields(SkillContext)}
        blank = {"node": path_id, "question": "", "answer": None, "message": ""}

        def publish(topic: str, message: Mapping[str, Any]) -> None:
            self.publish(topic, {**blank, **message} if topic == ANSWER_TOPIC else message)

        return SkillContext(**{**lent, "seed": leaf_seed(self.seed, path_id), "publish": publish})
