"""Precision and recall of the tracker of people, in scans of a robot that drives among walking people; prints JSON.

    python -m tests.benchmarks.people_tracking [--first 0] [--count 3] [--seconds 60]

Three people walk between rooms of the flat, each at a pace of its own, and one stands in the living room. A person is
visible while at least 12 returns of a scan within 6 m lie on them. The recall is the share of visible people with a
track within 0.5 m, the precision the share of tracks in view within 0.5 m of a person. A switch is a track that goes
over to another person.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.app.mission_run import run_request
from executive.app.placed_robots import only_robot
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.mission import Route
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import load_grid_map
from skills.perception.people import people_in_scan
from skills.perception.people_tracking import SCAN_APART_M, PeopleOptions, PeopleTracker

VISIBLE_M, VISIBLE_POINTS, BODY_M, SAME_M = 6.0, 12, 0.33, 0.5
ROOMS = ("kitchen", "living room", "bedroom", "workshop", "office", "bathroom", "hall")
NAMES = ("Ann", "Bob", "Cid")
STANDING = "Robin"


class Count:
    """Observer of the plant that tracks people in each scan and compares them with the truth."""

    def __init__(self, backend: SimulatedBackend, robot_name: str, keepout: Path) -> None:
        simulation = backend._simulation
        self._engine, self._robot = simulation.engine, simulation.robots[robot_name]
        world = self._engine.world
        self._body = world.robots[robot_name].body
        models = {name: world.models[name] for name in (*NAMES, STANDING)}
        self._people = {
            name: world.plant.get_body(world.plant.GetBodyIndices(each)[0]) for name, each in models.items()
        }
        self._survey, self._tracker = LayeredCostmap(load_grid_map(keepout)), PeopleTracker()
        self._stamp_s, self._owner = -math.inf, dict[int, str]()
        self.visible = self.found = self.tracks = self.right = self.switches = 0
        self.off_m: list[float] = []

    def __call__(self, now_s: float) -> None:
        scan = self._robot.scan()
        if scan is None or scan.stamp_s <= self._stamp_s or now_s - scan.stamp_s > 0.06:
            return
        self._stamp_s = scan.stamp_s
        plant, context = self._engine.world.plant, self._engine.context
        X_WB = plant.EvalBodyPoseInWorld(context, self._body)
        people = {n: plant.EvalBodyPoseInWorld(context, body).translation()[:2] for n, body in self._people.items()}
        found = people_in_scan(scan, X_WB, self._robot.capabilities().footprint_m, VISIBLE_M, self._survey)
        self._tracker.update(found, by_scan=True, apart_m=SCAN_APART_M)
        least, options = PeopleOptions().least_scans, PeopleOptions()
        self._tracker.revise(
            lambda one: one if now_s - one.stamp_s < (options.hidden_s if one.scans >= least else 0.5) else None
        )
        live = [one for one in self._tracker.people if one.scans >= least and scan.stamp_s - one.stamp_s < 0.3]
        points_W = X_WB.multiply(scan.points_B().T).T
        points_W = points_W[points_W[:, 2] > 0.7]
        for place in people.values():
            on_person = np.hypot(*(points_W[:, :2] - place).T) < BODY_M
            if math.dist(place, X_WB.translation()[:2]) > VISIBLE_M or np.count_nonzero(on_person) < VISIBLE_POINTS:
                continue
            off_m = min((math.dist(one.place_W, place) for one in live), default=math.inf)
            self.visible += 1
            if off_m < SAME_M:
                self.found += 1
                self.off_m.append(off_m)
        self.tracks += len(live)
        for one in live:
            off_m, name = min((math.dist(one.place_W, place), name) for name, place in people.items())
            if off_m < SAME_M:
                self.right += 1
                self.switches += self._owner.get(one.track, name) != name
                self._owner[one.track] = name


def count_of(seed: int, seconds: float) -> Count:
    """One drive among people whose routes the seed draws."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as made:
        steps = "".join(f"  - say: go to the {room}\n" for room in rng.permutation(ROOMS[:6])[:4])
        mission = Path(made) / "drive.yaml"
        mission.write_text(f"name: drive\nsteps:\n{steps}")
        request = Request(
            file=mission, world="flat", out=Path(made) / "out", record=False, seed=seed, time_limit_s=seconds
        )
        prepared = prepare(request, ask=None)
        routes = {}
        for name in NAMES:
            stops = tuple(prepared.knowledge.place_pose(str(room)) for room in rng.permutation(ROOMS)[:4])
            waypoints = tuple((pose.x + float(rng.uniform(0.3, 0.6)), pose.y) for pose in stops)
            speed = float(rng.uniform(0.6, 1.2))
            routes[name] = Route(waypoints=waypoints, speed=speed, loop=True, apart=True)
        world, name = prepared.world.with_routes(routes), prepared.mission.robot_name
        backend = SimulatedBackend(world, {name: only_robot(name, world, seed=seed)}, seed=seed, record=False)
        count = Count(backend, name, world.keepout_map_path)
        backend._simulation.engine.observe(count, every=2)
        run_request(replace(prepared, world=world), backend)
    return count


def main() -> None:
    """Runs the drives and prints."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=60.0)
    options = parser.parse_args()
    counts = [count_of(seed, options.seconds) for seed in range(options.first, options.first + options.count)]
    visible, tracks = sum(each.visible for each in counts), sum(each.tracks for each in counts)
    off_m = np.concatenate([each.off_m for each in counts])
    result = {
        "visible": visible,
        "recall": round(sum(each.found for each in counts) / max(visible, 1), 3),
        "tracks": tracks,
        "precision": round(sum(each.right for each in counts) / max(tracks, 1), 3),
        "switches": sum(each.switches for each in counts),
        "off_m_median": round(float(np.median(off_m)), 3),
        "off_m_95": round(float(np.percentile(off_m, 95)), 3),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
