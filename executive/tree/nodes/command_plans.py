"""Plans of commands: grasp, find, carry, go, wait, charge, people; and of pairs of commands with trips or rounds."""

from dataclasses import replace
from typing import Annotated, Final

from executive.mission.gripper import held_after, is_same
from executive.tree.assembly import Assembler, StepPlans
from executive.tree.board import FromBoard
from executive.tree.goals import clearing_goals, command_goal, surfaces_to_search
from executive.tree.node import NodeSpec
from executive.tree.nodes.carry import carried_along_plan, carry_plan, goal_in_words, goal_pose
from executive.tree.nodes.clearing import clear_plan, is_clearing, refuse_everything
from executive.tree.nodes.guard import HoldsNothingElse
from executive.tree.nodes.pick_up import go_into_plan, go_near_plan, held_plan, known_held_plan, pick_up_plan
from executive.tree.nodes.search import (
    last_known_floor,
    place_phrase,
    refuse_several,
    search_plan,
    surfaces_elsewhere,
    surfaces_first_known,
)
from executive.tree.plan import Assembled, PlanBuilder, StepPart, plan_faults
from executive.tree.task_page import defective, from_page
from executive.words.command import START, Command
from executive.words.goal import GoalCondition, When
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Do, Say
from executive.words.task import Part, Task, installed_tasks
from skills.api import ObjectKind
from skills.descriptions import count_of
from skills.inputs.errors import InputError, listing
from skills.quantities import Quantity

MAX_TRIPS: Final = 20


COUNTED: Final = Annotated[float, Quantity(ge=0.0, le=1_000.0)]
"""Number of objects that a look counts."""


def _plan(assembler: Assembler, step: Do | Say, builder: PlanBuilder) -> Assembled:
    """Plans one command, or two adjacent commands that get and bring several objects or everything."""
    if not step.commands:
        raise InputError("a step has no commands", hint="give it 'say', a command, a skill or a file to use")
    builder = replace(
        builder,
        anywhere=_in_usual_place(builder) if step.elsewhere is None else step.elsewhere,
        pick_ups=assembler.pick_ups if step.pick_ups is None else step.pick_ups,
        move_aside=assembler.move_aside if step.move_aside is None else step.move_aside,
    )
    command, following, flow, knowledge = builder.command, builder.following, assembler.flow, builder.knowledge
    if following is not None and (are_trips(command, following) or is_clearing(command, following)):
        return _pair_plan(assembler, builder, following)
    held, opening = flow.held, flow.opening
    goal_of_next = None if following is None or following.goal is None else knowledge.place(following.goal)
    builder = replace(
        builder,
        avoided=frozenset() if goal_of_next is None else frozenset(knowledge.surfaces_in(goal_of_next)),
        in_gripper=is_same(held, command.object, knowledge),
        carried=None if held is None or held.kind is None else held.kind.plain,
        met=flow.met,
    )
    refuse_several(builder)
    refuse_everything(builder)
    planned = go_plan(builder) if command.task is None else task_plan(command.task, builder)
    node = _giving(assembler, step, planned, builder)
    flow.held, flow.met = held_after(command, held, knowledge), _met_after(command, flow.met, knowledge)
    lets_go = command.item is not None or command.puts
    flow.opening = opening and not command.takes and flow.held == held and not lets_go
    goal = command_goal(command, knowledge, _elsewhere(builder))
    part = StepPart(builder.path_id, command, goal=goal, held=held, opening=opening, node=node.path_id)
    return Assembled((node,), (part,))


def _pair_plan(assembler: Assembler, builder: PlanBuilder, bring: Command) -> Assembled:
    """Plans two commands that get and bring several objects or everything."""
    get, flow, knowledge = builder.command, assembler.flow, builder.knowledge
    goals: tuple[GoalCondition | None, ...]
    if is_clearing(get, bring):
        node, goals = clear_plan(builder, bring), clearing_goals(get, bring, knowledge)
    else:
        node, got = trips_plan(builder, bring), command_goal(get, knowledge)
        goals = (None if got is None else replace(got, when=When.SOME_TIME), command_goal(bring, knowledge))
    held, opening = flow.held, flow.opening
    flow.held, flow.opening = None, False
    parts = (
        StepPart(node.path_id, get, goal=goals[0], held=held, opening=opening),
        StepPart(node.path_id, bring, goal=goals[1], held=held_after(get, held, knowledge), opening=False),
    )
    return Assembled((node,), parts, used=2)


def _giving(assembler: Assembler, step: Do | Say, node: NodeSpec, builder: PlanBuilder) -> NodeSpec:
    """Lets later steps read the answer to a question. Raises InputError for a value that the question does not give."""
    command, keys = builder.command, dict[str, str]()
    for port, name in (step.gives or {}).items():
        known = ("answer", "count") if command.object_count != 1 else ("answer",)
        if not command.looks or port not in known:
            said = listing(known) if command.looks else "no answer"
            hint = "write {answer: NAME} beside a question, or {count: NAME} beside one that counts"
            raise InputError.at(step.source, f"this step gives {said}, not '{port}'", hint=hint)
        kind, span = (float, COUNTED) if port == "count" or command.object_count == 0 else (bool, None)
        keys["count_key" if port == "count" else "key"] = assembler.give(name, builder.key(port), kind, builder, span)
    return _with_answer_options(node, keys) if keys else node


