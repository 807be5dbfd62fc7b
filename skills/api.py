"""Interface of a skill. The project's skills and those of others import only this module and `skills.robot`.

`skills.robot.quantities` has the port types that carry a range.

A skill is a plain object with the lifecycle `begin -> step, step, ... -> end`. It never blocks, sleeps or ticks. One
leaf of the executive wraps each skill, turns exceptions into failures with cause ERROR, and calls `end` on every exit.
"""

from __future__ import annotations

import enum
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Final, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from skills.detection import NO_DETECTOR
from skills.detection import Detection as Detection
from skills.detection import Detector as Detector
from skills.doorway import DoorMemory, Doorway
from skills.robot import Capabilities, Clock, Image, Lease, Picture, Pose2D, Robot
from skills.stack import RobotStack, default_stack
from skills.world_model import FLOOR as FLOOR
from skills.world_model import NO_TRAFFIC, NO_WORK_COUNTER, Traffic, WorkCounter
from skills.world_model import ClearableCostmap as ClearableCostmap
from skills.world_model import Costmap as Costmap
from skills.world_model import FilterType as FilterType
from skills.world_model import FreeSpace as FreeSpace
from skills.world_model import LocalisationEstimate as LocalisationEstimate
from skills.world_model import Localiser as Localiser
from skills.world_model import ObjectKind as ObjectKind
from skills.world_model import ObjectObservation as ObjectObservation
from skills.world_model import ObstacleLayerView as ObstacleLayerView
from skills.world_model import ParticleView as ParticleView
from skills.world_model import PlanningError as PlanningError
from skills.world_model import ReturnsView as ReturnsView
from skills.world_model import SearchingLocaliser as SearchingLocaliser
from skills.world_model import Surface as Surface
from skills.world_model import SurveyView as SurveyView
from skills.world_model import Tag as Tag
from skills.world_model import Zone as Zone
from skills.world_model import ZoneKind as ZoneKind
from skills.world_model import ZoneMask as ZoneMask

if TYPE_CHECKING:
    from pydrake.math import RigidTransform, RotationMatrix

    from skills.zone_map import ZoneMap

ResultT = TypeVar("ResultT")
ReadT = TypeVar("ReadT")
ResultT_co = TypeVar("ResultT_co", covariant=True)
InputsT = TypeVar("InputsT")


class Cause(enum.Enum):
    """Cause of a failure. The cause selects the recovery."""

    PRECONDITION = "PRECONDITION"  # it could not begin in the present state
    PLANNING = "PLANNING"  # no path, grasp or plan was found
    EXECUTION = "EXECUTION"  # the motion did not go as planned
    POSTCONDITION = "POSTCONDITION"  # it was done, and the check afterwards says no
    TIMEOUT = "TIMEOUT"  # the robot's clock ran past the limit
    CANCELLED = "CANCELLED"  # somebody stopped it
    ERROR = "ERROR"  # a defect: an exception, a hung verb


@dataclass(frozen=True)
class Running:
    """State of an unfinished skill: one plain sentence on its activity, and progress from 0 to 1 where known."""

    message: str
    progress: float | None = None


@dataclass(frozen=True)
class Succeeded:
    """Success. `outputs` are the skill's output ports by name."""

    message: str
    outputs: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Failed:
    """Failure: the cause and one plain sentence.

    `outputs` may fill output ports of the skill, for the next attempt. A failure is `final` when another attempt from
    the same state would fail in the same way: then the tree tries no recovery and no pose nearby.
    """

    cause: Cause
    message: str
    outputs: Mapping[str, Any] = field(default_factory=dict)
    final: bool = False


Step = Running | Succeeded | Failed


class Job(Protocol[ResultT_co]):
    """Job of the Worker."""

    def done(self) -> bool:
        """Returns whether the result may be read."""

    def result(self) -> ResultT_co:
        """Returns the result. Raises the job's exception, or RuntimeError before the job is done."""

    def withdraw(self) -> None:
        """Drops the job: nobody waits for its result. Idempotent."""


