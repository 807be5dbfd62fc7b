"""Precision and recall of the tracker of people, in scans of a robot that drives among walking people; prints JSON.

    python -m tests.benchmarks.people_tracking [--first 0] [--count 3] [--seconds 60] [--jobs 1]

Three people walk between rooms of the flat, each at a pace of its own, and one stands in the living room. A person is
visible while at least 12 returns of a scan within 6 m lie on them. The recall is the share of visible people with a
track within 0.5 m, the precision the share of tracks in view within 0.5 m of a person. A switch is a track that goes
over to another person.
"""

import math
from types import SimpleNamespace

import numpy as np

from executive.words.mission import Route
from skills.estimate.costmap import LayeredCostmap
from skills.grid_map import load_grid_map
from skills.perception.people import people_in_scan
from skills.perception.people_tracking import SCAN_APART_M, PeopleOptions, PeopleTracker
from tests.benchmarks.harness import benchmark, quantile, totals
from tests.benchmarks.plant_mission import PlantMission

VISIBLE_M, VISIBLE_POINTS, BODY_M, SAME_M = 6.0, 12, 0.33, 0.5
ROOMS = ("kitchen", "living room", "bedroom", "workshop", "office", "bathroom", "hall")
NAMES = ("Ann", "Bob", "Cid")
STANDING = "Robin"


class Observer:
    """Observer of the plant that tracks people in each scan and compares them with the truth.

    It counts visible people, those with a track, tracks, those near a person, and switches; `off_m` has the errors (m).
    """

    def __init__(self, mission):
        self._engine, self._robot = mission.simulation.engine, mission.simulation.robots[mission.robot_name]
        world = self._engine.world
        self._body = world.robots[mission.robot_name].body
        models = [world.models[name] for name in (*NAMES, STANDING)]
        self._people = [world.plant.get_body(world.plant.GetBodyIndices(each)[0]) for each in models]
        self._survey = LayeredCostmap(load_grid_map(mission.prepared.world.keepout_map_path))
        self._tracker, self._stamp_s, self._person_of = PeopleTracker(), -math.inf, {}
        self.counts = SimpleNamespace(visible=0, found=0, tracks=0, right=0, switches=0, off_m=[])

    def __call__(self, now_s):
        scan, counts = self._robot.scan(), self.counts
        if scan is None or scan.stamp_s <= self._stamp_s or now_s - scan.stamp_s > 0.06:
            return
        self._stamp_s = scan.stamp_s
        plant, context = self._engine.world.plant, self._engine.context
        X_WB = plant.EvalBodyPoseInWorld(context, self._body)
        found = people_in_scan(scan, X_WB, self._robot.capabilities().footprint_m, VISIBLE_M, self._survey)
        self._tracker.update(found, by_scan=True, apart_m=SCAN_APART_M)
        least, hidden_s = PeopleOptions().least_scans, PeopleOptions().hidden_s
        self._tracker.revise(
            lambda one: one if now_s - one.stamp_s < (hidden_s if one.scans >= least else 0.5) else None
        )
        live = [one for one in self._tracker.people if one.scans >= least and scan.stamp_s - one.stamp_s < 0.3]
        people_W = np.array([plant.EvalBodyPoseInWorld(context, each).translation()[:2] for each in self._people])
        off_m = np.array([np.hypot(*(people_W - one.place_W).T) for one in live]).reshape(-1, len(people_W))
        points_W = X_WB.multiply(scan.points_B().T).T
        points_W = points_W[points_W[:, 2] > 0.7]
        for person, place in enumerate(people_W):
            on_person = np.hypot(*(points_W[:, :2] - place).T) < BODY_M
            if math.dist(place, X_WB.translation()[:2]) <= VISIBLE_M and np.sum(on_person) >= VISIBLE_POINTS:
                nearest_m = float(np.min(off_m[:, person], initial=math.inf))
                counts.visible += 1
                counts.off_m += [nearest_m] if nearest_m < SAME_M else []
        counts.found, counts.tracks = len(counts.off_m), counts.tracks + len(live)
        for one, near_m in zip(live, off_m, strict=True):
            person = int(np.argmin(near_m))
            if near_m[person] < SAME_M:
                counts.right += 1
                counts.switches += self._person_of.get(one.track, person) != person
                self._person_of[one.track] = person


def cases(first: int = 0, count: int = 3, seconds: float = 60.0):
    return [(seed, seconds) for seed in range(first, first + count)]


def run_case(seed, seconds, folder):
    rng = np.random.default_rng(seed)
    steps = "".join(f"  - say: go to the {room}\n" for room in rng.permutation(ROOMS[:6])[:4])

    def with_people(prepared):
        routes = {}
        for name in NAMES:
            stops = [prepared.knowledge.place_pose(str(room)) for room in rng.permutation(ROOMS)[:4]]
            waypoints = tuple((pose.x + float(rng.uniform(0.3, 0.6)), pose.y) for pose in stops)
            routes[name] = Route(waypoints=waypoints, speed=float(rng.uniform(0.6, 1.2)), loop=True, apart=True)
        return prepared.world.with_routes(routes)

    mission = PlantMission(folder, seed, change=with_people, steps=steps, world="flat", time_limit_s=seconds)
    observer = Observer(mission)
    mission.simulation.engine.observe(observer, every=2)
    mission.run()
    return observer.counts


def summary(counts):
    sums = totals(counts, "visible", "found", "tracks", "right", "switches")
    off_m = [each for one in counts for each in one.off_m]
    return {
        "visible": sums["visible"],
        "recall": round(sums["found"] / max(sums["visible"], 1), 3),
        "tracks": sums["tracks"],
        "precision": round(sums["right"] / max(sums["tracks"], 1), 3),
        "switches": sums["switches"],
        "off_m_median": quantile(off_m, digits=3),
        "off_m_95": quantile(off_m, 0.95, digits=3),
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
