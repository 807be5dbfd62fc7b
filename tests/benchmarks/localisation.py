"""How well localisers know where the robot is; prints JSON.

    python -m tests.benchmarks.localisation record out/drive.npz [--seed 1] [--say SENTENCE]
    python -m tests.benchmarks.localisation replay out/drive.npz [--localiser monte_carlo]
    python -m tests.benchmarks.localisation kidnap [--count 50] [--localiser monte_carlo]
    python -m tests.benchmarks.localisation timing out/drive.npz

`record` runs a mission in the plant and keeps LiDAR, odometry and the true pose; `replay` lets a localiser follow that
drive. `kidnap` carries a robot that drives about in the flat off to a random free pose, with the plant's LiDAR and
odometry but no dynamics, and measures how far it drives until it is right again: within 10 cm and 3 degrees for 2 s,
and says so. `timing` is one update of 1000 particles by 60 beams.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from plant.robots.spot.model import spot_facts
from plant.sensors.lidar import Lidar
from plant.sensors.proprioception import OdometryModel
from plant.simulation import Simulation
from plant.worlds.world import World, load_world
from skills.estimate.grid_map import GridMap, load_grid_map
from skills.estimate.monte_carlo import MonteCarloLocaliser, MonteCarloOptions
from skills.estimate.particle_filter import FilterOptions, ParticleFilter
from skills.geometry import compose, relative_pose
from skills.robot import Odometry, Pose2D, Scan
from skills.stack import components

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
RIGHT_M, RIGHT_RAD, RIGHT_S, MOST_M = 0.10, math.radians(3.0), 2.0, 15.0
WRONG_M, WRONG_S = 0.5, 2.0
SPEED_M_S, TURN_RAD_S, STEP_S = 0.5, 0.6, 0.05
WARM_M = 2.0


class Replay:
    """A robot of which only odometry and the LiDAR are there."""

    def __init__(self) -> None:
        self.odometry_now: Odometry | None = None
        self.scan_now: Scan | None = None

    def odometry(self) -> Odometry:
        assert self.odometry_now is not None
        return self.odometry_now

    def scan(self) -> Scan | None:
        return self.scan_now


@dataclass(frozen=True)
class Seen:
    """A scan and where the robot truly is at it."""

    scan: Scan
    true: Pose2D


def errors(localiser, seen: Seen) -> tuple[float, float]:
    """Metres and radians off."""
    estimate = Pose2D.from_transform(localiser.estimate().X_WO @ seen.scan.X_OB)
    off = relative_pose(seen.true, estimate)
    return math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)


# ---- missions


def record(path: Path, seed: int, say: str) -> None:
    """Run a mission and keep what its LiDAR and odometry saw."""
    request = Request(sentence=say, world="flat", seed=seed, record=False, out=path.with_suffix(""))
    path.with_suffix("").mkdir(parents=True, exist_ok=True)
    prepared = prepare(request, ask=None)
    name = prepared.mission.robot_name
    backend = SimulatedBackend(prepared.world, prepared.robots, seed=seed, record=False)
    simulation: Simulation = backend._simulation
    engine, robot = simulation.engine, simulation.robots[name]
    body = engine.world.robots[name].body
    kept: list[tuple] = []

    def keep() -> None:
        scan = robot.scan()
        if scan is None or (kept and scan.stamp_s < kept[-1][0] + 0.049) or scan.stamp_s < engine.now() - 1e-6:
            return
        X_WB = engine.world.plant.EvalBodyPoseInWorld(engine.context, body)
        true = Pose2D.from_transform(X_WB)
        millimetres = np.nan_to_num(1000.0 * scan.ranges_m, nan=0.0).clip(0.0, 65535.0).astype(np.uint16)
        kept.append((scan.stamp_s, millimetres, scan.X_OB.GetAsMatrix4(), (true.x_m, true.y_m, true.yaw_rad), scan))

    engine.after_advance(keep)
    finished = run_request(prepared, backend)
    scan = kept[-1][4]
    np.savez_compressed(
        path,
        stamps=[k[0] for k in kept],
        ranges=np.stack([k[1] for k in kept]),
        X_OB=np.stack([k[2] for k in kept]),
        true=np.array([k[3] for k in kept]),
        elevations=scan.elevations_rad,
        azimuths=scan.azimuths_rad,
        X_BL=scan.X_BL.GetAsMatrix4(),
    )
    print(json.dumps({"outcome": finished.report.outcome, "scans": len(kept)}))


def replayed(path: Path) -> Iterator[Seen]:
    """What was recorded."""
    with np.load(path) as kept:
        data = dict(kept)
    X_BL = RigidTransform(data["X_BL"])
    rows = zip(data["stamps"], data["ranges"], data["X_OB"], data["true"], strict=True)
    for stamp, ranges, X_OB, true in rows:
        metres = ranges.astype(np.float32) / 1000.0
        metres[ranges == 0] = np.nan
        scan = Scan(float(stamp), metres, data["elevations"], data["azimuths"], X_BL, RigidTransform(X_OB))
        yield Seen(scan, Pose2D(*true.tolist()))


def replay(path: Path, name: str, *, start: bool = True) -> dict[str, object]:
    """How far a localiser is off along a recorded drive, while it moves and at rest, and what an update takes."""
    grid = load_grid_map(load_world("flat").scan_map_path)
    robot, localiser = Replay(), None
    off, moving, took, said, health, before = [], [], [], [], [], None
    for seen in replayed(path):
        robot.scan_now = seen.scan
        robot.odometry_now = Odometry(seen.scan.stamp_s, seen.scan.X_OB, (0.0, 0.0, 0.0))
        if localiser is None:
            localiser = components("localiser")[name]().build(grid, seen.true if start else None, surely=start)
            localiser.update(robot)
            before = seen
            continue
        begun = time.perf_counter()
        localiser.update(robot)
        took.append(1000.0 * (time.perf_counter() - begun))
        step = relative_pose(before.true, seen.true)
        dt = seen.scan.stamp_s - before.scan.stamp_s
        moving.append(math.hypot(step.x_m, step.y_m) > 0.05 * dt or abs(step.yaw_rad) > 0.05 * dt)
        off.append(errors(localiser, seen))
        said.append(localiser.estimate().localised)
        health.append(localiser.estimate().health)
        before = seen
    offs, drove = np.array(off), np.array(moving)
    return {
        "localiser": name,
        "scans": len(offs),
        "rms_cm": _rms(100.0 * offs[drove, 0]),
        "rms_deg": _rms(np.degrees(offs[drove, 1])),
        "max_cm": round(float(100.0 * offs[drove, 0].max()), 2),
        "max_deg": round(float(np.degrees(offs[drove, 1]).max()), 2),
        "rest_rms_cm": _rms(100.0 * offs[~drove, 0]),
        "localised": round(float(np.mean(said)), 4),
        "health_median": round(float(np.median(health)), 3),
        "health_min": round(float(np.min(health)), 3),
        "update_ms_median": round(float(np.median(took)), 3),
        "update_ms_mean": round(float(np.mean(took)), 3),
        "update_ms_p99": round(float(np.percentile(took, 99)), 3),
    }


def _rms(values: np.ndarray) -> float:
    return round(float(np.sqrt(np.mean(np.square(values)))), 3)


# ---- kidnapped


class Wanderer:
    """A robot that drives about on free ground: the plant's LiDAR and odometry, without its dynamics."""

    def __init__(self, world: World, seed: int) -> None:
        simulation = Simulation(world, seed=seed, visuals=False)
        engine = simulation.engine
        self._plant, self._context = engine.world.plant, engine.context
        self._model = engine.world.robots["Alice"]
        self.rng = np.random.default_rng(seed)
        X_BL = RigidTransform(spot_facts()["lidar"]["xyz"])
        inspector = engine.world.scene_graph.model_inspector()
        self._lidar = Lidar(self._plant, inspector, self._model.body, X_BL, self.rng, unseen=self._model.instances())
        self._odometry = OdometryModel(self.rng)
        self._keepout = load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
        self.now_s, self.way_m, self._turning = 0.0, 0.0, 0.0
        self._shift = Pose2D(0.0, 0.0, 0.0)
        self.robot = Replay()
        self.true = self.anywhere()
        self._unkidnapped = self.true
        self.sense()

    def anywhere(self) -> Pose2D:
        """A random pose with room for the body to turn about."""
        free = np.argwhere(self._keepout.distance > 0.62)
        x, y = self._keepout.centres(free[self.rng.integers(len(free))][None])[0]
        return Pose2D(float(x), float(y), float(self.rng.uniform(-math.pi, math.pi)))

    def carry_off(self, pose: Pose2D) -> None:
        """Odometry does not notice."""
        self.true = pose

    def step(self) -> None:
        """Ahead while there is room, else turn to one side."""
        vx, wz = self._command()
        step = Pose2D(vx * STEP_S, 0.0, wz * STEP_S)
        self.true = compose(self.true, step)
        self._unkidnapped = compose(self._unkidnapped, step)
        self.way_m += abs(vx) * STEP_S
        self.now_s += STEP_S
        self.sense((vx, wz))

    def _command(self) -> tuple[float, float]:
        ahead = [compose(self.true, Pose2D(d, 0.0, 0.0)) for d in (0.3, 0.6, 0.9)]
        clear = self._keepout.distance_m(np.array([(p.x_m, p.y_m) for p in ahead])).min()
        if clear > 0.4:
            self._turning = 0.0
            return SPEED_M_S, float(0.2 * math.sin(0.7 * self.now_s))
        self._turning = self._turning or float(self.rng.choice([-1.0, 1.0])) * TURN_RAD_S
        return 0.0, self._turning

    def sense(self, velocity: tuple[float, float] = (0.0, 0.0)) -> None:
        """New readings at the true pose."""
        self._model.place(self._context, self.true)
        believed = self._unkidnapped
        height = spot_facts()["capabilities"]["standing_height"]
        c, s = math.cos(believed.yaw_rad), math.sin(believed.yaw_rad)
        X_WB = RigidTransform(RollPitchYaw(0.0, 0.0, believed.yaw_rad), [believed.x_m, believed.y_m, height])
        moved = np.array([c * velocity[0], s * velocity[0], 0.0])
        self.robot.odometry_now = self._odometry.update(self.now_s, X_WB, np.array([0.0, 0.0, velocity[1]]), moved)
        self.robot.scan_now = self._lidar.scan(self._context, self.now_s, self.robot.odometry_now.X_OB)

    @property
    def seen(self) -> Seen:
        assert self.robot.scan_now is not None
        return Seen(self.robot.scan_now, self.true)


