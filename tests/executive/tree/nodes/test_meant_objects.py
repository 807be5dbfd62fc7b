"""Commands with relations: what the skills get, what the referee judges, and how a search ends that cannot tell."""

import pytest

from executive.run.outcome import Outcome
from executive.words.goal import GoalKind
from skills.api import Cause, Failed
from skills.relations import RelationKind
from skills.robot import Pose2D

GRASP = "Take [Nothing] to [kitchen] and do [grasp] to [coke left of the beer]"
PUT = "Take [coke] to [counter next to the beer] and do [Nothing] to [Nothing]"
FIND = "Take [Nothing] to [kitchen] and do [find] to [coke left of the beer]"


def inputs_of(tree, skill):
    """Ports of each leaf with a skill."""
    leaves = [node for node in tree.root.walk() if node.kind == "skill" and node.options["skill"].name == skill]
    return [leaf.options["inputs"] for leaf in leaves]


def test_the_search_gets_the_relations_with_the_classes_of_their_landmarks(compiled, knowledge):
    detects = inputs_of(compiled(GRASP), "detect")
    (relation,) = detects[0]["relations"].value
    assert (relation.kind, relation.landmarks[0].classes) == (RelationKind.LEFT_OF, ("beer",))
    assert all("relations" in each for each in detects)
    surfaces = [surface for each in detects for surface in getattr(each["surfaces"], "value", ())]
    view = knowledge.surfaces["counter"].viewpoints[0]
    assert {each.viewer for each in surfaces if each.name == "counter"} == {Pose2D(view.x, view.y, view.yaw)}


def test_a_search_without_relations_gets_no_port_for_them(compiled):
    plain = compiled(GRASP.replace(" left of the beer", ""))
    assert all("relations" not in each for each in inputs_of(plain, "detect"))


def test_a_dropped_object_is_found_without_relations_and_put_where_they_hold(compiled):
    tree = compiled(GRASP, PUT)
    goals = [each["relations"].value for each in inputs_of(tree, "place") if "relations" in each]
    assert [each.kind for relations in goals for each in relations] == [RelationKind.NEXT_TO]
    again = [node for node in tree.root.walk() if "again" in node.path_id and node.path_id.endswith("detect")]
    carried = [node for node in again if "carry-on" in node.path_id]
    assert carried and all("relations" not in node.options["inputs"] for node in carried)


def test_a_question_counts_all_objects_that_are_meant(compiled):
    assert {each["count"].value for each in inputs_of(compiled(FIND), "detect")} == {0}


def test_the_referee_judges_relations_of_the_object_and_of_the_goal(compiled):
    got, put = (part.goal for part in compiled(GRASP, PUT).parts)
    assert (got.kind, got.relations[0].kind, got.relations[0].landmarks[0].classes) == (
        GoalKind.GRASPED,
        RelationKind.LEFT_OF,
        ("beer",),
    )
    assert (put.kind, put.relations[0].kind) == (GoalKind.PLACED, RelationKind.NEXT_TO)
    assert all(region.viewer is not None for region in (*got.source, *put.goal))


def test_a_mission_with_relations_runs_to_its_end(compiled, run_tree, script):
    script.seen_on = {"counter"}
    assert run_tree(compiled(GRASP, PUT)).worst.outcome is Outcome.SUCCESS
    assert script.begun.count("place") == 1


@pytest.mark.parametrize("final", [True, False])
def test_a_search_that_cannot_tell_which_ends_at_once(compiled, run_tree, script, final):
    said = "there are two cokes on the counter left of the beer, and it is not said which one"
    script.ends["detect"] = lambda skill: Failed(Cause.PRECONDITION, said, final=final)
    result = run_tree(compiled(GRASP)).worst
    assert result.cause is Cause.PRECONDITION and said in result.message
    assert (script.begun.count("detect") == 1) is final


def test_a_question_about_several_is_in_the_plural(compiled):
    tree = compiled(FIND.replace("[coke", "[2 coke"))
    names = {node.name for node in tree.root.walk() if node.kind == "answer"}
    assert names == {"are there two cokes left of the beer in the kitchen?"}
