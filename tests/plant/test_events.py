"""Sliding doors and moved objects in the flat: `DOORS` and `MOVES` have what happens when."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from executive.words.mission import Route
from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from plant.worlds.seeding import place_people
from plant.worlds.world import DoorRule, MoveRule, SurfaceTop, WorldError, load_world
from skills.robot import Pose2D

STOOL = SurfaceTop("stool", ((9.0, 2.0), (9.05, 2.0), (9.05, 2.05)), 0.5)
FLAT = load_world("flat")
FLAT = replace(FLAT, surfaces={**FLAT.surfaces, "stool": STOOL})
AT, CALLED_AT, AHEAD = (9.0, 5.40), (6.85, 5.40), (9.0, 6.7)
FIRST = {
    "closes at once": ((2.90, 5.40), {"closes": 0.0}, True),
    "opens": ((5.10, 5.40), {"opens": 9.0}, True),
    "closes": ((3.30, 3.60), {"closes": 9.0}, False),
    "opens before it closes": ((5.60, 3.60), {"opens": 8.0, "closes": 9.0}, True),
}
"""Doors by name: their place, their times, and whether they are shut at first."""


def rule(name, at, **times):
    return DoorRule(name=name, at=at, yaw=math.pi, width=0.9, **times)


DOOR, CALLED = rule("door", AT, closes=0.75, opens=3.4), rule("called", CALLED_AT, opens=900.0)
DOORS = (DOOR, CALLED, *(rule(name, at, **times) for name, (at, times, _) in FIRST.items()))
MOVES = (
    MoveRule(name="beer", at=0.75, to="kitchen table"),
    MoveRule(name="hammer", at=0.5, to=(9.0, 3.0, 0.0)),
    MoveRule(name="coke", at=0.5, to="stool"),
)


def simulated(doors=DOORS, moves=MOVES, start=FLAT.start):
    robots = [PlacedRobot("Alice", "spot", start, FLAT.dock)]
    return Simulation(FLAT.with_events(doors, moves), seed=1, visuals=False, robots=robots)


@dataclass
class Seen:
    """The panels' places, the returns in the doorway, the objects' places, and the changes of each door at a time."""

    panels: dict
    rays: int
    things: dict
    history: dict

    @classmethod
    def of(cls, simulation):
        engine = simulation.engine
        names = [name for name in engine.world.models if name in {door.name for door in DOORS}]
        positions = {name: engine.world.plant.GetPositions(engine.context, engine.world.models[name]) for name in names}
        things = {name: each.last.p_WO for name, each in simulation.referee.objects.items()}
        panels = {name: tuple(each[:2]) for name, each in positions.items()}
        return cls(panels, rays_in_doorway(simulation), things, engine.doors.history())


def rays_in_doorway(simulation):
    """Number of returns of the latest scan in the doorway."""
    X_WB = simulation.true_pose("Alice").transform(0.52)
    points_W = X_WB.multiply(simulation.robots["Alice"].scan().points_B().T).T
    near = (np.abs(points_W[:, 0] - AT[0]) < 0.4) & (np.abs(points_W[:, 1] - AT[1]) < 0.15) & (points_W[:, 2] > 0.2)
    return int(near.sum())


def slid(at):
    """The place of the panel of an open door."""
    return pytest.approx((at[0] - 0.9, at[1]))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Five seconds of the flat: the simulation, what was seen by time, and another that goes on from 1.8 s."""
    simulation, after, file = simulated(), simulated(), tmp_path_factory.mktemp("run") / "flat.plant"
    seen = {0.0: Seen.of(simulation)}
    for now_s in (0.2, 0.5, 1.8, 2.4, 5.1):
        simulation.clock.advance(now_s - simulation.clock.now())
        seen[now_s] = Seen.of(simulation)
        if now_s == 0.2:
            simulation.engine.doors.call(CALLED_AT)
        if now_s == 1.8:
            simulation.save_snapshots(file)
            after.restore(file)
    return simulation, seen, after


def test_a_door_closes_and_opens_at_its_times_and_the_lidar_sees_it(run):
    simulation, seen, _ = run
    assert [seen[now_s].panels["door"] for now_s in (0.5, 2.4)] == [slid(AT), pytest.approx(AT)]
    assert [seen[now_s].rays > 500 for now_s in (0.5, 2.4, 5.1)] == [False, True, False]
    assert seen[0.5].rays == seen[5.1].rays == 0
    said = [sentence for _, sentence in simulation.clock.events]
    assert [sentence for sentence in said if "the door " in sentence] == ["the door closes", "the door opens"]
    changes = simulation.engine.doors.history()[AT]
    assert [share for _, share in changes] == [0.0, 0.5, 1.0, 0.5, 0.0]
    assert [begun_s for begun_s, _ in changes] == pytest.approx([0.0, 0.75, 2.25, 3.4, 4.9], abs=0.05)


