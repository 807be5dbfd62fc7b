"""Random drives among random zones, judged by the robot's true poses; prints JSON.

    python -m tests.benchmarks.zone_drives [--drives 100] [--seed 9600] [--worlds flat,shop] [--jobs 1]

Each drive has one to three keep-out zones and one to three speed limits on or beside the path that the robot would
take, and at times a preferred lane and a one-way zone; in one of eight a keep-out zone lies where the robot starts.
Half of the keep-out zones and limits are filter masks of Nav2. Counted are the drives in which a part of the true
outline was in a keep-out zone after it had left the one of its start, the ticks of 0.05 s with a true speed of 0.05 m/s
above the limit of a zone that the outline touched, the metres against one-way zones, and the goals reached. Zones
that leave no path are drawn again, most of them; a drive that they refuse counts as refused if the failure names one.
"""

import math
from dataclasses import replace

import cv2
import numpy as np
import shapely

from executive.mission.load import load_stack
from plant.worlds.world import load_world
from skills.api import PlanningError
from skills.estimate.costmap import LayeredCostmap
from skills.navigate.planner import plan_path
from skills.navigate.surroundings import NavigateInputs
from skills.world_model import FilterType, Zone, ZoneKind, ZoneMask
from skills.zone_map import KeepOut, zone_map
from tests.benchmarks.driving import SPOT, TICK_S, Driver, free_poses, maps_of
from tests.benchmarks.goals import from_people
from tests.benchmarks.harness import benchmark, tell

CELL_M, OVER_M_S, FULL_M_S = 0.05, 0.05, 0.8
INSIDE_EVERY, TRIES, BLOCKED_SHARE = 8, 8, 0.02
AT_GOAL_M, LEAST_M = 0.15, 2.0


def rectangle(middle, size, yaw):
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size
    return outline_at(np.array([*middle, yaw]), corners)


def outline_at(pose, corners):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return shapely.Polygon(corners @ [[c, s], [-s, c]] + pose[:2])


def draw_zones(rng, path, body, at_goal, *, inside):
    """Zones about a path (N, 3); keep-out zones stay off the goal, and off the start unless it is to be inside."""

    def place(low, high, aside):
        point = path[rng.integers(len(path))]
        size = rng.uniform(low, high, 2)
        return rectangle(point[:2] + rng.uniform(-aside, aside, 2), size, float(rng.uniform(0.0, math.pi)))

    found = []
    kinds = [ZoneKind.KEEP_OUT] * int(rng.integers(1, 4)) + [ZoneKind.SPEED_LIMIT] * int(rng.integers(1, 4))
    kinds += [kind for kind in (ZoneKind.PREFERRED, ZoneKind.ONE_WAY) if rng.random() < 0.3]
    for number, kind in enumerate(kinds):
        polygon = place(0.3, 1.5, 0.8) if kind is ZoneKind.KEEP_OUT else place(0.8, 3.0, 0.5)
        if kind is ZoneKind.KEEP_OUT:
            if inside and number == 0:
                polygon = rectangle(path[0, :2], rng.uniform(0.5, 2.0, 2), float(rng.uniform(0.0, math.pi)))
            elif polygon.distance(body) < AT_GOAL_M:
                continue
            if polygon.distance(at_goal) < AT_GOAL_M:
                continue
        corners = tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1])
        speed = float(rng.uniform(0.1, 0.5)) if kind is ZoneKind.SPEED_LIMIT else None
        zone = Zone(f"{kind} {number}", kind, corners, None, speed, None, float(rng.uniform(-3.1, 3.1)))
        found.append((zone, polygon))
    return found


def as_mask(zone, polygon, file):
    """The same zone as a filter mask of Nav2, with the ground of its cells."""
    x0, y0, x1, y1 = polygon.buffer(0.2).bounds
    columns, rows = math.ceil((x1 - x0) / CELL_M), math.ceil((y1 - y0) / CELL_M)
    centres = np.stack(np.meshgrid(x0 + (np.arange(columns) + 0.5) * CELL_M, y0 + (np.arange(rows) + 0.5) * CELL_M), -1)
    inside = shapely.contains_xy(polygon, centres.reshape(-1, 2)).reshape(rows, columns)
    value = 100 if zone.speed_m_s is None else round(100.0 * (1.0 - zone.speed_m_s / FULL_M_S))
    cv2.imwrite(str(file.with_suffix(".pgm")), np.flipud(np.where(inside, value, 0)).astype(np.uint8))
    facts = f"image: {file.stem}.pgm\nmode: raw\nresolution: {CELL_M}\norigin: [{x0}, {y0}, 0.0]\nnegate: 0\n"
    file.write_text(f"{facts}occupied_thresh: 0.65\nfree_thresh: 0.25\n")
    keep_out = zone.kind is ZoneKind.KEEP_OUT
    info = (FilterType.KEEP_OUT, 0.0, 1.0) if keep_out else (FilterType.SPEED_SHARE, 100.0, -1.0)
    cells = shapely.union_all([shapely.box(x, y, x + CELL_M, y + CELL_M) for x, y in centres[inside] - 0.5 * CELL_M])
    masked = replace(zone, corners_W=(), speed_m_s=None, mask=ZoneMask(str(file), *info))
    return masked, cells, None if keep_out else FULL_M_S * (1.0 - value / 100.0)


