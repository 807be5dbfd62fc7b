"""Groups of steps: the zones that their skills mind."""

from executive.tree.compiler import compile_mission
from executive.words.command import Command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from executive.words.steps import Group, Try
from executive.words.zone import ZoneFacts
from skills.api import Succeeded

HALL, KITCHEN = (Do.from_command(Command(goal=goal)) for goal in ("hall", "kitchen"))
QUIET = ZoneFacts.model_validate({"kind": "silent", "place": "hall"})
CLOSED = ZoneFacts.model_validate({"kind": "keep_out", "polygon": [[5, 5], [6, 5], [6, 6]]})


def test_a_skill_minds_the_zones_of_its_group(script, run_tree, knowledge, registry):
    minded = []

    def arrive(skill):
        minded.append([zone.name for zone in skill.context.zones])
        return Succeeded("there")

    script.ends["navigate"] = arrive
    group = Group(steps=(KITCHEN,), zones={"corner": CLOSED})
    mission = Mission(name="round", robot="Alice", zones={"hall": QUIET}, steps=(HALL, group, HALL))
    tree = compile_mission(mission, knowledge=knowledge, registry=registry)
    assert run_tree(tree).robots[0].outcome.value == "success"
    assert minded == [["hall"], ["hall", "corner"], ["hall"]]
    assert [zone.name for zone in tree.zones] == ["hall"]


def test_zones_of_a_group_that_is_the_whole_mission_hold_for_its_interrupts(knowledge, registry):
    group = Group(steps=(KITCHEN,), zones={"corner": CLOSED})
    mission = Mission.from_steps((group,), world="test", robot="Alice")
    assert [zone.name for zone in compile_mission(mission, knowledge=knowledge, registry=registry).zones] == ["corner"]


def test_a_zone_of_a_mission_replaces_no_zone_of_the_world(knowledge, registry):
    known = knowledge.model_copy(update={"zones": {"hall": CLOSED}})
    mission = Mission(name="round", robot="Alice", zones={"hall": QUIET}, steps=(KITCHEN,))
    tree = compile_mission(mission, knowledge=known, registry=registry)
    assert [zone.words for zone in tree.zones] == ["keep out of: hall", "silent in: hall (mission)"]


def test_the_log_of_the_tree_has_the_zones(run_tree, published, knowledge, registry):
    group = Group(steps=(KITCHEN,), zones={"corner": CLOSED})
    mission = Mission(name="round", robot="Alice", zones={"hall": QUIET}, steps=(HALL, group))
    run_tree(compile_mission(mission, knowledge=knowledge, registry=registry))
    (logged,) = (message for topic, message in published if topic == "tree")
    assert [(zone["name"], zone["rule"]) for zone in logged["zones"]] == [
        ("hall", "silent in: hall"),
        ("corner", "keep out of: corner"),
    ]


def test_the_tree_names_the_zones_of_a_group(knowledge, registry):
    group = Group(steps=(KITCHEN,), zones={"corner": CLOSED, "hall": QUIET})
    tree = compile_mission(Mission(name="round", steps=(HALL, group)), knowledge=knowledge, registry=registry)
    assert "keep out of: corner; silent in: hall" in [node.name for node in tree.root.walk()]


def names(knowledge, registry, mission, kind):
    tree = compile_mission(mission, knowledge=knowledge, registry=registry)
    return [node.name for node in tree.root.walk() if node.kind == kind]


def test_a_try_is_named_after_what_it_tries_and_what_it_does_else(knowledge, registry):
    block = Try.model_validate({"try": [HALL], "else": [KITCHEN, HALL]})
    mission = Mission(name="round", robot="Alice", steps=(block,))
    assert names(knowledge, registry, mission, "try") == ["go to hall, else go to kitchen, then go to hall"]


def test_a_mission_with_steps_in_the_end_is_named_after_both(knowledge, registry):
    mission = Mission(name="round", robot="Alice", steps=(HALL,), always=(KITCHEN,))
    assert names(knowledge, registry, mission, "always") == ["round, in the end go to kitchen"]
