"""The plant counts its work; the same run gives the same counts."""

from executive.testing.bench import write_small_room
from plant.simulation import Simulation
from plant.worlds.world import load_world


def counted(world):
    simulation = Simulation(world, seed=1, visuals=False)
    robot = simulation.robots["Alice"]
    robot.scan()
    before = simulation.work()
    simulation.clock.advance(0.5)
    robot.scan()
    robot.image("frontleft", depth=False)
    robot.image("frontleft", visual=False)
    robot.image("hand")
    return before, simulation.work()


def test_steps_rays_and_pictures_are_counted_and_the_same_run_does_the_same_work(tmp_path):
    world = load_world(write_small_room(tmp_path))
    before, after = counted(world)
    scan = 16 * 900
    assert (before["lidar_rays"], (after["plant_steps"], after["lidar_rays"])) == (scan, (40, 2 * scan))
    assert after["pictures_320x240"] == after["depth_pictures_160x120"] == 1
    assert after["pictures_640x480"] == after["depth_pictures_640x480"] == 1
    assert after["contact_points"] > before["contact_points"] and counted(world) == (before, after)
