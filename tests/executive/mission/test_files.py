"""Files that use files, parameters, knowledge of their own, and skill steps."""

import pytest

from executive.mission.load import knowledge_of_mission, load_mission
from executive.mission.resolve import MAX_DEPTH, mission_from_file
from executive.tree.board import Constant, FromBoard
from skills.files.errors import InputError
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


def leaves(tree, name):
    return [node for node in tree.root.walk() if node.kind == "skill" and node.name == name]


def test_a_used_file_stands_in_the_tree_with_its_parameters(compile_text):
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


def test_nodes_of_a_used_file_map_to_its_lines(compile_text):
    tree = compile_text(ROUND, visit=VISIT)
    node = next(node for node in tree.root.walk() if node.path_id == "alice/round/1-visit-office/1-office")
    assert (node.source.file.name, node.source.line) == ("visit.yaml", 4)


def test_every_node_of_a_file_maps_to_a_line(compile_file, missions):
    without = [node.path_id for path in missions for node in compile_file(path).root.walk() if node.source is None]
    assert without == []


def test_a_parameter_within_a_text_and_a_plain_one(compile_text):
    tree = compile_text('name: "$${x} ${place} round"\nparameters: {place: 7}\nsteps: [{to: hall}]\n')
    assert tree.mission_name == "${x} 7 round"


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        (ROUND.replace("visit.yaml", "visitt.yaml", 1), 3, "did you mean 'visit.yaml'?"),
        (ROUND.replace("room: office", "rom: office"), 3, "did you mean 'room'?"),
        (ROUND.replace("  - use: visit.yaml", "  - use: mission.yaml", 1), 3, "mission.yaml -> mission.yaml"),
    ],
)
def test_a_wrong_use_is_refused_at_its_line(compile_text, text, line, says):
    error = refused(compile_text, text, visit=VISIT)
    assert (error.line, error.file.name, says in str(error)) == (line, "mission.yaml", True), str(error)


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ('"${thing}"', '"${thinng}"', 5, "did you mean '${thing}'?"),
        ("do: find", "do: fnd", 5, "did you mean 'find'?"),
        ("timeout", "timeuot", 4, "did you mean 'timeout'?"),
        ('to: "${room}", timeout', "to: moon, timeout", 4, "unknown place or person 'moon'"),
        ("limit: 30", "limit: soon", 4, "timeout: should be a number"),
        ("limit: 30", "1x: 30", 2, "cannot be a parameter's name"),
        ("limit: 30", "limit: [1]", 2, "cannot hold a list"),
        ("name: visit ${room}", "name: v\nworld: moon", 2, "'world' of a file that is used cannot differ"),
    ],
)
def test_an_error_in_a_used_file_names_both_lines(compile_text, old, new, line, says):
    assert old in VISIT
    error = refused(compile_text, ROUND.replace(", limit: 9.5", ""), visit=VISIT.replace(old, new, 1))
    assert (error.line, error.file.name) == (line, "visit.yaml"), str(error)
    assert says in str(error)
    assert "mission.yaml:3)" in error.message


def test_a_parameter_without_a_value_is_refused_at_its_line(compile_text):
    error = refused(compile_text, ROUND.replace("thing: coke, ", ""), visit=VISIT)
    assert (error.line, error.file.name) == (2, "visit.yaml")
    assert "parameter 'thing' has no value" in str(error)
    assert "mission.yaml:5)" in error.message


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


@pytest.mark.parametrize("most", [MAX_DEPTH, 300])
def test_a_chain_of_used_files_has_an_end(compile_text, most):
    last = {f"f{most}": "name: end\nsteps: [{to: hall}]\n"}
    files = {f"f{n}": f"name: f{n}\nsteps:\n  - use: f{n + 1}.yaml\n" for n in range(1, most)}
    error = refused(compile_text, "name: m\nsteps:\n  - use: f1.yaml\n", **files, **last)
    assert (error.line, error.file.name) == (3, f"f{MAX_DEPTH - 1}.yaml")
    assert str(MAX_DEPTH) in error.message
    assert len(str(error)) < 2000


