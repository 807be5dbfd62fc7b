"""Replies of a robot in a conversation, and its answers to remarks about the run."""

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from py_trees.common import Status

from executive.language.followups import Remark
from executive.language.grounding import known_line
from executive.language.questions import ClarifyingQuestion
from executive.language.reference import Memory
from executive.language.understand import Understanding
from executive.run.control import Control
from executive.run.control_state import ControlState, Mode, RobotMode
from executive.run.visitor import Progress
from executive.tree.compiler import CompiledTree
from executive.tree.node import Snapshot
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.outlines import distance_m
from executive.words.step import Step
from skills.robot import Pose2D

OVER: Final = "the run is over; begin another with 'errand run'"
NEVER_MIND: Final = "all right, never mind"


@dataclass(frozen=True)
class Speech:
    """Understanding of sentences for one robot.

    `understand` takes a sentence without wake phrase and the memory of earlier sentences. `compile` compiles steps to a
    mission with a name that is not taken, and raises InputError if the mission is impossible.
    """

    knowledge: Knowledge
    robot_name: str
    understand: Callable[[str, Memory | None], Understanding]
    compile: Callable[[Sequence[Step], frozenset[str]], CompiledTree]


class ReplyKind(enum.Enum):
    """Kind of a reply."""

    DONE = "done"  # the robot does it
    ANSWER = "answer"  # it was a question to the robot
    QUESTION = "question"  # the robot asks back
    REFUSED = "refused"  # the robot cannot do it; the text says why
    IGNORED = "ignored"  # the sentence was for another robot


@dataclass(frozen=True)
class Reply:
    """Reply in one line, with the commands that the robot starts or the question that it asks."""

    kind: ReplyKind
    text: str
    commands: tuple[Command, ...] = ()
    question: ClarifyingQuestion | None = None


@dataclass(frozen=True)
class Waiting:
    """Robot's open question about a sentence, which may be answered until `until_s` (s on the robot's clock)."""

    question: ClarifyingQuestion
    sentence: str
    until_s: float


def answer(text: str) -> Reply:
    """Reply that answers a question."""
    return Reply(ReplyKind.ANSWER, text)


def confirmation(text: str) -> Reply:
    """Reply that says what the robot does."""
    return Reply(ReplyKind.DONE, text)


def refusal(text: str) -> Reply:
    """Reply that says why the robot refuses."""
    return Reply(ReplyKind.REFUSED, text)


NEAR_M: Final = 1.3
"""Largest distance (m) from a surface at which the robot stands next to it."""
IN_THE_ROOM_M: Final = 0.3
"""Largest distance (m) outside a room's outline that still counts as inside: walls have a thickness."""
_STOP_REASON: Final = "told to stop"
_HELD: Final = frozenset({Mode.PAUSED, Mode.STEPPING, Mode.STOPPED, Mode.LEASE_LOST})


class RemarkAnswers:
    """Handler of remarks: stops, pauses, resumes or cancels the robot, and describes its place and work.

    A remark concerns the addressed robot. `progress` is the latest progress of the run.
    """

    def __init__(self, speech: Speech, control: Control) -> None:
        self._speech, self._control = speech, control
        self.progress: Progress | None = None
        self._answers: Mapping[Remark, Callable[[], Reply]] = MappingProxyType(
            {
                Remark.FREEZE: self._stop,
                Remark.STOP: self._stop,
                Remark.ENOUGH: lambda: answer("all right"),
                Remark.WAIT: self._wait,
                Remark.GO_ON: self._go_on,
                Remark.CANCEL: self._cancel,
                Remark.WHERE: self._where,
                Remark.DOING: lambda: answer(doing_in_words(self.progress, control.state, speech.robot_name)),
                Remark.ABLE: lambda: answer(known_line(speech.knowledge)),
                Remark.HURRY: lambda: answer("I drive as fast as I may; a mission, a zone and people near me limit it"),
                Remark.THANKS: lambda: answer("you are welcome"),
                Remark.PRAISE: lambda: answer("you are welcome"),
            }
        )

    def answer_to(self, remark: Remark, text: str) -> Reply:
        """Carries out a remark, which was said as `text`, and returns the reply."""
        acts = remark in (Remark.FREEZE, Remark.STOP, Remark.WAIT, Remark.GO_ON, Remark.CANCEL)
        if acts and self._control.state.mode is Mode.ENDED:
            return refusal(OVER)
        ends = remark in (Remark.ENOUGH, Remark.THANKS) or (remark is Remark.STOP and not self._held)
        if ends and self._control.tell(text.strip(), robot=self._speech.robot_name):
            return confirmation("all right, that is done; say 'stop' once more to make me stand still")
        return self._answers[remark]()

    @property
    def _held(self) -> bool:
        """Returns whether a person has ordered the robot to stand still."""
        state = self._control.state
        return state.robots.get(self._speech.robot_name, state).mode in _HELD

    def _stop(self) -> Reply:
        self._control.stop_button(_STOP_REASON, robot=self._one)
        return confirmation("I stand still; say 'go on' when I may move again")

    def _wait(self) -> Reply:
        self._control.pause("told to wait", robot=self._one)
        return confirmation("I wait; say 'go on' when I may go on")

    def _go_on(self) -> Reply:
        state, one = self._control.state, self._one
        now = RobotMode(state.mode, state.reason) if one is None else state.robots[one]
        if now.mode is Mode.STOPPED and now.reason != _STOP_REASON:
            return refusal(f"{now.reason}; release it where it was pressed")
        held = now.mode in (Mode.STOPPED, Mode.PAUSED, Mode.STEPPING)
        self._control.release_stop_button(robot=one)
        self._control.resume(robot=one)
        if one is not None and (still := self._control.state.robots[one]).mode in (Mode.STOPPED, Mode.PAUSED):
            return refusal(f"{still.reason}, as all robots are; say so to all of them")
        return confirmation("I go on" if held else "I am under way")

    def _cancel(self) -> Reply:
        self._control.cancel("told to cancel", robot=self._one)
        return confirmation("I give it up and stop")

    @property
    def _one(self) -> str | None:
        """Name of the robot if the run has several robots; None if it has one."""
        return self._speech.robot_name if len(self._control.state.missions) > 1 else None

    def _where(self) -> Reply:
        status = None if self.progress is None else self.progress.robots.get(self._speech.robot_name)
        if status is None:
            return answer("I do not know yet; the run has not begun")
        return answer(place_in_words(status.pose, self._speech.knowledge))


