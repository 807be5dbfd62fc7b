"""How well localisers know where the robot is; prints JSON.

    python -m tests.benchmarks.localisation record out/drive.npz [--seed 1] [--say SENTENCE]
    python -m tests.benchmarks.localisation replay out/drive.npz [--localiser monte_carlo] [--unknown-start]
    python -m tests.benchmarks.localisation kidnap [--count 50] [--localiser monte_carlo] [--seed 1] [--unknown-start]
    python -m tests.benchmarks.localisation timing out/drive.npz

`record` runs a mission in the plant and stores LiDAR, odometry and the true pose; `replay` lets a localiser follow that
drive. `kidnap` carries a robot that drives about in the flat off to a random free pose, with the plant's LiDAR and
odometry but no dynamics, and measures how far it drives until it is right again: within 10 cm and 3 degrees for 2 s,
and says so. `timing` is one update of 1000 particles by 60 beams. With `--unknown-start` the localiser is not given the
pose where it begins.
"""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform

from plant.simulation import Simulation
from plant.worlds.world import load_world
from skills.estimate.monte_carlo import MonteCarloLocaliser, MonteCarloOptions
from skills.estimate.particle_filter import FilterOptions, ParticleFilter
from skills.geometry import compose, relative_pose
from skills.grid_map import load_grid_map
from skills.robot import Odometry, Pose2D, Scan
from skills.stack import components
from tests.benchmarks.gliding import GlidingBase
from tests.benchmarks.harness import command, quantile, tell
from tests.benchmarks.plant_mission import PlantMission

SENTENCE = "Hey Alice, can you fetch me a drink from the kitchen"
RIGHT_M, RIGHT_RAD, RIGHT_S, MOST_M = 0.10, math.radians(3.0), 2.0, 15.0
WRONG_M, WRONG_S, WRONG_AFTER_M = 0.5, 2.0, 3.0
SPEED_M_S, TURN_RAD_S, STEP_S = 0.5, 0.6, 0.05
WARM_M = 2.0


@dataclass(frozen=True)
class Seen:
    """A scan, and the true pose of the robot; a robot of which only odometry and the LiDAR are there."""

    taken: Scan
    true: Pose2D

    def odometry(self):
        return Odometry(self.taken.stamp_s, self.taken.X_OB, (0.0, 0.0, 0.0))

    def scan(self):
        return self.taken


def errors(localiser, scan, true):
    off = relative_pose(true, Pose2D.from_transform(localiser.estimate().X_WO @ scan.X_OB))
    return math.hypot(off.x_m, off.y_m), abs(off.yaw_rad)


def took_ms(work):
    begun = time.perf_counter()
    work()
    return 1000.0 * (time.perf_counter() - begun)


def record(file: Path, seed: int = 1, say: str = SENTENCE):
    """Runs a mission and stores what its LiDAR and odometry saw."""
    mission = PlantMission(file.with_suffix(""), seed, sentence=say, world="flat")
    simulation, name = mission.simulation, mission.robot_name
    kept = []

    def keep():
        scan = simulation.robots[name].scan()
        fresh = scan is not None and scan.stamp_s >= simulation.engine.now() - 1e-6
        if fresh and (not kept or scan.stamp_s >= kept[-1][0].stamp_s + 0.049):
            millimetres = np.nan_to_num(1000.0 * scan.ranges_m, nan=0.0).clip(0.0, 65535.0).astype(np.uint16)
            kept.append((scan, millimetres, simulation.true_pose(name)))

    simulation.engine.after_advance(keep)
    report = mission.run()
    scan = kept[-1][0]
    np.savez_compressed(
        file,
        stamps=[each.stamp_s for each, _, _ in kept],
        ranges=np.stack([millimetres for _, millimetres, _ in kept]),
        X_OB=np.stack([each.X_OB.GetAsMatrix4() for each, _, _ in kept]),
        true=np.array([(true.x_m, true.y_m, true.yaw_rad) for _, _, true in kept]),
        elevations=scan.elevations_rad,
        azimuths=scan.azimuths_rad,
        X_BL=scan.X_BL.GetAsMatrix4(),
    )
    return {"outcome": report.outcome, "scans": len(kept)}


