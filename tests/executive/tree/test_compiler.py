"""From commands to trees: which nodes, which ids, and what is refused."""

import re

import pytest
from py_trees.common import Status

from executive.app.runs.goal_conditions import conditions_of
from executive.run.outcome import Outcome
from executive.tree.behaviour import ExplainedDecorator, ExplainedNode, MemoryComposite
from executive.tree.board import FromBoard
from executive.tree.compiler import build, compile_mission, writes
from executive.tree.goals import surfaces_to_search
from executive.tree.node import NodeSpec, node_classes, node_pages
from executive.tree.nodes.policies import Timeout
from executive.words.command import parse_command
from executive.words.knowledge import TagFacts
from executive.words.leaf_steps import Check, Do, steps_of_commands
from executive.words.mission import Mission
from executive.words.step import Place
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import YamlSource
from skills.robot import Pose2D
from skills.small.charging import LocateDock
from tests.sources import modules
from tests.tables import yaml_beside

LEAVES, IMPOSSIBLE = (yaml_beside(__file__, f"{name}.yaml") for name in ("leaves_of_a_fetch", "impossible_commands"))


def skills_of(tree):
    """The skills that run when all goes well."""
    return [node for node in followed(tree.mission) if node.kind == "skill"]


def followed(node):
    yield node
    for child in node.behaviour.usual_children(node):
        yield from followed(child)


def port(node, name):
    return node.options["inputs"][name]


def test_the_leaves_of_a_fetch_have_these_path_ids(compiled, make):
    ids = [node.path_id for node in compiled(*make.FETCH).mission.walk() if not node.children]
    assert [path_id.removeprefix("alice/fetch-drink/") for path_id in ids] == LEAVES


def test_every_mission_is_watched_in_order_of_priority(compiled, make):
    tree = compiled(*make.FETCH)
    watches = [node.path_id.rpartition("/")[2] for node in tree.root.children[:-1]]
    assert watches == ["stop-button", "lease", "battery", "lost"]
    assert (tree.root.path_id, tree.root.children[-1]) == ("alice/fetch-drink/watch", tree.mission)


def test_compiling_twice_gives_equal_trees(compiled, make):
    assert compiled(*make.FETCH) == compiled(*make.FETCH)


def test_usual_surfaces_come_first_and_the_others_after(knowledge):
    drink, hammer = ObjectKind("drink"), ObjectKind("hammer")
    asked = ((drink, "kitchen"), (hammer, "kitchen"), (drink, None), (drink, "shelf"))
    assert [surfaces_to_search(knowledge, *each) for each in asked] == [
        ("counter", "shelf"),
        ("shelf", "counter"),
        ("counter", "shelf", "bedside table"),
        ("shelf",),
    ]


@pytest.mark.parametrize(
    ("goal", "asked", "classes", "attributes"),
    [
        ("counter", "find] to [some object", ("coke", "beer", "hammer"), ()),
        ("kitchen", "grasp] to [drink", ("coke", "beer"), ()),
        ("kitchen", "grasp] to [red hammer", ("hammer",), ("red",)),
    ],
)
def test_the_detector_gets_classes_and_attributes(compiled, goal, asked, classes, attributes):
    tree = compiled(f"Take [Nothing] to [{goal}] and do [{asked}]")
    found = [node.options["inputs"] for node in tree.mission.walk() if node.name == "detect"]
    assert {(each["classes"].value, each["attributes"].value) for each in found} == {(classes, attributes)}


def test_the_drive_back_leads_to_the_remembered_pose_under_a_guard(compiled, make):
    tree = compiled(*make.FETCH)
    (guard,) = [node for node in tree.root.walk() if node.path_id == "alice/fetch-drink/2-start"]
    (navigate,) = [node for node in skills_of(tree) if node.path_id.endswith("2-start/navigate")]
    assert guard.kind == "guard"
    assert port(navigate, "goal") == FromBoard("alice/fetch-drink/start-pose")
    assert navigate in list(guard.walk())