class Worker(Protocol):
    """Runs long jobs in the background, one after the other, in the order in which they are submitted.

    A job may use only inputs that were read before: no robot, clock, estimator or costmap. It changes nothing that a
    tick uses. In lock-step the result appears after `latency_s` on the robot's clock.
    """

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """Starts `work`, which takes latency_s on the robot's clock."""

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """Starts `work` on the value of `read`, which in lock-step runs at once; `read` may block."""


@dataclass(frozen=True)
class Question:
    """Question to the operator.

    `id` (a path id) is unique among the open questions. With `options`, only an option is an answer. `default` becomes
    the answer when nobody answers within `limit_s` on the robot's clock; it may be empty. The constructor raises
    ValueError when a default that is not empty is none of the options.
    """

    id: str
    text: str
    options: tuple[str, ...]
    default: str
    limit_s: float

    def __post_init__(self) -> None:
        if self.options and self.default and self.default not in self.options:
            raise ValueError(f"question '{self.id}': the default '{self.default}' is none of {list(self.options)}")


Asked = Job[str]
"""Open question to the operator. Its `result` is the answer, or the question's default once the time limit is over."""


class Ask(Protocol):
    """Puts questions to the operator."""

    def __call__(self, question: Question) -> Asked:
        """Asks and returns at once. Raises ValueError when a question with that id is open already."""


@dataclass(frozen=True)
class _Unheard:
    """Open question without an operator: the default is the answer."""

    question: Question

    def done(self) -> bool:
        """Returns True."""
        return True

    def result(self) -> str:
        """Returns the default."""
        return self.question.default

    def withdraw(self) -> None:
        """Does nothing."""


def nobody_to_ask(question: Question) -> Asked:
    """Answers a question with its default at once; serves as an `Ask`."""
    return _Unheard(question)


Listen = Callable[[], Job[str]]
"""Waits for a remark of a person that ends the skill, such as "stop", "thank you" or "we are there".

Returns at once; the job is done when a person has spoken, and its result is the remark. The skill withdraws the job in
`end` and in `suspend`: while no skill waits, "stop" presses the stop button.
"""


@dataclass(frozen=True)
class _Silence:
    """Remark that never comes: the job is never done."""

    def done(self) -> bool:
        """Returns False."""
        return False

    def result(self) -> str:
        """Raises RuntimeError."""
        raise RuntimeError("nobody has spoken")

    def withdraw(self) -> None:
        """Does nothing."""


def nobody_speaks() -> Job[str]:
    """Returns a job that is never done; serves as a `Listen`."""
    return _Silence()


class Publish(Protocol):
    """Writes a message to the event log."""

    def __call__(self, topic: str, message: Mapping[str, Any]) -> None:
        """Logs `message` (JSON-like values; numpy images allowed under key "image") under `topic`."""


PICTURES: Final = "pictures"
"""Topic of the messages that `SkillContext.show_picture` publishes."""
TOUCHES: Final = "touches"
"""Topic of the messages that `SkillContext.expect_touch` publishes."""
SPEECH: Final = "speech"
"""Topic of the messages that `say` publishes."""


@dataclass
class Payload:
    """Object in the gripper, noted by the skill that grasped it.

    `corners_H` is its bounding box as corners (N, 3) in the hand frame (m). `R_BH` is the rotation of the hand when it
    grasped the object, which stood or lay level then. `kind` is the kind of object that the skill was to grasp. A field
    is None while it is unknown, as after a restart. The payload counts only while the gripper holds an object.

    While the payload is `offered`, a person may pull it out of the closed gripper, or a skill may release it; that
    skill verifies who has it.
    """

    corners_H: NDArray[np.float64] | None = None
    R_BH: RotationMatrix | None = None
    kind: ObjectKind | None = None
    offered: bool = False


@dataclass
class SeenSolid:
    """Solid cells (N, 3) near the robot, from its depth images (`skills.manipulation.arm.solid_cells`).

    `views` are the last depth images at a reduced resolution, each with X_WO at its capture time.
    """

    cells: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    views: tuple[tuple[Image, RigidTransform], ...] = ()


