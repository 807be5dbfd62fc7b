from pathlib import Path

import pytest

from executive.language.parser import load_parser
from executive.language.understand import understand
from executive.mission.load import knowledge_of_mission, load_mission
from executive.mission.resolve import mission_from_file
from executive.words.command import Command, parse_command
from executive.words.knowledge import load_knowledge
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.mission import Mission
from executive.words.step import Place
from executive.words.steps import Loop, Repeat, lines_of_steps, steps_from_lines
from skills.files.errors import InputError
from skills.files.yaml_source import YamlSource

WORLD = Path(__file__).parents[1] / "language" / "world.yaml"
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


@pytest.fixture(scope="module")
def parser():
    return load_parser()


@pytest.fixture(scope="module")
def knowledge():
    return load_knowledge(WORLD)


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / "mission.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.fixture
def load(write, parser, knowledge):
    return lambda text: mission_from_file(write(text), parser=parser, knowledge=knowledge)


def test_a_file_becomes_a_mission(load):
    mission = load(MISSION)
    assert (mission.name, mission.world, mission.robot_name) == ("tidy up", "flat", "Bob")
    assert [str(command) for command in mission.commands] == COMMANDS


def test_each_step_keeps_its_line(load):
    mission = load(MISSION)
    assert [step.source.line for step in mission.steps] == [5, 7, 8, 11]
    assert {step.source.file.name for step in mission.steps} == {"mission.yaml"}


def test_waiting_takes_a_time_and_charging_nothing(load):
    mission = load('name: go\nsteps:\n  - {to: hall, do: wait, object: "10 second"}\n  - do: charge\n')
    assert [str(command) for command in mission.commands] == [
        "Take [Nothing] to [hall] and do [wait] to [10 second]",
        "Take [Nothing] to [Nothing] and do [charge] to [Nothing]",
    ]


def test_people_can_be_looked_for_but_not_grasped(load):
    steps = "  - {to: hall, do: find, object: person}\n  - {do: find, object: some person}\n"
    assert [str(command) for command in load(f"name: go\nsteps:\n{steps}").commands] == [
        "Take [Nothing] to [hall] and do [find] to [person]",
        "Take [Nothing] to [Nothing] and do [find] to [some person]",
    ]
    with pytest.raises(InputError, match="unknown object 'person'"):
        load("name: go\nsteps:\n  - {to: hall, do: grasp, object: person}\n")


def test_world_and_robot_have_defaults(load):
    mission = load("name: go\nsteps:\n  - {to: kitchen}\n")
    assert (mission.world, mission.robot_name) == ("flat", "Alice")


def test_a_sentence_may_begin_with_the_missions_own_robot(load):
    mission = load("name: go\nrobot: Bob\nsteps:\n  - say: Hey Bob, go to the kitchen\n")
    assert [str(c) for c in mission.commands] == ["Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"]


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("world:", "wrold:", 2, "unknown key 'wrold'; did you mean 'world'?"),
        ("    object: 2", "    objekt: 2", 10, "unknown key 'objekt'; did you mean 'object'?"),
        ("name: tidy up\n", "", 1, "key 'name' is missing in the file; add 'name'"),
        ("do: grasp", "do: juggle", 9, "'grasp', 'find', 'place', 'wait', 'charge', 'follow', 'guide' or 'greet'"),
        ("    object: 2 red spanner\n", "", 8, "'do' and 'object' go together"),
        ("{to: lounge}", "{to: lunge}", 7, "unknown place or person 'lunge'; did you mean 'lounge'?"),
        ("{to: lounge}", "{to: moon base}", 7, " more"),
        ("{to: lounge}", "{}", 7, "the step is empty"),
        ("{to: lounge}", "{to: hall, say: go}", 7, "either 'say' or to, not both"),
        ("{to: lounge}", '{to: "[hall]"}', 7, "write names in plain words"),
        ("object: 2 red spanner", "object: 2 red spaner", 10, "unknown object 'spaner'"),
        ("take: 2 red wrench", "take: banana", 11, "unknown object 'banana'; known are beer, "),
        ("Robin at entrance", "Robin at gate", 12, "unknown place 'gate'"),
        ("from the kitchen to the bedroom", "and sing", 5, "sing"),
        ("from the kitchen to", "from the kitchn to", 5, "did you mean 'kitchen'?"),
        ("{to: lounge}", "{to: lounge", 8, "broken YAML"),
        ("  - {to: lounge}", "\t- {to: lounge}", 7, "broken YAML"),
        ("- {to: lounge}", "- lounge", 7, "steps.1"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line_and_the_hint(load, old, new, line, says):
    assert old in MISSION
    with pytest.raises(InputError) as error:
        load(MISSION.replace(old, new, 1))
    assert (error.value.line, says in str(error.value)) == (line, True), str(error.value)
    assert f"mission.yaml:{line}: " in str(error.value)
    assert error.value.hint
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "name: x\n", "name: x\nsteps: []\n", "steps: 3\nname: x\n", "- say: go\n"])
def test_a_file_without_steps_is_refused(load, text):
    with pytest.raises(InputError, match=r"mission\.yaml:\d: "):
        load(text)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        load_mission(tmp_path / "nowhere.yaml")