def test_a_door_that_is_called_opens_and_stays_open(run):
    simulation, seen, _ = run
    places = [seen[now_s].panels["called"] for now_s in (0.2, 1.8, 5.1)]
    assert places == [pytest.approx(CALLED_AT), *[slid(CALLED_AT)] * 2]
    assert [share for _, share in simulation.engine.doors.history()[CALLED_AT]] == [1.0, 0.5, 0.0]


@pytest.mark.parametrize("name", FIRST)
def test_the_earlier_time_says_how_a_door_is_at_first(run, name):
    _, seen, _ = run
    at, _, shut = FIRST[name]
    assert seen[0.0].panels[name] == (pytest.approx(at) if shut else slid(at))


def test_an_object_is_moved_to_a_free_spot_of_a_surface_and_no_robot_did_it(run):
    simulation, seen, _ = run
    x, y, z = seen[2.4].things["beer"]
    assert (11.05 < x < 11.85, 5.95 < y < 7.05, 0.75 < z < 1.0) == (True, True, True)
    assert seen[0.5].things["beer"][0] < 10.0
    others = [place_W for name, place_W in seen[2.4].things.items() if name != "beer"]
    assert min(math.dist(other[:2], (x, y)) for other in others) > 0.06
    moved = ("Somebody moved the beer at 0.75 s.", "Somebody moved the hammer at 0.50 s.")
    assert tuple(sorted(simulation.referee.events)) == moved
    assert (simulation.referee.drops, simulation.referee.lifts("Alice")) == (0, ())


def test_an_object_is_put_on_the_floor_at_a_point(run):
    _, seen, _ = run
    assert seen[1.8].things["hammer"] == pytest.approx((9.0, 3.0, 0.03), abs=0.03)


def test_an_object_stays_when_the_goal_surface_has_no_free_spot(run):
    simulation, seen, _ = run
    assert seen[1.8].things["coke"] == pytest.approx(seen[0.0].things["coke"], abs=0.01)
    assert (0.5, "nobody moves the coke, because the stool has no free spot") in simulation.clock.events


def test_doors_and_moves_go_on_after_a_restart(run):
    _, seen, after = run
    before, now = seen[1.8], Seen.of(after)
    assert (now.panels["door"], after.clock.events) == (pytest.approx(AT), [])
    assert now.history[AT][:2] == before.history[AT] == ((0.0, 0.0), (0.75, 0.5))
    assert now.things["beer"] == pytest.approx(before.things["beer"], abs=0.01)


def test_a_door_waits_for_a_robot_in_the_doorway_and_a_closed_one_blocks_it():
    simulation = simulated((DOOR, rule("gate", AHEAD, closes=0.0)), (), Pose2D(*AT, math.pi / 2))
    simulation.clock.advance(3.0)
    assert (Seen.of(simulation).panels["door"], simulation.referee.collisions) == (slid(AT), ())
    robot = simulation.robots["Alice"]
    robot.drive(0.5, 0.0, 0.0, until_s=simulation.clock.now() + 2.0, lease=robot.acquire_lease("test"))
    simulation.clock.advance(2.0)
    assert AT[1] + 0.3 < simulation.true_pose("Alice").y_m < AHEAD[1] - 0.4
    assert any("gate" in bump.sentence for bump in simulation.referee.collisions)


def test_a_standing_person_sets_off_from_their_place():
    world = FLAT.with_walks({"Robin": Route(waypoints=((9.5, 3.0),), start=1.0)})
    (stands,) = place_people(FLAT, seed=1)
    simulation = Simulation(world, seed=1, visuals=False, robots=[PlacedRobot("Alice", "spot", Pose2D(4.0, 4.5, 0.0))])
    ((x, y),) = simulation.engine.walkers.places_W()
    assert (x, y) == pytest.approx(tuple(stands.X_WO.translation()[:2]))
    simulation.clock.advance(3.0)
    assert math.dist(next(simulation.engine.walkers.places_W()), (x, y)) > 1.0


def test_nobody_walks_twice():
    route = Route(waypoints=((9.5, 3.0),))
    with pytest.raises(WorldError, match="Robin walks already"):
        FLAT.with_walks({"Robin": route}).with_walks({"Robin": route})