def kidnap(count: int, name: str, seed: int, *, told: bool) -> dict[str, object]:
    """Of so many kidnappings (or, not told, starts at unknown places), in how many it is right again within 15 m."""
    world = load_world("flat")
    grid, wanderer = load_grid_map(world.scan_map_path), Wanderer(world, seed)
    ways, failed, false_claims = [], [], 0
    for number in range(count):
        wanderer.carry_off(wanderer.anywhere())
        wanderer.sense()
        localiser = components("localiser")[name]().build(grid, wanderer.true if told else None, surely=told)
        if told:
            localiser.update(wanderer.robot)
            begun = wanderer.way_m
            while wanderer.way_m < begun + WARM_M:
                wanderer.step()
                localiser.update(wanderer.robot)
            wanderer.carry_off(wanderer.anywhere())
        way, false = _recovered(wanderer, localiser)
        false_claims += false
        (failed if way is None else ways).append(number if way is None else way)
        print(f"{number}: {way}", "claimed a wrong place" if false else "", file=sys.stderr, flush=True)
    return {
        "localiser": name,
        "kidnapped" if told else "unknown_start": count,
        "right_again": len(ways),
        "way_m_median": round(float(np.median(ways)), 2) if ways else None,
        "way_m_p90": round(float(np.percentile(ways, 90)), 2) if ways else None,
        "wrong_claims": false_claims,
        "failed": failed,
    }


