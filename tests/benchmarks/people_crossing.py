"""People who step before a driving robot, and people who cross its way; prints JSON.

    python -m tests.benchmarks.people_crossing [--what steps_in,crosses] [--first 0] [--count 10] [--json]

The robot drives 9 m along a hall with openings at its sides, at 0.5 to 1.0 m/s. `steps_in`: somebody beside its way,
or in an opening, walks into the way when the robot's front is 1.2 m before them, and stays. `crosses`: somebody crosses
the way at 1.2 m/s, whatever the robot does, so that the two would meet: before the robot, or at its side. Each case is
drawn from its number. Reported are the contacts that the referee lays to the robot, those with people who walked into
it while it stood, goals reached, and the time lost against the same drive without anybody.
"""

from __future__ import annotations

import argparse
import functools
import json
import math
import statistics
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from executive.app.mission_run import run_request
from executive.app.placed_robots import only_robot
from executive.app.prepare import prepare
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.words.mission import Route
from plant.worlds.builder.own import world_from_grid
from plant.worlds.builder.rooms import FREE, OCCUPIED, Grid
from skills.robot import Pose2D

CELL_M, HALL_M, DEPTH_M = 0.05, (11.0, 4.4), 1.6
OPENINGS_M = (3.5, 5.5, 7.5)
WIDTH_M = 1.0
WAY_Y_M, GOAL_X_M = DEPTH_M + HALL_M[1] / 2.0, 10.0
START = Pose2D(1.0, WAY_Y_M, 0.0)
STEP_IN_M, FRONT_M, HALF_SWATH_M = 1.2, 0.55, 0.5
BODY_M = 0.15
ASIDE_M = {"steps_in": (0.8, 1.5), "crosses": (1.3, 1.8)}
NOBODY = "nobody"


@dataclass(frozen=True)
class Case:
    """Somebody who sets off from one point to another, once the robot's front is `gap_m` before them there.

    `speed_m_s` is theirs, `robot_m_s` the most that the robot may drive.
    """

    what: str
    number: int
    robot_m_s: float
    from_W: tuple[float, float]
    to_W: tuple[float, float]
    speed_m_s: float
    gap_m: float


@dataclass(frozen=True)
class Outcome:
    """What came of a case."""

    what: str
    number: int
    people_hit: int
    hit_by_people: int
    reached: bool
    time_s: float
    least_gap_m: float
    events: tuple[str, ...]


def case(what: str, number: int) -> Case:
    """A case by its number."""
    rng = np.random.default_rng([number, len(what)])
    side = float(rng.choice([-1.0, 1.0]))
    hidden = rng.random() < 0.5
    x = float(rng.choice(OPENINGS_M) if hidden else rng.uniform(3.5, 7.5))
    aside_m = float(rng.uniform(2.5, 3.0) if hidden else rng.uniform(*ASIDE_M[what]))
    robot_m_s = float(rng.uniform(0.5, 1.0))
    start_W = (x, WAY_Y_M + side * aside_m)
    if what == "steps_in":
        to_W = (x, WAY_Y_M + float(rng.uniform(-0.25, 0.25)))
        return Case(what, number, robot_m_s, start_W, to_W, float(rng.uniform(0.8, 1.4)), STEP_IN_M)
    beyond_m = float(rng.uniform(1.2, 1.8))
    gap_m = float(rng.uniform(-0.8, 1.2))
    return Case(what, number, robot_m_s, start_W, (x, WAY_Y_M - side * beyond_m), 1.2, gap_m)


def make_world(folder: Path) -> None:
    """A hall with three openings at each side, to small rooms."""
    rows, columns = (round(length / CELL_M) for length in (HALL_M[1] + 2 * DEPTH_M, HALL_M[0]))
    cells = np.full((rows, columns), OCCUPIED, np.uint8)
    depth = round(DEPTH_M / CELL_M)
    cells[depth:-depth, 4:-4] = FREE
    for x in OPENINGS_M:
        low, high = (round((x + half) / CELL_M) for half in (-WIDTH_M / 2, WIDTH_M / 2))
        cells[4:-4, low:high] = FREE
    folder.mkdir(parents=True, exist_ok=True)
    world_from_grid(folder, Grid(cells, (0.0, 0.0), CELL_M), start=START, wall_height_m=2.0)


