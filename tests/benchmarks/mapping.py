"""How good a map is that the robot makes: trajectory, loop closures, walls, and its own time; prints JSON.

    python -m tests.benchmarks.mapping [--world flat] [--seed 1] [--route FILE] [--out DIR] [--dynamics]

The robot has the plant's LiDAR and odometry; its base follows velocities at once, unless `--dynamics` steps the plant.
`false_closures` are those kept whose relative pose is off the truth by more than 0.3 m or 3 degrees. `walls_within` is
the share of the map's occupied cells (each band) within 5, 10 and 15 cm of occupied ones in the surveyed grid of the
world, after the alignment of the trajectory. `times_faster` is the robot's time over the processor time of everything
but the plant.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from plant.referee.object_history import align, trajectory_error_m
from plant.robots.spot.model import spot_facts
from plant.sensors.lidar import Lidar
from plant.sensors.proprioception import OdometryModel
from plant.simulation import Simulation
from plant.worlds.world import load_world
from skills.estimate.grid_map import load_grid_map
from skills.geometry import compose, relative_pose
from skills.mapping.map_folder import map_grids, save_graph, save_grids
from skills.mapping.mapper import Mapper
from skills.mapping.survey import Survey
from skills.robot import CommandId, CommandState, CommandStatus, Pose2D

STEP_S = 0.05
FALSE_M, FALSE_RAD = 0.3, math.radians(3.0)


class Gliding:
    """A robot whose base follows velocities at once: the plant's LiDAR and odometry, without its dynamics."""

    def __init__(self, simulation: Simulation, seed: int) -> None:
        engine, self._robot = simulation.engine, simulation.robots["Alice"]
        self._context, self._model = engine.context, engine.world.robots["Alice"]
        rng = np.random.default_rng(seed)
        X_BL = RigidTransform(spot_facts()["lidar"]["xyz"])
        inspector = engine.world.scene_graph.model_inspector()
        self._lidar = Lidar(engine.world.plant, inspector, self._model.body, X_BL, rng, unseen=self._model.instances())
        self._odometry = OdometryModel(rng)
        self._height = spot_facts()["capabilities"]["standing_height"]
        self.true, self._velocity, self._until_s, self.now_s = simulation.starts["Alice"], np.zeros(3), 0.0, 0.0
        self.capabilities, self.joints, self.gripper = self._robot.capabilities, self._robot.joints, self._robot.gripper
        self._sense()

    def advance(self, dt_s: float) -> None:
        velocity = self._velocity if self.now_s < self._until_s else np.zeros(3)
        self.now_s += dt_s
        self.true = compose(self.true, Pose2D(*(velocity * dt_s)))
        self._sense(velocity)

    def now(self) -> float:
        return self.now_s

    def _sense(self, velocity=(0.0, 0.0, 0.0)) -> None:
        self._model.place(self._context, self.true)
        c, s = math.cos(self.true.yaw_rad), math.sin(self.true.yaw_rad)
        vx, vy, wz = velocity
        moved = np.array([c * vx - s * vy, s * vx + c * vy, 0.0])
        X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, self.true.yaw_rad), [self.true.x_m, self.true.y_m, self._height])
        self._reading = self._odometry.update(self.now_s, X_WB, np.array([0.0, 0.0, wz]), moved)
        self._scan = self._lidar.scan(self._context, self.now_s, self._reading.X_OB)

    def odometry(self):
        return self._reading

    def scan(self):
        return self._scan

    def drive(self, vx, vy, wz, *, until_s, lease):
        self._velocity, self._until_s = np.array([vx, vy, wz]), until_s
        return CommandId(0)

    def stop(self, *, lease, only=None):
        self._velocity = np.zeros(3)
        return CommandId(0)

    def command_status(self, command):
        return CommandStatus(CommandState.RUNNING)


class InPlant:
    """The plant's own robot."""

    def __init__(self, simulation: Simulation) -> None:
        self.robot, self._simulation = simulation.robots["Alice"], simulation
        self.advance, self.now = simulation.clock.advance, simulation.clock.now

    @property
    def true(self) -> Pose2D:
        return self._simulation.true_pose("Alice")


