"""Random drives among random zones, judged by the robot's true poses; prints JSON.

    python -m tests.benchmarks.zone_drives [--drives 100] [--seed 9600] [--worlds flat,shop]

Each drive has one to three keep-out zones and one to three speed limits on or beside the path that the robot would
take, and at times a preferred lane and a one-way zone; in one of eight a keep-out zone lies where the robot starts.
Half of the keep-out zones and limits are filter masks of Nav2. Counted are the drives in which a part of the true
outline was in a keep-out zone after it had left the one of its start, the ticks of 0.05 s with a true speed of 0.05 m/s
above the limit of a zone that the outline touched, the metres against one-way zones, and the goals reached. Zones
that leave no path are drawn again, most of them; a drive that they refuse counts as refused if the failure names one.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import shapely

from executive.mission.load import load_stack
from plant.worlds.world import load_world
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import load_grid_map
from skills.navigate.planner import plan_path
from skills.navigate.zone_map import KeepOut, zone_map
from skills.navigate.zones import FilterType, Zone, ZoneKind, ZoneMask
from skills.ports import NavigateInputs
from skills.robot import Pose2D
from tests.benchmarks.driving import TICK_S, Driver
from tests.benchmarks.goals import footprint_of, poses

CELL_M = 0.05
OVER_M_S = 0.05
FULL_M_S = 0.8
INSIDE_EVERY = 8
TRIES, BLOCKED_SHARE = 8, 0.02


@dataclass(frozen=True)
class Judged:
    """One drive: its end, what it broke, and what it was told."""

    succeeded: bool
    named: bool
    entered: bool
    deepest_m: float
    over_ticks: int
    most_over_m_s: float
    against_m: float
    hits: int
    message: str


def rectangle(middle: np.ndarray, size: np.ndarray, yaw: float) -> shapely.Polygon:
    """A turned rectangle."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size
    return shapely.Polygon(corners @ [[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]] + middle)


def drawn_zones(
    rng: np.random.Generator, path: np.ndarray, body: shapely.Polygon, at_goal: shapely.Polygon, *, inside: bool
) -> list[tuple[Zone, shapely.Polygon]]:
    """Zones about a path (N, 3); keep-out zones stay off the goal, and off the start unless it is to be inside."""

    def place(low: float, high: float, aside: float) -> shapely.Polygon:
        point = path[rng.integers(len(path))]
        size = rng.uniform(low, high, 2)
        return rectangle(point[:2] + rng.uniform(-aside, aside, 2), size, float(rng.uniform(0.0, math.pi)))

    found: list[tuple[Zone, shapely.Polygon]] = []
    kinds = [ZoneKind.KEEP_OUT] * int(rng.integers(1, 4)) + [ZoneKind.SPEED_LIMIT] * int(rng.integers(1, 4))
    kinds += [kind for kind in (ZoneKind.PREFERRED, ZoneKind.ONE_WAY) if rng.random() < 0.3]
    for number, kind in enumerate(kinds):
        polygon = place(0.3, 1.5, 0.8) if kind is ZoneKind.KEEP_OUT else place(0.8, 3.0, 0.5)
        if kind is ZoneKind.KEEP_OUT:
            if inside and number == 0:
                polygon = rectangle(path[0, :2], rng.uniform(0.5, 2.0, 2), float(rng.uniform(0.0, math.pi)))
            elif polygon.distance(body) < 0.15:
                continue
            if polygon.distance(at_goal) < 0.15:
                continue
        corners = tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1])
        speed = float(rng.uniform(0.1, 0.5)) if kind is ZoneKind.SPEED_LIMIT else None
        found.append(
            (Zone(f"{kind} {number}", kind, corners, None, speed, None, float(rng.uniform(-3.1, 3.1))), polygon)
        )
    return found