def test_the_start_is_remembered_only_when_needed(compiled):
    tree = compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    assert not [node for node in tree.mission.walk() if node.kind == "remember"]
    assert port(skills_of(tree)[0], "goal").value == Pose2D(-4.0, 0.0, 0.0)


def test_an_object_is_put_on_any_surface_of_a_room(compiled):
    tree = compiled("Take [coke] to [kitchen] and do [Nothing] to [Nothing]")
    places = [node for node in skills_of(tree) if node.name == "place"]
    assert [port(node, "surface").value.name for node in places] == ["shelf", "counter"]
    assert "selector" in [node.kind for node in tree.mission.children[0].walk()]


def test_placing_is_carrying(compiled):
    texts = (
        "Take [coke] to [shelf] and do [Nothing] to [Nothing]",
        "Take [Nothing] to [shelf] and do [place] to [coke]",
    )
    first, second = (compiled(text).path_ids for text in texts)
    assert first == second


def test_a_person_gets_it_where_they_usually_are(compiled):
    navigate, hand_over = skills_of(compiled("Take [coke] to [Sam] and do [Nothing] to [Nothing]"))
    pose = port(navigate, "goal").value
    assert (pose.x_m, pose.y_m, round(pose.yaw_rad, 4)) == (0.0, 4.0, 0.7854)  # faced
    assert port(hand_over, "person").value == "Sam"


def test_a_person_at_a_place_is_found_there_before_they_get_it(compiled):
    *way, hand_over = skills_of(compiled("Take [coke] to [Sam at bedroom] and do [Nothing] to [Nothing]"))
    looks = [each for each in way if each.skill.name == "find_people"]
    assert [port(each, "place").value for each in looks] == ["bedroom"]
    assert (way[-1].skill.name, port(hand_over, "person").value) == ("meet_person", "Sam")


def test_the_person_at_the_start_is_named_when_known(compiled, make):
    hand_over = skills_of(compiled(*make.FETCH))[-1]
    assert port(hand_over, "person").value == "Robin"


def test_a_status_check_names_every_look(compiled):
    tree = compiled("Take [Nothing] to [kitchen] and do [find] to [drink]", name="check")
    (answer,) = [node for node in tree.root.walk() if node.kind == "answer"]
    base = "alice/check/1-kitchen/search"
    assert answer.options["looks"] == {
        "counter": (f"{base}/counter-1/detect", f"{base}/counter-2/detect"),
        "shelf": (f"{base}/shelf-1/detect",),
    }


def seeing_people_in(rooms):
    """How a look for people ends who stand in some rooms."""

    def look(skill):
        if skill.inputs.place not in rooms:
            return Failed(Cause.POSTCONDITION, "nobody")
        (x_m, y_m), *_ = skill.inputs.area_W
        who = ObjectKind(skill.inputs.person)
        seen = ObjectObservation(0.0, who, (x_m, y_m, 1.0), (0.5, 0.5, 1.7), 0.0, 0.9, skill.inputs.place)
        return Succeeded(
            f"saw them in the {skill.inputs.place}", {"observation": seen, "observations": (seen,), "unexplained": ()}
        )

    return look