def test_the_longest_chain_of_used_files_compiles(compile_text):
    last = {f"f{MAX_DEPTH - 1}": "name: end\nsteps: [{to: hall}]\n"}
    files = {f"f{n}": f"name: f{n}\nsteps:\n  - use: f{n + 1}.yaml\n" for n in range(1, MAX_DEPTH - 1)}
    tree = compile_text("name: m\nsteps:\n  - use: f1.yaml\n", **files, **last)
    assert len(tree.commands) == 1


def test_knowledge_of_the_file_is_laid_over_the_worlds(tmp_path, parser, flat):
    path = tmp_path / "m.yaml"
    path.write_text(
        "name: m\nknowledge:\n  people: {Sam: {at: office, aliases: [the boss]}}\n  things: {coke: {usual: [desk]}}\n"
        "steps:\n  - {to: the boss}\n"
    )
    knowledge = knowledge_of_mission(load_mission(path), flat)
    assert (knowledge.people["Sam"].at, knowledge.things["coke"].usual) == ("office", ("desk",))
    assert knowledge.things["coke"].categories == ("drink",)
    assert knowledge_of_mission(load_mission(path), knowledge) == knowledge
    own = knowledge_of_mission(load_mission(path), flat)
    assert mission_from_file(path, parser=parser, knowledge=own).commands[0].goal == "Sam"


@pytest.mark.parametrize(
    ("override", "line", "says"),
    [
        ("{people: {Robin: {at: mars}}}", 2, "'mars' is not known"),
        ("\n  things:\n    coke: {usal: [desk]}", 4, "did you mean 'usual'?"),
        ("\n  places:\n    attic: {pose: {x: 1, y: 1}}", 4, "'polygon' is missing"),
        ("{dock: 3}", 2, "dock: should be a mapping"),
    ],
)
def test_wrong_knowledge_is_refused_at_the_files_line(compile_text, override, line, says):
    error = refused(compile_text, f"name: m\nknowledge: {override}\nsteps: [{{to: hall}}]\n")
    assert (error.line, error.file.name, says in str(error)) == (line, "mission.yaml", True), str(error)


def test_a_plain_pose_is_a_goal(compile_text):
    tree = compile_text("name: m\nsteps:\n  - skill: navigate\n    with: {x: 1, y: 2, yaw: 0.5, max_speed: 0.4}\n")
    (navigate,) = [node for node in leaves(tree, "navigate") if node.path_id == "alice/m/1-navigate"]
    ports = navigate.options["inputs"]
    assert ports == {"goal": Constant(Pose2D(1.0, 2.0, 0.5)), "max_speed_m_s": Constant(0.4)}


@pytest.mark.parametrize("speed", ["-1", "0", "100", ".nan", ".inf", "-.inf"])
def test_a_number_out_of_its_ports_range_is_refused_at_its_line(compile_text, speed):
    text = f"name: m\nsteps:\n  - skill: navigate\n    with:\n      goal: kitchen\n      max_speed: {speed}\n"
    error = refused(compile_text, text)
    assert (error.line, "max_speed" in error.message, speed in str(error)) == (6, True, True)


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
    tree = compile_text(DETECT)
    (grasp,) = [node for node in leaves(tree, "grasp") if node.path_id == "alice/m/2-grasp"]
    assert grasp.options["inputs"]["observation"] == FromBoard("alice/m/1-detect/observation")


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("skill: grasp", "skill: grsp", 6, "did you mean 'grasp'?"),
        ("from: tool", "from: tol", 7, "did you mean 'tool'?"),
        ("observation: tool", "obsrvation: tool", 5, "did you mean 'observation'?"),
        ("surfaces: workbench", "surfaces: workbnch", 4, "did you mean 'workbench'?"),
        ("surfaces: workbench", "surface: workbench", 4, "did you mean 'surfaces'?"),
        ("[hammer]", "hammer", 4, "give a list"),
        ("[hammer]", "[1]", 4, "give a text"),
        ("with: {observation: {from: tool}}", "with: {}", 6, "input port 'observation' has no value"),
        ("  - skill: grasp\n    with: {observation", "  - skill: navigate\n    with: {goal", 6, "reads"),
    ],
)
def test_ports_that_are_wired_wrongly_are_refused_at_their_line(compile_text, old, new, line, says):
    assert old in DETECT
    error = refused(compile_text, DETECT.replace(old, new, 1))
    assert (error.line, says in str(error)) == (line, True), str(error)
    assert error.hint
