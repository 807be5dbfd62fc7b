"""People who hear a robot near them, and answer."""

import pytest

from executive.words.mission import Route
from plant.simulation import Simulation
from plant.worlds.seeding import add_answers
from plant.worlds.world import DoorRule, load_world

BEFORE_DOOR, BEYOND_DOOR = (8.7, 4.5), (6.4, 4.5)
ANSWERS = {"Kim": {"drink": "tea"}}
DOOR = DoorRule(name="hall door", at=(7.45, 4.5), yaw=1.57, width=0.9, closes=1.0, opens=99.0)


@pytest.fixture(scope="module")
def simulation():
    """The flat: Robin stands 1.1 m from the robot, Kim beyond the kitchen's wall, Maya in the hall."""
    routes = {"Kim": Route(waypoints=((9.0, 6.5),)), "Maya": Route(waypoints=(BEYOND_DOOR,))}
    world = add_answers(load_world("flat").with_routes(routes), ANSWERS).with_events([DOOR], ())
    return Simulation(world, seed=9721, visuals=False)


def test_the_nearest_person_in_sight_hears_the_robot(simulation):
    assert simulation.listeners.hearer("Alice") == "Robin"


def test_the_person_whom_the_robot_faces_hears_it_before_a_nearer_one(simulation, monkeypatch):
    at = {"Robin": (8.4, 4.05), "Kim": (10.3, 4.8), "Maya": (5.8, 4.5)}
    bodies = {body: at[name] for name, body in simulation.listeners._bodies.items()}
    place_W = simulation.listeners._place_W
    monkeypatch.setattr(simulation.listeners, "_place_W", lambda body: bodies.get(body) or place_W(body))
    assert simulation.listeners.hearer("Alice") == "Kim"


@pytest.mark.parametrize(("robin", "hears"), [((11.5, 0.7), None), (BEFORE_DOOR, "Robin")])
def test_behind_a_wall_or_too_far_away_nobody_hears(simulation, monkeypatch, robin, hears):
    at = {"Robin": robin, "Kim": (10.6, 6.0), "Maya": (5.8, 4.5)}
    bodies = {body: at[name] for name, body in simulation.listeners._bodies.items()}
    place_W = simulation.listeners._place_W
    monkeypatch.setattr(simulation.listeners, "_place_W", lambda body: bodies.get(body) or place_W(body))
    assert simulation.listeners.hearer("Alice") == hears


def test_a_closed_door_keeps_words_out(simulation):
    listeners = simulation.listeners
    assert listeners._in_sight(BEFORE_DOOR, BEYOND_DOOR)
    simulation.engine.step(3.0)
    assert not listeners._in_sight(BEFORE_DOOR, BEYOND_DOOR)


@pytest.mark.parametrize(
    ("person", "question", "answer"),
    [
        ("Robin", "Excuse me, are you Robin?", "yes"),
        ("Maya", "Are you Robin?", "no"),
        ("Kim", "Which drink would you like?", "tea"),
        ("Kim", "How are you?", None),
        ("Maya", "Which drink would you like?", None),
    ],
)
def test_people_answer_by_their_name_or_as_given(simulation, person, question, answer):
    assert simulation.listeners.answer(person, question) == answer


def test_a_person_with_answers_chooses_an_option_by_the_seed(simulation):
    asked = [f"Question {number}?" for number in range(12)]
    said = [simulation.listeners.answer("Kim", each, ("yes", "no")) for each in asked]
    assert {*said} == {"yes", "no"}
    assert said == [simulation.listeners.answer("Kim", each, ("yes", "no")) for each in asked]
    assert simulation.listeners.answer("Maya", asked[0], ("yes", "no")) is None
