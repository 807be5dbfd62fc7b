"""From a mission's steps to the root of its tree, and a list of what its parts are to bring about."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final

from executive.mission.gripper import UNNAMED, after_command, is_same
from executive.tree.board import Constant
from executive.tree.compiling.flow import PYTHON_TYPES, Flow, answering, block_name, give, set_plan
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.compiling.skill_steps import skill_plan
from executive.tree.compiling.trips import are_trips, refuse_several, trips_plan
from executive.tree.goals import clearing_goals, command_goal, drive_goal, given_goal, lifted_goal, put_goal
from executive.tree.kinds import block_plan
from executive.tree.node import NodeSpec
from executive.tree.nodes.clearing import clear_plan, is_clearing, refuse_everything
from executive.tree.nodes.commands import step_plan
from executive.tree.nodes.group import framed
from executive.tree.nodes.policies import PolicyFrame, needs_way_back, under_policy
from executive.tree.nodes.search import surfaces_elsewhere
from executive.tree.plan import PICK_UPS, PlanBuilder, Registry, start_key
from executive.words.command import START, Command, Task
from executive.words.expression import kind_of, literal
from executive.words.goal import GoalCondition, When
from executive.words.knowledge import Knowledge, Pose
from executive.words.leaf_steps import CallSkill, Do, Say, UseMission
from executive.words.mission import Mission
from executive.words.policy import OnFailure, Policy
from executive.words.slug import slug
from executive.words.step import Step
from skills.api import Skill, Surface
from skills.files.errors import InputError, Problems, SourceLine, listing
from skills.quantities import Quantity
from skills.robot import Pose2D

__all__ = ["Assembled", "StepPart", "assemble", "step_name"]

NO_POLICY: Final = Policy()
_SKIPPING: Final = frozenset({"skip", "ask"})
COUNTED: Final = Annotated[float, Quantity(ge=0.0, le=1_000.0)]
"""How many objects a look counts."""
_ANSWERS: Final[Mapping[str, tuple[str, type]]] = {"answer": ("key", bool), "count": ("count_key", float)}
"""What a status check can give: the option of its answer node that names the key, and the type."""


@dataclass(frozen=True)
class _Item:
    """One command, skill or used mission: its number on its level, and its step with that step's place, from 1."""

    number: int
    place: int
    step: Step
    command: Command | None = None


def assemble(mission: Mission, *, knowledge: Knowledge, registry: Registry) -> tuple[NodeSpec, tuple[StepPart, ...]]:
    """The root of a mission's tree, and its parts in order.

    Raises InputError: unknown names, ports wired wrongly, commands that cannot be carried out; all in `others`.
    """
    base = f"{slug(mission.robot_name)}/{slug(mission.name)}"
    pick_ups = PICK_UPS if mission.pick_ups is None else mission.pick_ups
    move_aside = mission.move_aside or 0
    assembler = _Assembler(knowledge, registry, start_key(mission.robot_name, mission.name), pick_ups, move_aside)
    builder = assembler.builder(base, mission.source)
    steps = assembler.mission(mission, base)
    remember = [builder.node("remember", "where it starts", part="remember-start", key=builder.start_key, keep=True)]
    first = remember if _leads_back(mission) else []
    if mission.is_empty and not _may_skip(steps.nodes):
        return builder.sequence(mission.name, *first, *steps.nodes), steps.parts
    frame = PolicyFrame(builder.at("whole"), mission.name, may_skip=False)
    body = builder.node("sequence", "steps", *steps.nodes, part="steps")
    whole = _under(Assembled((body,), steps.parts), mission, frame)
    (body,) = whole.nodes
    if _may_skip(whole.nodes):
        paths = tuple(node.path_id for node in steps.nodes)
        body = builder.node("summary", "tell what was skipped", body, part="summary", steps=paths)
    return builder.sequence(mission.name, *first, body), whole.parts


def step_name(command: Command) -> str:
    """The step's name in path ids: the goal, else the object."""
    return slug(command.goal or str(command.object or command.item or "anywhere"))


