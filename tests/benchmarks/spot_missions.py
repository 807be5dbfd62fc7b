"""Missions through Spot's API beside the same missions in process. Prints JSON at the end.

    python -m tests.benchmarks.spot_missions [--missions fetch_drink,patrol] [--seed 1] [--seeds 1] [--api-only]

Adapter and server run in lock-step, and the referee of the plant behind the server judges. Without `--missions`, all
shipped missions of one robot run. `same` counts the pairs with equal outcome and equal verdict; with `--api-only` the
run in process is left out.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from executive.app.goal_conditions import verdict_of
from executive.app.mission_run import run_request
from executive.app.placed_robots import robot_stack
from executive.app.prepare import prepare
from executive.app.real_spot import ApiBackend
from executive.app.served_spot import SpotPerception
from executive.app.simulated import simulate
from executive.mission.request import Request
from plant.simulation import Simulation
from plant.spot_api.server.identity import credentials
from tests.plant.spot_api.lock_step import LockStep

MISSIONS: Final = Path(__file__).parents[2] / "missions"
SEVERAL: Final = "two_robots"
TIME_OF_DAY: Final = "08:29"
"""Missions that wait for a time begin shortly before it."""


@dataclass(frozen=True)
class Ended:
    """End of a mission: its outcome, the referee's verdict with its reason, robot time and time of the computer (s)."""

    outcome: str
    verdict: bool
    why: str
    robot_s: float
    took_s: float


class Judged(ApiBackend):
    """Backend of a real Spot, with the referee of the plant behind the server."""

    def __init__(self, step: LockStep, simulation: Simulation, prepared: Any) -> None:
        stack = robot_stack(prepared.robots[step.robot.name])
        super().__init__(step.robot, step, prepared.world, stack, prepared.world.start)
        self._simulation = simulation

    def judge(self, tree, result, *, before=(), since_s=0.0):  # type: ignore[no-untyped-def]
        """Judges the run by the plant."""
        return verdict_of(tree, result, self._simulation.referee.judge, before=before, since_s=since_s)


def in_process(request: Request) -> Ended:
    """Runs a request in the plant."""
    began_s = time.monotonic()
    return _ended(run_request(prepare(request)).report, began_s)


def through_api(
    request: Request, folder: Path, options: Callable[[LockStep], Mapping[str, Any]] = lambda _: {}
) -> Ended:
    """Runs a request through adapter and server in lock-step; the server's credentials lie in the folder.

    `options` are more options of `run_request`.
    """
    prepared, made = prepare(request), list[Simulation]()

    def build() -> tuple[Any, Any]:
        made.append(simulate(prepared.world, prepared.robots, seed=request.seed, record=False))
        return made[0].robots["Alice"], made[0].clock

    step = LockStep(build, credentials(folder), SpotPerception({}))
    try:
        step.stand_up()
        began_s = time.monotonic()
        return _ended(run_request(prepared, Judged(step, made[0], prepared), **options(step)).report, began_s)
    finally:
        made.clear()
        step.close()


def _ended(report: Any, began_s: float) -> Ended:
    seen = report.seen
    took_s = round(time.monotonic() - began_s, 1)
    return Ended(
        str(report.outcome), seen.success, f"{report.message}; {seen.why}", round(report.sim_time_s, 1), took_s
    )


def both(name: str, seed: int, *, api_only: bool) -> tuple[Ended, Ended | None]:
    """Runs a mission, or a sentence, through the API and in process."""
    with tempfile.TemporaryDirectory() as out:
        what: dict[str, Any] = {"sentence": name} if " " in name else {"file": MISSIONS / f"{name}.yaml"}
        request = Request(**what, seed=seed, record=False, time_of_day=TIME_OF_DAY, out=Path(out) / "run")
        api = through_api(request, Path(out) / "credentials")
        return api, None if api_only else in_process(replace(request, out=Path(out) / "in_process"))


def compared(names: list[str], seeds: range, *, api_only: bool) -> dict[str, Any]:
    """Runs each mission with each seed, each in a process of its own: a renderer must end in the thread it began in."""
    runs: dict[str, Any] = {}
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
        for name, seed in product(names, seeds):
            api, here = pool.submit(both, name, seed, api_only=api_only).result()
            runs[f"{name} {seed}"] = {"api": vars(api), "in_process": None if here is None else vars(here)}
            sys.stderr.write(f"{name} {seed}: {api} {here or ''}\n")
    ended = [run["api"] for run in runs.values()]
    pairs = [(run["api"], run["in_process"]) for run in runs.values() if run["in_process"] is not None]
    return {
        "same": sum(all(api[key] == here[key] for key in ("outcome", "verdict")) for api, here in pairs),
        "fulfilled": sum(each["verdict"] for each in ended),
        "of": len(runs),
        "robot_s_per_s": round(sum(each["robot_s"] for each in ended) / sum(each["took_s"] for each in ended), 2),
        "runs": runs,
    }


def main() -> None:
    """Runs the measure from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    shipped = sorted(file.stem for file in MISSIONS.glob("*.yaml") if file.stem != SEVERAL)
    parser.add_argument("--missions", default=",".join(shipped), help="names of shipped missions, or sentences")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seeds", type=int, default=1, help="how many, from --seed on")
    parser.add_argument("--api-only", action="store_true", help="leave out the runs in process")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.seeds)
    print(json.dumps(compared(options.missions.split(","), seeds, api_only=options.api_only), indent=1))


if __name__ == "__main__":
    main()
