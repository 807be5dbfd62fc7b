"""Missions through a server beside the same missions in process: what the benchmarks of Spot's API and ROS 2 share.

Adapter and server run in lock-step, and the referee of the plant behind the server judges.
"""

import time
from contextlib import ExitStack
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import robot_stack
from executive.app.runs.goal_conditions import verdict_of
from executive.app.runs.one_run import run_request
from executive.app.runs.real_robot import RealBackend, real_runner
from executive.app.runs.simulated import simulate
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.visitor import RunVisitor
from skills.api import PICTURES, TOUCHES
from skills.robot import ConnectedRobot
from tests.benchmarks.errand_process import ROOT

MISSIONS = ROOT / "missions"
SHIPPED = tuple(sorted(file.stem for file in MISSIONS.glob("*.yaml") if file.stem != "two_robots"))
TIME_OF_DAY = "08:29"
"""Missions that wait for a time begin shortly before it."""


class Judged(RealBackend):
    """Backend of a real robot, with the referee of the plant behind the server."""

    def __init__(self, step, simulation, prepared):
        stack = robot_stack(prepared.robots[step.robot.name])
        super().__init__(ConnectedRobot(step.robot, step), prepared.world, stack, prepared.world.start)
        self.referee = simulation.referee

    def judge(self, tree, result, *, before=(), since_s=0.0):
        return verdict_of(tree, result, self.referee.judge, before=before, since_s=since_s)


class Witness(RunVisitor):
    """Visitor that tells the plant's referee of the pictures and the touches that the robot announces."""

    def __init__(self, simulation):
        self._simulation = simulation

    def message(self, topic, message):
        if topic == TOUCHES:
            self._simulation.referee.expect_touch(message["robot"], message["until_s"])
        if topic == PICTURES and "of" in message:
            self._simulation.record_picture(message["robot"], message["camera"], message["stamp_s"])
        return message


def run_served(request, lock_step, options=lambda _: {}):
    """Runs a request through the adapter and server that `lock_step` starts around a robot and its clock.

    `lock_step` takes a function that builds both; `options` are more options of `run_request`.
    """
    prepared, made = prepare(request), []

    def build():
        made.append(simulate(prepared.world, prepared.robots, seed=request.seed, record=False))
        return made[0].robots["Alice"], made[0].clock

    step = lock_step(build)
    try:
        began_s, given = time.monotonic(), options(step)
        given["visitors"] = [Witness(made[0]), *given.get("visitors", ())]
        return _ended(run_request(prepared, Judged(step, made[0], prepared), **given).report, began_s)
    finally:
        made.clear()
        step.close()


def run_real(prepared, address, plant):
    """Returns the report of a run as by `errand run --robot`; `plant` has the referee behind the robot."""
    with real_runner(prepared, address) as run:
        run.keywords["backend"].judge = lambda *ended, **more: verdict_of(*ended, plant.referee.judge, **more)
        return run(prepared, visitors=[Witness(plant)], control=Control(pace=None)).report


def _ended(report, began_s):
    why, took_s = f"{report.message}; {report.seen.why}", round(time.monotonic() - began_s, 1)
    ended = {"outcome": str(report.outcome), "verdict": report.seen.success, "why": why}
    return SimpleNamespace(**ended, robot_s=round(report.sim_time_s, 1), took_s=took_s)


def cases(missions: tuple[str, ...] = SHIPPED, seed: int = 1, seeds: int = 1, served_only: bool = False):
    return product(missions, range(seed, seed + seeds), [served_only])


def run_pair(name, seed, served_only, folder, through):
    """Runs a mission by `through`, which takes a request and a folder for credentials, and then in process."""
    what = {"sentence": name} if " " in name else {"file": MISSIONS / f"{name}.yaml"}
    request = Request(**what, seed=seed, record=False, time_of_day=TIME_OF_DAY, out=folder / "run")
    served, here = through(request, folder / "credentials"), None
    if not served_only:
        began_s = time.monotonic()
        here = _ended(run_request(prepare(replace(request, out=folder / "in_process"))).report, began_s)
    same = here is not None and (served.outcome, served.verdict) == (here.outcome, here.verdict)
    return {"name": f"{name} {seed}", "same": same, "served": served, "in_process": here}


def summary(pairs):
    robot_s, took_s = (sum(getattr(each.served, name) for each in pairs) for name in ("robot_s", "took_s"))
    return {
        "same": sum(each.same for each in pairs),
        "fulfilled": sum(bool(each.served.verdict) for each in pairs),
        "of": len(pairs),
        "robot_s_per_s": round(robot_s / took_s, 2),
        "runs": {each.name: each for each in pairs},
    }


class Cut(RunVisitor):
    """Network that is cut for 90 ticks; `cut` gives the context of a cut, `seen` are the modes of the run."""

    def __init__(self, cut, control, tick):
        self._cut, self._control, self._tick, self._during, self.seen = cut, control, tick, ExitStack(), []

    def tick(self, progress):
        if progress.ticks == self._tick:
            self._during.enter_context(self._cut())
        elif progress.ticks == self._tick + 90:
            self._during.close()
        if self.seen[-1:] != [said := (self._control.state.mode, self._control.state.reason)]:
            self.seen.append(said)
