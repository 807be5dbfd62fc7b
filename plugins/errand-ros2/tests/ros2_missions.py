"""Missions through ROS 2 beside the same missions in process. Prints JSON at the end.

    python plugins/errand-ros2/tests/ros2_missions.py [--missions fetch_drink] [--seed 1] [--seeds 1] [--ros-only]

Adapter and server run in lock-step, and the referee of the plant behind the server judges. Without `--missions`, all
shipped missions of one robot run. `same` counts the pairs with equal outcome and equal verdict; with `--ros-only` the
run in process is left out.
"""

import time
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

from ros_client import free_port
from ros_lock_step import LockStep

from errand_ros2.wire.session import Place
from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import robot_stack
from executive.app.runs.goal_conditions import verdict_of
from executive.app.runs.one_run import run_request
from executive.app.runs.real_robot import RealBackend
from executive.app.runs.simulated import simulate
from executive.mission.request import Request
from skills.robot import ConnectedRobot
from tests.benchmarks.errand_process import ROOT
from tests.benchmarks.harness import benchmark

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


def through_ros(request, options=lambda _: {}):
    """Runs a request through adapter and server in lock-step; `options` are more options of `run_request`."""
    prepared, made = prepare(request), []

    def build():
        made.append(simulate(prepared.world, prepared.robots, seed=request.seed, record=False))
        return made[0].robots["Alice"], made[0].clock

    step = LockStep(build, Place(port=free_port()))
    try:
        began_s = time.monotonic()
        return ended(run_request(prepared, Judged(step, made[0], prepared), **options(step)).report, began_s)
    finally:
        made.clear()
        step.close()


def ended(report, began_s):
    why, took_s = f"{report.message}; {report.seen.why}", round(time.monotonic() - began_s, 1)
    told = {"outcome": str(report.outcome), "verdict": report.seen.success, "why": why}
    return SimpleNamespace(**told, robot_s=round(report.sim_time_s, 1), took_s=took_s)


def cases(missions: tuple[str, ...] = SHIPPED, seed: int = 1, seeds: int = 1, ros_only: bool = False):
    return product(missions, range(seed, seed + seeds), [ros_only])


def run_case(name, seed, ros_only, folder):
    what = {"sentence": name} if " " in name else {"file": MISSIONS / f"{name}.yaml"}
    request = Request(**what, seed=seed, record=False, time_of_day=TIME_OF_DAY, out=folder / "run")
    ros, here = through_ros(request), None
    if not ros_only:
        began_s = time.monotonic()
        here = ended(run_request(prepare(replace(request, out=folder / "in_process"))).report, began_s)
    same = here is not None and (ros.outcome, ros.verdict) == (here.outcome, here.verdict)
    return {"name": f"{name} {seed}", "same": same, "ros": ros, "in_process": here}


def summary(pairs):
    robot_s, took_s = (sum(getattr(each.ros, name) for each in pairs) for name in ("robot_s", "took_s"))
    return {
        "same": sum(each.same for each in pairs),
        "fulfilled": sum(bool(each.ros.verdict) for each in pairs),
        "of": len(pairs),
        "robot_s_per_s": round(robot_s / took_s, 2),
        "runs": {each.name: each for each in pairs},
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary, alone=True)  # a renderer must end in the thread it began in
