from pathlib import Path

import pytest

from executive.language.understand import understand
from executive.mission.load import knowledge_of_mission, load_mission
from executive.mission.resolve import mission_from_file
from executive.words.command import Command, parse_command
from executive.words.knowledge import load_knowledge
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.mission import Mission
from executive.words.step import Place
from executive.words.steps import Loop, Repeat, lines_of_steps, steps_from_lines
from skills.inputs.errors import InputError
from skills.inputs.yaml_source import YamlSource

ROOT = Path(__file__).parents[3]
MISSION = """\
name: tidy up
world: flat
robot: Bob
steps:
  - say: take a beer from the kitchen to the bedroom

  - {to: lounge}
  - to: workshop
    do: grasp
    object: 2 red spanner
  - take: 2 red wrench
    to: Robin at entrance
"""
COMMANDS = [
    "Take [Nothing] to [kitchen] and do [grasp] to [beer]",
    "Take [beer] to [bedroom] and do [Nothing] to [Nothing]",
    "Take [Nothing] to [living room] and do [Nothing] to [Nothing]",
    "Take [Nothing] to [workshop] and do [grasp] to [2 red wrench]",
    "Take [2 red wrench] to [Robin at hall] and do [Nothing] to [Nothing]",
]


def commands(mission):
    return [str(command) for command in mission.commands]


def test_a_file_becomes_a_mission_whose_steps_keep_their_lines(load):
    mission = load(MISSION)
    assert (mission.name, mission.world, mission.robot_name) == ("tidy up", "flat", "Bob")
    assert commands(mission) == COMMANDS
    lines = [(step.source.file.name, step.source.line) for step in mission.steps]
    assert lines == [("mission.yaml", line) for line in (5, 7, 8, 11)]


@pytest.mark.parametrize(
    ("step", "command"),
    [
        ("{do: charge}", "Take [Nothing] to [Nothing] and do [charge] to [Nothing]"),
        ("{do: find, object: some person}", "Take [Nothing] to [Nothing] and do [find] to [some person]"),
        ("{do: follow, object: speaker}", "Take [Nothing] to [Nothing] and do [follow] to [speaker]"),
        ("{to: hall, do: find, object: person}", "Take [Nothing] to [hall] and do [find] to [person]"),
        ("{to: hall, do: wait, object: 10 second}", "Take [Nothing] to [hall] and do [wait] to [10 second]"),
        ("{to: kitchen, do: guide, object: robin}", "Take [Nothing] to [kitchen] and do [guide] to [Robin]"),
        (
            "{to: lounge, do: greet, object: some person}",
            "Take [Nothing] to [living room] and do [greet] to [some person]",
        ),
        ("say: Hey Bob, go to the kitchen", "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"),
    ],
)
def test_a_step_becomes_a_command(load, step, command):
    assert commands(load(f"name: go\nrobot: Bob\nsteps:\n  - {step}\n")) == [command]


def test_world_and_robot_have_defaults(load):
    mission = load("name: go\nsteps:\n  - {to: kitchen}\n")
    assert (mission.world, mission.robot_name) == ("flat", "Alice")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_mission(tmp_path / "nowhere.yaml")


def test_an_error_can_name_the_line_of_any_key(write):
    error = load_mission(write(MISSION)).error(("world",), "unknown world 'flat'", "known are x")
    assert str(error).endswith("mission.yaml:2: unknown world 'flat'; known are x")


@pytest.fixture
def spoken(parser, flat):
    """Mission of a sentence."""

    def mission(sentence):
        meant = understand(sentence, parser=parser, knowledge=flat, require_wake=False)
        return Mission.from_steps(meant.all_steps, world="flat", robot="Alice")

    return mission


def test_a_sentence_becomes_a_mission(spoken):
    mission = spoken("fetch me a drink")
    assert (mission.world, mission.robot_name, mission.steps[0].source) == ("flat", "Alice", None)
    assert commands(mission) == [
        "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
        "Take [drink] to [start] and do [Nothing] to [Nothing]",
    ]


STRUCTURED = "if there is a beer in the kitchen bring it, otherwise wait until half past two"


@pytest.mark.parametrize(
    ("sentence", "name", "keys"),
    [
        (STRUCTURED, "bring beer", ["if"]),
        ("fetch me a drink", "fetch drink", ["", ""]),
        ("wait until half past two", "wait", ["wait"]),
    ],
)
def test_a_spoken_mission_is_named_for_its_first_command_or_block(spoken, sentence, name, keys):
    mission = spoken(sentence)
    assert (mission.name, [step.key for step in mission.steps]) == (name, keys)


def test_commands_become_a_mission_named_for_the_first():
    command = parse_command("Take [Nothing] to [hall] and do [Nothing] to [Nothing]")
    assert Mission.from_steps(steps_of_commands([command]), world="flat", robot="Alice").name == "do hall"


def test_a_mission_of_several_commands_alike_is_named_after_the_first_with_their_number():
    rooms = [Command(goal=goal, verb="visit") for goal in ("hall", "kitchen", "office")]
    assert Mission.from_steps(steps_of_commands(rooms), world="flat", robot="Alice").name == "visit hall and 2 more"
    assert Mission.from_steps(steps_of_commands(rooms[:2]), world="flat", robot="Alice").name == "visit hall"


@pytest.mark.parametrize("sentence", [STRUCTURED, "fetch me a drink"])
def test_steps_of_a_sentence_survive_their_text_form(spoken, sentence):
    lines = lines_of_steps(spoken(sentence).steps)
    assert lines_of_steps(steps_from_lines(lines)) == lines


def test_of_a_file_only_the_commands_are_lines():
    place = Place(YamlSource(Path("mission.yaml"), None, {}, first_line=3), ())
    step = Do.from_command(Command(goal="hall")).with_place(place)
    assert lines_of_steps((Repeat(loop=Loop(times=2), steps=(step,)).with_place(place),)) == (str(step.commands[0]),)


FOR_ONE = [path for path in sorted((ROOT / "missions").glob("*.yaml")) if path.stem != "two_robots"]


@pytest.mark.parametrize("path", FOR_ONE, ids=lambda path: path.stem)
def test_shipped_missions_load_in_their_world(path, parser):
    file = load_mission(path)
    known = load_knowledge(ROOT / "plant" / "worlds" / file.world / "knowledge.yaml")
    assert mission_from_file(file, parser=parser, knowledge=knowledge_of_mission(file, known)).steps


def test_the_fetch_drink_file_and_the_sentence_are_the_same_mission(parser, flat):
    from_file = mission_from_file(ROOT / "missions" / "fetch_drink.yaml", parser=parser, knowledge=flat)
    spoken = understand("fetch me a drink from the kitchen", parser=parser, knowledge=flat, require_wake=False)
    assert commands(from_file) == commands(spoken)