# goal        asked           people in   answer  rooms looked at  told
@pytest.mark.parametrize(
    ("goal", "asked", "people_in", "answer", "looks", "told"),
    [
        ("kitchen", "person", {"kitchen"}, True, 1, "yes: somebody in the kitchen"),
        ("kitchen", "person", set(), False, 1, "no: nobody in the kitchen"),
        ("Nothing", "person", {"bedroom"}, True, 2, "yes: somebody; saw them in the bedroom"),
        ("Nothing", "Robin", {"hall"}, True, 1, "yes: Robin; saw them in the hall"),
        ("Nothing", "Robin", set(), False, 4, "no: Robin is not anywhere"),
        ("Nothing", "some person", {"hall", "kitchen"}, 2, 4, "there are two people in the"),
        ("kitchen", "some person", set(), 0, 1, "no people in the kitchen"),
        ("kitchen", "2 person", {"kitchen"}, False, 1, "no: not two people in the kitchen; there is one person in the"),
    ],
)
def test_people_are_looked_for_in_rooms(
    compiled, knowledge, run_tree, script, goal, asked, people_in, answer, looks, told
):
    del knowledge.people["Sam"]

    script.ends["find_people"] = seeing_people_in(people_in)
    worst = run_tree(compiled(f"Take [Nothing] to [{goal}] and do [find] to [{asked}]")).worst
    assert (worst.outcome, list(worst.answers.values())) == (Outcome.SUCCESS, [answer])
    assert worst.message.startswith(told)
    assert script.begun.count("find_people") == looks


# not what      people in  answer  question  told
@pytest.mark.parametrize(
    ("asked", "people_in", "answer", "question", "told"),
    [
        ("person", set(), True, "is there nobody in the kitchen", "yes: nobody in the kitchen"),
        ("person", {"kitchen"}, False, "is there nobody in the kitchen", "no: somebody in the kitchen"),
        ("Robin", set(), True, "is Robin not in the kitchen", "yes: Robin is not in the kitchen"),
        (
            "2 person",
            {"kitchen"},
            True,
            "are there not two people in the kitchen",
            "yes: not two people in the kitchen",
        ),
    ],
)
def test_a_negated_question_has_one_answer_with_its_question(
    knowledge, registry, run_tree, script, asked, people_in, answer, question, told
):
    del knowledge.people["Sam"]
    script.ends["find_people"] = seeing_people_in(people_in)
    steps = (Check(condition={"not": {"object": asked, "at": "kitchen"}}),)
    mission = Mission(name="check", robot="Alice", steps=steps)
    worst = run_tree(compile_mission(mission, knowledge=knowledge, registry=registry)).worst
    (found,) = worst.findings
    assert (found.question, found.answer, found.sentence.split(";")[0]) == (question, answer, told)
    (condition,) = conditions_of(worst.tree, worst)
    assert (condition.question, condition.answer, condition.negated) == (question, answer, True)


# how many the look found before it failed -> the answer, or none
@pytest.mark.parametrize(("found", "answers"), [(2, [2]), (0, [])])
def test_a_count_of_people_in_a_room_that_was_not_seen_whole_is_the_least_number(
    compiled, run_tree, script, found, answers
):
    kind = ObjectKind("person")
    seen = [ObjectObservation(0.0, kind, (x, 0.0, 1.0), (0.5, 0.5, 1.7), 0.0, 0.9, "kitchen") for x in range(found)]
    outputs = {"observation": seen[0], "observations": tuple(seen)} if seen else {}
    script.ends["find_people"] = lambda skill: Failed(Cause.EXECUTION, "one may be hidden", outputs)
    robot = run_tree(compiled("Take [Nothing] to [kitchen] and do [find] to [some person]")).worst
    assert list(robot.answers.values()) == answers
    told = "there are at least two people in the kitchen; not all was seen in the kitchen"
    assert [(one.answer, one.at_least, one.sentence) for one in robot.findings] == [
        (each, True, told) for each in answers
    ]


def test_people_are_looked_for_from_the_door_when_somebody_blocks_it(compiled, run_tree, script):
    script.ends["navigate"] = lambda skill: Failed(Cause.PLANNING, "a person blocks the path")
    run_tree(compiled("Take [Nothing] to [kitchen] and do [find] to [person]"))
    assert script.begun.count("find_people") == 1


