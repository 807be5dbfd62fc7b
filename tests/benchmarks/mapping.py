"""How good a map is that the robot makes: trajectory, loop closures, walls, and its own time; prints JSON.

    python -m tests.benchmarks.mapping [--world flat] [--seed 1] [--route FILE] [--out DIR] [--dynamics] [--most 3000]

The robot has the plant's LiDAR and odometry; its base follows velocities at once, unless `--dynamics` steps the plant.
`false_closures` are those kept whose relative pose is off the truth by more than 0.3 m or 3 degrees. `walls_within` is
the share of the map's occupied cells (each band) within 5, 10 and 15 cm of occupied ones in the surveyed grid of the
world, after the alignment of the trajectory. `times_faster` is the robot's time over the processor time of everything
but the plant. The survey is broken off after `--most` seconds.
"""

import json
import math
import time
from pathlib import Path

import cv2
import numpy as np

from errand_make.maps.map_folder import map_grids, save_graph, save_grids
from errand_make.maps.mapper import Mapper
from errand_make.maps.survey import Survey
from errand_make.maps.trajectory import align, trajectory_error_m
from plant.simulation import Simulation
from plant.worlds.world import load_world
from skills.geometry import compose, relative_pose
from skills.grid_map import load_grid_map
from skills.robot import CommandId, CommandState, CommandStatus, Pose2D
from tests.benchmarks.driving import within
from tests.benchmarks.gliding import GlidingBase
from tests.benchmarks.harness import command, share, tell

STEP_S, TOLD_EVERY_S = 0.05, 20.0
SAME_PLACE = (0.3, math.radians(3.0))
CELL_M, OCCUPIED, FREE, BODY_M, NEAR_M = 0.025, 0.65, 0.45, 0.3, 0.1


class GlidingRobot(GlidingBase):
    def __init__(self, simulation, seed):
        super().__init__(simulation, np.random.default_rng(seed))
        robot = simulation.robots["Alice"]
        self.capabilities, self.joints, self.gripper = robot.capabilities, robot.joints, robot.gripper
        self._velocity, self._until_s = np.zeros(3), 0.0
        self.sense()

    def advance(self, dt_s):
        self.move(self._velocity if self.now_s < self._until_s else np.zeros(3), dt_s)

    def drive(self, vx, vy, wz, *, until_s, lease):
        self._velocity, self._until_s = np.array([vx, vy, wz]), until_s
        return CommandId(0)

    def stop(self, *, lease, only=None):
        self._velocity = np.zeros(3)
        return CommandId(0)

    def command_status(self, command):
        return CommandStatus(CommandState.RUNNING)