def _with_answer_options(node: NodeSpec, keys: dict[str, str]) -> NodeSpec:
    """Sets options of the node that answers a question, such as the key for the answer."""
    if node.behaviour.answers:
        return node.with_options(**keys)
    return replace(node, children=tuple(_with_answer_options(child, keys) for child in node.children))


def _in_usual_place(builder: PlanBuilder) -> bool:
    """Returns whether an object is asked for in its usual place, or in none; a place that was said is meant."""
    command, knowledge = builder.command, builder.knowledge
    if command.goal is None or command.object is None:
        return True
    return knowledge.place(command.goal) == knowledge.default_place(command.task, command.object.name)


def _elsewhere(builder: PlanBuilder) -> tuple[str, ...]:
    """Returns the surfaces outside the named place on which a command may find its object."""
    command, knowledge = builder.command, builder.knowledge
    if not command.takes or command.object is None or command.goal is None or not builder.anywhere:
        return ()
    return surfaces_elsewhere(knowledge, command.object, builder.place(command.goal), builder.avoided)


def grasp_plan(builder: PlanBuilder, *, anywhere: bool = True) -> NodeSpec:
    """Finds the object, approaches it, grasps it, and draws the arm in.

    After a failed approach or grasp, the recovery for the failure runs and the robot tries again; a failed search is
    final. With `anywhere`, the robot also searches elsewhere. If an earlier step has grasped the object, the robot
    searches only if the gripper is empty. While the gripper holds another object, the plan fails with PRECONDITION.
    """
    item = builder.required_object(builder.command.object)
    if builder.command.item is not None:
        raise builder.error("the one gripper cannot take hold of a second object", "put the first one down before")
    place = None if builder.command.goal is None else builder.place(builder.command.goal)
    surfaces = set(surfaces_first_known(builder, item, place))
    if anywhere and builder.anywhere:
        surfaces |= set(surfaces_elsewhere(builder.knowledge, item, place, builder.avoided))
    around = tuple(builder.surface(name) for name in builder.knowledge.surfaces if name in surfaces)
    if (floor := last_known_floor(builder, item)) is not None:
        around = (*around, floor)
    key = builder.key("detection")
    search = search_plan(builder.at("find"), item, place, key, anywhere=anywhere)
    get = pick_up_plan(builder, item, search, key, around)
    if not builder.in_gripper:
        held = known_held_plan(builder.at("have"), item)
        alone = HoldsNothingElse(str(item), builder.search_classes(item.name), item.attributes)
        get = builder.guarded(f"get the {item} with an empty gripper", get, alone, part="empty-handed")
        have = builder.first_of(f"have the {item}, or get it", held, get, part="have")
        return builder.sequence(f"get the {item} {place_phrase(builder.knowledge, place)}", have)
    get = builder.at("get").sequence("get it", get)
    return builder.first_of(f"have the {item}", held_plan(builder, item), get)


def meet_plan(builder: PlanBuilder, person: str, place: str | None = None) -> NodeSpec:
    """Finds a person and goes to them, by the task that meets people. Raises InputError where none is installed."""
    meets = next((task for task in installed_tasks().values() if task.meets), None)
    if meets is None:
        raise builder.error(f"no installed task goes to {person}", "install a plug-in that meets people")
    return task_plan(meets, replace(builder, command=Command(goal=place, task=meets, object=ObjectKind(person))))


def task_plan(task: Task, builder: PlanBuilder) -> NodeSpec:
    """Plans a command by the page of its task. Raises InputError for a part that the task does not have."""
    command = builder.command
    given = ((command.goal, task.goal_is, "place"), (command.object, task.object_is, "object"))
    for value, part, name in given:
        if value is not None and part is Part.NOTHING:
            raise builder.error(f"'{task.word}' takes no {name}, as in '{value}'", "leave it out")
    node = from_page(task, "plan", lambda page: page.plan(builder), NodeSpec)
    for fault in plan_faults(node):
        raise defective(task, "plan", fault)
    return node


def go_to_goal(builder: PlanBuilder) -> NodeSpec:
    """Drives near the goal of a command, into a room, or exactly to a named pose; or finds the person who is the goal.

    Raises InputError when the command names no goal.
    """
    goal, at, knowledge = builder.command.goal, builder.command.goal_at, builder.knowledge
    if goal is None:
        raise builder.error("the command names no place", "name one")
    to, person = goal_in_words(builder, goal), knowledge.person(goal)
    if person is not None:
        drive = meet_plan(builder.at("meet"), person, None if at is None else builder.place(at))
    elif knowledge.place(goal) in knowledge.poses:
        drive = builder.navigate(goal_pose(builder, goal), to, exactly=True)
    elif (room := knowledge.place(goal)) in knowledge.rooms and goal != START:
        drive = go_into_plan(builder, str(room))
    else:
        drive = go_near_plan(builder, goal_pose(builder, goal), to)
    return carried_along_plan(builder, drive, f"to {to}")