def survey(name: str, seed: int, route: Path | None, out: Path | None, *, dynamics: bool, most_s: float) -> dict:
    world = load_world(name)
    simulation = Simulation(world, seed=seed, visuals=False)
    plant = InPlant(simulation) if dynamics else Gliding(simulation, seed)
    robot = plant.robot if dynamics else plant
    lease = robot.acquire_lease("benchmark") if dynamics else None
    mapper, start = Mapper(world.start), world.start
    points = None
    if route is not None:
        there = [compose(start, Pose2D(*point, 0.0)) for point in json.loads(route.read_text())]
        points = [(pose.x_m, pose.y_m) for pose in there]
    made = Survey(robot, lease, mapper, home=start, route=points)
    truth: dict[float, Pose2D] = {}
    own_s, told, begun, slowest = 0.0, 0.0, time.perf_counter(), 0.0
    while not made.done and plant.now() < most_s:
        plant.advance(STEP_S)
        truth[round(robot.scan().stamp_s, 3)] = plant.true
        tick = time.process_time()
        made.tick(plant.now())
        took = time.process_time() - tick
        own_s += took if len(mapper.keyframes) > 3 else 0.0
        slowest = max(slowest, took) if len(mapper.keyframes) > 3 else 0.0
        if plant.now() > told:
            told += 20.0
            off = relative_pose(plant.true, mapper.pose)
            print(
                f"{plant.now():6.0f} s {mapper.driven_m:6.1f} m  {len(mapper.keyframes)} keyframes  "
                f"{len(mapper.graph.closures)} closures  off {math.hypot(off.x_m, off.y_m):.3f} m "
                f"{math.degrees(off.yaw_rad):.2f} deg  {made.goal and made.goal[0]}  own {own_s:.1f} s",
                file=sys.stderr,
                flush=True,
            )
    wall_s = time.perf_counter() - begun
    true = [truth[round(frame.stamp_s, 3)] for frame in mapper.keyframes]
    tick = time.process_time()
    grids = map_grids(mapper)
    render_s = time.process_time() - tick
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        save_grids(out, grids)
        save_graph(out, mapper)
    return {
        "world": world.name,
        "seed": seed,
        "done": made.done,
        "trouble": made.trouble,
        "notes": made.notes,
        "distance_m": round(mapper.driven_m, 1),
        "sim_time_s": round(plant.now(), 1),
        "wall_time_s": round(wall_s, 1),
        "trajectory_error_m": round(trajectory_error_m(mapper.graph.poses, true), 4),
        "loop_closures": len(mapper.graph.closures),
        "false_closures": false_closures(mapper, true),
        "dropped_closures": mapper.dropped,
        "walls_within": {band: walls_within(world, grids, mapper, true, band) for band in ("scan", "keepout")},
        "obstacles_found": obstacles_found(world, grids, mapper, true),
        "free_seen": free_seen(world, grids, mapper, true),
        "contacts": len(simulation.referee.collisions),
        "own_cpu_s": round(own_s + render_s, 1),
        "times_faster": round(plant.now() / (own_s + render_s), 1),
        "slowest_tick_s": round(slowest, 2),
    }


def false_closures(mapper: Mapper, true: list[Pose2D]) -> int:
    count = 0
    for edge in mapper.graph.closures:
        off = relative_pose(edge.measured, relative_pose(true[edge.first], true[edge.second]))
        count += int(math.hypot(off.x_m, off.y_m) > FALSE_M or abs(off.yaw_rad) > FALSE_RAD)
    return count


def walls_within(world, grids, mapper: Mapper, true: list[Pose2D], band: str) -> dict[str, float]:
    """Shares of the map's occupied cells near the truth's."""
    path = world.surveyed.scan_map_path if band == "scan" else world.surveyed.keepout_map_path
    surveyed_grid = load_grid_map(path)
    cells = np.argwhere(grids.probabilities[band] > 0.65)
    points = (cells[:, ::-1] + 0.5) * 0.025 + np.array(grids.origin_m)
    off = surveyed_grid.distance_m(align(points, mapper.graph.poses, true))
    return {f"{round(100 * limit)} cm": round(float(np.mean(off <= limit)), 4) for limit in (0.05, 0.1, 0.15)}


def free_seen(world, grids, mapper: Mapper, true: list[Pose2D]) -> float:
    """The share of the truth's ground with room for the body that is free in the map."""
    surveyed_grid = load_grid_map(world.surveyed.keepout_map_path)
    x0, y0 = grids.origin_m
    cells = np.argwhere(grids.observed["keepout"] & (grids.probabilities["keepout"] < 0.45))
    points = align((cells[:, ::-1] + 0.5) * 0.025 + np.array([x0, y0]), mapper.graph.poses, true)
    covered = np.zeros_like(surveyed_grid.occupied)
    rows, columns = surveyed_grid.cells(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < covered.shape[0]) & (columns < covered.shape[1])
    covered[rows[inside], columns[inside]] = True
    wanted = surveyed_grid.with_unknown_blocked().distance > 0.3
    return round(float(covered[wanted].mean()), 4)


def obstacles_found(world, grids, mapper: Mapper, true: list[Pose2D]) -> float:
    """The share of the keep-out's surface by the ground where the body fits that the map has within 10 cm."""
    truth = load_grid_map(world.surveyed.keepout_map_path)
    cells = np.argwhere(grids.probabilities["keepout"] > 0.65)
    points = align((cells[:, ::-1] + 0.5) * 0.025 + np.array(grids.origin_m), mapper.graph.poses, true)
    rows, columns = truth.cells(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < truth.occupied.shape[0]) & (columns < truth.occupied.shape[1])
    found = np.ones(truth.occupied.shape, dtype=np.uint8)
    found[rows[inside], columns[inside]] = 0
    off_m = cv2.distanceTransform(found, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * truth.resolution_m
    fits = (truth.with_unknown_blocked().distance > 0.3).astype(np.uint8)
    near = cv2.dilate(fits, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (27, 27))) > 0
    surface = truth.occupied & near & (truth.distance > -truth.resolution_m)
    return round(float(np.mean(off_m[surface] < 0.1)), 4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default="flat")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--route", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--most", type=float, default=3000.0)
    parser.add_argument("--dynamics", action="store_true")
    args = parser.parse_args()
    result = survey(args.world, args.seed, args.route, args.out, dynamics=args.dynamics, most_s=args.most)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