def place_in_words(pose: Pose2D | None, knowledge: Knowledge) -> str:
    """Room that contains a pose (world frame), and the surface beside the pose, in words; None means not localised."""
    if pose is None:
        return "I do not know where I am; I am looking for my place"
    here = (pose.x_m, pose.y_m)
    distances = {name: distance_m(outline, here) for name, outline in knowledge.rooms.items()}
    room = min(distances, key=lambda name: distances[name], default=None)
    if room is None:
        return f"I am at x {pose.x_m:.1f} m, y {pose.y_m:.1f} m"
    beside = {name: distance_m(knowledge.surfaces[name].polygon, here) for name in knowledge.surfaces_in(room)}
    nearest = min(beside, key=lambda name: beside[name], default=None)
    inside = f"in the {room}" if distances[room] <= IN_THE_ROOM_M else f"{distances[room]:.1f} m from the {room}"
    at = f", next to the {nearest}" if nearest is not None and beside[nearest] <= NEAR_M else ""
    return f"I am {inside}{at}"


def doing_in_words(progress: Progress | None, state: ControlState, robot_name: str) -> str:
    """Robot's mission and step in words, with the reason if the robot stands still."""
    if state.mode is Mode.ENDED:
        return "I have nothing to do; the mission is over"
    tree = None if progress is None else progress.trees.get(robot_name)
    if progress is None or tree is None:
        return "I have not begun yet"
    states = progress.states[robot_name]
    own = {path_id: states[path_id] for path_id in tree.path_ids if path_id in states}
    said = f"I am busy with '{tree.mission_name}'{_step(own)}"
    own_mode = state.robots.get(robot_name, state)
    if own_mode.mode in _HELD:
        said = f"I stand still ({own_mode.reason}); then I go on with '{tree.mission_name}'{_step(own)}"
    asked = "".join(f"; I have asked: {each.question.text}" for each in state.questions)
    trouble = _last_failure(own)
    return f"{said}{f'; before, {trouble}' if trouble else ''}{asked}"


def _step(states: Snapshot) -> str:
    """Deepest running node, with the node's message."""
    running = [(path_id, node) for path_id, node in states.items() if node.status is Status.RUNNING]
    if not running:
        return ""
    path_id, node = running[-1]
    how_far = f" ({100 * node.progress:.0f} %)" if node.progress else ""
    return f": {_name(path_id)}{f', {node.message}' if node.message else ''}{how_far}"


def _last_failure(states: Snapshot) -> str:
    """Last skill that failed, with cause and message."""
    for path_id, node in reversed([*states.items()]):
        if node.status is Status.FAILURE and node.cause is not None and node.message:
            return f"{_name(path_id)} failed ({node.cause.value}: {node.message})"
    return ""


def _name(path_id: str) -> str:
    """Last part of a path id, written as words."""
    return path_id.rpartition("/")[2].replace("-", " ").replace("_", " ")
