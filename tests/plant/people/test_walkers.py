"""People who walk in the plant."""

import itertools
import math
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.words.mission import Route
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.models.catalogue import load_catalogue
from plant.people import walkers
from plant.people.walk import Leg, Walk
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import SPOT
from plant.worlds.seeding import Lapse, PointRoute, PointStop, place_people
from plant.worlds.world import DoorRule, WorldError, load_world
from skills.robot import Pose2D
from tests.plant.boxes import box_world

STEP_S = 0.0125


def walk_of(*legs, loops=False, start_s=0.0, speed_m_s=1.0, **options):
    first = legs[0].corners_W[0] if legs else (0.0, 0.0)
    return Walk(legs, at_W=first, yaw_rad=0.0, speed_m_s=speed_m_s, start_s=start_s, loops=loops, **options)


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
    assert (after(walk, 0.1).yaw_rad, walk.heading_rad) == (pytest.approx(0.4, abs=0.06), pytest.approx(math.pi / 2))
    assert after(walk, 1.0).yaw_rad == pytest.approx(math.pi / 2)


def test_goes_round_and_round_on_a_loop():
    legs = (Leg(((0.0, 0.0), (1.0, 0.0)), 0.0), Leg(((1.0, 0.0), (0.0, 0.0)), 0.0))
    assert after(walk_of(*legs, loops=True), 4.5).place_W == pytest.approx((0.5, 0.0), abs=0.05)


def test_a_person_without_a_path_stands():
    assert after(walk_of(), 1.0).place_W == (0.0, 0.0)


START = Pose2D(-3.0, 0.0, 0.0)
PERSON = load_catalogue()["person"].forms["standing"].path()


_BUILT = {}


def built(folder, routes, robot, doors):
    """A floor with a wall, a robot and people; it is built once for the same people and doors."""
    kept, placed = (*routes, repr(doors)), PlacedRobot("Alice", "spot", robot)
    models = [
        LooseModel(name, PERSON, RigidTransform([*each.stops[0].at_W, 0.0]), route=each)
        for name, each in routes.items()
    ]
    if kept not in _BUILT:
        directives = box_world(folder, floor=("20 20 1", "0 0 -0.5"), wall=("0.2 6 2", "2 -2 1"))
        config = DiagramConfig(directives=directives, models=models, robots=[placed], visuals=False, render=False)
        _BUILT[kept] = build_diagram(replace(config, doors=doors))
    world = _BUILT[kept]
    world.robots["Alice"].robot = placed
    return replace(world, config=replace(world.config, models=models))


class Hall:
    """A floor with a wall, a robot and a person, and the referee."""

    def __init__(self, folder, route, robot=START, doors=(), **others):
        routes = {"Kim": route, **others}
        self.world = built(folder, routes, robot, doors)
        self.engine = Engine(self.world)
        self.referee = Referee(
            self.world.plant, [], robots={"Alice": SPOT}, persons=[*routes], scenery=self.world.scenery
        )
        self.engine.observe(lambda now_s: self.referee.observe(self.engine.context, now_s), every=4)

    @property
    def person_W(self):
        body = self.world.plant.GetBodyByName("person", self.world.models["Kim"])
        return Pose2D.from_transform(self.world.plant.EvalBodyPoseInWorld(self.engine.context, body))

    @property
    def person_xy(self):
        return self.person_W.x_m, self.person_W.y_m

    @property
    def gap_m(self):
        """Distance between the robot's body and Kim."""
        return math.dist(self.referee.path("Alice")[-1][:2], self.person_xy)

    @property
    def blame(self):
        """Collisions, people whom the robot hit, and people who walked into it."""
        verdict = self.referee.judge([])
        return verdict.collisions, verdict.people_hit, verdict.hit_by_people

    def saved(self):
        return self.engine.state(), {name: each.copy() for name, each in self.engine.world_state().items()}

    def drive(self, vx, seconds):
        robot = self.engine.robots["Alice"]
        lease = robot.take_lease("test")
        robot.drive(vx, 0.0, 0.0, until_s=self.engine.now() + seconds, lease=lease)
        self.engine.advance(seconds)


