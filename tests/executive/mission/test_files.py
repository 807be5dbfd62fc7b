"""Files that use files, parameters, knowledge of their own, and skill steps."""

import pytest

from executive.mission.load import knowledge_of_mission, load_mission
from executive.mission.resolve import MAX_DEPTH, mission_from_file
from executive.tree.board import Constant, FromBoard
from skills.inputs.errors import InputError
from skills.robot import Pose2D

VISIT = """\
name: visit ${room}
parameters: {room: kitchen, limit: 30, thing: null}
steps:
  - {to: "${room}", timeout: "${limit}"}
  - {to: "${room}", do: find, object: "${thing}"}
"""
ROUND = """\
name: round
steps:
  - use: visit.yaml
    with: {room: office, thing: hammer}
  - use: visit.yaml
    with: {thing: coke, limit: 9.5}
"""


def refused(compile_text, text, **others):
    with pytest.raises(InputError) as error:
        compile_text(text, **others)
    return error.value


def inputs(tree, path_id):
    return next(node for node in tree.root.walk() if node.path_id == path_id).options["inputs"]


def test_a_used_file_stands_in_the_tree_with_its_parameters_and_lines(compile_text):
    tree = compile_text(ROUND, visit=VISIT)
    assert [str(command) for command in tree.commands] == [
        "Take [Nothing] to [office] and do [Nothing] to [Nothing]",
        "Take [Nothing] to [office] and do [find] to [hammer]",
        "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]",
        "Take [Nothing] to [kitchen] and do [find] to [coke]",
    ]
    assert {"alice/round/1-visit-office/1-office", "alice/round/2-visit-kitchen/2-kitchen"} <= set(tree.path_ids)
    limits = [node.options["limit_s"] for node in tree.root.walk() if node.kind == "timeout"]
    assert limits == [30, 9.5]
    node = next(node for node in tree.root.walk() if node.path_id == "alice/round/1-visit-office/1-office")
    assert (node.source.file.name, node.source.line) == ("visit.yaml", 4)


def test_every_node_of_a_file_maps_to_a_line(compile_file, missions):
    without = [node.path_id for path in missions for node in compile_file(path).root.walk() if node.source is None]
    assert without == []


def test_a_parameter_within_a_text_and_a_plain_one(compile_text):
    tree = compile_text('name: "$${x} ${place} round"\nparameters: {place: 7}\nsteps: [{to: hall}]\n')
    assert tree.mission_name == "${x} 7 round"


def test_files_in_a_circle_name_the_circle(compile_text):
    other = "name: b\nsteps:\n  - use: mission.yaml\n"
    error = refused(compile_text, "name: a\nsteps:\n  - use: other.yaml\n", other=other)
    assert "mission.yaml -> other.yaml -> mission.yaml" in str(error)
    assert (error.line, error.file.name) == (3, "other.yaml")


def test_files_that_multiply_are_stopped(compile_text, monkeypatch):
    monkeypatch.setattr("executive.mission.resolve.MAX_STEPS", 500)
    text = "name: n\nsteps:\n" + "  - use: next.yaml\n" * 10
    files = {f"f{n}": text.replace("next", f"f{n + 1}") for n in range(5)}
    error = refused(compile_text, text.replace("next", "f0"), **files, f5="name: end\nsteps: [{to: hall}]\n")
    assert "more than 500 steps" in str(error)


def chain(length):
    """Mission files, of which each uses the next."""
    files = {f"f{n}": f"name: f{n}\nsteps:\n  - use: f{n + 1}.yaml\n" for n in range(length)}
    return {"text": files.pop("f0"), **files, f"f{length}": "name: end\nsteps: [{to: hall}]\n"}


@pytest.mark.parametrize("most", [MAX_DEPTH, 300])
def test_a_chain_of_used_files_has_an_end(compile_text, most):
    error = refused(compile_text, **chain(most))
    assert (error.line, error.file.name) == (3, f"f{MAX_DEPTH - 1}.yaml")
    assert str(MAX_DEPTH) in error.message
    assert len(str(error)) < 2000


def test_the_longest_chain_of_used_files_compiles(compile_text):
    assert len(compile_text(**chain(MAX_DEPTH - 1)).commands) == 1


def test_knowledge_of_the_file_is_laid_over_the_worlds(write, parser, flat):
    path = write(
        "name: m\nknowledge:\n  people: {Sam: {at: office, aliases: [the boss]}}\n  things: {coke: {usual: [desk]}}\n"
        "steps:\n  - {to: the boss}\n"
    )
    knowledge = knowledge_of_mission(load_mission(path), flat)
    assert (knowledge.people["Sam"].at, knowledge.things["coke"].usual) == ("office", ("desk",))
    assert knowledge.things["coke"].categories == ("drink",)
    assert knowledge_of_mission(load_mission(path), knowledge) == knowledge
    assert mission_from_file(path, parser=parser, knowledge=knowledge).commands[0].goal == "Sam"


def test_a_plain_pose_is_a_goal(compile_text):
    tree = compile_text("name: m\nsteps:\n  - skill: navigate\n    with: {x: 1, y: 2, yaw: 0.5, max_speed: 0.4}\n")
    ports = inputs(tree, "alice/m/1-navigate")
    assert ports == {"goal": Constant(Pose2D(1.0, 2.0, 0.5)), "max_speed_m_s": Constant(0.4)}


DETECT = """\
name: m
steps:
  - skill: detect
    with: {classes: [hammer], surfaces: workbench}
    gives: {observation: tool}
  - skill: grasp
    with: {observation: {from: tool}}
"""


def test_later_skill_takes_the_output_of_an_earlier_one(compile_text):
    observation = inputs(compile_text(DETECT), "alice/m/2-grasp")["observation"]
    assert observation == FromBoard("alice/m/1-detect/observation")
