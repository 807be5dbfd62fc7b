"""People who are described: who is sought, counted and told what, on a robot whose skills are scripted."""

import math
from dataclasses import dataclass

import pytest

from errand_home import nodes, person_nodes
from errand_home.facts import Facts, QuizAnswer, Team
from errand_people.looks import Appearance
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from tests.executive.conftest import scripted_skill
from tests.visitors import OnTick

TEAM = Team(name="Errand", country="Switzerland", affiliation="the Errand project")
QUIZ = QuizAnswer(question="What is the capital of Norway", answer="The capital of Norway is Oslo")
SEEK, REPORT = "Take [Nothing] to [{}] and do [seek] to [{}]", "Take [Nothing] to [{}] and do [report] to [{}]"


@dataclass(frozen=True)
class FindPersonInputs:
    """Ports of find_person."""

    area_W: object
    place: str
    person: str
    pose: str | None = None
    gesture: str | None = None
    clothes_colour: str | None = None
    count: int = 1
    avoid: tuple[ObjectObservation, ...] = ()


@dataclass(frozen=True)
class ReadPersonInputs:
    """Ports of read_person."""

    person: str
    traits: tuple[str, ...]
    place: str = ""
    place_W: tuple[float, float] | None = None
    area_W: object = ()


@pytest.fixture(autouse=True)
def facts(monkeypatch):
    known = Facts(team=TEAM, quiz=(QUIZ,))
    monkeypatch.setattr(person_nodes, "facts_of", lambda knowledge: known)


@pytest.fixture
def people(script, registry, robot):
    """People by name with place (x, y), room and appearance, whom the scripted skills find, meet and read."""
    there = {}
    of_person, observation = {"person": ObjectObservation}, ObjectObservation
    words = dict.fromkeys(("pose", "gesture", "clothes_colour", "text"), str)
    outputs = of_person | {"people": tuple[ObjectObservation, ...]}
    registry["find_person"] = scripted_skill(script, "find_person", FindPersonInputs, outputs)
    registry["read_person"] = scripted_skill(script, "read_person", ReadPersonInputs, of_person | words)

    def seen(x, y, room):
        return observation(0.0, ObjectKind("person"), (x, y, 0.8), (0.5, 0.5, 1.7), 0.0, 0.9, room)

    def find(skill):
        asked = skill.inputs
        wanted = Appearance(asked.pose, asked.gesture, asked.clothes_colour)
        here = (robot.standing.x_m, robot.standing.y_m)
        fit = [one for one in there.values() if one[2] == asked.place and fits(one[3], wanted)]
        found = [seen(x, y, room) for x, y, room, _ in sorted(fit, key=lambda one: math.dist(one[:2], here))]
        if not found:
            return Failed(Cause.POSTCONDITION, f"{asked.person} is not seen in the {asked.place}")
        return Succeeded("found", {"person": found[0], "people": tuple(found)})

    def find_people(skill):
        here = [one for one in there.values() if one[2] == skill.inputs.place and one[3].pose == "standing"]
        found = [seen(x, y, room) for x, y, room, _ in here]
        if not found:
            return Failed(Cause.POSTCONDITION, f"nobody is seen in the {skill.inputs.place}")
        return Succeeded("found", {"observation": found[0], "observations": tuple(found), "unexplained": ()})

    def fits(own, wanted):
        return wanted.traits().items() <= own.traits().items()

    def nearest(place_W):
        return min(there.values(), key=lambda one: math.dist(one[:2], place_W))

    def meet(skill):
        x, y, room, _ = nearest(skill.inputs.place_W)
        robot.standing = Pose2D(x - 1.0, y, 0.0)
        return Succeeded("beside them", {"person": seen(x, y, room)})

    def read(skill):
        x, y, room, own = nearest(skill.inputs.place_W)
        return Succeeded("read", {"person": seen(x, y, room), "text": own.text(), **own.traits()})

    def drive(skill):
        robot.standing = skill.inputs.goal
        return Succeeded("there")

    script.ends |= {
        "find_person": find,
        "find_people": find_people,
        "meet_person": meet,
        "read_person": read,
        "navigate": drive,
    }
    return there


@pytest.fixture
def result_of(people, knowledge, registry, run_tree, published, robot):
    """Runs commands; whom the robot is beside says their name, or asks the question `asks`."""

    def run(*texts, asks="", silent=False, **settings):
        control = Control(pace=None)

        def answer(*_):
            for each in () if silent else control.state.questions:
                here = (robot.standing.x_m + 1.0, robot.standing.y_m)
                name = min(people, key=lambda one: math.dist(people[one][:2], here))
                control.answer(each.question.id, f"I am {name}" if "name" in each.question.text else asks)

        steps = steps_of_commands([*map(parse_command, texts)])
        tree = compile_mission(Mission(name="m", robot="Alice", steps=steps), knowledge=knowledge, registry=registry)
        long = {"time_limit_s": 1e4, **settings}
        result = run_tree(tree, control=control, visitors=[OnTick(answer)], settings=long).robots[0]
        return result, [message["text"] for topic, message in published if topic == "speech"]

    return run


@pytest.fixture
def spoken(script):
    """What the robot says, in order."""
    words = []

    def speak(skill):
        words.append(skill.inputs.text)
        return Succeeded("said")

    script.ends["speak"] = speak
    return words


WAVING, SITTING = Appearance("standing", "waving", "red"), Appearance("sitting", "none", "blue")
KITCHEN = {"Sam": (5.0, 1.0, "kitchen", WAVING), "Robin": (5.0, -1.0, "kitchen", SITTING)}


