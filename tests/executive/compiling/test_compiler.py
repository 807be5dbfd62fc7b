"""From commands to trees: which nodes, which ids, and what is refused."""

import time

import pytest

from executive.behaviours.board import FromBoard
from executive.command import parse_command
from executive.compiler import Step, compile_commands
from executive.compiling.plans import AnswerPlan, HoldingPlan, SkillPlan, Source
from executive.compiling.search import surfaces_to_search
from executive.errors import InputError
from skills.robot import Pose2D


def skills_of(tree):
    return [node for node in tree.root.walk() if isinstance(node, SkillPlan)]


def port(node, name):
    return dict(node.inputs)[name]


def test_fetch_has_these_path_ids(compiled, make):
    assert compiled(*make.FETCH).path_ids == (
        "alice/fetch-drink",
        "alice/fetch-drink/remember-start",
        "alice/fetch-drink/1-kitchen",
        "alice/fetch-drink/1-kitchen/attempts",
        "alice/fetch-drink/1-kitchen/pick-up",
        "alice/fetch-drink/1-kitchen/find",
        "alice/fetch-drink/1-kitchen/find/again",
        "alice/fetch-drink/1-kitchen/find/again/seen-before",
        "alice/fetch-drink/1-kitchen/find/again/detect",
        "alice/fetch-drink/1-kitchen/find/counter-1",
        "alice/fetch-drink/1-kitchen/find/counter-1/navigate",
        "alice/fetch-drink/1-kitchen/find/counter-1/detect",
        "alice/fetch-drink/1-kitchen/find/counter-2",
        "alice/fetch-drink/1-kitchen/find/counter-2/navigate",
        "alice/fetch-drink/1-kitchen/find/counter-2/detect",
        "alice/fetch-drink/1-kitchen/find/shelf-1",
        "alice/fetch-drink/1-kitchen/find/shelf-1/navigate",
        "alice/fetch-drink/1-kitchen/find/shelf-1/detect",
        "alice/fetch-drink/1-kitchen/approach",
        "alice/fetch-drink/1-kitchen/grasp",
        "alice/fetch-drink/1-kitchen/stow",
        "alice/fetch-drink/2-start",
        "alice/fetch-drink/2-start/bring",
        "alice/fetch-drink/2-start/navigate",
        "alice/fetch-drink/2-start/hand-over",
    )


def test_compiling_twice_gives_equal_trees(compiled, make):
    assert compiled(*make.FETCH) == compiled(*make.FETCH)


def test_usual_surfaces_come_first_and_the_others_after(knowledge):
    assert surfaces_to_search(knowledge, "drink", "kitchen") == ("counter", "shelf")
    assert surfaces_to_search(knowledge, "hammer", "kitchen") == ("shelf", "counter")
    assert surfaces_to_search(knowledge, "drink", None) == ("counter", "shelf", "bedside table")
    assert surfaces_to_search(knowledge, "drink", "shelf") == ("shelf",)


def test_a_category_is_looked_for_by_its_classes(compiled, make):
    detect = next(node for node in skills_of(compiled(*make.FETCH)) if node.name == "detect")
    assert port(detect, "classes").value == ("coke", "beer")


def test_attributes_reach_the_detector(compiled):
    tree = compiled("Take [Nothing] to [kitchen] and do [grasp] to [red hammer]")
    detect = next(node for node in skills_of(tree) if node.name == "detect")
    assert port(detect, "attributes").value == ("red",)


def test_the_way_back_leads_to_the_remembered_pose_under_a_guard(compiled, make):
    tree = compiled(*make.FETCH)
    (guard,) = [node for node in tree.root.walk() if isinstance(node, HoldingPlan)]
    navigate = [node for node in skills_of(tree) if node.name == "navigate"][-1]
    assert port(navigate, "goal") == FromBoard("alice/fetch-drink/start-pose")
    assert navigate in list(guard.walk())