def survey(
    world: str = "flat",
    seed: int = 1,
    route: Path | None = None,
    out: Path | None = None,
    dynamics: bool = False,
    most: float = 3000.0,
):
    """Surveys a world, by a route if there is one, and judges the map; the files of the map are written to a folder."""
    opened = load_world(world)
    simulation = Simulation(opened, seed=seed, visuals=False)
    robot = simulation.robots["Alice"] if dynamics else GlidingRobot(simulation, seed)
    lease = robot.acquire_lease("benchmark") if dynamics else None
    clock = simulation.clock
    points = None if route is None else [compose(opened.start, Pose2D(*p, 0.0)) for p in json.loads(route.read_text())]
    stops = None if points is None else [(pose.x_m, pose.y_m) for pose in points]
    mapper = Mapper(opened.start)
    made = Survey(robot, lease, mapper, home=opened.start, route=stops)
    truth = {}
    now_s, own_s, told_s, begun, slowest_s = 0.0, 0.0, 0.0, time.perf_counter(), 0.0
    while not made.done and now_s < most:
        (clock if dynamics else robot).advance(STEP_S)
        now_s = clock.now() if dynamics else robot.now_s
        true_pose = simulation.true_pose("Alice") if dynamics else robot.true
        truth[round(robot.scan().stamp_s, 3)] = true_pose
        tick = time.process_time()
        made.tick(now_s)
        took_s = time.process_time() - tick if len(mapper.keyframes) > 3 else 0.0
        own_s, slowest_s = own_s + took_s, max(slowest_s, took_s)
        if now_s > told_s:
            told_s += TOLD_EVERY_S
            off = relative_pose(true_pose, mapper.pose)
            tell(
                f"{now_s:6.0f} s {mapper.driven_m:6.1f} m  {len(mapper.keyframes)} keyframes  "
                f"{len(mapper.graph.closures)} closures  off {math.hypot(off.x_m, off.y_m):.3f} m "
                f"{math.degrees(off.yaw_rad):.2f} deg  {made.goal and made.goal[0]}  own {own_s:.1f} s"
            )
    wall_s = time.perf_counter() - begun
    true = [truth[round(frame.stamp_s, 3)] for frame in mapper.keyframes]
    tick = time.process_time()
    grids = map_grids(mapper)
    own_s += time.process_time() - tick
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        save_grids(out, grids)
        save_graph(out, mapper)
    return {
        "world": opened.name,
        "seed": seed,
        "done": made.done,
        "trouble": made.trouble,
        "notes": made.notes,
        "distance_m": round(mapper.driven_m, 1),
        "sim_time_s": round(now_s, 1),
        "wall_time_s": round(wall_s, 1),
        "trajectory_error_m": round(trajectory_error_m(mapper.graph.poses, true), 4),
        "loop_closures": len(mapper.graph.closures),
        "false_closures": false_closures(mapper, true),
        "dropped_closures": mapper.dropped,
        **judged(opened, grids, mapper, true),
        "contacts": len(simulation.referee.collisions),
        "own_cpu_s": round(own_s, 1),
        "times_faster": round(now_s / own_s, 1),
        "slowest_tick_s": round(slowest_s, 2),
    }


def false_closures(mapper, true):
    real = [relative_pose(true[edge.first], true[edge.second]) for edge in mapper.graph.closures]
    return sum(
        not within(edge.measured, pose, SAME_PLACE) for edge, pose in zip(mapper.graph.closures, real, strict=True)
    )


def judged(world, grids, mapper, true):
    """Figures of the grids against the surveyed ones of the world."""
    files = {"scan": world.surveyed.scan_map_path, "keepout": world.surveyed.keepout_map_path}
    surveyed = {band: load_grid_map(file) for band, file in files.items()}

    def aligned(cells):
        points = (np.argwhere(cells)[:, ::-1] + 0.5) * CELL_M + np.array(grids.origin_m)
        return align(points, mapper.graph.poses, true)

    occupied = {band: aligned(grids.probabilities[band] > OCCUPIED) for band in surveyed}
    off_m = {band: surveyed[band].distance_m(points) for band, points in occupied.items()}
    free = aligned(grids.observed["keepout"] & (grids.probabilities["keepout"] < FREE))
    return {
        "walls_within": {
            band: {f"{round(100 * limit)} cm": share(each <= limit, 4) for limit in (0.05, 0.1, 0.15)}
            for band, each in off_m.items()
        },
        "obstacles_found": obstacles_found(surveyed["keepout"], occupied["keepout"]),
        "free_seen": free_seen(surveyed["keepout"], free),
    }


def cells_at(truth, points):
    marked = np.zeros(truth.occupied.shape, dtype=bool)
    rows, columns = truth.cells(points).T
    inside = (rows >= 0) & (columns >= 0) & (rows < marked.shape[0]) & (columns < marked.shape[1])
    marked[rows[inside], columns[inside]] = True
    return marked


def free_seen(truth, free):
    """Share of the truth's ground with room for the body that is free in the map."""
    return round(float(cells_at(truth, free)[truth.with_unknown_blocked().distance > BODY_M].mean()), 4)


def obstacles_found(truth, occupied):
    """Share of the keep-out's surface by the ground where the body fits that the map has within 10 cm."""
    found = (~cells_at(truth, occupied)).astype(np.uint8)
    off_m = cv2.distanceTransform(found, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * truth.resolution_m
    fits = (truth.with_unknown_blocked().distance > BODY_M).astype(np.uint8)
    near = cv2.dilate(fits, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (27, 27))) > 0
    surface = truth.occupied & near & (truth.distance > -truth.resolution_m)
    return round(float(np.mean(off_m[surface] < NEAR_M)), 4)


if __name__ == "__main__":
    command(survey)