# command; where the robot stands then, or the cause of its failure
@pytest.mark.parametrize(
    ("command", "at_W", "cause"),
    [
        (SEEK.format("kitchen", "waving person"), (4.0, 1.0), None),
        (SEEK.format("kitchen", "person wearing blue"), (4.0, -1.0), None),
        (SEEK.format("counter", "person"), (4.0, -1.0), None),
        (SEEK.format("shelf", "person"), (4.0, 1.0), None),
        (SEEK.format("kitchen", "person"), (4.0, 1.0), None),
        (SEEK.format("kitchen", "lying person"), None, Cause.POSTCONDITION),
        (SEEK.format("bedroom", "waving person"), None, Cause.POSTCONDITION),
    ],
)
def test_the_robot_goes_to_the_person_who_is_described(result_of, people, robot, command, at_W, cause):
    people |= KITCHEN
    result, _ = result_of(command)
    assert (result.outcome is Outcome.SUCCESS, result.cause) == (cause is None, cause), result.message
    assert at_W is None or (robot.standing.x_m, robot.standing.y_m) == at_W


# topic; what the robot says
@pytest.mark.parametrize(
    ("topic", "says"),
    [
        ("number of waving people in the kitchen", "There is 1 waving person in the kitchen"),
        ("number of people in the kitchen", "There are 2 people in the kitchen"),
        ("number of lying people in the kitchen", "There are no lying people in the kitchen"),
        ("name of the person at the shelf", "The person at the shelf is called Sam"),
        ("pose of the person at the counter", "The person at the counter is sitting"),
        ("gesture of the person at the counter", "The person at the counter is making no gesture"),
        ("country of the team", "Our team comes from Switzerland"),
        ("time", "It is 14:05"),
    ],
)
def test_the_robot_comes_back_and_says_what_it_found(result_of, people, spoken, robot, topic, says):
    people |= KITCHEN
    result, _ = result_of(REPORT.format("start", topic), time_of_day_s=14 * 3600.0 + 5 * 60.0)
    assert result.outcome is Outcome.SUCCESS, result.message
    assert (spoken, math.hypot(robot.standing.x_m, robot.standing.y_m) < 0.1) == ([says], True)


def test_the_robot_tells_the_person_at_another_place(result_of, people, spoken, robot):
    people |= {**KITCHEN, "Kim": (-5.0, 0.0, "bedroom", SITTING)}
    result, _ = result_of(REPORT.format("bedside table", "name of the person at the shelf"))
    assert (result.outcome, spoken) == (Outcome.SUCCESS, ["The person at the shelf is called Sam"])
    assert (robot.standing.x_m, robot.standing.y_m) == (-6.0, 0.0)


def test_a_search_that_was_not_made_gives_no_number(result_of, people, script, spoken):
    people |= KITCHEN
    script.ends["find_person"] = lambda skill: Failed(Cause.EXECUTION, "the camera gives old pictures")
    result, _ = result_of(REPORT.format("start", "number of waving people in the kitchen"))
    assert (result.outcome is Outcome.SUCCESS, result.cause, spoken) == (False, Cause.EXECUTION, [])


def test_a_person_who_does_not_answer_has_no_name(result_of, people, spoken):
    people |= KITCHEN
    result, _ = result_of(REPORT.format("start", "name of the person at the shelf"), silent=True)
    assert (result.cause, spoken) == (Cause.TIMEOUT, [])


# question, answer (None: not known)
@pytest.mark.parametrize(
    ("question", "says"),
    [
        ("What is the capital of Norway?", "The capital of Norway is Oslo"),
        ("What is your team's name?", "Our team is called Errand"),
        ("What is the capital of Peru?", None),
    ],
)
def test_the_robot_answers_what_it_knows(result_of, people, spoken, question, says):
    people |= KITCHEN
    seek = SEEK.format("kitchen", "waving person")
    result, _ = result_of(seek, "Take [Nothing] to [Nothing] and do [answer] to [quiz]", asks=question)
    assert (result.cause, spoken) == ((None, [says]) if says else (Cause.POSTCONDITION, [])), result.message


def test_the_object_is_handed_to_the_person_who_is_described(result_of, people, script, robot):
    people |= KITCHEN
    take = "Take [Nothing] to [shelf] and do [grasp] to [coke]"
    script.seen_on = ("shelf",)
    result, _ = result_of(take, "Take [coke] to [kitchen] and do [deliver] to [waving person]")
    assert result.outcome is Outcome.SUCCESS, result.message
    assert (robot.standing.x_m, robot.standing.y_m) == (4.0, 1.0)
    assert script.begun[-1] == "hand_over"


# command, part of the reason
@pytest.mark.parametrize(
    ("command", "says"),
    [
        (SEEK.format("kitchen", "tall person"), "'tall person' describes no person"),
        (REPORT.format("start", "weather"), "'weather' is nothing that the robot can report"),
        (REPORT.format("start", "number of waving people in the shelf"), "people are counted in rooms"),
        (REPORT.format("start", "name of the person in the garden"), "garden"),
        ("Take [Nothing] to [Nothing] and do [answer] to [phone]", "'phone' is nothing that the robot can answer"),
    ],
)
def test_a_command_that_cannot_be_done_is_refused(result_of, people, command, says):
    with pytest.raises(InputError, match=says):
        result_of(command)


def test_a_team_without_facts_is_refused(result_of, people, monkeypatch):
    monkeypatch.setattr(person_nodes, "facts_of", lambda knowledge: Facts())
    with pytest.raises(InputError, match="the name of the team is not known") as raised:
        result_of(REPORT.format("start", "name of the team"))
    assert nodes.FACTS_FILE in raised.value.hint