def recorded(file):
    with np.load(file) as kept:
        data = dict(kept)
    X_BL = RigidTransform(data["X_BL"])
    for stamp, ranges, X_OB, true in zip(data["stamps"], data["ranges"], data["X_OB"], data["true"], strict=True):
        metres = ranges.astype(np.float32) / 1000.0
        metres[ranges == 0] = np.nan
        scan = Scan(float(stamp), metres, data["elevations"], data["azimuths"], X_BL, RigidTransform(X_OB))
        yield Seen(scan, Pose2D(*true.tolist()))


def replay(file: Path, localiser: str = "monte_carlo", unknown_start: bool = False):
    """Measures the error of a localiser along a recorded drive, while it moves and at rest, and its updates' times."""
    grid = load_grid_map(load_world("flat").scan_map_path)
    first, *drive = recorded(file)
    follows = components("localiser")[localiser]().build(
        grid, None if unknown_start else first.true, surely=not unknown_start
    )
    follows.update(first)
    off, moving, took, said, health = [], [], [], [], []
    for before, seen in zip([first, *drive], drive, strict=False):
        took.append(took_ms(lambda seen=seen: follows.update(seen)))
        step, dt = relative_pose(before.true, seen.true), seen.taken.stamp_s - before.taken.stamp_s
        moving.append(math.hypot(step.x_m, step.y_m) > 0.05 * dt or abs(step.yaw_rad) > 0.05 * dt)
        off.append(errors(follows, seen.taken, seen.true))
        said.append(follows.estimate().localised)
        health.append(follows.estimate().health)
    off_cm, off_deg = 100.0 * np.array(off)[:, 0], np.degrees(np.array(off)[:, 1])
    drove = np.array(moving)
    return {
        "localiser": localiser,
        "scans": len(off),
        "rms_cm": _rms(off_cm[drove]),
        "rms_deg": _rms(off_deg[drove]),
        "max_cm": quantile(off_cm[drove], 1.0),
        "max_deg": quantile(off_deg[drove], 1.0),
        "rest_rms_cm": _rms(off_cm[~drove]),
        "localised": round(float(np.mean(said)), 4),
        "health_median": quantile(health, digits=3),
        "health_min": quantile(health, 0.0, 3),
        "update_ms_median": quantile(took, digits=3),
        "update_ms_mean": round(float(np.mean(took)), 3),
        "update_ms_p99": quantile(took, 0.99, 3),
    }


def _rms(values):
    return round(float(np.sqrt(np.mean(np.square(values)))), 3)


