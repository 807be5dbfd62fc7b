"""Routes kept between processes."""

import os

import pytest

from executive.app.route_cache import RouteCache, route_cache_of
from executive.app.worlds import open_world
from executive.tree.estimate import Route
from skills.robot import Pose2D

HERE, THERE, NOWHERE = Pose2D(0.0, 0.0, 0.0), Pose2D(3.0, 4.0, 0.5), Pose2D(99.0, 0.0, 0.0)


class Planner:
    """Counts how often it is asked."""

    def __init__(self):
        self.asked = 0

    def route(self, start, goal):
        self.asked += 1
        if goal == NOWHERE:
            raise ValueError("There is no way.")
        return Route(5.0, 5.25)


@pytest.mark.parametrize("broken", ["", "[", '{"a": 1'])
def test_each_route_is_planned_once_in_all_processes(tmp_path, broken):
    file, planner = tmp_path / "routes" / "a.json", Planner()
    file.parent.mkdir()
    file.write_text(broken)
    for process in range(2):
        routes = RouteCache(file, planner)
        assert routes.route(HERE, THERE) == Route(5.0, 5.25)
        with pytest.raises(ValueError, match=r"There is no way\."):
            routes.route(HERE, NOWHERE)
        assert planner.asked == 2, process
    RouteCache(file, planner).route(THERE, HERE)
    assert planner.asked == 3


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_where_nothing_can_be_kept_routes_are_planned_all_the_same(tmp_path):
    tmp_path.chmod(0o500)
    assert RouteCache(tmp_path / "routes" / "a.json", Planner()).route(HERE, THERE) == Route(5.0, 5.25)


def test_ways_are_planned_anew_when_a_file_that_they_depend_on_has_changed(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robot, planner = tmp_path / "robot.yaml", Planner()
    for text, asked in (("a", 1), ("a", 1), ("b", 2)):
        robot.write_text(text)
        route_cache_of(open_world("flat"), planner, robot).route(HERE, THERE)
        assert planner.asked == asked
