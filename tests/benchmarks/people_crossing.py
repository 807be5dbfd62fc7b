"""People who step before a driving robot, and people who cross its way; prints JSON.

    python -m tests.benchmarks.people_crossing [--what steps_in,crosses] [--first 0] [--count 10] [--jobs 1] [--json]

The robot drives 9 m along a hall with openings at its sides, at 0.5 to 1.0 m/s. `steps_in`: somebody beside its way,
or in an opening, walks into the way when the robot's front is 1.2 m before them, and stays. `crosses`: somebody crosses
the way at 1.2 m/s, whatever the robot does, so that the two would meet: before the robot, or at its side. Each case is
drawn from its number. Reported are the contacts that the referee lays to the robot, those with people who walked into
it while it stood, goals reached, and the time lost against the same drive without anybody.
"""

import functools
import math
import tempfile
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from errand_make.worlds.own import world_from_grid
from errand_make.worlds.rooms import FREE, OCCUPIED, Grid
from executive.words.mission import Route
from skills.robot import Pose2D
from tests.benchmarks.harness import benchmark, for_each, quantile
from tests.benchmarks.plant_mission import PlantMission

CELL_M, HALL_M, DEPTH_M = 0.05, (11.0, 4.4), 1.6
OPENINGS_M = (3.5, 5.5, 7.5)
WIDTH_M = 1.0
WAY_Y_M, GOAL_X_M = DEPTH_M + HALL_M[1] / 2.0, 10.0
START = Pose2D(1.0, WAY_Y_M, 0.0)
STEP_IN_M, FRONT_M, HALF_SWATH_M = 1.2, 0.55, 0.5
BODY_M = 0.15
ASIDE_M = {"steps_in": (0.8, 1.5), "crosses": (1.3, 1.8)}
STEPS = "  - skill: navigate\n    timeout: 120\n    with: {{x: {x}, y: {y}, yaw: 0.0, max_speed: {speed:.3f}}}\n"
STACK = "controller: {use: path_follower, max_speed_m_s: 1.0}\n"


def cases(what: tuple[str, ...] = ("steps_in", "crosses"), first: int = 0, count: int = 10):
    return product(what, range(first, first + count))


def draw_walk(what, number):
    """Highest speed of the robot (m/s), and the walk of somebody from one point to another.

    They set off once the robot's front is `gap_m` before them there.
    """
    rng = np.random.default_rng([number, len(what)])
    side = float(rng.choice([-1.0, 1.0]))
    hidden = rng.random() < 0.5
    x = float(rng.choice(OPENINGS_M) if hidden else rng.uniform(3.5, 7.5))
    aside_m = float(rng.uniform(2.5, 3.0) if hidden else rng.uniform(*ASIDE_M[what]))
    robot_m_s = float(rng.uniform(0.5, 1.0))
    walk = SimpleNamespace(name=what, from_W=(x, WAY_Y_M + side * aside_m))
    if what == "steps_in":
        walk.to_W = (x, WAY_Y_M + float(rng.uniform(-0.25, 0.25)))
        walk.speed_m_s, walk.gap_m = float(rng.uniform(0.8, 1.4)), STEP_IN_M
    else:
        walk.to_W = (x, WAY_Y_M - side * float(rng.uniform(1.2, 1.8)))
        walk.speed_m_s, walk.gap_m = 1.2, float(rng.uniform(-0.8, 1.2))
    return robot_m_s, walk


def make_world(folder):
    rows, columns = (round(length / CELL_M) for length in (HALL_M[1] + 2 * DEPTH_M, HALL_M[0]))
    cells = np.full((rows, columns), OCCUPIED, np.uint8)
    depth = round(DEPTH_M / CELL_M)
    cells[depth:-depth, 4:-4] = FREE
    for x in OPENINGS_M:
        low, high = (round((x + half) / CELL_M) for half in (-WIDTH_M / 2, WIDTH_M / 2))
        cells[4:-4, low:high] = FREE
    folder.mkdir(parents=True)
    world_from_grid(folder, Grid(cells, (0.0, 0.0), CELL_M), start=START, wall_height_m=2.0)


class Trigger:
    """Observer of the plant that lets somebody set off in time to be in the robot's way."""

    def __init__(self, mission, walk):
        self._simulation, self._robot_name, self._walk = mission.simulation, mission.robot_name, walk
        self._walker = mission.simulation.engine.walkers[walk.name]
        self._body = mission.simulation.engine.world.robots[mission.robot_name].body
        self._off = False
        self.least_gap_m = math.inf

    def __call__(self, now_s):
        engine = self._simulation.engine
        plant, context = engine.world.plant, engine.context
        x, y, _ = plant.EvalBodyPoseInWorld(context, self._body).translation()
        vx = float(plant.EvalBodySpatialVelocityInWorld(context, self._body).translational()[0])
        person_x, person_y = self._walker.place_W
        self.least_gap_m = min(self.least_gap_m, math.dist((x, y), (person_x, person_y)))
        way_m = abs(person_y - y) - HALF_SWATH_M
        gap_m = person_x - BODY_M - x - FRONT_M
        if not self._off and gap_m <= self._walk.gap_m + max(vx, 0.1) * way_m / self._walk.speed_m_s:
            self._off = True
            self._walker.set_off()


def drive(folder, number, robot_m_s, walk=None):
    """Drives along the hall; the end of the mission has the least distance from somebody, too (m)."""
    make_world(folder / "hall")
    stack = folder / "stack.yaml"
    stack.write_text(STACK)

    def with_walk(prepared):
        if walk is None:
            return prepared.world
        route = Route(waypoints=(walk.from_W, walk.to_W), speed=walk.speed_m_s, start=86400.0, yields=False)
        return prepared.world.with_routes({walk.name: route})

    steps = STEPS.format(x=GOAL_X_M, y=WAY_Y_M, speed=robot_m_s)
    mission = PlantMission(folder, number, change=with_walk, steps=steps, world=str(folder / "hall"), stack=stack)
    if walk is None:
        return mission.end("drive")
    trigger = Trigger(mission, walk)
    mission.simulation.engine.observe(trigger, every=2)
    ended = mission.end("drive")
    ended.least_gap_m = round(trigger.least_gap_m, 3)
    return ended


@functools.cache
def time_alone_s(robot_m_s):
    with tempfile.TemporaryDirectory() as folder:
        return drive(Path(folder), 0, robot_m_s).sim_time_s


def run_case(what, number, folder):
    robot_m_s, walk = draw_walk(what, number)
    ended = drive(folder, number, robot_m_s, walk)
    return vars(ended) | {"what": what, "lost_s": ended.sim_time_s - time_alone_s(round(robot_m_s, 1))}


def figures(ends):
    lost_s = [each.lost_s for each in ends if each.claimed]
    return {
        "cases": len(ends),
        "cases_with_contact_while_moving": sum(each.people_hit > 0 for each in ends),
        "cases_walked_into_standing_robot": sum(each.hit_by_people > 0 for each in ends),
        "reached": sum(each.claimed for each in ends),
        "time_lost_s_median": quantile(lost_s, digits=1),
        "time_lost_s_max": quantile(lost_s, 1.0, digits=1),
        "failed": [each.seed for each in ends if each.people_hit or not each.claimed],
    }


if __name__ == "__main__":
    benchmark(cases, run_case, for_each("what", figures))