@pytest.mark.parametrize(
    ("asked", "seen_on", "answer", "told"),
    [
        ("some coke", ("counter", "shelf"), 2, "there are two cokes on the counter and"),
        ("2 coke", ("counter", "shelf"), True, "yes: two cokes in the kitchen; there are two cokes"),
        ("2 coke", ("shelf",), False, "no: not two cokes in the kitchen; there is one coke on the shelf"),
        ("some coke", (), 0, "no cokes in the kitchen"),
    ],
)
def test_objects_are_counted_on_all_surfaces_of_a_place(compiled, run_tree, script, asked, seen_on, answer, told):
    def look(skill):
        (surface,) = skill.inputs.surfaces
        if surface.name not in seen_on:
            return Failed(Cause.POSTCONDITION, "not seen")
        x_m, y_m = surface.polygon_W[0]
        seen = ObjectObservation(0.0, ObjectKind("coke"), (x_m, y_m, 1.0), (0.1, 0.1, 0.1), 0.0, 0.9, surface.name)
        return Succeeded("seen", {"observation": seen, "observations": (seen,), "unexplained": ()})

    script.ends["detect"] = look
    worst = run_tree(compiled(f"Take [Nothing] to [kitchen] and do [find] to [{asked}]")).worst
    assert (worst.outcome, list(worst.answers.values())) == (Outcome.SUCCESS, [answer])
    assert worst.message.startswith(told)
    assert script.begun.count("detect") == 3


@pytest.mark.parametrize("row", [row for rows in IMPOSSIBLE.values() for row in rows], ids=str)
def test_an_impossible_command_is_refused_with_a_reason_and_a_hint(compiled, row):
    with pytest.raises(InputError, match=row["message"]) as error:
        compiled(*row["input"])
    assert error.value.hint


@pytest.fixture
def compile_step(knowledge, registry):
    """Compiles a step from a command, on a line of a file, if one is given."""

    def compile_one(text, place=None, registry=registry):
        step = Do.from_command(parse_command(text)).with_place(place)
        mission = Mission(name="m", robot="Alice", steps=(step,))
        return compile_mission(mission, knowledge=knowledge, registry=registry)

    return compile_one


def test_nodes_and_refusals_have_the_line_of_their_step(compile_step, tmp_path):
    place = Place(YamlSource(tmp_path / "m.yaml", None, {}, first_line=7), ())
    tree = compile_step("Take [Nothing] to [kitchen] and do [grasp] to [coke]", place)
    assert {node.source for node in tree.mission.children[0].walk()} == {place.line()}
    with pytest.raises(InputError, match=r"m\.yaml:7: the place 'moon'"):
        compile_step("Take [Nothing] to [moon] and do [Nothing] to [Nothing]", place)


def test_an_absent_skill_and_an_empty_mission_are_refused(compile_step, compiled):
    with pytest.raises(InputError, match="no skill 'navigate'"):
        compile_step("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]", registry={})
    with pytest.raises(InputError, match="no commands"):
        compiled()


def test_a_mission_of_a_hundred_steps_compiles(compiled, make):
    assert len(compiled(*(make.FETCH * 50)).mission.children) == 101


WAIT = "Take [Nothing] to [{}] and do [wait] to [{}]"
CHARGE = "Take [Nothing] to [Nothing] and do [charge] to [Nothing]"


@pytest.mark.parametrize(("time", "duration_s"), [("10 second", 10.0), ("minute", 60.0), ("2 minutes", 120.0)])
def test_waiting_takes_its_time(compiled, time, duration_s):
    (pause,) = [node for node in followed(compiled(WAIT.format("Nothing", time)).mission) if node.kind == "pause"]
    assert pause.options["duration_s"] == duration_s


def test_waiting_in_a_place_goes_there_first(compiled, run_tree, script):
    tree = compiled(WAIT.format("kitchen", "10 second"))
    kinds = [node.kind for node in followed(tree.mission) if node.kind in ("skill", "pause")]
    assert (kinds[0], kinds[-1]) == ("skill", "pause")
    assert run_tree(tree).outcome is Outcome.SUCCESS
    assert script.begun == ["navigate"]


def test_waiting_where_it_stands_has_no_goal_condition_and_in_a_place_it_has(compiled):
    here, there = (compiled(WAIT.format(goal, "10 second")).parts[0].goal for goal in ("Nothing", "kitchen"))
    assert (here, there.goal[0].name) == (None, "kitchen")