@pytest.fixture
def hall(tmp_path):
    return lambda *points, robot=START, doors=(), others=MappingProxyType({}), **options: Hall(
        tmp_path, PointRoute(tuple(PointStop(point) for point in points), **options), robot, doors, **others
    )


def test_the_body_in_the_plant_follows_the_route(hall):
    stage = hall((0.0, 2.0), (0.0, -2.0), speed_m_s=1.0)
    stage.engine.advance(2.0)
    assert stage.person_xy == pytest.approx((0.0, 0.0), abs=1e-6)
    assert stage.person_W.yaw_rad == pytest.approx(-math.pi / 2, abs=0.01)


def test_a_person_walks_around_a_wall_without_contact(hall):
    stage = hall((1.0, 0.0), (3.0, 0.0), speed_m_s=2.0)
    places = []
    for _ in range(60):
        stage.engine.advance(0.05)
        places.append(stage.person_xy)
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
    assert -0.6 < stage.person_W.y_m < -0.4 and not stage.referee.collisions
    stage.drive(-0.8, 4.0)
    assert stage.person_W.y_m > 1.0 and not stage.referee.collisions


def test_a_person_who_does_not_yield_walks_into_a_standing_robot(hall):
    stage = hall((-1.0, -2.0), (-1.0, 1.0), robot=Pose2D(-1.0, 0.5, 0.0), yields=False)
    stage.engine.advance(4.0)
    assert stage.blame == (0, 0, 1) and "Kim walked into Alice's" in stage.referee.events[0]
    assert stage.person_W.y_m == pytest.approx(1.0, abs=1e-6)


def test_a_robot_that_drives_into_a_person_causes_the_collision(hall):
    stage = hall((-1.0, 0.0), (-1.0, 0.0))
    stage.drive(0.6, 4.0)
    assert (stage.blame, stage.person_xy) == ((1, 1, 0), pytest.approx((-1.0, 0.0), abs=0.02))


def test_a_person_who_has_yielded_for_long_walks_around_the_robot(hall, monkeypatch):
    monkeypatch.setattr(walkers, "PATIENCE_S", 1.5)
    stage = hall((-1.0, -1.0), (-1.0, 2.2), robot=Pose2D(-1.0, 0.5, 0.0))
    stage.engine.advance(6.5)
    assert stage.person_xy == pytest.approx((-1.0, 2.2), abs=1e-6) and not stage.referee.collisions


def test_a_standing_person_asked_by_a_robot_lets_it_pass_and_comes_back(hall, monkeypatch):
    monkeypatch.setattr(walkers, "LETS_PASS_S", 5.0)
    stage = hall((0.5, 0.0), robot=Pose2D(-1.5, 0.0, 0.0))
    stage.engine.walkers.let_pass("Alice", "Kim")
    stage.engine.advance(3.0)
    assert abs(stage.person_W.y_m) > 0.9
    stage.engine.advance(7.0)
    assert stage.person_xy == pytest.approx((0.5, 0.0), abs=0.1) and not stage.referee.collisions


def test_a_deaf_person_stays_before_a_robot_that_asks(hall):
    stage = hall((0.5, 0.0), robot=Pose2D(-1.5, 0.0, 0.0), steps_aside=0.0)
    stage.engine.walkers.let_pass("Alice", "Kim")
    stage.engine.advance(3.0)
    assert stage.person_xy == pytest.approx((0.5, 0.0), abs=1e-6)


# a loop without a robot in the way, and a detour around one
@pytest.mark.parametrize(
    ("points", "options", "before_s", "detour"),
    [
        (((0.0, 2.0), (0.0, -2.0)), {"loops": True}, 1.0, False),
        (((-1.0, -1.0), (-1.0, 3.5)), {"robot": Pose2D(-1.0, 0.5, 0.0)}, 4.5, True),
    ],
)
def test_a_restored_walk_continues(hall, points, options, before_s, detour):
    stage = hall(*points, **options)
    stage.engine.advance(before_s)
    saved = stage.saved()
    stage.engine.advance(1.0)
    there = stage.person_xy
    stage.engine.resume(*saved)
    stage.engine.advance(1.0)
    assert (stage.engine.walkers["Kim"].on_detour, stage.person_xy) == (detour, pytest.approx(there, abs=1e-6))