def _recovered(wanderer: Wanderer, localiser) -> tuple[float | None, bool]:
    """The way (m) until it is right, None when it is not; whether it claimed a wrong place for 2 s after 3 m."""
    begun_m, right_since, wrong_s, false, at_m = wanderer.way_m, None, 0.0, False, 0.0
    while wanderer.way_m < begun_m + MOST_M:
        wanderer.step()
        localiser.update(wanderer.robot)
        metres, radians = errors(localiser, wanderer.seen)
        claims = localiser.estimate().localised
        way = wanderer.way_m - begun_m
        wrong_s = wrong_s + STEP_S if claims and metres > WRONG_M and way > 3.0 else 0.0
        false |= wrong_s > WRONG_S
        if not (claims and metres < RIGHT_M and radians < RIGHT_RAD):
            right_since = None
            continue
        if right_since is None:
            right_since, at_m = wanderer.now_s, way
        if wanderer.now_s - right_since >= RIGHT_S:
            return round(at_m, 2), false
    return None, false


# ---- time


def timing(path: Path, particles: int = 1000, beams: int = 60) -> dict[str, object]:
    """What one whole update of the filter takes, and with it that of the localiser."""
    grid: GridMap = load_grid_map(load_world("flat").scan_map_path)
    options = FilterOptions(min_particles=particles, max_particles=particles, beams=beams)
    seen = list(replayed(path))[:400]
    filter_only = ParticleFilter(grid, options)
    localiser = MonteCarloLocaliser(
        grid, seen[0].true, MonteCarloOptions(particles=options, update_m=1e-6, update_rad=1e-6)
    )
    robot, whole = Replay(), []
    for each in seen:
        robot.scan_now = each.scan
        robot.odometry_now = Odometry(each.scan.stamp_s, each.scan.X_OB, (0.0, 0.0, 0.0))
        begun = time.perf_counter()
        localiser.update(robot)
        whole.append(1000.0 * (time.perf_counter() - begun))
    filter_only.place(seen[0].true, np.diag([0.05, 0.05, 0.02]) ** 2)
    points, alone = localiser._points(seen[0].scan), []
    chosen = np.ascontiguousarray(points[np.linspace(0, len(points) - 1, beams).astype(int)])
    for _ in range(300):
        begun = time.perf_counter()
        filter_only.move(Pose2D(0.01, 0.0, 0.0))
        filter_only.weigh(chosen)
        filter_only.resample()
        alone.append(1000.0 * (time.perf_counter() - begun))
    return {
        "particles": particles,
        "beams": beams,
        "filter_ms_median": round(float(np.median(alone)), 3),
        "filter_ms_p99": round(float(np.percentile(alone[5:], 99)), 3),
        "localiser_ms_median": round(float(np.median(whole)), 3),
        "localiser_ms_p99": round(float(np.percentile(whole[5:], 99)), 3),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("record", "replay", "kidnap", "timing"))
    parser.add_argument("file", type=Path, nargs="?", help="the recorded drive")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--say", default=SENTENCE)
    parser.add_argument("--localiser", default="monte_carlo")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--unknown-start", action="store_true", help="the localiser is not told where it begins")
    args = parser.parse_args()
    if args.what == "kidnap":
        result = kidnap(args.count, args.localiser, args.seed, told=not args.unknown_start)
    elif args.file is None:
        parser.error(f"{args.what} needs a file")
    elif args.what == "record":
        record(args.file, args.seed, args.say)
        return
    elif args.what == "replay":
        result = replay(args.file, args.localiser, start=not args.unknown_start)
    else:
        result = timing(args.file)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