def test_charging_goes_to_the_dock_and_charges_there(compiled, knowledge):
    tree = compiled(CHARGE)
    navigate, charge = skills_of(tree)
    dock = knowledge.dock
    assert port(navigate, "goal").value == Pose2D(dock.x, dock.y, dock.yaw)
    assert (charge.name, port(charge, "level").value) == ("charge", knowledge.battery.charged)
    assert tree.parts[0].goal.goal[0].name == "the dock"


def test_any_object_as_a_goal_has_all_classes(compiled, knowledge):
    tree = compiled("Take [Nothing] to [counter] and do [find] to [some object]")
    assert tree.parts[0].goal.classes == tuple(knowledge.things)


PAUSE = NodeSpec("pause", "alice/limit/wait", "wait", {"duration_s": 9.0})
LIMIT = NodeSpec("timeout", "alice/limit", "in time", {"limit_s": 5.0}, (PAUSE,))


def below(node):
    """All classes that derive from one, as often as they do."""
    return [each for child in node.__subclasses__() for each in (child, *below(child))]


def test_each_kind_of_node_has_exactly_one_class():
    pages = tuple(page.__name__ for page in node_pages())
    named = [node.kind for node in below(ExplainedNode) if node.__module__ in pages and node.kind]
    assert sorted(named) == sorted(node_classes())


def test_no_code_compares_the_kind_of_a_node():
    kinds = "|".join(map(re.escape, node_classes()))
    listed = rf"""(?:[=!]=|(?:not )?in)\s*[({{]?\s*["'](?:{kinds})["']"""
    compared = re.compile(rf"\.kind\s*{listed}|\b(?:node|spec)\.kind\s*[=!]=")
    found = [path for path, text in modules("executive", "skills", "plant").items() if compared.search(text)]
    assert found == []
    assert compared.search('if node.kind == "skill":') and compared.search("node.kind == Check.kind")


@pytest.mark.parametrize("node", node_classes().values(), ids=node_classes())
def test_each_node_with_children_documents_its_truth_table(node):
    with_children = issubclass(node, ExplainedDecorator | MemoryComposite)
    assert not with_children or "| status |" in node.__doc__ or "status of its only child" in node.__doc__.lower()


def test_a_spec_becomes_its_node_on_the_runs_clock(context, clock):
    root = build(LIMIT, context)
    assert isinstance(root, Timeout)
    assert [node.path_id for node in root.iterate()] == ["alice/limit/wait", "alice/limit"]
    root.tick_once()
    assert root.status is Status.RUNNING
    clock.advance(6.0)
    root.tick_once()
    assert (root.status, root.children[0].status) == (Status.FAILURE, Status.INVALID)


def test_outputs_of_a_node_follow_from_its_options():
    assert writes(NodeSpec("remember", "alice/r", "r", {"key": "alice/pose"})) == {"alice/pose": Pose2D}
    assert writes(LIMIT) == {}


def test_a_tag_at_the_dock_is_looked_for_before_the_robot_drives_onto_it(knowledge, registry):
    dock, text = knowledge.dock, parse_command(CHARGE)
    tag = TagFacts(id=520, size=0.146, on="dock", at=(dock.x + 0.7, dock.y, 0.4), yaw=3.14159)
    mission = Mission(name="m", robot="Alice", steps=steps_of_commands([text]))
    with_tag = knowledge.model_copy(update={"tags": (tag,)})
    skills = {**registry, "locate_dock": LocateDock}
    before, look, onto, _ = skills_of(compile_mission(mission, knowledge=with_tag, registry=skills))
    assert port(before, "goal").value.x_m == pytest.approx(dock.x - 0.7)
    assert (look.name, port(look, "tag").value.id) == ("locate_dock", 520)
    assert port(onto, "goal").key == look.options["outputs"]["dock"]