def go_to_object(builder: PlanBuilder, key: str) -> NodeSpec:
    """Plans finding the object of a command, and approaching it; the observation is under a blackboard key then.

    Raises InputError when the command names no object.
    """
    item = builder.required_object(builder.command.object)
    place = None if builder.command.goal is None else builder.place(builder.command.goal)
    below = builder.at("go")
    around = tuple(builder.surface(name) for name in surfaces_to_search(builder.knowledge, item, place))
    approach = below.skill("approach", {"observation": FromBoard(key), "surfaces": around})
    search = search_plan(below.at("find"), item, place, key)
    return below.sequence(f"go to the {item}", search, approach)


def go_plan(builder: PlanBuilder) -> NodeSpec:
    """Drives to a place, a person or the start; carries the item if the command has one."""
    command = builder.command
    if command.item is not None:
        person, meet = builder.knowledge.person(command.goal or ""), None
        if person is not None and _is_to_be_found(builder, person):
            at = command.goal_at or builder.knowledge.people[person].at
            meet = meet_plan(builder.at("meet"), person, builder.place(at))
        return carry_plan(builder, meet)
    if command.goal is None:
        raise builder.error("the command asks for nothing", "name a place to go to, or an object")
    to = goal_in_words(builder, command.goal)
    return builder.sequence(f"go to {to}", go_to_goal(builder))


def _is_to_be_found(builder: PlanBuilder, person: str) -> bool:
    """Returns whether a hand-over begins with a search: at a place that is said, or where others usually are, too."""
    said = builder.command.goal_at is not None
    rooms = {name: builder.knowledge.room(builder.place(each.at)) for name, each in builder.knowledge.people.items()}
    several = person not in builder.met and list(rooms.values()).count(rooms[person]) > 1
    asks = several and any(task.meets for task in installed_tasks().values())
    return (said or asks) and builder.has_ports("find_people", ())


def are_trips(get: Command, bring: Command | None) -> bool:
    """Returns whether two adjacent commands get several objects and bring the same number of them somewhere."""
    if bring is None or not get.takes or get.object is None or get.object_count < 2:
        return False
    carried, count = (bring.item, bring.item_count) if bring.task is None else (bring.object, bring.object_count)
    same = carried is not None and carried.plain == get.object.plain and count == get.object_count
    return (bring.task is None or bring.puts) and same


def trips_plan(builder: PlanBuilder, bring: Command) -> NodeSpec:
    """Gets one object and brings it to the goal, once for each object; `builder` belongs to the command to get them.

    Raises InputError for too many objects, a person as the goal, no source, or a source in which the robot would find
    the delivered objects again.
    """
    get, goal = builder.command, bring.goal
    count, item = get.object_count, get.object
    several = f"{count} of '{item}'"
    if count > MAX_TRIPS:
        raise builder.error(f"{several} are too many trips", f"ask for {MAX_TRIPS} at most")
    if goal == START or (goal is not None and builder.knowledge.person(goal) is not None):
        hint = "name a place with a surface to put them on"
        raise builder.error(f"{several} cannot be handed over: a person takes one object", hint)
    if get.goal is None:
        raise builder.error(f"it is not said where to take {several} from", "name the place")
    brought = set(builder.knowledge.surfaces_in(builder.place(goal))) if goal is not None else set()
    if item is not None and brought & set(surfaces_to_search(builder.knowledge, item, builder.place(get.goal))):
        hint = "name the surface that they are to be taken from"
        raise builder.error(f"{several} that lie in the {get.goal} already look like those brought there", hint)
    trips = []
    for number in range(1, count + 1):
        trip = builder.at(f"trip-{number}")
        get_one = replace(trip.at("get"), command=replace(get, object_count=1))
        bring_one = replace(trip.at("bring"), command=replace(bring, item_count=1, object_count=1))
        trips.append(trip.sequence(f"trip {number}", grasp_plan(get_one, anywhere=False), carry_plan(bring_one)))
    return builder.sequence(f"bring {count_of(count, str(item and item.plain))} to the {goal}, one at a time", *trips)


PLANS: Final[StepPlans] = {Do: _plan, Say: _plan}


def _met_after(command: Command, met: frozenset[str], knowledge: Knowledge) -> frozenset[str]:
    """Returns the people whom the robot has met at their places, after a successful command."""
    if command.task is not None and command.task.moves and command.object is not None:
        return met - {knowledge.person(command.object.name) or ""}
    goes = command.task is None and command.item is None and command.goal is not None
    return met | set(filter(None, (knowledge.person(command.goal or ""),))) if goes else met