@dataclass
class _Assembler:
    """Makes the subtrees of one mission.

    `pick_ups` and `move_aside` count for steps that do not say otherwise; `flow` is what is known by then. Values that
    steps set have blackboard keys below `values_base`.
    """

    knowledge: Knowledge
    registry: Registry
    start_key: str
    pick_ups: int = PICK_UPS
    move_aside: int = 0
    values_base: str = ""
    flow: Flow = field(default_factory=Flow)

    def builder(self, path_id: str, source: SourceLine | None) -> PlanBuilder:
        """The builder of nodes that belong to no one command."""
        return PlanBuilder(self.knowledge, self.registry, path_id, self.start_key, Command(goal=START), source)

    def mission(self, mission: Mission, base: str) -> Assembled:
        """The subtrees of a mission's steps, under what is watched meanwhile, after its values are set."""
        builder, outer = self.builder(base, mission.source), (self.values_base, self.flow.declared)
        known = dict(self.flow.names)
        first: tuple[NodeSpec, ...] = ()
        self.values_base = f"{base}/values"
        if mission.variables:
            first = (self._declare(mission, builder),)
        before = self.flow.copy()
        steps = self.level(mission.steps, base)
        if mission.is_framed:
            row = replace(steps, nodes=(builder.node("sequence", "steps", *steps.nodes, part="all"),))
            steps = framed(self, row, mission, builder.at("whole"), before)
        self.values_base, self.flow.declared = outer
        self.flow.names.update({name: known[name] for name in mission.variables or () if name in known})
        return replace(steps, nodes=(*first, *steps.nodes))

    def level(self, steps: Sequence[Step], base: str) -> Assembled:
        """The subtrees of steps: those under a policy each as one, the others' parts as they are."""
        made, problems = Assembled(), Problems()
        for items, policy in _groups(steps):
            with problems:
                before = self.flow.copy()
                group = self._group(items, base)
                if policy.on_failure in (OnFailure.SKIP, OnFailure.ASK):
                    self.flow.may_lack(before)
                if not policy.is_empty:
                    builder = self.builder(f"{base}/step-{items[0].place}", items[0].step.source)
                    words = f"step {items[0].place}: {_words(items)}"
                    if len(group.nodes) > 1:
                        group = replace(group, nodes=(builder.sequence(words, *group.nodes),))
                    group = _under(group, policy, PolicyFrame(builder, words))
                made += group
        problems.raise_any()
        return made

    def _group(self, items: Sequence[_Item], base: str) -> Assembled:
        """The subtrees of items in a row; those that get and bring several objects are trips, all of them rounds."""
        made, problems, done = Assembled(), Problems(), 0
        for item, after in zip(items, (*items[1:], None), strict=True):
            if item.number <= done:
                continue
            following = None if after is None else after.command
            with problems:
                if item.command is not None and following is not None and _go_together(item.command, following):
                    done = item.number + 1
                    made += self._pair(item, item.command, following, base)
                else:
                    made += self._item(item, following, base)
        problems.raise_any()
        return made

    def _pair(self, item: _Item, get: Command, bring: Command, base: str) -> Assembled:
        """The one subtree of two commands that get and bring several objects, or all."""
        builder = self._command_builder(item, base)
        goals: tuple[GoalCondition | None, ...]
        if is_clearing(get, bring):
            node, goals = clear_plan(builder, bring), clearing_goals(get, bring, self.knowledge)
        else:
            node = trips_plan(builder, bring)
            got = command_goal(get, self.knowledge)
            goals = (None if got is None else replace(got, when=When.SOME_TIME), command_goal(bring, self.knowledge))
        held, opening = self.flow.held, self.flow.opening
        self.flow.held, self.flow.opening = None, False
        between = after_command(get, held, self.knowledge)
        parts = (
            StepPart(node.path_id, get, goal=goals[0], held=held, opening=opening),
            StepPart(node.path_id, bring, goal=goals[1], held=between, opening=False),
        )
        return Assembled((node,), parts)

    def _item(self, item: _Item, following: Command | None, base: str) -> Assembled:
        """The subtree of one command, skill or used mission; `following` is the command right after it."""
        step = item.step
        match step:
            case UseMission():
                return self._used(step, f"{base}/{item.number}-{slug(step.words)}")
            case CallSkill():
                return self._skill(step, f"{base}/{item.number}-{slug(step.skill)}")
        if not isinstance(step, Do | Say):
            return block_plan(self, step, self.builder(f"{base}/{item.number}-{block_name(step)}", step.source))
        flow = self.flow
        builder = replace(self._command_builder(item, base), avoided=_goals(following, self.knowledge))
        refuse_several(builder)
        refuse_everything(builder)
        command, held, opening = builder.command, flow.held, flow.opening
        carried = None if held is None else held.thing
        in_gripper = is_same(held, command.object, self.knowledge)
        builder = replace(builder, in_gripper=in_gripper, carried=carried)
        node = self._giving(step, command, step_plan(builder), builder)
        flow.held = after_command(command, held, self.knowledge)
        flow.opening = opening and command.task is not Task.GRASP and flow.held == held and not _lets_go(command)
        goal = command_goal(command, self.knowledge, _elsewhere(builder))
        return Assembled(
            (node,), (StepPart(builder.path_id, command, goal=goal, held=held, opening=opening, node=node.path_id),)
        )

    def _skill(self, step: CallSkill, path_id: str) -> Assembled:
        """The leaf of a skill on its own."""
        flow, builder = self.flow, self.builder(path_id, step.source)
        leaf = skill_plan(
            step,
            path_id,
            knowledge=self.knowledge,
            registry=self.registry,
            names={name: named.key for name, named in flow.names.items()},
            gives_to=lambda name, key, kind: give(self, name, key, kind, builder),
        )
        skill: type[Skill[Any]] = leaf.options["skill"]
        part = StepPart(path_id, skill=skill, goal=self._skill_goal(leaf), held=flow.held, opening=flow.opening)
        flow.held = {None: flow.held, True: UNNAMED, False: None}[skill.gripper_after]
        flow.opening = flow.opening and skill.gripper_after is None
        return Assembled((leaf,), (part,))

    def _skill_goal(self, leaf: NodeSpec) -> GoalCondition | None:
        """What a skill on its own is to bring about; None: nothing that a referee can see, or not known before."""
        inputs = {port: each.value for port, each in leaf.options["inputs"].items() if isinstance(each, Constant)}
        match leaf.name:
            case "navigate" if isinstance(pose := inputs.get("goal"), Pose2D):
                return drive_goal(Pose(x=pose.x_m, y=pose.y_m, yaw=pose.yaw_rad))
            case "grasp":
                return lifted_goal()
            case "place" if isinstance(surface := inputs.get("surface"), Surface):
                return put_goal(self.knowledge, surface.name) if surface.name in self.knowledge.surfaces else None
            case "hand_over":
                return given_goal(self.knowledge.person(str(inputs.get("person", ""))))
        return None

    def _giving(self, step: Do | Say, command: Command, node: NodeSpec, builder: PlanBuilder) -> NodeSpec:
        """The subtree of a status check whose answer later steps read. Raises InputError: it gives no such thing."""
        keys: dict[str, str] = {}
        for port, name in (step.gives or {}).items():
            known = ("answer", "count") if command.object_count != 1 else ("answer",)
            if command.task is not Task.FIND or port not in known:
                said = listing(known) if command.task is Task.FIND else "no answer"
                hint = "write {answer: NAME} beside a question, or {count: NAME} beside one that counts"
                raise InputError.at(step.source, f"this step gives {said}, not '{port}'", hint=hint)
            option, kind = _ANSWERS[port]
            counted = COUNTED if port == "count" else None
            keys[option] = give(self, name, builder.key(port), kind, builder, counted)
        return answering(node, keys) if keys else node

    def _declare(self, mission: Mission, builder: PlanBuilder) -> NodeSpec:
        """The leaf that gives a mission's values as they are at the beginning."""
        flow, values = self.flow, {}
        for name, value in (mission.variables or {}).items():
            key = give(self, name, f"{self.values_base}/{name}", PYTHON_TYPES[kind_of(value)], builder)
            values[key] = literal(value)
        flow.declared = frozenset(mission.variables or ())
        return set_plan(builder, values, flow.names, "values", "values at the beginning")

    def _used(self, step: UseMission, base: str) -> Assembled:
        """The subtree of a mission that a step uses."""
        used: Mission = step.mission
        try:
            steps = self.mission(used, base)
        except InputError as error:
            raise error if step.source is None else error.within(step.source.file, step.source.line) from error
        builder = self.builder(base, step.source)
        body = replace(steps, nodes=(builder.sequence(used.name, *steps.nodes),))
        return _under(body, used, PolicyFrame(builder.at("whole"), used.name, may_skip=False))

    def _command_builder(self, item: _Item, base: str) -> PlanBuilder:
        command = item.command
        if command is None:
            raise InputError("a step has no commands", hint="give it 'say', a command, a skill or a file to use")
        builder = self.builder(f"{base}/{item.number}-{step_name(command)}", item.step.source)
        own = item.step
        return replace(
            builder,
            command=command,
            anywhere=not isinstance(own, Do | Say) or own.elsewhere is not False,
            pick_ups=self.pick_ups if own.pick_ups is None else own.pick_ups,
            move_aside=self.move_aside if own.move_aside is None else own.move_aside,
        )


