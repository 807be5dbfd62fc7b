"""Plans groups of steps with `when`, `while` and `always`, and defines their nodes."""

from dataclasses import replace
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.assembly import PYTHON_TYPES, Assembler, Flow, StepPlans, words_of
from executive.tree.behaviour import ExplainedDecorator, cause_of, message_of
from executive.tree.context import RunContext
from executive.tree.estimate import Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import MustHold, MustNotBegin, instant_decision
from executive.tree.nodes.interrupts import HANDLING
from executive.tree.nodes.policies import under_policy
from executive.tree.nodes.recovery import Afterwards
from executive.tree.nodes.values import set_plan
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import steps as model
from executive.words.condition import AllOf, Condition, ValueIs
from executive.words.expression import Expression, Template, kind_of, literal
from executive.words.goal import GoalCondition, GoalKind, When
from executive.words.leaf_steps import UseMission
from executive.words.mission import Mission
from executive.words.step import OnFailure, Policy
from skills.api import Zone
from skills.inputs.errors import InputError


class Always(Afterwards):
    """Composite of work (first child), and of steps that run after the work (second child), whatever its result.

    | work | steps in the end | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | SUCCESS, FAILURE | ticked in the same tick | RUNNING until they end |
    | SUCCESS | FAILURE | FAILURE with the cause of the steps |
    | SUCCESS, FAILURE | SUCCESS, or FAILURE after FAILURE | as the work |
    | halted | handed to the run, which ticks them first (`RunContext.endings`) | INVALID with CANCELLED |
    """

    kind = "always"
    context: RunContext

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stops the children; hands the second one to the run when the node is stopped from outside."""
        first, last = self.children
        endings = self.context.endings
        interrupted = new_status == Status.INVALID and self.status == Status.RUNNING
        if not interrupted and not endings.has(last):
            super().stop(new_status)
            return
        self.hook.note_stop(self, new_status)
        if not interrupted or first.status == Status.RUNNING:
            first.stop(Status.INVALID)
        if interrupted and not endings.take(last):
            last.stop(Status.INVALID)
        if interrupted:
            self.explain_cancelled()
        self.status = new_status
        self.iterator = self.tick()

    def _take_over(self, child: Behaviour) -> None:
        super()._take_over(child)
        first, then = self.children
        if first.status == Status.SUCCESS and then.status == Status.FAILURE:
            self._end(cause_of(then), f"{message_of(first)}, but then: {message_of(then)}")


class InZones(ExplainedDecorator):
    """Decorator that adds `zones` to the zones in force, for its subtree.

    | child | status |
    |---|---|
    | RUNNING, SUCCESS | as the child |
    | FAILURE | FAILURE with its cause |
    | halted | INVALID with CANCELLED |
    """

    kind = "zones"
    zones: tuple[Zone, ...]

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the child, for a robot that obeys these zones as well."""
        outer, walk.zones = walk.zones, tuple(dict.fromkeys((*walk.zones, *node.options["zones"])))
        try:
            return walk.all_of(node, first)
        finally:
            walk.zones = outer

    def update(self) -> Status:
        """Returns the child's status."""
        return self.pass_on()


def _plan(assembler: Assembler, block: model.Group, builder: PlanBuilder) -> Assembled:
    before = assembler.flow.copy()
    body = assembler.row(block.steps, builder, block.name or "group")
    return frame_plan(assembler, body, block, builder, before)


def frame_plan(
    assembler: Assembler, body: Assembled, group: model.Group | Mission, builder: PlanBuilder, before: Flow
) -> Assembled:
    """Adds `when`, `while` and `always` around steps; `before` is the data flow before the steps."""
    node, parts = body.node, body.parts
    if group.when:
        after, calls = assembler.flow, []
        for number, handler in enumerate(group.when, start=1):
            below = builder.at(f"when-{number}")
            decision = instant_decision(before, handler.condition, below)
            assembler.flow = before.copy()
            work = assembler.row(handler.steps, below, f"when {handler.condition}")
            parts += work.parts
            calls.append(
                below.node(
                    "interrupt",
                    f"when {handler.condition}",
                    *work.nodes,
                    condition=MustNotBegin(decision, str(handler.condition)),
                    spares=HANDLING,
                    uses=handler.times,
                )
            )
        assembler.flow = after
        node = builder.node("interrupts", f"{node.name}, watched", *calls, node, part="watched")
    if group.while_ is not None:
        holds = group.while_.holds
        decision = instant_decision(before, holds, builder.at("while"))
        condition = MustHold(decision, str(holds))
        node = builder.guarded(f"while {holds}", node, condition, part="while")
        if _is_holding(holds):
            parts = (StepPart(node.path_id, goal=GoalCondition(GoalKind.GRASPED, when=When.ALWAYS)), *parts)
    if group.always:
        assembler.flow.join([before.copy(), assembler.flow.copy()])
        last = assembler.row(group.always, builder.at("always"), "in the end")
        parts += last.parts
        name = f"{group.name or node.name}, in the end {words_of(group.always)}"
        node = builder.node("always", name, node, *last.nodes, part="whatever-happens")
    if group.zones:
        known = assembler.knowledge
        zones = known.with_zones(group.zones).known_zones()[len(known.zones) :]
        words = "; ".join(zone.words for zone in zones)
        node = builder.node("zones", words, node, part="zones", zones=zones)
    return Assembled((node,), parts)


