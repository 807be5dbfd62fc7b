"""How well the robot goes to random poses on a map, and through narrow doors; prints JSON.

    python -m tests.benchmarks.goals [--goals 40] [--world flat] [--seed 1] [--stack FILE] [--speed 0.8] [--doors]

The robot goes from pose to pose; each goal is free for its footprint and reachable on the map. A goal is reached when
the skill says so and the robot stands within 5 cm and 3 degrees of it by its own estimate, and 12 cm and 4 degrees in
truth. The way gone is compared with the shortest one for the footprint. Every fifth drive is cancelled underway.
`--doors`: the world is two rooms joined by a door of 0.75 m, and each goal lies in the other room.
"""

import math
import tempfile
from pathlib import Path

import numpy as np

from errand_make.worlds.own import world_from_grid
from errand_make.worlds.rooms import FREE, OCCUPIED, Grid
from executive.mission.load import load_stack
from plant.worlds.seeding import place_people
from plant.worlds.world import load_world
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.geometry import relative_pose
from skills.navigate.planner import LatticePlanner, plan_path
from skills.navigate.skill import NavigateInputs
from skills.path import path_length
from skills.robot import Pose2D
from tests.benchmarks.driving import SPOT, Driver, free_poses, maps_of, within
from tests.benchmarks.harness import command, quantile, tell

OWN, TRUE = (0.05, math.radians(3.0)), (0.12, math.radians(4.0))
ROOM_M, DOOR_M, CELL_M = 5.0, 0.75, 0.025
FROM_PEOPLE_M, COMPARED_M, CANCEL_EVERY, CANCEL_S, MOST_NOWHERE = 1.3, 2.0, 5, 2.5, 100
SPEEDS = {"forward_m_s": 1.0, "backward_m_s": 1.0, "lateral_m_s": 1.0, "turn_rad_s": 6.0}
SHORTEST = LatticePlanner(**SPEEDS, soft_weight=1e-3, greed=1.0)


def rooms_with_door(folder):
    rows, columns = round(ROOM_M / CELL_M), round(2.0 * ROOM_M / CELL_M)
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    edge, half, middle = round(0.1 / CELL_M), round(0.5 * DOOR_M / CELL_M), columns // 2
    cells[:edge], cells[-edge:], cells[:, :edge], cells[:, -edge:] = (OCCUPIED,) * 4
    cells[:, middle - edge // 2 : middle + edge // 2] = OCCUPIED
    cells[rows // 2 - half : rows // 2 + half, middle - edge // 2 : middle + edge // 2] = FREE
    world_from_grid(folder, Grid(cells, (0.0, 0.0), CELL_M), start=Pose2D(1.5, 2.5, 0.0), wall_height_m=2.5)
    return load_world(str(folder))


def from_people(world, seed):
    people = [one.X_WO.translation()[:2] for one in place_people(world, seed)]
    return lambda pose: all(math.dist((pose.x_m, pose.y_m), each) >= FROM_PEOPLE_M for each in people)


def shortest_m(grid, start, goal):
    try:
        return path_length(plan_path(LayeredCostmap(grid), SPOT, start, goal, SHORTEST))
    except PlanningError:
        return None


def run(
    goals: int = 40,
    world: str = "flat",
    seed: int = 1,
    stack: Path | None = None,
    speed: float = 0.8,
    doors: bool = False,
):
    """Measures drives to goals, at most at a speed (m/s)."""
    with tempfile.TemporaryDirectory() as folder:
        return measure(rooms_with_door(Path(folder)) if doors else load_world(world), goals, seed, stack, speed, doors)


def measure(world, count, seed, stack, most_m_s, doors):
    maps, right = maps_of(world), True
    driver = Driver(world, load_stack(stack), maps, seed=seed)
    far = from_people(world, seed)

    def accept(pose):
        """True away from people, and beyond the door."""
        nonlocal right
        beyond = not doors or ((pose.x_m > ROOM_M) == right and abs(pose.x_m - ROOM_M) >= 0.8)
        fits = beyond and far(pose)
        right ^= fits
        return fits

    trips = []
    reached = nowhere = 0
    off, ratios, misses, stops = [], [], [], []
    for goal in free_poses(maps[1], SPOT, seed, accept):
        least_m = shortest_m(maps[1], driver.context.pose(), goal)
        nowhere = nowhere + 1 if least_m is None else 0
        if nowhere > MOST_NOWHERE or len(trips) == count:
            break  # a robot that lost its place may believe to stand in a wall
        if least_m is None:
            continue
        inputs = NavigateInputs(goal, *OWN, max_speed_m_s=most_m_s)
        if cancelled := not doors and len(trips) % CANCEL_EVERY == CANCEL_EVERY - 1:
            stops.append(driver.go(inputs, cancel_at_s=CANCEL_S).time_s - CANCEL_S)
        trip = driver.go(inputs)
        trips.append(trip)
        good = trip.succeeded and within(goal, trip.estimate, OWN) and within(goal, trip.pose, TRUE)
        reached += good
        own, true = relative_pose(goal, trip.estimate), relative_pose(goal, trip.pose)
        off.append((100.0 * math.hypot(own.x_m, own.y_m), 100.0 * math.hypot(true.x_m, true.y_m), true.yaw_rad))
        if not good or trip.hits:
            place = [round(value, 2) for value in (goal.x_m, goal.y_m, goal.yaw_rad)]
            misses.append({"goal": place, "why": trip.message, "hits": trip.hits})
        if least_m > COMPARED_M and trip.succeeded and not cancelled:
            ratios.append(trip.path_m / least_m)
        told = f"{len(trips)}: {trip.time_s:.1f} s, {trip.path_m:.1f} of {least_m:.1f} m, {trip.message}"
        tell(" ".join((told, *trip.hits)))
    own_cm, true_cm, true_rad = zip(*off, strict=True)
    planning_ms = [ms for trip in trips for ms in trip.planning_ms]
    control_ms = [ms for trip in trips for ms in trip.control_ms]
    return {
        "world": world.name,
        "goals": len(trips),
        "reached": reached,
        "contacts": sum(len(trip.hits) for trip in trips),
        "own_cm_max": quantile(own_cm, 1.0),
        "true_cm_median": quantile(true_cm),
        "true_cm_max": quantile(true_cm, 1.0),
        "true_deg_max": quantile(np.degrees(np.abs(true_rad)), 1.0),
        "path_ratio_median": quantile(ratios, digits=3),
        "time_s_mean": round(float(np.mean([trip.time_s for trip in trips])), 2),
        "planning_ms": [quantile(planning_ms, part, 1) for part in (0.5, 0.99)],
        "control_ms": [quantile(control_ms, part) for part in (0.5, 0.99)],
        "cancel_s_max": quantile(stops, 1.0),
        "misses": misses,
    }


if __name__ == "__main__":
    command(run)
