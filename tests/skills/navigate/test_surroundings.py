"""Speed limits near people, and clearance to them."""

import math

import numpy as np
import pytest

from skills.footprint import Footprint, with_discs
from skills.navigate.surroundings import PaceManager, SpaceOptions, outline_distance_m, with_people
from skills.perception.people import SeenPerson
from skills.robot import Pose2D
from skills.testing.estimators import OPEN_M, BlockCostmap

FOOTPRINT = Footprint.rectangle([(0.55, 0.25), (-0.55, 0.25), (-0.55, -0.25), (0.55, -0.25)])
HERE = Pose2D(0.0, 0.0, 0.0)
FAR_GOAL = Pose2D(20.0, 0.0, 0.0)
FULL_M_S = 0.8


def person(x, y=0.0):
    return SeenPerson((x, y), np.eye(2) * 0.01, 0.9, 0.0, HERE, 2)


def path_ahead(length_m=1.2):
    """Poses straight ahead."""
    x = np.arange(0.0, length_m + 1e-9, 0.05)
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def pace(*people, manager=None, now_s=0.0, ahead=None, goal=FAR_GOAL, full_m_s=FULL_M_S):
    manager = manager or PaceManager(FOOTPRINT)
    return manager.pace(now_s, HERE, path_ahead() if ahead is None else ahead, people, full_m_s, goal)


def test_distances_are_from_the_outline():
    found = outline_distance_m(FOOTPRINT, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, math.pi / 2]]), [person(2.0)])
    assert found[:, 0] == pytest.approx([1.45, 1.75], abs=0.02)


def test_a_low_speed_limit_stays():
    assert pace(person(0.6, 2.0), full_m_s=0.2).most_m_s <= 0.2


@pytest.mark.parametrize(
    ("people", "expected"),
    [
        # beside the path: outline to axis (m) -> speed (m/s)
        ([person(0.6, 0.25 + 3.0)], math.inf),
        ([person(0.6, 0.25 + 2.5)], math.inf),
        ([person(0.6, 0.25 + 1.75)], 0.55),
        ([person(0.6, 0.25 + 1.0)], 0.3),
        ([person(0.6, 0.25 + 0.85)], 0.3),
        ([person(3.4)], 0.3 + (1.65 - 1.0) / 1.5 * 0.5),  # 2.85 m from the outline now, 1.65 m in 1.2 m
        ([person(8.0), person(0.0, 6.0)], math.inf),
    ],
)
def test_speed_falls_with_the_distance_of_the_nearest_person(people, expected):
    result = pace(*people)
    assert result.most_m_s == pytest.approx(expected, abs=0.02)
    assert not result.waiting
    assert (result.person is None) is math.isinf(expected)


def test_robot_waits_for_a_person_near_its_path_and_then_passes_slowly():
    manager, options = PaceManager(FOOTPRINT), SpaceOptions()
    result = [pace(person(2.0), manager=manager, now_s=0.1 * k) for k in range(60)]
    stood = [one for one in result if one.waiting]
    assert len(stood) == pytest.approx(10 * options.patience_s, abs=2)
    assert {one.most_m_s for one in stood} == {0.0}
    assert [one.overdue for one in stood].count(True) == 1
    assert stood[-1].overdue
    assert result[-1].most_m_s == options.pass_m_s


def test_patience_starts_again_when_nobody_was_near_for_a_while():
    manager = PaceManager(FOOTPRINT)
    for k in range(60):
        pace(person(2.0), manager=manager, now_s=0.1 * k)
    pace(manager=manager, now_s=7.0)
    assert not pace(person(2.0), manager=manager, now_s=7.1).waiting
    pace(manager=manager, now_s=12.0)
    assert pace(person(2.0), manager=manager, now_s=12.1).waiting


def test_robot_does_not_wait_when_its_path_leads_away_from_a_person():
    result = pace(person(1.2), ahead=path_ahead() * [-1.0, 1.0, 1.0])
    assert not result.waiting
    assert 0.5 < result.most_m_s < 0.7


def test_robot_reaches_a_goal_before_a_person_slowly_without_waiting():
    # at the goal 0.6 m from the outline to the axis
    result = pace(person(1.95), goal=Pose2D(0.8, 0.0, 0.0), ahead=path_ahead(0.8))
    assert not result.waiting
    assert result.most_m_s == pytest.approx(0.3)


def test_people_are_obstacles_in_the_costmap():
    costmap = with_discs(BlockCostmap(), np.array([[1.0, 0.0, 0.5], [9.0, 0.0, 0.5]]))
    assert costmap.clearance_m(np.array([[3.0, 0.0], [1.0, 0.3], [50.0, 0.0]])) == pytest.approx([1.5, -0.2, OPEN_M])


def test_without_people_the_costmap_is_unchanged():
    costmap = BlockCostmap()
    assert with_people(costmap, FOOTPRINT, (HERE,), [], 0.5) is costmap


def test_discs_about_people_leave_start_and_goal_free():
    # the outline is 0.45 m from the first person's axis and far from the second's
    around, people = (HERE, Pose2D(5.0, 0.0, 0.0)), [person(1.0), person(2.5, 3.0)]
    costmap = with_people(BlockCostmap(), FOOTPRINT, around, people, 0.5)
    assert costmap.clearance_m(np.array([[1.0, 0.0], [2.5, 3.0]])) == pytest.approx([-0.4, -0.5], abs=0.02)
