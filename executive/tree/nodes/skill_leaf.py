"""Leaf that runs a skill: binds ports, limits the time, turns exceptions into failures, and always ends the skill."""

import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, Final, TypeVar

from py_trees.common import Status

from executive.mission.gripper import UNNAMED
from executive.tree.assembly import Assembler, Named, StepPlans
from executive.tree.behaviour import ExplainedLeaf, StoppableTime
from executive.tree.board import Binding, Constant, FromBoard, Sign
from executive.tree.context import RunContext
from executive.tree.estimate import CannotError, Estimate, Walk
from executive.tree.goals import POSE_NEAR_M, square_region, surface_region
from executive.tree.node import NodeSpec
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.tree.port_values import (
    FROM_KEY,
    PortValueError,
    assign_ports,
    conforms,
    describe_type,
    field_types,
    port_value,
)
from executive.tree.registry import missing_skill
from executive.words.goal import GoalCondition, GoalKind
from executive.words.knowledge import Knowledge, Pose
from executive.words.leaf_steps import CallSkill
from executive.words.slug import slug
from skills.api import Cause, Failed, Part, Running, Skill, Step, Succeeded, Surface
from skills.inputs.errors import InputError, listing, shortage, suggestion
from skills.robot import Pose2D

ResultT = TypeVar("ResultT")
ERROR_TOPIC = "errors"
_TOLERANCE_S = 1e-6
_SIGNS: Final = {"observation": Sign.SEEN, "released_W": Sign.RELEASED}


