"""Sliding doors and moved objects in the flat."""

import math
from dataclasses import replace

import numpy as np
import pytest

from executive.words.mission import Route
from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from plant.worlds.seeding import place_people
from plant.worlds.world import DoorRule, MoveRule, SurfaceTop, WorldError, load_world
from skills.robot import Pose2D

FLAT = load_world("flat")
AT = (9.0, 5.40)
DOOR = DoorRule(name="door", at=AT, yaw=math.pi, width=0.9, closes=1.0, opens=5.0)


def simulated(*, doors=(DOOR,), moves=(), start=None, seed=1):
    robots = [PlacedRobot("Alice", "spot", start or FLAT.start, FLAT.dock)]
    return Simulation(FLAT.with_events(doors, moves), seed=seed, visuals=False, robots=robots)


def panel_W(simulation):
    engine = simulation.engine
    return engine.world.plant.GetPositions(engine.context, engine.world.models["door"])[:2]


def rays_in_doorway(simulation):
    """Number of returns of the latest scan in the doorway."""
    X_WB = simulation.true_pose("Alice").transform(0.52)
    points_W = X_WB.multiply(simulation.robots["Alice"].scan().points_B().T).T
    near = (np.abs(points_W[:, 0] - AT[0]) < 0.4) & (np.abs(points_W[:, 1] - AT[1]) < 0.15) & (points_W[:, 2] > 0.2)
    return int(near.sum())


def thing_W(simulation, name):
    return simulation.referee.objects[name].last.p_WO


def test_a_door_closes_and_opens_at_its_times_and_the_lidar_sees_it():
    simulation = simulated()
    simulation.clock.advance(0.9)
    assert panel_W(simulation) == pytest.approx((AT[0] - 0.9, AT[1]))
    assert rays_in_doorway(simulation) == 0
    simulation.clock.advance(3.0)
    assert panel_W(simulation) == pytest.approx(AT)
    assert rays_in_doorway(simulation) > 500
    simulation.clock.advance(3.0)
    assert rays_in_doorway(simulation) == 0
    assert [sentence for _, sentence in simulation.clock.events] == ["the door closes", "the door opens"]
    changes = simulation.engine.doors.history()[AT]
    assert [share for _, share in changes] == [0.0, 0.5, 1.0, 0.5, 0.0]
    assert [begun_s for begun_s, _ in changes] == pytest.approx([0.0, 1.0, 2.5, 5.0, 6.5], abs=0.05)


def test_a_door_that_is_called_opens_and_stays_open():
    simulation = simulated(doors=(DOOR.model_copy(update={"closes": None, "opens": 900.0}),))
    simulation.clock.advance(0.2)
    simulation.engine.doors.call(AT)
    simulation.clock.advance(2.0)
    assert panel_W(simulation) == pytest.approx((AT[0] - 0.9, AT[1]))
    assert [share for _, share in simulation.engine.doors.history()[AT]] == [1.0, 0.5, 0.0]


@pytest.mark.parametrize(
    ("times", "shut"),
    [({"closes": 0.0}, True), ({"opens": 9.0}, True), ({"closes": 9.0}, False), ({"opens": 2.0, "closes": 9.0}, True)],
)
def test_the_earlier_time_says_how_a_door_is_at_first(times, shut):
    simulation = simulated(doors=(DoorRule(name="door", at=AT, yaw=math.pi, width=0.9, **times),))
    assert panel_W(simulation)[0] == pytest.approx(AT[0] if shut else AT[0] - 0.9)


def driven(simulation, seconds):
    robot = simulation.robots["Alice"]
    robot.drive(0.5, 0.0, 0.0, until_s=simulation.clock.now() + seconds, lease=robot.acquire_lease("test"))
    simulation.clock.advance(seconds)
    return simulation.true_pose("Alice")


def test_a_closed_door_blocks_the_body_and_the_referee_sees_the_bump():
    shut = DoorRule(name="door", at=AT, yaw=math.pi, width=0.9, closes=0.0)
    simulation = simulated(doors=(shut,), start=Pose2D(9.0, 4.2, math.pi / 2))
    assert driven(simulation, 4.0).y_m < AT[1]
    assert any("door" in bump.sentence for bump in simulation.referee.collisions)


