"""The judges of tasks on people know what people look like and ask, and hear what the robot said to whom."""

from types import SimpleNamespace

import numpy as np
import pytest

from errand_home.person_judges import true_appearance
from errand_home.tasks import Answer, Deliver, Report, Seek
from errand_people.looks import Appearance
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.command import parse_command
from executive.words.goal import GoalCondition
from plant.models.person_figure import CLOTHES, Figure
from plant.referee.object_history import TimedPath, TimedPoses, Truth

KNOWLEDGE = knowledge_of(open_world("home"))
SPIDER = "How many legs does a spider have"


def stands(x, y, z=0.0):
    return TimedPath(np.array([[x, y, z, 0.0]]))


def person(figure, question=""):
    return SimpleNamespace(figure=figure, answers={"your question": question, "your quiz question": question})


PEOPLE = {
    "Jane": person(Figure("standing", "waving", (0.70, 0.12, 0.10)), SPIDER),
    "Alex": person(Figure("sitting", "none", CLOTHES["blue"]), "What is the capital of Peru"),
    "Simone": person(None),
}
PLACES = {"Jane": stands(8.0, 7.0), "Alex": stands(11.0, 7.2), "Simone": stands(2.0, 3.0)}


def truth(robot_W, facing_rad=0.0, on_tray=None):
    """Truth with the robot at a place, its hand ahead of it."""
    hand = robot_W + 0.6 * np.array([np.cos(facing_rad), np.sin(facing_rad)])
    hands = {"Alice": TimedPoses(stands(*hand, 0.6), stands(0.0, 0.0))}
    cola = SimpleNamespace(name="cola", class_name="cola", on_tray_of=on_tray)
    return Truth(60.0, (cola,), {"Alice": stands(*robot_W)}, PLACES, {}, hands=hands, people=PEOPLE)


def condition(page, text, *said, ended_s=50.0):
    """Condition of a command whose step has ended; the words were said at its end."""
    promised = page().promise(parse_command(text), KNOWLEDGE, ())
    own = {"said": said, "spoken_s": tuple(40.0 for _ in said), "began_s": 0.0, "ended_s": ended_s}
    return GoalCondition(**{**vars(promised), **own})


def test_the_colour_of_clothes_is_that_of_the_nearest_dye():
    assert true_appearance("Jane", truth(np.zeros(2))) == Appearance("standing", "waving", "red")
    assert true_appearance("Simone", truth(np.zeros(2))) == Appearance("standing", "none")


BEFORE_JANE, BEFORE_ALEX = np.array([6.7, 7.0]), np.array([9.8, 7.2])


# description, place; the robot, its direction; whether it is right
@pytest.mark.parametrize(
    ("who", "place", "robot_W", "facing_rad", "right"),
    [
        ("waving person", "kitchen", BEFORE_JANE, 0.0, True),
        ("waving person", "kitchen", BEFORE_JANE, 3.1, False),
        ("waving person", "kitchen", BEFORE_JANE - [1.0, 0.0], 0.0, False),
        ("waving person", "kitchen", BEFORE_ALEX, 0.0, False),
        ("person wearing red", "kitchen", BEFORE_JANE, 0.0, True),
        ("sitting person", "kitchen", BEFORE_JANE, 0.0, False),
        ("waving person", "bedroom", BEFORE_JANE, 0.0, False),
        ("person", "kitchen", BEFORE_JANE, 0.0, True),
        ("person", "kitchen table", BEFORE_ALEX, 0.0, True),
        ("person", "kitchen table", BEFORE_JANE, 0.0, False),
    ],
)
def test_a_person_was_found_whom_the_robot_is_near_and_faces(who, place, robot_W, facing_rad, right):
    sought = condition(Seek, f"Take [Nothing] to [{place}] and do [seek] to [{who}]")
    holds, why = Seek().judge(sought, truth(robot_W, facing_rad))
    assert holds is right, why


START = np.array([KNOWLEDGE.start.x, KNOWLEDGE.start.y])


# to whom, topic; what was said, from where; whether it is right
@pytest.mark.parametrize(
    ("goal", "topic", "said", "robot_W", "right"),
    [
        ("start", "number of people in the kitchen", "There are 2 people in the kitchen", START, True),
        ("start", "number of people in the kitchen", "There are 3 people in the kitchen", START, False),
        ("start", "number of people in the kitchen", "There are 2 people in the kitchen", BEFORE_JANE, False),
        ("start", "number of lying people in the kitchen", "There are no lying people in the kitchen", START, True),
        ("start", "name of the person at the kitchen table", "The person is called Alex", START, True),
        ("start", "name of the person at the kitchen table", "The person is called Jane", START, False),
        ("start", "pose of the person at the kitchen table", "The person is sitting", START, True),
        ("start", "gesture of the person in the bedroom", "The person is making no gesture", START, True),
        ("start", "gesture of the person in the bedroom", "The person is waving", START, False),
        ("start", "time", "It is 14:05", START, True),
        ("start", "time", "It is late", START, False),
        ("start", "country of the team", "Our team comes from Switzerland", START, True),
        ("start", "country of the team", "Our team comes from Norway", START, False),
        ("Jane", "time", "It is 14:05", BEFORE_JANE, True),
        ("Jane", "time", "It is 14:05", BEFORE_ALEX, False),
        ("kitchen table", "time", "It is 14:05", BEFORE_ALEX, True),
        ("kitchen table", "time", "It is 14:05", START, False),
        ("Nothing", "time", "It is 14:05", START, True),
        ("start", "time", None, START, False),
    ],
)
def test_a_report_is_right_by_the_truth_and_the_listener(goal, topic, said, robot_W, right):
    words = () if said is None else (said,)
    reported = condition(Report, f"Take [Nothing] to [{goal}] and do [report] to [{topic}]", *words)
    holds, why = Report().judge(reported, truth(robot_W))
    assert holds is right, why


@pytest.mark.parametrize(
    ("robot_W", "said", "right"),
    [
        (BEFORE_JANE, "A spider has eight legs", True),
        (BEFORE_JANE, "The capital of Norway is Oslo", False),
        (BEFORE_ALEX, "A spider has eight legs", False),
        (START, "A spider has eight legs", False),
    ],
)
def test_an_answer_is_that_to_the_question_of_the_person_before_the_robot(robot_W, said, right):
    answered = condition(Answer, "Take [Nothing] to [Nothing] and do [answer] to [quiz]", said)
    holds, why = Answer().judge(answered, truth(robot_W))
    assert holds is right, why


@pytest.mark.parametrize(("on_tray", "right"), [("Jane", True), ("Alex", False), (None, False)])
def test_an_object_was_delivered_that_a_described_person_has(on_tray, right):
    delivered = condition(Deliver, "Take [cola] to [kitchen] and do [deliver] to [waving person]")
    holds, why = Deliver().judge(delivered, truth(BEFORE_JANE, on_tray=on_tray))
    assert holds is right, why
