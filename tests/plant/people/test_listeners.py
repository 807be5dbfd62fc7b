"""People who hear a robot near them, and answer."""

import pytest

from executive.words.mission import Route
from plant.simulation import Simulation
from plant.worlds.seeding import add_answers
from plant.worlds.world import DoorRule, load_world
from tests.tables import table

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


# where Robin, Kim and Maya stand -> who hears the robot: whom it faces before who is nearer, nobody behind a wall
@pytest.mark.parametrize(
    ("robin", "kim", "hears"),
    [((8.4, 4.05), (10.3, 4.8), "Kim"), ((11.5, 0.7), (10.6, 6.0), None), (BEFORE_DOOR, (10.6, 6.0), "Robin")],
)
def test_the_person_whom_the_robot_faces_hears_it_and_nobody_behind_a_wall(simulation, monkeypatch, robin, kim, hears):
    at = {"Robin": robin, "Kim": kim, "Maya": (5.8, 4.5)}
    bodies = {body: at[name] for name, body in simulation.listeners._bodies.items()}
    place_W = simulation.listeners._place_W
    monkeypatch.setattr(simulation.listeners, "_place_W", lambda body: bodies.get(body) or place_W(body))
    assert simulation.listeners.hearer("Alice") == hears


def test_a_closed_door_keeps_words_out(simulation):
    listeners = simulation.listeners
    assert listeners._in_sight(BEFORE_DOOR, BEYOND_DOOR)
    simulation.engine.step(3.0)
    assert not listeners._in_sight(BEFORE_DOOR, BEYOND_DOOR)


@pytest.mark.parametrize(*table(__file__, "answers"))
def test_people_answer_by_their_name_or_as_given(simulation, person, question, answer):
    assert simulation.listeners.answer(person, question) == answer


def test_a_person_with_answers_chooses_an_option_by_the_seed(simulation):
    asked = [f"Question {number}?" for number in range(12)]
    first, second = ([simulation.listeners.answer("Kim", each, ("yes", "no")) for each in asked] for _ in range(2))
    assert first == second and {*first} == {"yes", "no"}
    assert simulation.listeners.answer("Maya", asked[0], ("yes", "no")) is None