def test_a_door_waits_for_a_robot_in_the_doorway():
    simulation = simulated(start=Pose2D(9.0, 5.4, math.pi / 2))
    simulation.clock.advance(4.0)
    assert panel_W(simulation)[0] == pytest.approx(AT[0] - 0.9)
    assert simulation.referee.collisions == ()


def test_an_object_is_moved_to_a_free_spot_of_a_surface_and_no_robot_did_it():
    simulation = simulated(doors=(), moves=(MoveRule(name="beer", at=1.0, to="kitchen table"),))
    simulation.clock.advance(0.9)
    before_W = thing_W(simulation, "beer")
    simulation.clock.advance(2.0)
    x, y, z = thing_W(simulation, "beer")
    assert (before_W[0] < 10.0, 11.05 < x < 11.85, 5.95 < y < 7.05, 0.75 < z < 1.0) == (True, True, True, True)
    others = [thing_W(simulation, name) for name in simulation.referee.objects if name != "beer"]
    assert min(math.dist(other[:2], (x, y)) for other in others) > 0.06
    assert simulation.referee.events == ("Somebody moved the beer at 1.00 s.",)
    assert (simulation.referee.drops, simulation.referee.lifts("Alice")) == (0, ())


def test_an_object_is_put_on_the_floor_at_a_point():
    simulation = simulated(doors=(), moves=(MoveRule(name="hammer", at=0.5, to=(9.0, 3.0, 0.0)),))
    simulation.clock.advance(2.0)
    assert thing_W(simulation, "hammer") == pytest.approx((9.0, 3.0, 0.03), abs=0.03)
    assert simulation.referee.drops == 0


def test_an_object_stays_when_the_goal_surface_has_no_free_spot():
    stool = SurfaceTop("stool", ((9.0, 3.0), (9.05, 3.0), (9.05, 3.05)), 0.5)
    world = replace(FLAT, surfaces={**FLAT.surfaces, "stool": stool})
    world = world.with_events((), (MoveRule(name="beer", at=0.5, to="stool"),))
    simulation = Simulation(world, seed=1, visuals=False)
    before_W = thing_W(simulation, "beer")
    simulation.clock.advance(1.0)
    assert thing_W(simulation, "beer") == pytest.approx(before_W, abs=0.01)
    assert simulation.clock.events == [(0.5, "nobody moves the beer, because the stool has no free spot")]


def test_doors_and_moves_go_on_after_a_restart(tmp_path):
    moves = (MoveRule(name="beer", at=1.0, to="kitchen table"),)
    before = simulated(moves=moves)
    keep = before.save_snapshots(tmp_path / "flat.plant")
    before.clock.advance(2.0)
    keep()
    after = simulated(moves=moves)
    after.restore(tmp_path / "flat.plant")
    assert panel_W(after) == pytest.approx(AT)
    assert after.clock.events == []
    assert after.engine.doors.history()[AT][:2] == before.engine.doors.history()[AT] == ((0.0, 0.0), (1.0, 0.5))
    assert thing_W(after, "beer") == pytest.approx(thing_W(before, "beer"), abs=0.01)


def test_a_standing_person_sets_off_from_their_place():
    world = FLAT.with_walks({"Robin": Route(waypoints=((9.5, 3.0),), start=1.0)})
    (stands,) = place_people(FLAT, seed=1)
    simulation = Simulation(world, seed=1, visuals=False, robots=[PlacedRobot("Alice", "spot", Pose2D(4.0, 4.5, 0.0))])
    ((x, y),) = simulation.engine.walkers.places_W()
    assert (x, y) == pytest.approx(tuple(stands.X_WO.translation()[:2]))
    simulation.clock.advance(4.0)
    assert math.dist(next(simulation.engine.walkers.places_W()), (x, y)) > 1.0


def test_nobody_walks_twice():
    route = Route(waypoints=((9.5, 3.0),))
    with pytest.raises(WorldError, match="Robin walks already"):
        FLAT.with_walks({"Robin": route}).with_walks({"Robin": route})
