"""How well the robot goes to random poses on a map, and through narrow doors; prints JSON.

    python -m tests.benchmarks.goals [--goals 40] [--world flat] [--seed 1] [--stack FILE] [--doors] [--json]

The robot goes from pose to pose; each goal is free for its footprint and reachable on the map. A goal is reached when
the skill says so and the robot stands within 5 cm and 3 degrees of it by its own estimate, and 12 cm and 4 degrees in
truth. The way gone is compared with the shortest one for the footprint. Every fifth drive is cancelled underway.
`--doors`: the world is two rooms joined by a door of 0.75 m, and each goal lies in the other room.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from executive.mission.load import load_stack
from plant.worlds.builder.own import world_from_grid
from plant.worlds.builder.rooms import FREE, OCCUPIED, Grid
from plant.worlds.seeding import place_people
from plant.worlds.world import World, load_world
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import GridMap, load_grid_map
from skills.geometry import relative_pose
from skills.navigate.footprint import Footprint, footprint_clear
from skills.navigate.path import path_length
from skills.navigate.planner import LatticePlanner, plan_path
from skills.navigate.skill import NavigateInputs
from skills.robot import Pose2D
from tests.benchmarks.driving import Driver, Trip

OWN, TRUE = (0.05, math.radians(3.0)), (0.12, math.radians(4.0))
ROOM_M, DOOR_M, CELL_M = 5.0, 0.75, 0.025
FROM_PEOPLE_M, COMPARED_M, CANCEL_EVERY, CANCEL_S, MOST_NOWHERE = 1.3, 2.0, 5, 2.5, 100
SHORTEST = LatticePlanner(
    forward_m_s=1.0, backward_m_s=1.0, lateral_m_s=1.0, turn_rad_s=6.0, soft_weight=1e-3, greed=1.0
)


def rooms_with_door(folder: Path) -> World:
    """Two rooms side by side, a door in the wall between them."""
    rows, columns = round(ROOM_M / CELL_M), round(2.0 * ROOM_M / CELL_M)
    cells = np.full((rows, columns), FREE, dtype=np.uint8)
    edge, half, middle = round(0.1 / CELL_M), round(0.5 * DOOR_M / CELL_M), columns // 2
    cells[:edge], cells[-edge:], cells[:, :edge], cells[:, -edge:] = (OCCUPIED,) * 4
    cells[:, middle - edge // 2 : middle + edge // 2] = OCCUPIED
    cells[rows // 2 - half : rows // 2 + half, middle - edge // 2 : middle + edge // 2] = FREE
    world_from_grid(folder, Grid(cells, (0.0, 0.0), CELL_M), start=Pose2D(1.5, 2.5, 0.0), wall_height_m=2.5)
    return load_world(str(folder))


def poses(world: World, grid: GridMap, seed: int, *, other_room: bool) -> Iterator[Pose2D]:
    """Random poses that the footprint fits at, away from people; with `other_room`, right and left of the door."""
    rng = np.random.default_rng([seed, 27])
    costmap, footprint = LayeredCostmap(grid), footprint_of()
    people = np.array([one.X_WO.translation()[:2] for one in place_people(world, seed)]).reshape(-1, 2)
    free, right = grid.centres(np.argwhere(grid.distance > footprint.inscribed_m)), True
    while True:
        x, y = (float(value) for value in free[rng.integers(len(free))])
        pose = Pose2D(x, y, float(rng.uniform(-math.pi, math.pi)))
        if other_room and ((x > ROOM_M) != right or abs(x - ROOM_M) < 0.8):
            continue
        if len(people) and np.min(np.hypot(*(people - [x, y]).T)) < FROM_PEOPLE_M:
            continue
        if footprint_clear(costmap, footprint, pose, 0.08):
            right = not right
            yield pose


def footprint_of() -> Footprint:
    """Spot's."""
    from plant.robots.spot.kind import spot_capabilities

    return Footprint.of(spot_capabilities())


def shortest_m(grid: GridMap, start: Pose2D, goal: Pose2D) -> float | None:
    """The shortest way for the footprint on the map, None where there is none."""
    try:
        return path_length(plan_path(LayeredCostmap(grid), footprint_of(), start, goal, SHORTEST))
    except PlanningError:
        return None


