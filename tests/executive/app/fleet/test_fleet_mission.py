"""What a robot offers for a mission: by its routes, by where the object is, and by its battery."""

from types import SimpleNamespace

import pytest

from executive.app.fleet.auction import Auction
from executive.app.fleet.fleet_mission import FleetMission, FleetRobot, Offers, bid_for
from executive.app.prepare.from_request import prepare
from executive.mission.request import Request
from executive.tree.estimate import Route
from executive.words.knowledge import BatteryFacts, SurfaceFacts
from skills.robot import Pose2D

TAKE = "Take [Nothing] to [kitchen table] and do [grasp] to [coke]"
PUT = "Take [coke] to [sideboard] and do [Nothing] to [Nothing]"
CHARGE = "Take [Nothing] to [Nothing] and do [charge] to [Nothing]"
HERE = Pose2D(10.6, 4.2, 0.0)
KITCHEN_Y_M = 5.45


class Routes:
    """Ways of ten metres; none into the kitchen where that is `closed`."""

    def __init__(self, *, closed=False):
        self.closed = closed

    def route(self, start, goal, zones=()):
        if self.closed and goal.y_m > KITCHEN_Y_M:
            raise ValueError("there is no way")
        return Route(10.0, 10.0)


def prepared(*lines):
    return prepare(Request(commands=lines, world="flat", name="work", robot="Alice"), ask=None)


def robot(name, charge, planner, dock=None):
    return FleetRobot(SimpleNamespace(name=name), HERE, charge, planner=planner, dock=dock)


@pytest.fixture(scope="module")
def mission():
    return FleetMission(SimpleNamespace(id=1), {"Alice": prepared(TAKE, PUT)})


@pytest.fixture(scope="module")
def dock():
    return prepared(CHARGE)


def test_a_robot_that_can_do_it_offers_its_time_and_what_is_left_of_its_battery(mission):
    bid = bid_for(mission, robot("Alice", 0.9, Routes()), 0.15)
    assert bid.problems == ()
    assert bid.duration_s > 30.0
    assert 0.8 < bid.charge < 0.9


# The robot, and why it cannot do the mission.
UNFIT = [
    (("Alice", 0.9, Routes(closed=True)), "no path leads to the kitchen table, where it must take the coke"),
    (("Alice", 0.15, Routes()), "its battery has 15%, and "),
    (("Bob", 0.9, Routes()), "it is for Alice"),
]


@pytest.mark.parametrize(("of", "problem"), UNFIT)
def test_a_robot_that_cannot_reach_the_object_or_charge_or_that_is_not_meant_does_not_bid(mission, of, problem):
    assert any(each.startswith(problem) for each in bid_for(mission, robot(*of), 0.15).problems)


def test_a_robot_that_would_be_low_adds_the_time_to_charge(mission, dock):
    full = bid_for(mission, robot("Alice", 0.9, Routes(), dock), 0.15)
    low = bid_for(mission, robot("Alice", 0.15, Routes(), dock), 0.15)
    assert (full.charges, low.charges, low.problems) == (False, True, ())
    assert low.duration_s > full.duration_s + 0.6 * 300.0
    assert low.charge > 0.7


TABLE = SurfaceFacts.model_validate(
    {
        "place": "room",
        "height": 0.45,
        "polygon": [[9.0, 1.45], [10.1, 1.45], [10.1, 2.05], [9.0, 2.05]],
        "viewpoints": [{"x": 9.0, "y": 3.0, "yaw": -1.57}],
    }
)


class EastOf:
    """Ways lead only to where x is large enough (m)."""

    def __init__(self, x_m):
        self.x_m = x_m

    def route(self, start, goal, zones=()):
        if goal.x_m < self.x_m:
            raise ValueError("there is no way")


@pytest.mark.parametrize(("x_m", "reached"), [(9.5, True), (10.6, False)])
def test_a_robot_takes_over_only_a_reachable_object(clock, x_m, reached):
    bob = FleetRobot(SimpleNamespace(kind="spot"), Pose2D(11.0, 2.0, 0.0), planner=EastOf(x_m))
    offers = Offers({"Bob": bob}, BatteryFacts(), clock.now, Auction((), ["Bob"]))
    assert offers.takes_from("Bob", TABLE) is reached


@pytest.mark.parametrize(("now_s", "busy", "ready_s"), [(20.0, True, 80.0), (150.0, True, 50.0), (150.0, False, 0.0)])
def test_a_robot_that_is_late_is_expected_to_be_as_late_again(now_s, busy, ready_s):
    late = FleetRobot(SimpleNamespace(kind="spot"), Pose2D(11.0, 2.0, 0.0), free_at_s=100.0)
    assert late.ready_s(now_s, busy=busy) == ready_s
