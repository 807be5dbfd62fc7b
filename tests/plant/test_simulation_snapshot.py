"""A plant continues from the saved state of another plant."""

import numpy as np
import pytest

from plant.simulation import Simulation
from plant.snapshot_file import SnapshotError, SnapshotWriter, read_snapshot
from plant.worlds.world import load_world
from skills.robot import LeaseError

WORLD = load_world("flat")


def make():
    return Simulation(WORLD, seed=3, visuals=False)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A plant that was abandoned while its robot walked, and the path of its snapshots."""
    simulation, path = make(), tmp_path_factory.mktemp("kept") / "flat.plant"
    keep = simulation.save_snapshots(path, label="7")
    robot = simulation.robots["Alice"]
    lease = robot.acquire_lease("test")
    for _ in range(30):
        robot.drive(0.6, 0.0, 0.4, until_s=simulation.clock.now() + 0.5, lease=lease)
        robot.set_gripper(0.6, 30.0, until_s=simulation.clock.now() + 0.5, lease=lease)
        simulation.clock.advance(0.05)
    assert read_snapshot(path).number == 2  # at the beginning and after a second
    keep()
    return simulation, path


@pytest.fixture(scope="module")
def restored(kept):
    simulation = make()
    simulation.restore(kept[1], label="7")
    return simulation


def positions(simulation):
    engine = simulation.engine
    return engine.world.plant.GetPositions(engine.context)


def test_the_robot_stops_where_it_was_and_nobody_has_its_lease(kept, restored):
    before, robot = kept[0], restored.robots["Alice"]
    assert restored.clock.now() == pytest.approx(before.clock.now() + 1.5)
    pose, was = robot.odometry().pose, before.robots["Alice"].odometry().pose
    assert np.hypot(pose.x_m - was.x_m, pose.y_m - was.y_m) < 0.15
    assert np.linalg.norm(robot.odometry().velocity) < 0.05
    robot.return_lease(robot.acquire_lease("somebody else"))
    with pytest.raises(LeaseError):
        before.robots["Alice"].acquire_lease("somebody else")


def test_objects_stay_in_place_after_a_restart(kept, restored):
    for name in restored.referee._histories:
        was, now = (each.referee._histories[name].last.p_WO for each in (kept[0], restored))
        assert np.linalg.norm(now - was) < 0.002


def test_sensors_go_on_with_their_errors(kept, restored):
    was, now = (each.robots["Alice"] for each in (kept[0], restored))
    assert now.battery().charge == pytest.approx(was.battery().charge, abs=0.01)
    assert now.gripper().opening == pytest.approx(was.gripper().opening, abs=0.1)
    assert now.scan() is not None


def test_the_referees_record_goes_on(kept, restored):
    assert "Robin" in restored.referee.names
    for name in restored.referee.names:
        before, after = (np.array(each.referee.points(name)) for each in (kept[0], restored))
        assert len(before) and np.array_equal(after[: len(before)], before)


def test_two_plants_go_on_alike_and_another_mission_begins_a_new_chapter(kept, restored):
    other = make()
    other.restore(kept[1], label="7")
    assert np.array_equal(positions(other), positions(restored))
    assert other.robots["Alice"].odometry() is not restored.robots["Alice"].odometry()
    assert str(other.robots["Alice"].odometry().pose) == str(restored.robots["Alice"].odometry().pose)
    other.restore(kept[1], label=None)
    assert len(other.referee.path("Alice")) < 20 and other.referee.drops == 0


@pytest.mark.parametrize(("label", "seed"), [("8", 3), ("7", 4)])
def test_a_state_of_another_simulation_is_refused(kept, restored, monkeypatch, label, seed):
    monkeypatch.setattr(restored, "seed", seed)
    with pytest.raises(SnapshotError, match=rf"another simulation \({'label' if label == '8' else 'seed'}\)"):
        restored.restore(kept[1], label=label)


def test_a_snapshot_is_written_a_hundred_times_into_one_small_file(kept, tmp_path):
    simulation, _ = kept
    path = tmp_path / "often.plant"
    writer = SnapshotWriter(path, simulation.engine, simulation.referee, {})
    for _ in range(100):
        writer()
    assert read_snapshot(path).number == 100
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) < 200_000
