"""Mission files for several robots: the part of each, and its lines."""

import pytest

from executive.mission.load import knowledge_of_mission, load_mission, mission_of_robot
from executive.mission.resolve import mission_from_file
from executive.words.robot_config import RobotConfig, robots_of_file
from skills.inputs.errors import InputError
from skills.robot import Pose2D

KINDS = ("fetch", "spot")
FILE = """name: two
robots:
  alice: spot
  bob: {kind: fetch, at: [1, 2.5, 0], dock: office, stack: own.yaml}
parameters: {room: kitchen}
each: {retries: 2}
timeout: 100
always:
  - speak: Done.
parts:
  alice:
    steps:
      - to: ${room}
  bob:
    after: alice
    timeout: 50
    always:
      - to: hall
    steps:
      - repeat: {for_each: [office, bedroom], as: where}
        steps:
          - to: ${where}
"""


@pytest.fixture
def load(write):
    return lambda text=FILE, **given: load_mission(write(text), given)


@pytest.fixture
def part(load, parser, flat):
    """Mission of one robot."""

    def of(name, text=FILE, **given):
        loaded = mission_of_robot(load(text, **given), name.title(), name)
        return mission_from_file(loaded, parser=parser, knowledge=flat)

    return of


def test_robots_stand_in_the_file_with_what_they_begin_with(load, tmp_path):
    loaded = load()
    alice, bob = robots_of_file(loaded.robots, KINDS, loaded.document)
    own = RobotConfig("Bob", "fetch", Pose2D(1.0, 2.5, 0.0), "office", tmp_path / "own.yaml")
    assert (alice, bob) == (RobotConfig("Alice", "spot"), own)
    assert (bob.source.file.name, bob.source.line) == ("mission.yaml", 4)


def test_each_robot_has_its_steps(part):
    alice, bob = part("alice", room="hall"), part("bob")
    assert (alice.robot_name, bob.robot_name) == ("Alice", "Bob")
    assert [command.goal for command in alice.commands] == ["hall"]
    assert [step.commands[0].goal for step in bob.walk() if step.commands] == ["office", "bedroom", "hall"]


def test_keys_at_the_top_apply_to_each_part(part):
    alice, bob = part("alice"), part("bob")
    assert (alice.timeout_s, bob.timeout_s) == (100.0, 50.0)
    assert alice.steps[0].retries == 2
    assert [step.is_block for step in alice.always] == [True]
    assert [step.commands[0].goal for step in bob.always] == ["hall"]


def test_an_error_in_a_part_has_its_own_line(part):
    with pytest.raises(InputError) as error:
        part("bob", FILE.replace("to: hall", "to: hal"))
    assert (error.value.line, "'hal'" in str(error.value)) == (18, True)


@pytest.mark.parametrize(
    ("robots", "line", "words"),
    [
        ("alice: spot\n  Alice: fetch", 4, "'alice' and 'Alice' are the same name"),
        ("alice: spot\n  bob: ftch", 4, "unknown kind of robot 'ftch'; did you mean 'fetch'?"),
        ("everyone: spot", 3, "means all robots"),
    ],
)
def test_robots_that_cannot_be_are_refused_with_their_line(load, robots, line, words):
    loaded = load(f"name: x\nrobots:\n  {robots}\nsteps: [{{to: hall}}]\n")
    with pytest.raises(InputError) as error:
        robots_of_file(loaded.robots, KINDS, loaded.document)
    assert (error.value.line, words in str(error.value)) == (line, True), str(error.value)


def test_a_file_with_parts_is_no_mission_for_one_robot(load, parser, flat):
    with pytest.raises(InputError, match="its parts are for several robots"):
        mission_from_file(load(), parser=parser, knowledge=flat)


def test_the_robots_do_not_stand_in_the_knowledge(load, flat):
    loaded = load("name: x\nknowledge: {robots: {alice: spot}}\nsteps: [{to: hall}]\n")
    with pytest.raises(InputError, match="write 'robots' at the top"):
        knowledge_of_mission(loaded, flat)
