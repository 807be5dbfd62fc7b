"""Everything on one surface is taken to another, one object after the other."""

import pytest

from executive.app.runs.goal_conditions import conditions_of
from executive.run.outcome import Outcome
from executive.tree.board import Constant
from executive.words.goal import GoalKind
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded

GET = "Take [Nothing] to [counter] and do [grasp] to [everything]"
BRING = "Take [everything] to [bedside table] and do [Nothing] to [Nothing]"
BASE = "alice/fetch-drink/1-counter"


def standing(name, x):
    return ObjectObservation(0.0, ObjectKind(name), (x, -1.5, 0.95), (0.06, 0.06, 0.1), 0.0, 0.9, "counter")


@pytest.fixture
def table(script):
    """What stands on the counter, in the order in which it is seen; placed objects are taken off."""
    there = [standing("cube", 5.2), standing("thing", 5.5), standing("thing", 5.8)]

    def look(skill):
        avoided = [each.position_W for each in skill.inputs.avoid]
        left = sorted(there, key=lambda each: each.position_W in avoided)
        if not left:
            return Failed(Cause.POSTCONDITION, "no thing seen")
        return Succeeded("seen", {"observation": left[0], "observations": tuple(left), "unexplained": ()})

    def hold(skill):
        skill.context.robot._robot.holding = True
        there.remove(skill.inputs.observation)
        return Succeeded("held", {"tried": ()})

    def put_down(skill):
        skill.context.robot._robot.holding = False
        return Succeeded("put down")

    near = {"approach": lambda skill: Succeeded("near", {"observation": skill.inputs.observation})}
    script.ends |= {"detect": look, "grasp": hold, "place": put_down, **near}
    return there


def test_one_look_and_one_move_serve_for_all_objects(compiled):
    tree = compiled(GET, BRING)
    (rounds,) = [node for node in tree.root.walk() if node.kind == "for each found"]
    assert [child.path_id for child in rounds.children] == [f"{BASE}/left", f"{BASE}/move"]
    assert rounds.options["limit"] == 12


def test_any_object_is_looked_for(compiled):
    detects = [node for node in compiled(GET, BRING).mission.walk() if node.name == "detect"]
    assert {node.options["inputs"]["classes"] for node in detects} == {Constant(("thing",))}


def test_clearing_continues_until_no_object_is_left_and_reports_the_moved_ones(compiled, run_tree, script, table):
    result = run_tree(compiled(GET, BRING)).robots[0]
    assert result.outcome is Outcome.SUCCESS
    assert result.message == "moved one cube and two things to the bedside table; nothing is left on the counter"
    assert (script.begun.count("grasp"), script.begun.count("place")) == (3, 3)


def test_an_empty_surface_is_cleared_already(compiled, run_tree, script, table):
    table.clear()
    result = run_tree(compiled(GET, BRING)).robots[0]
    assert (result.outcome, result.message) == (Outcome.SUCCESS, "nothing is on the counter")
    assert "grasp" not in script.begun


def test_an_object_that_cannot_be_taken_comes_last_and_then_fails(compiled, run_tree, script, table):
    wide, hold = table[0], script.ends["grasp"]

    def try_to_hold(skill):
        return Failed(Cause.PLANNING, "too wide") if skill.inputs.observation == wide else hold(skill)

    script.ends["grasp"] = try_to_hold
    result = run_tree(compiled(GET, BRING)).robots[0]
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.PLANNING)
    assert result.message.startswith("moved two things to the bedside table, then too wide")
    assert table == [wide]


def test_an_object_gone_after_a_failure_is_no_success(compiled, run_tree, script, table):
    del table[1:]

    def push_off(skill):
        table.clear()
        return Failed(Cause.POSTCONDITION, "it slipped")

    script.ends["grasp"] = push_off
    result = run_tree(compiled(GET, BRING)).robots[0]
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.POSTCONDITION)
    assert "the cube is gone from there" in result.message


def test_a_look_that_was_not_possible_is_no_sign_that_nothing_is_left(compiled, run_tree, script, table):
    script.ends["detect"] = lambda skill: Failed(Cause.EXECUTION, "it is dark")
    result = run_tree(compiled(GET, BRING)).robots[0]
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.EXECUTION)


def test_no_more_than_the_limit_is_moved(compiled, run_tree, script, table):
    table += [standing("thing", 10.0 + number) for number in range(12)]
    result = run_tree(compiled(GET, BRING), settings={"time_limit_s": 1e4}).robots[0]
    assert result.outcome is Outcome.FAILURE
    assert "something is left on the counter" in result.message
    assert script.begun.count("place") == 12


def test_the_conditions_are_that_nothing_is_left_and_all_of_it_is_there(compiled, run_tree, table):
    tree = compiled(GET, BRING)
    left, there = conditions_of(tree, run_tree(tree).robots[0])
    assert (left.kind, there.kind) == (GoalKind.CLEARED, GoalKind.CLEARED)
    assert [area.name for area in left.source] == [area.name for area in there.source] == ["counter"]
    assert (left.goal, [area.name for area in there.goal]) == ((), ["bedside table"])


def test_a_thing_on_its_own_is_any_object(compiled):
    tree = compiled(GET.replace("everything", "thing"))
    detects = [node for node in tree.mission.walk() if node.name == "detect"]
    assert {node.options["inputs"]["classes"] for node in detects} == {Constant(("thing",))}
    asked = compiled(GET.replace("everything", "thing").replace("grasp", "find"))
    (look, *_) = [node for node in asked.mission.walk() if node.name == "detect"]
    assert look.options["inputs"]["classes"] == Constant(("coke", "beer", "hammer"))
