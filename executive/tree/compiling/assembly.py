"""From a mission's steps to the root of its tree, and a list of what its parts are to bring about."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.mission.command import Command, Task
from executive.mission.errors import InputError, Problems
from executive.mission.file.model import Mission, MissionStep, StepPolicy
from executive.mission.knowledge import Knowledge
from executive.tree.behaviours.board import FromBoard
from executive.tree.compiling.plans import NodePlan, RememberPosePlan, SequencePlan, SkillPlan, Source
from executive.tree.compiling.policies import AskPlan, PolicyFrame, SkipPlan, SummaryPlan, needs_way_back, under_policy
from executive.tree.compiling.search import surfaces_elsewhere
from executive.tree.compiling.skill_steps import skill_plan
from executive.tree.compiling.steps import START, step_plan
from executive.tree.compiling.trips import are_trips, refuse_several, trips_plan
from executive.tree.compiling.workshop import Registry, Workshop, slug, start_key

__all__ = ["Assembled", "StepPart", "assemble", "step_name"]

NO_POLICY: Final = StepPolicy()


@dataclass(frozen=True)
class StepPart:
    """A part of a mission with something to show for it: a command, or a skill on its own.

    `path_id` is that of its subtree. `excused` are pairs of path ids: when the first succeeded although the second
    failed, the part was skipped. `elsewhere` are the surfaces on which a thing may be found that is not in its place.
    """

    path_id: str
    command: Command | None = None
    skill: SkillPlan | None = None
    excused: tuple[tuple[str, str], ...] = ()
    elsewhere: tuple[str, ...] = ()


@dataclass(frozen=True)
class Assembled:
    """The root of a mission's tree, and its parts in order."""

    root: NodePlan
    parts: tuple[StepPart, ...]


@dataclass(frozen=True)
class _Item:
    """One command, skill or used mission: its number on its level, and its step with that step's place, from 1."""

    number: int
    place: int
    step: MissionStep
    command: Command | None = None


@dataclass
class _Site:
    """What all levels of one mission share."""

    knowledge: Knowledge
    registry: Registry
    start_key: str
    names: dict[str, str] = field(default_factory=dict)

    def navigate(self, path_id: str, source: Source | None) -> NodePlan:
        """The way back to where the mission began, below `path_id`."""
        shop = Workshop(self.knowledge, self.registry, path_id, self.start_key, Command(goal=START), source)
        return shop.navigate(FromBoard(self.start_key))


def assemble(mission: Mission, *, knowledge: Knowledge, registry: Registry) -> Assembled:
    """The tree of a mission.

    Raises:
        InputError: unknown names, ports wired wrongly, commands that cannot be carried out; all in `others`.
    """
    base = f"{slug(mission.robot_name)}/{slug(mission.name)}"
    site = _Site(knowledge, registry, start_key(mission.robot_name, mission.name))
    plans, parts = _level(mission, base, site)
    remember = tuple(_remember(base, site.start_key, mission))
    name, source = mission.name, mission.source
    if mission.policy == NO_POLICY and not _may_skip(plans):
        return Assembled(SequencePlan(path_id=base, name=name, source=source, steps=(*remember, *plans)), parts)
    body: NodePlan = SequencePlan(path_id=f"{base}/steps", name="steps", source=source, steps=plans)
    body, excuse = _under(body, mission.policy, PolicyFrame(f"{base}/whole", name, source, site.navigate, False))
    if _may_skip((body,)):
        words, steps = "tell what was skipped", tuple(plan.path_id for plan in plans)
        body = SummaryPlan(path_id=f"{base}/summary", name=words, source=source, child=body, steps=steps)
    root = SequencePlan(path_id=base, name=name, source=source, steps=(*remember, body))
    return Assembled(root, tuple(_excused(parts, excuse)))


def step_name(command: Command) -> str:
    """The step's name in path ids: the goal, else the thing."""
    return slug(command.goal or str(command.object or command.item or "anywhere"))


def _level(mission: Mission, base: str, site: _Site) -> tuple[tuple[NodePlan, ...], tuple[StepPart, ...]]:
    """The subtrees of a mission's steps: those under a policy each as one, the others' parts as they are."""
    plans: list[NodePlan] = []
    parts: list[StepPart] = []
    problems = Problems()
    for group, policy in _groups(mission.steps):
        with problems:
            below, made = _group_plans(group, base, site)
            if policy == NO_POLICY:
                plans, parts = [*plans, *below], [*parts, *made]
                continue
            number = group[0].place
            place, source, words = f"{base}/step-{number}", group[0].step.source, f"step {number}: {_words(group)}"
            one = below[0] if len(below) == 1 else SequencePlan(path_id=place, name=words, source=source, steps=below)
            plan, excuse = _under(one, policy, PolicyFrame(place, words, source, site.navigate))
            plans, parts = [*plans, plan], [*parts, *_excused(made, excuse)]
    problems.raise_any()
    return tuple(plans), tuple(parts)


def _groups(steps: Sequence[MissionStep]) -> Iterator[tuple[tuple[_Item, ...], StepPolicy]]:
    """Items that belong together: those of one step under a policy, or of steps in a row without any."""
    number, free = 1, []
    for place, step in enumerate(steps, start=1):
        commands: Sequence[Command | None] = step.commands or (None,)
        items = [_Item(number + offset, place, step, command) for offset, command in enumerate(commands)]
        number += len(items)
        if step.policy == NO_POLICY:
            free += items
            continue
        if free:
            yield tuple(free), NO_POLICY
        free = []
        yield tuple(items), step.policy
    if free:
        yield tuple(free), NO_POLICY


