"""The referee sees robots touch each other."""

from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from plant.worlds.world import load_world
from skills.robot import Pose2D


def test_a_crash_of_two_robots_is_one_contact_between_them():
    """Alice drives into Bob, who stands, and stays in contact."""
    alice, bob = Pose2D(2.0, 4.5, 0.0), Pose2D(2.95, 4.5, 3.14)
    robots = [PlacedRobot("Alice", "spot", alice), PlacedRobot("Bob", "fetch", bob)]
    simulation = Simulation(load_world("flat"), seed=1, visuals=False, robots=robots)
    alice = simulation.robots["Alice"]
    lease = alice.acquire_lease("test")
    for _ in range(20):
        alice.drive(0.5, 0.0, 0.0, until_s=simulation.clock.now() + 0.3, lease=lease)
        simulation.clock.advance(0.05)
    verdict = simulation.referee.judge([])
    assert (verdict.collisions, verdict.robots_hit, verdict.people_hit) == (1, 1, 0)
    (bump,) = simulation.referee.collisions
    assert {bump.robot, bump.other_robot} == {"Alice", "Bob"}