@dataclass
class _LastPose:
    """Cache of the last pose, with the two transforms that it was computed from."""

    known: tuple[RigidTransform, RigidTransform, Pose2D] | None = None


@dataclass(frozen=True)
class SkillContext:
    """Robot, estimators and services that a skill may use. `seed` derives from the run's seed and the leaf's path id.

    For the motion of the base, a skill queries `free_space` rather than `costmap`, which ignores the zones.

    `doors` and `zones` are those on the robot's map; `door_memory` has the last known state of each door. `tags` are
    the AprilTags whose poses or carriers the robot knows. `solid_columns` (N, 3) are walls
    and furniture of the map (`skills.manipulation.arm.solid_cells`).
    """

    robot: Robot
    lease: Lease
    clock: Clock
    worker: Worker
    localiser: Localiser
    costmap: Costmap
    publish: Publish
    seed: int
    ask: Ask = nobody_to_ask
    listen: Listen = nobody_speaks
    detector: Detector = NO_DETECTOR
    work: WorkCounter = NO_WORK_COUNTER
    stack: RobotStack = field(default_factory=default_stack)
    payload: Payload = field(default_factory=Payload)
    solid: SeenSolid = field(default_factory=SeenSolid)
    traffic: Traffic = NO_TRAFFIC
    doors: tuple[Doorway, ...] = ()
    door_memory: DoorMemory = field(default_factory=DoorMemory)
    tags: tuple[Tag, ...] = ()
    zones: tuple[Zone, ...] = ()
    solid_columns: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    _last_pose: _LastPose = field(default_factory=_LastPose, repr=False, compare=False)

    def zone_map(self) -> ZoneMap:
        """Returns the zones as layers on the ground. Raises InputError when a mask cannot be read."""
        from skills.zone_map import zone_map

        full_m_s = min(self.robot.capabilities().max_speed_m_s, self.stack.controller.max_speed_m_s)
        return zone_map(self.zones, full_m_s)

    def free_space(self) -> FreeSpace:
        """Returns the costmap with the keep-out zones as obstacles; a robot inside such a zone may still leave it."""
        if not self.zones:
            return self.costmap
        from skills.footprint import Footprint
        from skills.zone_map import KeepOut

        return KeepOut(self.zone_map()).space(self.costmap, Footprint.of(self.robot.capabilities()), self.pose())

    def silent_zone(self) -> str | None:
        """Returns the name of the silent zone in which the robot stands; None when it stands in none."""
        is_any = any(zone.kind is ZoneKind.SILENT for zone in self.zones)
        return next(iter(self.zone_map().names_at(ZoneKind.SILENT, self.pose()) if is_any else ()), None)

    def X_WB(self) -> RigidTransform:
        """Returns the body's estimated pose in the world."""
        return self.localiser.estimate().X_WO @ self.robot.odometry().X_OB

    def show_picture(self, picture: Picture, caption: str, **facts: object) -> None:
        """Puts a picture (RGB or grey, uint8) with its caption and further facts into the log and into the report."""
        self.publish(PICTURES, {"caption": caption, "image": picture, **facts})

    def expect_touch(self, span_s: float) -> None:
        """Says that the fingertips may touch a surface within a time (s); 0 takes that back."""
        self.publish(TOUCHES, {"until_s": round(self.clock.now() + span_s, 6)})

    def pose(self) -> Pose2D:
        """Returns the planar part of X_WB; caches it until the estimate or the odometry changes."""
        X_WO, X_OB = self.localiser.estimate().X_WO, self.robot.odometry().X_OB
        last = self._last_pose.known
        if last is None or last[0] is not X_WO or last[1] is not X_OB:
            last = self._last_pose.known = X_WO, X_OB, Pose2D.from_transform(X_WO @ X_OB)
        return last[2]


def say(context: SkillContext, text: str) -> str | None:
    """Says a text without waiting for its end; in a silent zone only shows it, and returns the zone's name."""
    message = {"robot": context.robot.name, "text": text, "t": round(context.clock.now(), 6)}
    if silent := context.silent_zone():
        message["silent"] = silent
    context.publish(SPEECH, message)
    return silent