def _group_plans(items: Sequence[_Item], base: str, site: _Site) -> tuple[tuple[NodePlan, ...], tuple[StepPart, ...]]:
    """The subtrees of items in a row; commands to get and bring several things become trips."""
    plans: list[NodePlan] = []
    parts: list[StepPart] = []
    problems, done = Problems(), 0
    for item, after in zip(items, (*items[1:], None), strict=True):
        if item.number <= done:
            continue
        following = None if after is None else after.command
        with problems:
            if item.command is not None and following is not None and are_trips(item.command, following):
                done = item.number + 1
                plan = trips_plan(_shop(item, base, site), following)
                made: tuple[StepPart, ...] = tuple(StepPart(plan.path_id, c) for c in (item.command, following))
            else:
                plan, made = _plan(item, following, base, site)
            plans, parts = [*plans, plan], [*parts, *made]
    problems.raise_any()
    return tuple(plans), tuple(parts)


def _plan(item: _Item, following: Command | None, base: str, site: _Site) -> tuple[NodePlan, tuple[StepPart, ...]]:
    """The subtree of one command, skill or used mission; `following` is the command right after it."""
    step = item.step
    if step.used is not None:
        return _used_plan(step, step.used, f"{base}/{item.number}-{slug(step.used.name)}", site)
    if step.skill is not None:
        path_id = f"{base}/{item.number}-{slug(step.skill.skill)}"
        leaf = skill_plan(
            step.skill, path_id, step.source, knowledge=site.knowledge, registry=site.registry, names=site.names
        )
        return leaf, (StepPart(path_id, skill=leaf),)
    shop = replace(_shop(item, base, site), avoided=_goals(following, site.knowledge))
    refuse_several(shop)
    plan = step_plan(shop)
    return plan, (StepPart(shop.path_id, shop.command, elsewhere=_elsewhere(shop)),)


def _goals(command: Command | None, knowledge: Knowledge) -> frozenset[str]:
    """The surfaces to which a command brings what is fetched before."""
    place = None if command is None or command.goal is None else knowledge.place(command.goal)
    return frozenset() if place is None else frozenset(knowledge.surfaces_in(place))


def _elsewhere(shop: Workshop) -> tuple[str, ...]:
    """Where else the thing of a command to get it may be found."""
    command, knowledge = shop.command, shop.knowledge
    if command.task is not Task.GRASP or command.object is None or command.goal is None or not shop.anywhere:
        return ()
    name = knowledge.thing(command.object.name) or command.object.name
    return surfaces_elsewhere(knowledge, name, shop.place(command.goal), shop.avoided)


def _used_plan(step: MissionStep, used: Mission, base: str, site: _Site) -> tuple[NodePlan, tuple[StepPart, ...]]:
    """The subtree of a mission that a step uses."""
    try:
        plans, parts = _level(used, base, site)
    except InputError as error:
        raise error if step.source is None else error.within(step.source.file, step.source.line) from error
    body = SequencePlan(path_id=base, name=used.name, source=step.source, steps=plans)
    plan, excuse = _under(body, used.policy, PolicyFrame(f"{base}/whole", used.name, step.source, site.navigate, False))
    return plan, tuple(_excused(parts, excuse))


def _shop(item: _Item, base: str, site: _Site) -> Workshop:
    command = item.command
    if command is None:
        raise InputError("a step has no commands", mend="give it 'say', a command, a skill or a file to use")
    path_id = f"{base}/{item.number}-{step_name(command)}"
    source, anywhere = item.step.source, item.step.elsewhere
    return Workshop(site.knowledge, site.registry, path_id, site.start_key, command, source, anywhere)


def _under(body: NodePlan, policy: StepPolicy, frame: PolicyFrame) -> tuple[NodePlan, tuple[tuple[str, str], ...]]:
    """The body under its policy, and the pair of nodes that tells whether it was skipped."""
    plan = under_policy(body, policy, frame)
    excuse = ((plan.path_id, plan.child.path_id),) if isinstance(plan, SkipPlan | AskPlan) else ()
    return plan, excuse


def _excused(parts: Sequence[StepPart], excuse: tuple[tuple[str, str], ...]) -> list[StepPart]:
    return [replace(part, excused=(*part.excused, *excuse)) for part in parts]


def _may_skip(plans: Sequence[NodePlan]) -> bool:
    return any(isinstance(node, SkipPlan | AskPlan) for plan in plans for node in plan.walk())


def _remember(base: str, key: str, mission: Mission) -> Iterator[NodePlan]:
    """A leaf that notes where the robot stands, when something leads back to it."""
    policies = (mission.policy, *(step.policy for step in mission.walk()), *_used_policies(mission))
    if any(map(needs_way_back, policies)) or any(command.goal == START for command in mission.commands):
        path_id = f"{base}/remember-start"
        yield RememberPosePlan(path_id=path_id, name="where it starts", source=mission.source, key=key, keep=True)


def _used_policies(mission: Mission) -> Iterator[StepPolicy]:
    yield from (step.used.policy for step in mission.walk() if step.used is not None)


def _words(items: Sequence[_Item]) -> str:
    """What a step is called in sentences."""
    step = items[0].step
    if step.used is not None:
        return step.used.name
    commands = [item.command for item in items if item.command is not None]
    return step.skill.skill if step.skill is not None else ", then ".join(map(_command_words, commands))


def _command_words(command: Command) -> str:
    """A command in a few words: "grasp coke at kitchen table"."""
    thing = command.object or command.item
    deed = command.task.value if command.task is not None else "take" if command.item is not None else "go"
    goal = "" if command.goal is None else f"{'at' if command.task is not None else 'to'} {command.goal}"
    return " ".join(filter(None, (deed, str(thing or ""), goal)))