def test_the_start_is_remembered_only_when_needed(compiled):
    tree = compiled("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    assert [node.kind for node in tree.root.walk()] == ["sequence", "sequence", "skill"]
    assert port(skills_of(tree)[0], "goal").value == Pose2D(-4.0, 0.0, 0.0)


def test_a_thing_is_put_on_any_surface_of_a_room(compiled):
    tree = compiled("Take [coke] to [kitchen] and do [Nothing] to [Nothing]")
    places = [node for node in skills_of(tree) if node.name == "place"]
    assert [port(node, "surface").value.name for node in places] == ["shelf", "counter"]
    assert tree.root.children[0].kind == "selector"


def test_placing_is_carrying(compiled):
    texts = (
        "Take [coke] to [shelf] and do [Nothing] to [Nothing]",
        "Take [Nothing] to [shelf] and do [place] to [coke]",
    )
    first, second = (compiled(text).path_ids for text in texts)
    assert first == second


def test_a_person_gets_it_where_they_are_and_is_faced(compiled):
    tree = compiled("Take [coke] to [Sam] and do [Nothing] to [Nothing]")
    navigate, hand_over = skills_of(tree)
    goal = port(navigate, "goal").value
    assert (goal.x_m, goal.y_m, round(goal.yaw_rad, 4)) == (0.0, 4.0, 0.7854)
    assert port(hand_over, "person").value == "Sam"


def test_a_person_said_to_be_elsewhere_is_met_there(compiled):
    tree = compiled("Take [coke] to [Sam at bedroom] and do [Nothing] to [Nothing]")
    assert port(skills_of(tree)[0], "goal").value == Pose2D(-4.0, 0.0, 0.0)


def test_the_person_at_the_start_is_named_when_known(compiled, make):
    hand_over = skills_of(compiled(*make.FETCH))[-1]
    assert port(hand_over, "person").value == "Robin"


def test_a_status_check_names_every_look(compiled):
    tree = compiled("Take [Nothing] to [kitchen] and do [find] to [drink]", name="check")
    (answer,) = [node for node in tree.root.walk() if isinstance(node, AnswerPlan)]
    base = "alice/check/1-kitchen/search"
    assert answer.looks == (
        ("counter", (f"{base}/counter-1/detect", f"{base}/counter-2/detect")),
        ("shelf", (f"{base}/shelf-1/detect",)),
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "Take [Nothing] to [kichen] and do [grasp] to [coke]",
            "the place 'kichen' is not known.*did you mean 'kitchen'",
        ),
        ("Take [Nothing] to [kitchen] and do [grasp] to [unicorn]", "the thing 'unicorn' is not known.*known are"),
        ("Take [Nothing] to [bathroom] and do [grasp] to [coke]", "no surface to look at"),
        ("Take [coke] to [bathroom] and do [Nothing] to [Nothing]", "no surface to put the coke on"),
        ("Take [Nothing] to [Nothing] and do [Nothing] to [Nothing]", "asks for nothing"),
        ("Take [coke] to [Nothing] and do [Nothing] to [Nothing]", "not said where"),
        ("Take [coke] to [kitchen] and do [grasp] to [beer]", "one gripper"),
        ("Take [Nothing] to [kitchen] and do [grasp] to [2 coke]", "2 of 'coke' cannot be carried in one go"),
        ("Take [Nothing] to [kitchen] and do [grasp] to [several coke]", "cannot be carried in one go|is no"),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_reason(compiled, text, words):
    with pytest.raises((InputError, ValueError), match=words):
        compiled(text)


def test_refusals_name_the_line(knowledge, registry, tmp_path):
    command = parse_command("Take [Nothing] to [moon] and do [Nothing] to [Nothing]")
    step = Step(command, Source(tmp_path / "m.yaml", 7))
    with pytest.raises(InputError, match=r"m\.yaml:7: the place 'moon'"):
        compile_commands("m", [step], knowledge=knowledge, registry=registry, robot_name="Alice")


def test_nodes_keep_their_line(knowledge, registry, tmp_path):
    source = Source(tmp_path / "m.yaml", 4)
    command = parse_command("Take [Nothing] to [kitchen] and do [grasp] to [coke]")
    tree = compile_commands("m", [Step(command, source)], knowledge=knowledge, registry=registry, robot_name="Alice")
    assert {node.source for node in tree.root.children[0].walk()} == {source}


def test_an_absent_skill_and_an_empty_mission_are_refused(knowledge, registry):
    command = parse_command("Take [Nothing] to [bedroom] and do [Nothing] to [Nothing]")
    with pytest.raises(InputError, match="no skill 'navigate'"):
        compile_commands("m", [Step(command)], knowledge=knowledge, registry={}, robot_name="Alice")
    with pytest.raises(InputError, match="no commands"):
        compile_commands("m", [], knowledge=knowledge, registry=registry, robot_name="Alice")


def test_a_mission_of_a_hundred_steps_compiles_fast(compiled, make):
    began = time.perf_counter()
    tree = compiled(*(make.FETCH * 50))
    assert len(tree.root.children) == 101
    assert time.perf_counter() - began < 1.0