@dataclass(frozen=True)
class NoOptions:
    """Options of a skill without options."""


class Part(enum.Enum):
    """Resource of the robot that only one skill at a time may use."""

    BASE = "base"
    ARM = "arm"
    VOICE = "voice"


WHOLE_ROBOT: Final = frozenset({Part.BASE, Part.ARM})


class Skill(ABC, Generic[InputsT]):
    """Base of all skills.

    `Inputs` is a frozen dataclass whose fields are the input ports (defaults allowed). `outputs` maps the name of each
    output port to its type. `causes` says, for each cause, when the skill fails with it. `default_timeout_s` is on the
    robot's clock. `checkpoint` holds, as JSON values, what a later `resume` needs beyond the inputs; the store writes
    it to disk.

    `changes_world` marks a skill that must not run twice: after a restart the tree calls `resume`, which first checks
    what is done. `gripper_before` says whether the gripper must hold an object when the skill begins (True), must be
    empty (False), or either (None). `gripper_after` says whether the gripper holds an object after success; None means
    that the skill does not change this. `uses` are the resources that the skill occupies: skills that share none may
    run in parallel. `needs_camera`: the skill looks with the robot's camera. `Options` is a frozen dataclass with the
    skill's settings in a stack file; every field has a default.

    `max_data_age_s` is the largest age (s) of the data on which a success rests. Its keys are sense verbs (not
    `image`), "localisation", or output ports whose values have a `stamp_s`. A success on older data is a failed
    postcondition.
    """

    name: ClassVar[str]
    Inputs: ClassVar[type]
    outputs: ClassVar[Mapping[str, type]] = {}
    causes: ClassVar[Mapping[Cause, str]] = {}
    default_timeout_s: ClassVar[float] = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {}
    changes_world: ClassVar[bool] = False
    gripper_before: ClassVar[bool | None] = None
    gripper_after: ClassVar[bool | None] = None
    uses: ClassVar[frozenset[Part]] = WHOLE_ROBOT
    needs_camera: ClassVar[bool] = False
    Options: ClassVar[type] = NoOptions
    checkpoint: Mapping[str, Any] = MappingProxyType({})

    def __init__(self, context: SkillContext, options: Any = None) -> None:
        self.context = context
        self.options = options or context.stack.skills.get(self.name) or self.Options()

    @classmethod
    def reached_heights_m(cls, capabilities: Capabilities) -> tuple[float, float]:
        """Heights above the floor of the lowest and the highest surface at which it works; infinite without a limit."""
        return -math.inf, math.inf

    @classmethod
    def refuses(cls, inputs: Mapping[str, Any], capabilities: Capabilities) -> tuple[str, str] | None:
        """Error and hint for constant inputs, by name, with which no robot with these capabilities succeeds."""
        return None

    @abstractmethod
    def begin(self, inputs: InputsT) -> None:
        """Starts an attempt and forgets any earlier one. May not command motion that continues after `end`."""

    @abstractmethod
    def step(self) -> Step:
        """Does one tick's work without blocking."""

    def end(self) -> None:
        """Cleans up on every exit; idempotent. Stops only this skill's own commands (`Robot.stop(only=...)`)."""

    def suspend(self) -> None:
        """Stops this skill's motion and keeps its state, until `resume` or `end` is called.

        The default implementation ends the attempt.
        """
        self.end()

    def resume(self, inputs: InputsT) -> None:
        """Continues after `suspend`. Time has passed, and the robot may have moved.

        After a restart of the executive this is called on a new object in place of `begin`, with the last `checkpoint`
        set. The default implementation begins a new attempt. Override it where a new attempt would undo or repeat
        finished work.
        """
        self.begin(inputs)

    def undone(self, inputs: InputsT) -> str | None:
        """Returns, after a restart, why an earlier success no longer holds; None when it holds or that is unknown.

        Reads sensors and commands no motion. The reason is a clause, such as "the gripper is empty".
        """
        return None