LINE = ((0.0, 0.0), (9.0, 0.0))


def test_a_distracted_person_stops_and_walks_on():
    walk = after(walk_of(Leg(LINE, 0.0), lapses=(Lapse(2.0, 3.0),)), 4.0)
    assert walk.place_W == pytest.approx((2.0, 0.0), abs=0.05) and walk.lapsed
    assert after(walk, 2.0).place_W == pytest.approx((3.0, 0.0), abs=0.05)


def test_a_distracted_person_walks_back_first():
    walk = after(walk_of(Leg(LINE, 0.0), lapses=(Lapse(4.0, 2.0, 1.5),)), 6.0)
    assert (walk.place_W, abs(walk.heading_rad)) == (pytest.approx((2.5, 0.0), abs=0.05), pytest.approx(math.pi))
    assert (after(walk, 3.0).place_W, after(walk, 9.0).place_W) == (pytest.approx((4.0, 0.0), abs=0.05), (9.0, 0.0))


def test_something_behind_ends_the_walk_back():
    walk = after(walk_of(Leg(LINE, 0.0), lapses=(Lapse(4.0, 2.0, 3.0),)), 4.5)
    assert walk.turn_round() and walk.pauses and not walk.goes_back
    assert after(walk, 3.5).place_W == pytest.approx((5.0, 0.0), abs=0.1)


def test_the_pace_changes_on_the_path():
    walk = walk_of(Leg(LINE, 0.0), pace=lambda part: (1.0, 0.5)[part % 2])
    assert after(walk, 5.0).place_W == pytest.approx((4.0, 0.0), abs=0.05)


# a walk, which goes back after a lapse, or not -> it continues from its state
@pytest.mark.parametrize(
    ("leg", "lapses", "before_s", "after_s"),
    [
        (Leg(((0.0, 0.0), (1.0, 0.0), (1.0, 3.0)), 0.5), (), 1.7, 0.5),
        (Leg(LINE, 0.0), (Lapse(2.0, 1.0, 1.5),), 2.5, 4.0),
    ],
)
def test_a_walk_continues_from_a_state(leg, lapses, before_s, after_s):
    walk, other = after(walk_of(leg, lapses=lapses), before_s), walk_of(leg, lapses=lapses)
    other.restore(walk.state())
    assert walk.goes_back is bool(lapses)
    assert after(other, after_s).state() == after(walk, after_s).state()


def test_a_person_follows_the_robot_that_has_spoken_near_them(hall):
    stage = hall((-4.5, 0.0), robot=Pose2D(-3.0, 0.0, 0.0), follows="robot", apart=True)
    stage.drive(0.8, 3.0)
    assert stage.gap_m > 3.2
    stage.engine.walkers.hear("Alice")
    stage.drive(-0.8, 2.0)
    assert stage.person_W.x_m == pytest.approx(-4.5)
    stage.engine.walkers.hear("Alice")
    stage.drive(0.5, 4.0)
    assert 1.3 < stage.gap_m < 2.2 and not stage.referee.collisions


def test_a_distracted_follower_waits_until_the_robot_is_near(hall):
    lapses = (Lapse(0.5, 0.5, 0.4),)
    stage = hall((-5.0, 0.0), robot=Pose2D(-3.0, 0.0, 0.0), follows="robot", lapses=lapses)
    stage.engine.walkers.hear("Alice")
    stage.drive(0.8, 3.0)
    assert stage.person_W.x_m == pytest.approx(-4.9, abs=0.1)
    stage.drive(-0.8, 3.5)
    stage.drive(0.8, 3.0)
    assert stage.person_W.x_m > -4.0


DOOR = DoorRule(name="gate", at=(2.0, -6.5), yaw=0.0, width=3.0, closes=0.0, opens=2.0)