def as_mask(zone: Zone, polygon: shapely.Polygon, folder: Path, number: int) -> tuple[Zone, shapely.Geometry]:
    """The same zone as a filter mask of Nav2, and the ground of its cells."""
    x0, y0, x1, y1 = polygon.buffer(0.2).bounds
    columns, rows = math.ceil((x1 - x0) / CELL_M), math.ceil((y1 - y0) / CELL_M)
    centres = np.stack(np.meshgrid(x0 + (np.arange(columns) + 0.5) * CELL_M, y0 + (np.arange(rows) + 0.5) * CELL_M), -1)
    inside = shapely.contains_xy(polygon, centres.reshape(-1, 2)).reshape(rows, columns)
    value = 100 if zone.speed_m_s is None else round(100.0 * (1.0 - zone.speed_m_s / FULL_M_S))
    cv2.imwrite(str(folder / f"{number}.pgm"), np.flipud(np.where(inside, value, 0)).astype(np.uint8))
    text = f"image: {number}.pgm\nmode: raw\nresolution: {CELL_M}\norigin: [{x0}, {y0}, 0.0]\nnegate: 0\n"
    (folder / f"{number}.yaml").write_text(f"{text}occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    keep_out = zone.kind is ZoneKind.KEEP_OUT
    info = (FilterType.KEEP_OUT, 0.0, 1.0) if keep_out else (FilterType.SPEED_SHARE, 100.0, -1.0)
    limit = None if keep_out else FULL_M_S * (1.0 - value / 100.0)
    cells = shapely.union_all([shapely.box(x, y, x + CELL_M, y + CELL_M) for x, y in centres[inside] - 0.5 * CELL_M])
    masked = replace(zone, corners_W=(), speed_m_s=None, mask=ZoneMask(str(folder / f"{number}.yaml"), *info))
    return masked, (cells, limit)


def outline_at(pose: np.ndarray, corners: np.ndarray) -> shapely.Polygon:
    """The body's true outline."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return shapely.Polygon(corners @ [[c, s], [-s, c]] + pose[:2])


def judge(trip_poses: np.ndarray, grounds: list[tuple[Zone, shapely.Geometry, float | None]], corners: np.ndarray):
    """Entered, deepest (m), ticks too fast, most too fast (m/s), metres against a one-way zone."""
    bodies = [outline_at(pose, corners) for pose in trip_poses]
    steps = np.diff(trip_poses[:, :2], axis=0)
    speeds = np.hypot(*steps.T) / TICK_S
    entered, deepest_m, over, most, against_m = False, 0.0, 0, 0.0, 0.0
    for zone, ground, limit in grounds:
        shapely.prepare(ground)
        if zone.kind is ZoneKind.KEEP_OUT:
            touches = np.array([ground.intersects(body) for body in bodies])
            left = int(np.argmin(touches)) if touches[0] and not touches.all() else 0
            again = np.flatnonzero(touches[left:]) if not touches.all() else []
            entered |= len(again) > 0
            deepest_m = max([deepest_m, *(math.sqrt(ground.intersection(bodies[left + n]).area) for n in again)])
        elif limit is not None:
            inside = np.array([ground.intersects(body) for body in bodies[1:]])
            excess = speeds[inside] - limit
            over, most = over + int(np.sum(excess > OVER_M_S)), max([most, *excess.tolist()])
        elif zone.kind is ZoneKind.ONE_WAY:
            middle = 0.5 * (trip_poses[1:, :2] + trip_poses[:-1, :2])
            inside = shapely.contains_xy(ground.buffer(-0.1), middle)
            along = steps @ (math.cos(zone.direction_rad), math.sin(zone.direction_rad))
            against_m += float(-along[inside & (along < 0.0)].sum())
    return entered, deepest_m, over, most, against_m


def leaves_a_path(driver: Driver, zones: tuple[Zone, ...], start: Pose2D, goal: Pose2D) -> bool:
    """Whether the planner finds a path among the keep-out zones."""
    try:
        plan_path(
            KeepOut(zone_map(zones, FULL_M_S)).space(driver.context.costmap, footprint_of(), start),
            footprint_of(),
            start,
            goal,
        )
    except PlanningError:
        return False
    return True


def drive(
    driver: Driver, goal: Pose2D, free: np.ndarray, rng: np.random.Generator, number: int, folder: Path
) -> Judged:
    """Draws zones about the path (N, 3) that leads to the goal, drives, and judges."""
    corners = np.array(driver.context.robot.capabilities().footprint_m)
    here = driver.true_pose()
    at_start, at_goal = (outline_at(np.array([p.x_m, p.y_m, p.yaw_rad]), corners) for p in (here, goal))
    for _ in range(TRIES):
        drawn = drawn_zones(rng, free, at_start, at_goal, inside=number % INSIDE_EVERY == INSIDE_EVERY - 1)
        if rng.random() < BLOCKED_SHARE or leaves_a_path(driver, tuple(zone for zone, _ in drawn), here, goal):
            break
    zones, grounds = [], []
    for index, (zone, polygon) in enumerate(drawn):
        ground, limit = polygon, zone.speed_m_s
        if zone.kind in (ZoneKind.KEEP_OUT, ZoneKind.SPEED_LIMIT) and rng.random() < 0.5:
            zone, (ground, limit) = as_mask(zone, polygon, folder, 100 * number + index)
        zones.append(zone)
        grounds.append((zone, ground, limit))
    driver.context = replace(driver.context, zones=tuple(zones))
    trip = driver.go(NavigateInputs(goal))
    entered, deepest_m, over, most, against_m = judge(trip.poses, grounds, corners)
    named = trip.message.count("zone") > 0
    return Judged(
        trip.succeeded,
        named,
        entered,
        deepest_m,
        over,
        most,
        against_m,
        len(trip.hits),
        f"{trip.time_s:.0f} s: {trip.message}",
    )


def measure(world_name: str, count: int, seed: int) -> list[Judged]:
    """Drives so many times in a world."""
    world = load_world(world_name)
    grids = load_grid_map(world.scan_map_path), load_grid_map(world.keepout_map_path).with_unknown_blocked()
    driver, rng, judged = Driver(world, load_stack(None), grids, seed=seed), np.random.default_rng([seed, 51]), []
    with tempfile.TemporaryDirectory() as folder:
        for goal in poses(world, grids[1], seed, other_room=False):
            start = driver.context.pose()
            if math.hypot(goal.x_m - start.x_m, goal.y_m - start.y_m) < 2.0:
                continue
            try:
                free = plan_path(LayeredCostmap(grids[1]), footprint_of(), start, goal).poses
            except PlanningError as error:
                print(error, file=sys.stderr)
                continue
            judged.append(drive(driver, goal, free, rng, len(judged), Path(folder)))
            print(f"{world_name} {len(judged) - 1}: {judged[-1]}", file=sys.stderr, flush=True)
            if len(judged) == count:
                return judged
    return judged


def main() -> None:
    """Measures each world."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=100)
    parser.add_argument("--seed", type=int, default=9600)
    parser.add_argument("--worlds", default="flat")
    given = parser.parse_args()
    names = given.worlds.split(",")
    judged = [each for name in names for each in measure(name, given.drives // len(names), given.seed)]
    failed = [each for each in judged if not each.succeeded]
    result = {
        "drives": len(judged),
        "reached": len(judged) - len(failed),
        "refused_with_a_name": sum(each.named for each in failed),
        "entered_keep_out": sum(each.entered for each in judged),
        "drives_over_a_limit": sum(each.over_ticks > 0 for each in judged),
        "most_over_m_s": round(max(each.most_over_m_s for each in judged), 3),
        "against_one_way_m": round(sum(each.against_m for each in judged), 2),
        "contacts": sum(each.hits for each in judged),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
