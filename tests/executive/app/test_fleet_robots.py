"""What a robot of a fleet reaches of what another one puts down for it."""

from types import SimpleNamespace

import pytest

from executive.app.fleet_robots import FleetRobot, Offers
from executive.words.knowledge import BatteryFacts, SurfaceFacts
from skills.robot import Pose2D

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

    def route(self, start, goal):
        if goal.x_m < self.x_m:
            raise ValueError("there is no way")


@pytest.mark.parametrize(("x_m", "reached"), [(9.5, True), (10.6, False)])
def test_a_robot_takes_over_only_what_it_can_come_near_to(clock, x_m, reached):
    robot = FleetRobot(SimpleNamespace(kind="spot"), Pose2D(11.0, 2.0, 0.0), planner=EastOf(x_m))
    offers = Offers({"Bob": robot}, BatteryFacts(), clock.now)
    assert offers.takes_from("Bob", TABLE) is reached


@pytest.mark.parametrize(("now_s", "busy", "ready_s"), [(20.0, True, 80.0), (150.0, True, 50.0), (150.0, False, 0.0)])
def test_a_robot_that_is_late_is_expected_to_be_as_late_again(now_s, busy, ready_s):
    robot = FleetRobot(SimpleNamespace(kind="spot"), Pose2D(11.0, 2.0, 0.0), free_at_s=100.0)
    assert robot.ready_s(now_s, busy=busy) == ready_s