def test_an_error_can_name_the_line_of_any_key(write):
    error = load_mission(write(MISSION)).error(("world",), "unknown world 'flat'", "known are x")
    assert str(error).endswith("mission.yaml:2: unknown world 'flat'; known are x")


@pytest.fixture
def spoken(parser, knowledge):
    """Mission of a sentence."""

    def mission(sentence):
        meant = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False)
        return Mission.from_steps(meant.all_steps, world="flat", robot="Alice")

    return mission


def test_a_sentence_becomes_a_mission(spoken):
    mission = spoken("fetch me a drink")
    assert (mission.name, mission.world, mission.robot_name) == ("fetch drink", "flat", "Alice")
    assert [str(command) for command in mission.commands] == [
        "Take [Nothing] to [kitchen] and do [grasp] to [drink]",
        "Take [drink] to [start] and do [Nothing] to [Nothing]",
    ]
    assert mission.steps[0].source is None


def test_commands_become_a_mission_named_for_the_first():
    command = parse_command("Take [Nothing] to [hall] and do [Nothing] to [Nothing]")
    assert Mission.from_steps(steps_of_commands([command]), world="flat", robot="Alice").name == "do hall"


STRUCTURED = "if there is a beer in the kitchen bring it, otherwise wait until half past two"


def test_a_sentence_that_decides_becomes_a_mission_named_for_its_first_command(spoken):
    mission = spoken(STRUCTURED)
    assert [step.key for step in mission.steps] == ["if"]
    assert mission.name == "bring beer"


def test_a_mission_without_commands_is_named_for_its_first_block(spoken):
    assert spoken("wait until half past two").name == "wait"


@pytest.mark.parametrize("sentence", [STRUCTURED, "fetch me a drink"])
def test_steps_of_a_sentence_survive_their_text_form(spoken, sentence):
    lines = lines_of_steps(spoken(sentence).steps)
    assert lines_of_steps(steps_from_lines(lines)) == lines


def test_of_a_file_only_the_commands_are_lines():
    place = Place(YamlSource(Path("mission.yaml"), None, {}, first_line=3), ())
    step = Do.from_command(Command(goal="hall")).with_place(place)
    assert lines_of_steps((Repeat(loop=Loop(times=2), steps=(step,)).with_place(place),)) == (str(step.commands[0]),)


MISSIONS = [
    path for path in sorted((Path(__file__).parents[3] / "missions").glob("*.yaml")) if path.stem != "two_robots"
]


@pytest.mark.parametrize("path", MISSIONS, ids=[path.stem for path in MISSIONS])
def test_the_missions_that_come_with_it_load_in_their_world(path, parser):
    worlds = Path(__file__).parents[3] / "plant" / "worlds"
    file = load_mission(path)
    knowledge = knowledge_of_mission(file, load_knowledge(worlds / file.world / "knowledge.yaml"))
    mission = mission_from_file(file, parser=parser, knowledge=knowledge)
    assert mission.steps


def test_the_fetch_drink_file_and_the_sentence_are_the_same_mission(parser):
    root = Path(__file__).parents[3]
    knowledge = load_knowledge(root / "plant" / "worlds" / "flat" / "knowledge.yaml")
    from_file = mission_from_file(root / "missions" / "fetch_drink.yaml", parser=parser, knowledge=knowledge)
    spoken = understand("fetch me a drink from the kitchen", parser=parser, knowledge=knowledge, require_wake=False)
    assert [str(c) for c in from_file.commands] == [str(c) for c in spoken.commands]