class Wanderer(GlidingBase):
    """A robot that drives about on free ground of the flat."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        super().__init__(Simulation(load_world("flat"), seed=seed, visuals=False), self.rng)
        self._keepout = load_grid_map(load_world("flat").surveyed.keepout_map_path).with_unknown_blocked()
        self.way_m, self._turning = 0.0, 0.0
        self.carry_off()
        self.believed = self.true
        self.sense()

    def carry_off(self):
        """Puts the robot at a random pose with room to turn about, which odometry does not notice."""
        free = np.argwhere(self._keepout.distance > 0.62)
        x, y = self._keepout.centres(free[self.rng.integers(len(free))][None])[0]
        self.true = Pose2D(float(x), float(y), float(self.rng.uniform(-math.pi, math.pi)))

    def step(self):
        """Drives ahead while there is room, else turns to one side."""
        ahead = [compose(self.true, Pose2D(d, 0.0, 0.0)) for d in (0.3, 0.6, 0.9)]
        if self._keepout.distance_m(np.array([(p.x_m, p.y_m) for p in ahead])).min() > 0.4:
            self._turning, velocity = 0.0, (SPEED_M_S, 0.0, 0.2 * math.sin(0.7 * self.now_s))
        else:
            self._turning = self._turning or float(self.rng.choice([-1.0, 1.0])) * TURN_RAD_S
            velocity = (0.0, 0.0, self._turning)
        self.way_m += velocity[0] * STEP_S
        self.move(np.array(velocity), STEP_S)


def kidnap(count: int = 50, localiser: str = "monte_carlo", seed: int = 1, unknown_start: bool = False):
    """Counts in how many of so many kidnappings, or starts at unknown places, it is right again within 15 m."""
    grid, wanderer = load_grid_map(load_world("flat").scan_map_path), Wanderer(seed)
    ways, failed, false_claims = [], [], 0
    for number in range(count):
        wanderer.carry_off()
        wanderer.sense()
        start = None if unknown_start else wanderer.true
        follows = components("localiser")[localiser]().build(grid, start, surely=not unknown_start)
        if not unknown_start:
            follows.update(wanderer)
            begun = wanderer.way_m
            while wanderer.way_m < begun + WARM_M:
                wanderer.step()
                follows.update(wanderer)
            wanderer.carry_off()
        way, false = _recovered(wanderer, follows)
        false_claims += false
        (failed if way is None else ways).append(number if way is None else way)
        tell(f"{number}: {way} {'claimed a wrong place' if false else ''}")
    return {
        "localiser": localiser,
        "unknown_start" if unknown_start else "kidnapped": count,
        "right_again": len(ways),
        "way_m_median": quantile(ways),
        "way_m_p90": quantile(ways, 0.9),
        "wrong_claims": false_claims,
        "failed": failed,
    }


def _recovered(wanderer, localiser):
    """The way (m) until it is right, None when it is not; whether it claimed a wrong place for 2 s after 3 m."""
    begun_m, right_since, wrong_s, false, at_m = wanderer.way_m, None, 0.0, False, 0.0
    while wanderer.way_m < begun_m + MOST_M:
        wanderer.step()
        localiser.update(wanderer)
        metres, radians = errors(localiser, wanderer.scan(), wanderer.true)
        claims, way = localiser.estimate().localised, wanderer.way_m - begun_m
        wrong_s = wrong_s + STEP_S if claims and metres > WRONG_M and way > WRONG_AFTER_M else 0.0
        false |= wrong_s > WRONG_S
        if not (claims and metres < RIGHT_M and radians < RIGHT_RAD):
            right_since = None
            continue
        if right_since is None:
            right_since, at_m = wanderer.now_s, way
        if wanderer.now_s - right_since >= RIGHT_S:
            return round(at_m, 2), false
    return None, false


def timing(file: Path, particles: int = 1000, beams: int = 60):
    """Times a whole update of the filter, and with it that of the localiser."""
    grid, seen = load_grid_map(load_world("flat").scan_map_path), list(recorded(file))[:400]
    options = FilterOptions(min_particles=particles, max_particles=particles, beams=beams)
    always = MonteCarloOptions(particles=options, update_m=1e-6, update_rad=1e-6)
    localiser, alone = MonteCarloLocaliser(grid, seen[0].true, always), ParticleFilter(grid, options)
    whole = [took_ms(lambda each=each: localiser.update(each)) for each in seen]
    alone.place(seen[0].true, np.diag([0.05, 0.05, 0.02]) ** 2)
    points = localiser._points(seen[0].taken)
    chosen = np.ascontiguousarray(points[np.linspace(0, len(points) - 1, beams).astype(int)])

    def update():
        alone.move(Pose2D(0.01, 0.0, 0.0))
        alone.weigh(chosen)
        alone.resample()

    filtering = [took_ms(update) for _ in range(300)]
    return {
        "particles": particles,
        "beams": beams,
        "filter_ms_median": quantile(filtering, digits=3),
        "filter_ms_p99": quantile(filtering[5:], 0.99, 3),
        "localiser_ms_median": quantile(whole, digits=3),
        "localiser_ms_p99": quantile(whole[5:], 0.99, 3),
    }


if __name__ == "__main__":
    command(record, replay, kidnap, timing)
