"""People who walk in the plant."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform

from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.models.catalogue import load_catalogue
from plant.people.walkers import Leg, Walk
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import SPOT
from plant.worlds.seeding import PointRoute, PointStop
from plant.worlds.world import WorldError
from skills.robot import Pose2D

STEP_S = 0.0125


def walk_of(*legs, loops=False, start_s=0.0, speed_m_s=1.0):
    first = legs[0].corners_W[0] if legs else (0.0, 0.0)
    return Walk(legs, at_W=first, yaw_rad=0.0, speed_m_s=speed_m_s, start_s=start_s, loops=loops)


def after(walk, seconds):
    for _ in range(round(seconds / STEP_S)):
        walk.advance(STEP_S)
    return walk


def test_goes_at_its_speed_and_stops_at_the_end():
    walk = after(walk_of(Leg(((0.0, 0.0), (3.0, 0.0)), 0.0), speed_m_s=1.2), 1.0)
    assert walk.place_W == pytest.approx((1.2, 0.0)) and walk.walks
    assert after(walk, 5.0).place_W == (3.0, 0.0) and walk.done and not walk.walks


def test_waits_for_its_start_and_at_a_stop():
    legs = (Leg(((0.0, 0.0), (1.0, 0.0)), 2.0), Leg(((1.0, 0.0), (1.0, 1.0)), 0.0))
    walk = walk_of(*legs, start_s=1.0)
    assert after(walk, 1.0).place_W == (0.0, 0.0)
    assert after(walk, 2.5).place_W == (1.0, 0.0) and not walk.walks
    assert after(walk, 1.0).place_W[1] == pytest.approx(0.5, abs=0.05)


def test_a_person_ends_the_pause_on_request():
    walk = walk_of(Leg(((0.0, 0.0), (3.0, 0.0)), 0.0), start_s=1000.0)
    walk.set_off()
    assert after(walk, 1.0).place_W == pytest.approx((1.0, 0.0))


def test_a_person_turns_to_the_path_at_a_limited_rate():
    walk = walk_of(Leg(((0.0, 0.0), (0.0, 3.0)), 0.0))
    assert after(walk, 0.1).yaw_rad == pytest.approx(0.4, abs=0.06)
    assert walk.heading_rad == pytest.approx(math.pi / 2)
    assert after(walk, 1.0).yaw_rad == pytest.approx(math.pi / 2)


def test_goes_round_and_round_on_a_loop():
    legs = (Leg(((0.0, 0.0), (1.0, 0.0)), 0.0), Leg(((1.0, 0.0), (0.0, 0.0)), 0.0))
    assert after(walk_of(*legs, loops=True), 4.5).place_W == pytest.approx((0.5, 0.0), abs=0.05)


def test_a_person_without_a_path_stands():
    assert after(walk_of(), 1.0).place_W == (0.0, 0.0)


def test_goes_on_from_a_state():
    leg = Leg(((0.0, 0.0), (1.0, 0.0), (1.0, 3.0)), 0.5)
    walk, other = after(walk_of(leg), 1.7), walk_of(leg)
    other.restore(walk.state())
    assert after(other, 0.5).state() == after(walk, 0.5).state()


FLOOR = """<sdf version="1.9"><model name="floor"><link name="floor">
<collision name="top"><pose>0 0 -0.5 0 0 0</pose><geometry><box><size>20 20 1</size></box></geometry></collision>
</link></model></sdf>"""
WALL = """<sdf version="1.9"><model name="wall"><link name="wall">
<collision name="wall"><pose>2 -2 1 0 0 0</pose><geometry><box><size>0.2 6 2</size></box></geometry></collision>
</link></model></sdf>"""
WORLD = """directives:
- add_model: {name: floor, file: "%s"}
- add_weld: {parent: world, child: "floor::floor"}
- add_model: {name: wall, file: "%s"}
- add_weld: {parent: world, child: "wall::wall"}
"""
START = Pose2D(-3.0, 0.0, 0.0)
PERSON = load_catalogue()["person"].forms["standing"].path()


class Hall:
    """A floor with a wall, a robot and a person, and the referee."""

    def __init__(self, folder, route, robot=START):
        for name, text in (("floor", FLOOR), ("wall", WALL)):
            (folder / f"{name}.sdf").write_text(text)
        (folder / "world.dmd.yaml").write_text(
            WORLD % tuple((folder / f"{name}.sdf").as_uri() for name in ("floor", "wall"))
        )
        (x, y), models = route.stops[0].at_W, []
        models.append(LooseModel("Kim", PERSON, RigidTransform([x, y, 0.0]), route=route))
        self.world = build_diagram(
            DiagramConfig(
                directives=folder / "world.dmd.yaml",
                models=models,
                robots=[PlacedRobot("Alice", "spot", robot)],
                visuals=False,
                render=False,
            )
        )
        self.engine = Engine(self.world)
        self.referee = Referee(
            self.world.plant, [], robots={"Alice": SPOT}, persons=["Kim"], scenery=self.world.scenery
        )
        self.engine.observe(lambda now_s: self.referee.observe(self.engine.context, now_s), every=4)

    @property
    def person_W(self):
        body = self.world.plant.GetBodyByName("person")
        return Pose2D.from_transform(self.world.plant.EvalBodyPoseInWorld(self.engine.context, body))

    def drive(self, vx, seconds):
        robot = self.engine.robots["Alice"]
        robot.drive(vx, 0.0, 0.0, until_s=self.engine.now() + seconds, lease=robot.acquire_lease("test"))
        self.engine.advance(seconds)


@pytest.fixture
def hall(tmp_path):
    return lambda *points, robot=START, **options: Hall(
        tmp_path, PointRoute(tuple(PointStop(point) for point in points), **options), robot
    )


def test_the_body_in_the_plant_follows_the_route(hall):
    stage = hall((0.0, 2.0), (0.0, -2.0), speed_m_s=1.0)
    stage.engine.advance(2.0)
    assert (stage.person_W.x_m, stage.person_W.y_m) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert stage.person_W.yaw_rad == pytest.approx(-math.pi / 2, abs=0.01)


def test_a_person_walks_around_a_wall_without_contact(hall):
    stage = hall((1.0, 0.0), (3.0, 0.0), speed_m_s=2.0)
    places = []
    for _ in range(60):
        stage.engine.advance(0.05)
        places.append((stage.person_W.x_m, stage.person_W.y_m))
    assert places[-1] == pytest.approx((3.0, 0.0), abs=1e-6)
    aside = [math.hypot(max(abs(x - 2.0) - 0.1, 0.0), max(y - 1.0, 0.0)) for x, y in places]
    assert min(aside) > 0.22


def test_a_route_into_the_wall_is_refused(hall):
    with pytest.raises(WorldError, match="Kim cannot stand"):
        hall((1.0, 0.0), (2.0, 0.0))


def test_the_lidar_sees_a_walking_person(hall):
    stage = hall((-1.0, 0.0), (0.0, 0.0), speed_m_s=1.0)

    def ahead_m():
        scan = stage.engine.robots["Alice"].scan()
        return float(np.nanmin(scan.ranges_m[:, np.abs(scan.azimuths_rad) < 0.1]))

    stage.engine.advance(0.1)
    near_m = ahead_m()
    stage.engine.advance(0.9)
    assert ahead_m() - near_m == pytest.approx(0.9, abs=0.12)


def test_a_yielding_person_waits_for_a_robot_ahead_and_walks_on_later(hall):
    stage = hall((-1.0, -2.0), (-1.0, 3.0), robot=Pose2D(-1.0, 0.5, 0.0))
    stage.engine.advance(4.0)
    held = stage.person_W.y_m
    assert -0.6 < held < -0.4 and not stage.referee.collisions
    stage.drive(-0.8, 4.0)
    assert stage.person_W.y_m > 1.0 and not stage.referee.collisions


def test_a_person_who_does_not_yield_walks_into_a_standing_robot(hall):
    stage = hall((-1.0, -2.0), (-1.0, 1.0), robot=Pose2D(-1.0, 0.5, 0.0), yields=False)
    stage.engine.advance(4.0)
    verdict = stage.referee.judge([])
    assert (verdict.collisions, verdict.people_hit, verdict.hit_by_people) == (0, 0, 1)
    assert "Kim walked into Alice's" in stage.referee.events[0]
    assert stage.person_W.y_m == pytest.approx(1.0, abs=1e-6)


def test_a_robot_that_drives_into_a_person_causes_the_collision(hall):
    stage = hall((-1.0, 0.0), (-1.0, 0.0))
    stage.drive(0.6, 4.0)
    verdict = stage.referee.judge([])
    assert (verdict.collisions, verdict.people_hit, verdict.hit_by_people) == (1, 1, 0)
    assert (stage.person_W.x_m, stage.person_W.y_m) == pytest.approx((-1.0, 0.0), abs=0.02)


def test_a_restored_walk_continues(hall):
    stage = hall((0.0, 2.0), (0.0, -2.0), loops=True)
    stage.engine.advance(1.0)
    state, world = stage.engine.state(), {k: v.copy() for k, v in stage.engine.world_state().items()}
    stage.engine.advance(1.0)
    there = stage.person_W
    stage.engine.resume(state, world)
    stage.engine.advance(1.0)
    assert (stage.person_W.x_m, stage.person_W.y_m) == pytest.approx((there.x_m, there.y_m), abs=1e-6)


def test_a_person_who_has_yielded_for_long_walks_around_the_robot(hall):
    stage = hall((-1.0, -2.5), (-1.0, 3.5), robot=Pose2D(-1.0, 0.5, 0.0))
    stage.engine.advance(12.0)
    assert (stage.person_W.x_m, stage.person_W.y_m) == pytest.approx((-1.0, 3.5), abs=1e-6)
    assert not stage.referee.collisions


def test_a_detour_continues_after_a_restart(hall):
    stage = hall((-1.0, -2.5), (-1.0, 3.5), robot=Pose2D(-1.0, 0.5, 0.0))
    stage.engine.advance(6.0)
    state, world = stage.engine.state(), {k: v.copy() for k, v in stage.engine.world_state().items()}
    stage.engine.advance(1.0)
    there = stage.person_W
    stage.engine.resume(state, world)
    stage.engine.advance(1.0)
    assert stage.engine.walkers["Kim"].on_detour
    assert (stage.person_W.x_m, stage.person_W.y_m) == pytest.approx((there.x_m, there.y_m), abs=1e-6)