def _lets_go(command: Command) -> bool:
    """Whether a command ends with nothing in the gripper."""
    return command.item is not None or command.task is Task.PLACE


def _go_together(get: Command, bring: Command) -> bool:
    """Whether two commands in a row are one: trips for several objects, or rounds for all."""
    return are_trips(get, bring) or is_clearing(get, bring)


def _groups(steps: Sequence[Step]) -> Iterator[tuple[tuple[_Item, ...], Policy]]:
    """Items that belong together: those of one step under a policy, or of steps in a row without any."""
    number, free = 1, []
    for place, step in enumerate(steps, start=1):
        commands: Sequence[Command | None] = step.commands or (None,)
        items = [_Item(number + offset, place, step, command) for offset, command in enumerate(commands)]
        number += len(items)
        if step.is_empty:
            free += items
            continue
        if free:
            yield tuple(free), NO_POLICY
        free = []
        yield tuple(items), step
    if free:
        yield tuple(free), NO_POLICY


def _goals(command: Command | None, knowledge: Knowledge) -> frozenset[str]:
    """The surfaces to which a command brings what is fetched before."""
    place = None if command is None or command.goal is None else knowledge.place(command.goal)
    return frozenset() if place is None else frozenset(knowledge.surfaces_in(place))


def _elsewhere(builder: PlanBuilder) -> tuple[str, ...]:
    """Where else the object of a command to get it may be found."""
    command, knowledge = builder.command, builder.knowledge
    if command.task is not Task.GRASP or command.object is None or command.goal is None or not builder.anywhere:
        return ()
    name = knowledge.thing(command.object.name) or command.object.name
    return surfaces_elsewhere(knowledge, name, builder.place(command.goal), builder.avoided)