def test_a_person_waits_before_a_closed_door(hall):
    door = DOOR.model_copy(update={"at": (-1.0, 0.5), "width": 30.0})
    stage = hall((-1.0, -1.0), (-1.0, 2.5), speed_m_s=1.5, doors=(door,))
    stage.engine.advance(2.0)
    assert stage.person_W.y_m == pytest.approx(-0.1, abs=0.05)
    for _ in range(25):
        stage.engine.walkers.before_step(0.1, (), ())
    assert stage.engine.walkers["Kim"].place_W == pytest.approx((-1.0, 2.5))


def test_a_person_takes_another_path_around_a_closed_door(hall):
    door = DOOR.model_copy(update={"at": (-1.0, 0.5), "width": 2.0, "opens": 60.0})
    stage = hall((-1.0, -1.0), (-1.0, 2.5), speed_m_s=1.5, doors=(door,))
    stage.engine.advance(9.0)
    assert stage.person_W.y_m == pytest.approx(2.5)


def test_people_who_meet_pass_each_other_apart(hall):
    other = PointRoute((PointStop((-1.0, 2.0)), PointStop((-1.0, -2.0))), apart=True)
    stage = hall((-1.0, -2.0), (-1.0, 2.0), apart=True, others={"Robin": other})
    apart_m = []
    stage.engine.observe(lambda _: apart_m.append(math.dist(*stage.engine.walkers.places_W())), every=4)
    stage.engine.advance(8.0)
    assert min(apart_m) > 0.4
    assert [round(y, 3) for _, y in stage.engine.walkers.places_W()] == [2.0, -2.0]


HALL_W, ROOM_W = (5.6, 4.5), (8.6, 2.5)
"""Points of the flat on both sides of a door through which one person goes at a time."""


def flat_walkers(**routes):
    people = {name: Route(waypoints=points, apart=True, start=0.0) for name, points in routes.items()}
    world = load_world("flat").without_people().with_routes(people)
    models = [LooseModel(each.name, each.model_path, each.X_WO, route=each.route) for each in place_people(world, 1)]
    config = DiagramConfig(directives=world.directives_path, models=models, visuals=False, render=False)
    return Engine(build_diagram(config)).walkers


def test_people_who_meet_in_a_doorway_make_way():
    people = flat_walkers(Kim=(HALL_W, ROOM_W), Lee=(ROOM_W, HALL_W), Robin=((8.1, 3.6), (4.6, 4.5)))
    apart_m = []
    for _ in range(600):
        people.before_step(0.05)
        apart_m.extend(math.dist(*pair) for pair in itertools.combinations(people.places_W(), 2))
    assert all(people[name].done for name in ("Kim", "Lee", "Robin")) and min(apart_m) > 0.4


def test_a_person_stops_beside_somebody_who_stands_at_the_end_of_the_route():
    people = flat_walkers(Kim=(ROOM_W,), Robin=(HALL_W, ROOM_W))
    for _ in range(300):
        people.before_step(0.05)
    assert people["Robin"].done and 0.4 < math.dist(people["Robin"].place_W, ROOM_W) < 1.3


def test_wandering_people_walk_to_free_points_that_their_seeds_draw(hall):
    other = PointRoute((PointStop((-1.0, 0.0)),), wanders=True, stream=(8,))
    stage = hall((-1.0, 0.0), wanders=True, stream=(7,), others={"Robin": other})
    stage.engine.advance(3.0)
    kim, robin = (stage.engine.walkers[name].next_stop_W for name in ("Kim", "Robin"))
    assert kim != robin and math.dist(stage.engine.walkers["Kim"].place_W, (-1.0, 0.0)) > 0.5


def test_a_person_speaks_once_at_the_end_of_the_route_when_a_robot_is_near(hall):
    far = PointRoute((PointStop((1.0, 0.0)), PointStop((1.0, 1.0))), says="hello")
    stage = hall((-7.0, 0.0), (-5.0, 0.0), says="thank you", speed_m_s=2.0, others={"Robin": far})
    stage.engine.advance(3.0)
    ((time_s, name, words),) = stage.engine.words
    assert (name, words) == ("Kim", "thank you") and 1.0 <= time_s < 1.2