def within(goal: Pose2D, pose: Pose2D, limits: tuple[float, float]) -> bool:
    """Whether a pose is that near (m, rad) to a goal."""
    off = relative_pose(goal, pose)
    return math.hypot(off.x_m, off.y_m) <= limits[0] and abs(off.yaw_rad) <= limits[1]


def measure(
    world: World, count: int, seed: int, stack: Path | None, *, doors: bool, most_m_s: float
) -> dict[str, object]:
    """Go to so many goals."""
    grids = load_grid_map(world.scan_map_path), load_grid_map(world.keepout_map_path).with_unknown_blocked()
    driver = Driver(world, load_stack(stack), grids, seed=seed)
    trips: list[Trip] = []
    reached = nowhere = 0
    off, ratios, misses, stops = [], [], [], []
    for goal in poses(world, grids[1], seed, other_room=doors):
        start = driver.context.pose()
        least_m = shortest_m(grids[1], start, goal)
        if least_m is None:
            nowhere += 1
            if nowhere > MOST_NOWHERE:
                break  # a robot that lost its place may believe to stand in a wall
            continue
        nowhere = 0
        inputs = NavigateInputs(goal, *OWN, max_speed_m_s=most_m_s)
        if not doors and len(trips) % CANCEL_EVERY == CANCEL_EVERY - 1:
            cancelled = driver.go(inputs, cancel_at_s=CANCEL_S)
            stops.append(cancelled.time_s - CANCEL_S)
        trip = driver.go(inputs)
        trips.append(trip)
        own, true = within(goal, trip.estimate, OWN), within(goal, trip.pose, TRUE)
        reached += trip.succeeded and own and true
        apart, real = relative_pose(goal, trip.estimate), relative_pose(goal, trip.pose)
        off.append([math.hypot(e.x_m, e.y_m) * 100 for e in (apart, real)] + [abs(math.degrees(real.yaw_rad))])
        if not (trip.succeeded and own and true) or trip.hits:
            misses.append({"goal": [round(v, 2) for v in (goal.x_m, goal.y_m, goal.yaw_rad)], "why": trip.message})
            misses[-1]["hits"] = list(trip.hits)
        if least_m > COMPARED_M and trip.succeeded and not (stops and len(trips) % CANCEL_EVERY == 0):
            ratios.append(trip.path_m / least_m)
        told = f"{len(trips)}: {trip.time_s:.1f} s, {trip.path_m:.1f} of {least_m:.1f} m, {trip.message}"
        print(told, *trip.hits, file=sys.stderr, flush=True)
        if len(trips) == count:
            break
    control = np.concatenate([trip.control_ms for trip in trips])
    planning = np.concatenate([trip.planning_ms for trip in trips])
    return {
        "world": world.name,
        "goals": len(trips),
        "reached": reached,
        "contacts": sum(len(trip.hits) for trip in trips),
        "own_cm_max": round(max(each[0] for each in off), 2),
        "true_cm_median": round(float(np.median([each[1] for each in off])), 2),
        "true_cm_max": round(max(each[1] for each in off), 2),
        "true_deg_max": round(max(each[2] for each in off), 2),
        "path_ratio_median": round(float(np.median(ratios)), 3) if ratios else None,
        "time_s_mean": round(float(np.mean([trip.time_s for trip in trips])), 2),
        "planning_ms": [round(float(np.percentile(planning, share)), 1) for share in (50, 99)],
        "control_ms": [round(float(np.percentile(control, share)), 2) for share in (50, 99)],
        "cancel_s_max": round(max(stops), 2) if stops else None,
        "misses": misses,
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--goals", type=int, default=40)
    parser.add_argument("--world", default="flat")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--stack", type=Path)
    parser.add_argument("--speed", type=float, default=0.8, help="the mission's maximum speed, m/s")
    parser.add_argument("--doors", action="store_true")
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end, and nothing else")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        world = rooms_with_door(Path(folder)) if options.doors else load_world(options.world)
        result = measure(world, options.goals, options.seed, options.stack, doors=options.doors, most_m_s=options.speed)
    print(json.dumps(result, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