def _under(body: Assembled, policy: Policy, frame: PolicyFrame) -> Assembled:
    """One node under its policy."""
    (below,) = body.nodes
    node = under_policy(below, policy, frame)
    return Assembled((node,), body.parts)


def _may_skip(nodes: Sequence[NodeSpec]) -> bool:
    return any(below.kind in _SKIPPING for node in nodes for below in node.walk())


def _leads_back(mission: Mission) -> bool:
    """Whether something in a mission leads back to where the robot stands at its beginning."""
    steps = list(mission.walk())
    used = (step.mission for step in steps if isinstance(step, UseMission))
    policies: tuple[Policy, ...] = (mission, *steps, *used)
    return any(map(needs_way_back, policies)) or any(command.goal == START for command in mission.commands)


def _words(items: Sequence[_Item]) -> str:
    """What a step is called in sentences."""
    commands = [item.command for item in items if item.command is not None]
    return ", then ".join(map(_command_words, commands)) or items[0].step.words


def _command_words(command: Command) -> str:
    """A command in a few words: "grasp coke at kitchen table"."""
    thing = command.object or command.item
    action = command.task.value if command.task is not None else "take" if command.item is not None else "go"
    goal = "" if command.goal is None else f"{'at' if command.task is not None else 'to'} {command.goal}"
    return " ".join(filter(None, (action, str(thing or ""), goal)))