class Trigger:
    """Lets somebody set off in time to be in the robot's way when its front is so far before them."""

    def __init__(self, backend: SimulatedBackend, drawn: Case) -> None:
        engine = backend._simulation.engine
        self._engine, self._case = engine, drawn
        self._walk = engine.walkers[drawn.what]
        self._body = engine.world.robots["Alice"].body
        self._off = False
        self.least_gap_m = math.inf

    def __call__(self, now_s: float) -> None:
        plant, context = self._engine.world.plant, self._engine.context
        X_WB = plant.EvalBodyPoseInWorld(context, self._body)
        x, y, _ = X_WB.translation()
        vx = float(plant.EvalBodySpatialVelocityInWorld(context, self._body).translational()[0])
        person_x, person_y = self._walk.place_W
        self.least_gap_m = min(self.least_gap_m, math.dist((x, y), (person_x, person_y)))
        way_m = abs(person_y - y) - HALF_SWATH_M
        gap_m = person_x - BODY_M - x - FRONT_M
        if not self._off and gap_m <= self._case.gap_m + max(vx, 0.1) * way_m / self._case.speed_m_s:
            self._off = True
            self._walk.set_off()


def run_case(folder: Path, drawn: Case) -> Outcome:
    """Drive it."""
    mission, stack = folder / "drive.yaml", folder / "stack.yaml"
    mission.write_text(
        f"name: drive\nsteps:\n  - skill: navigate\n    timeout: 120\n"
        f"    with: {{x: {GOAL_X_M}, y: {WAY_Y_M}, yaw: 0.0, max_speed: {drawn.robot_m_s:.3f}}}\n"
    )
    stack.write_text("controller: {use: path_follower, max_speed_m_s: 1.0}\n")
    out = Path(tempfile.mkdtemp(dir=folder))
    request = Request(file=mission, world=str(folder / "hall"), out=out, record=False, stack=stack, seed=drawn.number)
    prepared = prepare(request, ask=None)
    world = prepared.world
    if drawn.what != NOBODY:
        route = Route(waypoints=(drawn.from_W, drawn.to_W), speed=drawn.speed_m_s, start=86400.0, yields=False)
        world = world.with_routes({drawn.what: route})
    name = prepared.mission.robot_name
    backend = SimulatedBackend(
        world,
        {name: only_robot(name, world, seed=drawn.number, stack=stack)},
        seed=drawn.number,
        record=False,
    )
    trigger = None
    if drawn.what != NOBODY:
        trigger = Trigger(backend, drawn)
        backend._simulation.engine.observe(trigger, every=2)
    report = run_request(replace(prepared, world=world), backend).report
    seen = report.seen
    return Outcome(
        drawn.what,
        drawn.number,
        seen.people_hit,
        seen.hit_by_people,
        report.outcome == "success",
        report.sim_time_s,
        round(trigger.least_gap_m, 3) if trigger else math.inf,
        (*seen.events, report.message),
    )


def summary(outcomes: list[Outcome], alone_s: dict[int, float]) -> dict[str, object]:
    """The figures of one kind of case."""
    lost = [each.time_s - alone_s[each.number] for each in outcomes if each.reached and each.number in alone_s]
    return {
        "cases": len(outcomes),
        "cases_with_contact_while_moving": sum(each.people_hit > 0 for each in outcomes),
        "cases_walked_into_standing_robot": sum(each.hit_by_people > 0 for each in outcomes),
        "reached": sum(each.reached for each in outcomes),
        "time_lost_s_median": round(statistics.median(lost), 1) if lost else None,
        "time_lost_s_max": round(max(lost), 1) if lost else None,
        "failed": [each.number for each in outcomes if each.people_hit or not each.reached],
    }


@functools.cache
def time_alone_s(folder: Path, robot_m_s: float) -> float:
    """How long the drive takes without anybody."""
    return run_case(folder, Case(NOBODY, 0, robot_m_s, (0.0, 0.0), (0.0, 0.0), 1.0, 0.0)).time_s


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--what", default="steps_in,crosses")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--only", help="numbers of cases, in place of --first and --count")
    parser.add_argument("--json", action="store_true", help="all on one line")
    options = parser.parse_args()
    numbers = (
        [int(each) for each in options.only.split(",")]
        if options.only
        else range(options.first, options.first + options.count)
    )
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        make_world(folder / "hall")
        found: dict[str, object] = {}
        for what in options.what.split(","):
            outcomes, alone_s = [], {}
            for number in numbers:
                drawn = case(what, number)
                outcomes.append(run_case(folder, drawn))
                alone_s[number] = time_alone_s(folder, round(drawn.robot_m_s, 1))
                told = asdict(outcomes[-1])
                print(f"{what} {told} alone {alone_s[number]:.1f} s, {drawn}", file=sys.stderr, flush=True)
            found[what] = summary(outcomes, alone_s)
    print(json.dumps(found, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