class SkillLeaf(ExplainedLeaf):
    """Leaf that runs one skill.

    | skill | status |
    |---|---|
    | `Running` in time | RUNNING |
    | `Succeeded` in time, outputs of the declared types, data fresh | SUCCESS |
    | `Succeeded` in time, on data older than it declares | FAILURE with POSTCONDITION |
    | `Failed` | FAILURE with its cause |
    | `Running` or `Succeeded` after `limit_s`, longer by speed limits | FAILURE with TIMEOUT |
    | an exception, no `Step`, or outputs that are missing or of a wrong type | FAILURE with ERROR |
    | suspended | RUNNING; the next tick calls `Skill.resume`, and the time between does not count |
    | halted | INVALID with CANCELLED |

    The leaf calls `end` in every case. Each attempt gets a new skill object, so that attempts share no state. `first`
    are skills that stow the arm: they run before the skill if the arm may be anywhere, unless the robot has no arm. If
    the arm has no free path, the next of them moves the base, then the arm is tried again.
    """

    kind = "skill"
    runs_skill = True
    logged = True
    skill: type[Skill[Any]]
    limit_s: float
    context: RunContext
    inputs: Mapping[str, Binding] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    first: Sequence[type[Skill[Any]]] = ()
    _first: Skill[Any] | None = field(default=None, init=False)
    _left: list[type[Skill[Any]]] = field(default_factory=list, init=False)
    _skill: Skill[Any] | None = field(default=None, init=False)
    _values: Any = field(default=None, init=False)
    _false_start: Failed | None = field(default=None, init=False)

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates a drive from its route, and another skill from its typical duration."""
        goal = _drive_goal(node, walk)
        walk.written.update(node.options["outputs"].values())
        if goal is None:
            duration_s = walk.estimates.skills.get(node.name, walk.estimates.other_skill_s)
            return walk.draw(node, Estimate(duration_s, 0.0, duration_s * walk.estimates.battery.standing_per_s))
        try:
            route = walk.planner.route(walk.pose, goal, walk.zones)
        except ValueError as error:
            hint = f"name another place or pose, or correct the world's map{' or the zones' if walk.zones else ''}"
            raise CannotError(InputError.at(node.source, str(error).rstrip("."), hint=hint)) from error
        walk.pose = goal
        drive = walk.estimates.drive
        slower_s = sum(max(0.0, part_m / limit_m_s - drive.per_metre_s * part_m) for part_m, limit_m_s in route.limited)
        duration_s = drive.overhead_s + drive.per_metre_s * route.progress_m + slower_s
        charge = duration_s * walk.estimates.battery.driving_per_s
        return walk.draw(node, Estimate(duration_s, route.length_m, charge))

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the keys of the skill's bound output ports, and their types."""
        return {key: options["skill"].outputs.get(port, Any) for port, key in options.get("outputs", {}).items()}

    @classmethod
    def signs(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the keys under which the skill writes an object's place; people do not count."""
        keys = {} if options["skill"].name == "find_people" else options["outputs"]
        return {keys[port]: sign for port, sign in _SIGNS.items() if port in keys}

    def __post_init__(self) -> None:
        super().__post_init__()
        self._time = StoppableTime(self.context.clock)

    @property
    def active(self) -> bool:
        """Returns whether the skill has begun and not ended."""
        return self._skill is not None

    @property
    def checkpoint(self) -> Mapping[str, Any]:
        """Checkpoint of the active skill for a restart; empty for an idle leaf."""
        return {} if self._skill is None else self._skill.checkpoint

    @property
    def skill_name(self) -> str:
        """Registered name of the skill."""
        return self.skill.name

    @property
    def suspended(self) -> bool:
        """Returns whether the skill is suspended until the next tick."""
        return self.active and self._time.stopped

    def initialise(self) -> None:
        """Begins a new attempt; `update` reports an error, since an exception here would leave the tree RUNNING."""
        self.progress = None
        self._false_start = self._guarded(self._begin)

    def update(self) -> Status:
        """Runs one step of the skill, and judges it."""
        if self.suspended:
            self._go_on()
        step = self._false_start or self._judged(self._guarded(self._step))
        if isinstance(step, Running):
            self.message, self.progress = step.message, step.progress
            return Status.RUNNING
        step = self._ended() or self._written(step)
        self.context.arm_order.note_end(self.skill, succeeded=isinstance(step, Succeeded))
        self.message = self.feedback_message = step.message
        self.cause = step.cause if isinstance(step, Failed) else None
        self.final = isinstance(step, Failed) and step.final
        return Status.FAILURE if isinstance(step, Failed) else Status.SUCCESS

    def suspend(self) -> None:
        """Suspends the skill, which stops its motion; does nothing on an idle or suspended leaf."""
        if not self.active or self.suspended:
            return
        active = self._first or self._skill
        assert active is not None
        self._time.stop()
        self.context.arm_order.note_end(self.skill, succeeded=False)
        self._false_start = self._guarded(active.suspend) or self._false_start

    def terminate(self, new_status: Status) -> None:
        """Ends an active skill when the node is stopped from outside; else clears an old result."""
        if new_status != Status.INVALID:
            return
        if self.active:
            self.abandon()
        else:
            self.clear_explanation()

    def abandon(self) -> None:
        """Ends an active skill and explains that it was cancelled; does nothing on an idle leaf."""
        if not self.active:
            return
        defect = self._ended()
        self.context.arm_order.note_end(self.skill, succeeded=False)
        self.explain_cancelled()
        if defect is not None:
            self.cause, self.message = defect.cause, defect.message

    def _begin(self) -> None:
        self._time = StoppableTime(self.context.clock)
        board = self.context.board
        values = {port: binding.read(board) for port, binding in self.inputs.items()}
        self._skill = self.skill(self.context.for_skill(self.path_id))
        self._values = self.skill.Inputs(**values)
        self._left = list(self.first)
        if self._left and self.context.arm_order.anywhere and self.context.robot.capabilities().arm:
            self._begin_next()
        else:
            self._skill.begin(self._values)

    def _begin_next(self) -> None:
        """Begins the next skill that stows the arm."""
        kind = self._left.pop(0)
        self._first = kind(self.context.for_skill(f"{self.path_id}/first"))
        self._first.begin(kind.Inputs())

    def _go_on(self) -> None:
        """Resumes the skill in the first tick after a suspension; `update` reports an exception of the skill."""
        assert self._skill is not None
        first, skill = self._first, self._skill
        self._time.go_on()
        resume = (lambda: skill.resume(self._values)) if first is None else lambda: first.resume(first.Inputs())
        self._false_start = self._false_start or self._guarded(resume)

    def _step(self) -> Step:
        assert self._skill is not None
        if self._first is not None:
            return self._bring_in(self._first, self._skill)
        step = self._skill.step()
        if not isinstance(step, Running | Succeeded | Failed):
            return Failed(Cause.ERROR, f"{self.name} gave back {step!r} instead of a step")
        return step

    def _bring_in(self, first: Skill[Any], skill: Skill[Any]) -> Running:
        """Runs one step of a skill that stows the arm; after it, begins the next one, or the leaf's skill and time."""
        step = first.step()
        if isinstance(step, Running) and self._time.elapsed_s() <= first.default_timeout_s:
            return step
        self._first = None
        first.end()
        self.context.arm_order.note_end(type(first), succeeded=isinstance(step, Succeeded))
        self._time = StoppableTime(self.context.clock)
        has_no_path = isinstance(step, Failed) and step.cause is Cause.PLANNING
        if self._left and (has_no_path if Part.ARM in first.uses else isinstance(step, Succeeded)):
            self._begin_next()
            return Running(step.message)
        skill.begin(self._values)
        return Running("the arm is brought in" if isinstance(step, Succeeded) else f"goes on: {step.message}")

    def _judged(self, step: Step) -> Step:
        """Turns a step after the time limit into a failure, and a success with data that is too old."""
        drives = Part.BASE in self.skill.uses and bool(self.context.zones)
        limit_s = self.limit_s * (self.context.zone_map().slowdown if drives else 1.0)
        if self._time.elapsed_s() > limit_s and not isinstance(step, Failed):
            return Failed(Cause.TIMEOUT, f"{self.name} took longer than {limit_s:g} s ({step.message})")
        if isinstance(step, Succeeded) and self.path_id not in self.hook.repeated:
            success = step
            return self._guarded(lambda: refuse_stale(self.skill, success, self.context))
        return step

    def _ended(self) -> Failed | None:
        """Calls the skill's `end` once; returns Failed when `end` raises."""
        active, self._first, self._skill = self._first or self._skill, None, None
        return None if active is None else self._guarded(active.end)

    def _written(self, step: Succeeded | Failed) -> Succeeded | Failed:
        """Writes the outputs to the blackboard; returns a defect for a missing or wrongly typed output.

        A failure may write outputs for the next attempt, but need not fill all ports.
        """
        given = step.outputs if isinstance(step, Failed) else self.skill.outputs
        for port, kind in self.skill.outputs.items():
            if port not in given:
                continue
            if not conforms(step.outputs.get(port), kind):
                found = type(step.outputs[port]).__name__ if port in step.outputs else "nothing"
                return Failed(Cause.ERROR, f"{self.name} gave {found} on port '{port}', not {describe_type(kind)}")
        for port, key in self.outputs.items():
            if port in given:
                self.context.board.put(key, step.outputs[port])
        return step

    def _guarded(self, call: Callable[[], ResultT]) -> ResultT | Failed:
        """Returns the call's result, or Failed(ERROR) when it raises, with the traceback in the log."""
        try:
            return call()
        except BaseException as defect:
            if type(defect) is KeyboardInterrupt or getattr(defect, "stops_run", False):
                raise  # a robot or a tick hangs, or Ctrl-C: no defect of a skill
            if isinstance(defect, OSError) and shortage(defect):
                raise  # the mission can be resumed when there is room again
            trace = traceback.format_exc()
            self.context.publish(ERROR_TOPIC, {"node": self.path_id, "traceback": trace})
            text = str(defect.args[0]) if isinstance(defect, KeyError) and defect.args else str(defect)
            return Failed(Cause.ERROR, f"{self.name} raised {type(defect).__name__}: {text}")


def _drive_goal(node: NodeSpec, walk: Walk) -> Pose2D | None:
    """Goal of a drive, if it is known before the run."""
    drives = node.skill is not None and Part.BASE in node.skill.uses
    binding = node.options["inputs"].get("goal") if drives else None
    if isinstance(binding, FromBoard):
        return walk.noted.get(binding.key)
    return binding.value if isinstance(binding, Constant) and isinstance(binding.value, Pose2D) else None


def refuse_stale(skill: type[Skill[Any]], success: Succeeded, context: RunContext) -> Succeeded | Failed:
    """Returns the success, or a failed postcondition if its data is older than the skill allows."""
    for source, most_s in skill.max_data_age_s.items():
        stamp_s = _stamp_s(source, success.outputs, context)
        if stamp_s is None:
            return Failed(Cause.POSTCONDITION, f"{skill.name} cannot be sure: there is no {source} data")
        age_s = context.clock.now() - stamp_s
        if age_s > most_s + _TOLERANCE_S:
            why = f"its {source} data is {age_s:.1f} s old, more than {most_s:g} s"
            return Failed(Cause.POSTCONDITION, f"{skill.name} cannot be sure: {why}")
    return success


def _stamp_s(source: str, outputs: Mapping[str, Any], context: RunContext) -> float | None:
    """Stamp (s) of the data that a skill used: an output port, the localisation, or a reading from the robot."""
    if source in outputs:
        return float(outputs[source].stamp_s)
    if source == "localisation":
        return context.localiser.estimate().stamp_s
    reading = getattr(context.robot, source)()
    return None if reading is None else float(reading.stamp_s)


def _plan(assembler: Assembler, call: CallSkill, builder: PlanBuilder) -> Assembled:
    """Plans the leaf that runs a single skill.

    Raises InputError for an unknown skill, port or name, or a value that does not fit its port.
    """
    if call.skill not in builder.registry:
        raise call.error(("skill",), *missing_skill(call.skill, builder.registry))
    flow, path_id, skill = assembler.flow, builder.path_id, builder.registry[call.skill]
    inputs, gives = _inputs(call, skill, builder.knowledge, flow.names), call.gives or {}
    for port in gives:
        if port not in skill.outputs:
            known = f"its outputs are {listing(skill.outputs)}" if skill.outputs else "it has none"
            hint = suggestion(port, skill.outputs, known)
            raise call.error(("gives", port), f"{call.skill} has no output port '{port}'", hint)
    outputs = {
        port: assembler.give(name, f"{path_id}/{slug(port)}", skill.outputs[port], builder)
        for port, name in gives.items()
    }
    leaf = builder.skill(call.skill, inputs, outputs, here=True)
    goal = _goal(call.skill, inputs, builder.knowledge)
    part = StepPart(path_id, skill=skill, goal=goal, held=flow.held, opening=flow.opening)
    flow.held = {None: flow.held, True: UNNAMED, False: None}[skill.gripper_after]
    flow.opening = flow.opening and skill.gripper_after is None
    return Assembled((leaf,), (part,))


def _goal(skill: str, bound: Mapping[str, Binding], knowledge: Knowledge) -> GoalCondition | None:
    """Goal condition of a single skill; None if a referee cannot judge it, or it is not known before the run."""
    inputs = {port: each.value for port, each in bound.items() if isinstance(each, Constant)}
    match skill:
        case "navigate" if isinstance(pose := inputs.get("goal"), Pose2D):
            at, name = Pose(x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad), f"({pose.x_m:.2f}, {pose.y_m:.2f})"
            return GoalCondition(GoalKind.WENT, goal=(square_region(name, at, POSE_NEAR_M),))
        case "grasp":
            return GoalCondition(GoalKind.GRASPED)
        case "place" if isinstance(surface := inputs.get("surface"), Surface):
            known = surface.name in knowledge.surfaces
            goal = (surface_region(knowledge, surface.name),) if known else ()
            return GoalCondition(GoalKind.PLACED, goal=goal) if known else None
        case "hand_over":
            return GoalCondition(GoalKind.HANDED_OVER, person=knowledge.person(str(inputs.get("person", ""))))
    return None


def _inputs(
    call: CallSkill, skill: type[Skill[Any]], knowledge: Knowledge, names: Mapping[str, Named]
) -> dict[str, Binding]:
    """Returns the bindings of the input ports that have values."""
    hints = field_types(skill.Inputs)
    try:
        ports = assign_ports(call.values or {}, skill.Inputs)
        return {
            port: _named_output(call, path, value[FROM_KEY], names)
            if isinstance(value, dict) and set(value) == {FROM_KEY}
            else Constant(port_value(value, hints[port], knowledge, path))
            for port, (path, value) in ports.items()
        }
    except PortValueError as error:
        where = ".".join(map(str, error.path))
        message = f"{call.skill}: {where + ': ' if where and where not in error.message else ''}{error.message}"
        raise call.error(("with", *error.path), message, error.hint) from error


def _named_output(call: CallSkill, path: tuple[str | int, ...], name: Any, names: Mapping[str, Named]) -> FromBoard:
    if not isinstance(name, str) or name not in names:
        none = None if names else "name one with 'gives: {PORT: NAME}' in an earlier step"
        hint = suggestion(str(name), names, none)
        raise call.error(("with", *path), f"no earlier step gives '{name}'", hint)
    return FromBoard(names[name].key)


PLANS: Final[StepPlans] = {CallSkill: _plan}