def _is_holding(condition: Condition) -> bool:
    """Returns whether a condition requires that the gripper holds something."""
    match condition:
        case ValueIs(text=text):
            return text.strip() == "holding"
        case AllOf(parts=parts):
            return any(map(_is_holding, parts))
    return False


def mission_plan(assembler: Assembler, mission: Mission, base: str) -> Assembled:
    """Plans a mission's steps: sets its values first, and adds the mission's `when`, `while` and `always` around."""
    builder, flow = assembler.builder(base, mission.source), assembler.flow
    outer, known = (assembler.values_base, flow.declared), dict(flow.names)
    assembler.values_base = f"{base}/values"
    first = (_declare(assembler, mission, builder),) if mission.variables else ()
    before = assembler.flow.copy()
    steps = assembler.level(mission.steps, base)
    if mission.is_framed:
        row = replace(steps, nodes=(builder.sequence("steps", *steps.nodes, part="all"),))
        steps = frame_plan(assembler, row, mission, builder.at("whole"), before)
    assembler.values_base, assembler.flow.declared = outer
    assembler.flow.names.update({name: known[name] for name in mission.variables or () if name in known})
    return replace(steps, nodes=(*first, *steps.nodes))


def _declare(assembler: Assembler, mission: Mission, builder: PlanBuilder) -> NodeSpec:
    """Builds the leaf that sets a mission's declared values at the beginning."""
    values, kinds = dict[str, Expression | Template](), dict[str, type]()
    for name, value in (mission.variables or {}).items():
        kind = PYTHON_TYPES[kind_of(value)]
        key = assembler.give(name, f"{assembler.values_base}/{name}", kind, builder)
        values[key], kinds[key] = literal(value), kind
    assembler.flow.declared = frozenset(mission.variables or ())
    return set_plan(assembler.flow, builder, values, kinds, "values", "values at the beginning")


def _use_plan(assembler: Assembler, step: UseMission, builder: PlanBuilder) -> Assembled:
    """Plans the mission that a step uses."""
    used: Mission = step.mission
    try:
        steps = mission_plan(assembler, used, builder.path_id)
    except InputError as error:
        raise step.within((), error) from error
    body = builder.sequence(used.name, *steps.nodes)
    whole = under_policy(body, used, builder.at("whole"), used.name, may_skip=False)
    return Assembled((whole,), steps.parts)


def whole_mission(mission: Mission, builder: PlanBuilder, steps: tuple[NodeSpec, ...]) -> NodeSpec:
    """Builds the node of a whole mission from its steps, under the mission's policy."""
    remember = builder.node("remember", "where it starts", part="remember-start", key=builder.start_key, keep=True)
    all_steps = list(mission.walk())
    used = (step.mission for step in all_steps if isinstance(step, UseMission))
    policies: tuple[Policy, ...] = (mission, *all_steps, *used)
    returns = any(policy.on_failure is OnFailure.RETURN for policy in policies)
    bound = (value for step in steps for node in step.walk() for value in node.options.get("inputs", {}).values())
    leads_back = returns or any(getattr(value, "key", None) == builder.start_key for value in bound)
    first = [remember] if leads_back else []
    if mission.is_empty and not any(map(_may_skip, steps)):
        return builder.sequence(mission.name, *first, *steps)
    body = builder.sequence("steps", *steps, part="steps")
    whole = under_policy(body, mission, builder.at("whole"), mission.name, may_skip=False)
    if _may_skip(whole):
        whole = builder.node("summary", "tell what was skipped", whole, part="summary")
    return builder.sequence(mission.name, *first, whole)


def _may_skip(node: NodeSpec) -> bool:
    return any(below.behaviour.skips for below in node.walk())


PLANS: Final[StepPlans] = {model.Group: _plan, UseMission: _use_plan}