def judge(poses, grounds, corners):
    """What a drive breaks of the zones, each with its ground and its limit of speed (m/s)."""
    bodies, steps = [outline_at(pose, corners) for pose in poses], np.diff(poses[:, :2], axis=0)
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
            inside = shapely.contains_xy(ground.buffer(-0.1), 0.5 * (poses[1:, :2] + poses[:-1, :2]))
            along = steps @ (math.cos(zone.direction_rad), math.sin(zone.direction_rad))
            against_m += float(-along[inside & (along < 0.0)].sum())
    fast = {"over_ticks": over, "most_over_m_s": most}
    return {"entered": entered, "deepest_m": deepest_m, "against_m": against_m, **fast}


def leaves_a_path(driver, zones, start, goal):
    try:
        plan_path(KeepOut(zone_map(zones, FULL_M_S)).space(driver.context.costmap, SPOT, start), SPOT, start, goal)
    except PlanningError:
        return False
    return True


def drive(driver, goal, path, rng, number, folder):
    """Draws zones about the path (N, 3) that leads to the goal, drives, and judges."""
    corners = np.array(driver.context.robot.capabilities().footprint_m)
    here = driver.simulation.true_pose("Alice")
    at_start, at_goal = (outline_at(np.array([p.x_m, p.y_m, p.yaw_rad]), corners) for p in (here, goal))
    for _ in range(TRIES):
        drawn = draw_zones(rng, path, at_start, at_goal, inside=number % INSIDE_EVERY == INSIDE_EVERY - 1)
        if rng.random() < BLOCKED_SHARE or leaves_a_path(driver, tuple(zone for zone, _ in drawn), here, goal):
            break
    grounds = []
    for index, (zone, polygon) in enumerate(drawn):
        masked = zone.kind in (ZoneKind.KEEP_OUT, ZoneKind.SPEED_LIMIT) and rng.random() < 0.5
        file = folder / f"{100 * number + index}.yaml"
        grounds.append(as_mask(zone, polygon, file) if masked else (zone, polygon, zone.speed_m_s))
    driver.context = replace(driver.context, zones=tuple(zone for zone, _, _ in grounds))
    trip = driver.go(NavigateInputs(goal))
    broken = judge(trip.poses, grounds, corners)
    told = {"named": "zone" in trip.message, "message": f"{trip.time_s:.0f} s: {trip.message}"}
    return {"succeeded": trip.succeeded, "hits": len(trip.hits), **broken, **told}


def cases(drives: int = 100, seed: int = 9600, worlds: tuple[str, ...] = ("flat",)):
    return [(world, drives // len(worlds), seed) for world in worlds]


def run_case(world_name, count, seed, folder):
    world = load_world(world_name)
    maps = maps_of(world)
    driver, rng, judged = Driver(world, load_stack(None), maps, seed=seed), np.random.default_rng([seed, 51]), []
    goals = free_poses(maps[1], SPOT, seed, from_people(world, seed))
    while len(judged) < count:
        goal, start = next(goals), driver.context.pose()
        if math.hypot(goal.x_m - start.x_m, goal.y_m - start.y_m) < LEAST_M:
            continue
        try:
            path = plan_path(LayeredCostmap(maps[1]), SPOT, start, goal).poses
        except PlanningError as error:
            tell(error)
            continue
        judged.append(drive(driver, goal, path, rng, len(judged), folder))
        tell(f"{world_name} {len(judged) - 1}: {judged[-1]}")
    return judged


def summary(worlds):
    judged = [each for world in worlds for each in world]
    failed = [each for each in judged if not each.succeeded]
    return {
        "drives": len(judged),
        "reached": len(judged) - len(failed),
        "refused_with_a_name": sum(each.named for each in failed),
        "entered_keep_out": sum(each.entered for each in judged),
        "drives_over_a_limit": sum(each.over_ticks > 0 for each in judged),
        "most_over_m_s": round(max(each.most_over_m_s for each in judged), 3),
        "against_one_way_m": round(sum(each.against_m for each in judged), 2),
        "contacts": sum(each.hits for each in judged),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
