"""How surely the robot hands over single objects: it takes one from a table and gives it to a person. Prints JSON.

    python -m tests.benchmarks.hand_over [--classes a,b] [--trials N] [--seed S] [--jobs 2] [--json]

Each trial is a room of `tests.benchmarks.manipulation` with one object of the class on a table of random height, and a
person who takes what is offered. The plant's truth judges: `taken` when the object was lifted, `given` when it rests on
the person's tray at the end, `false_claim` when the robot says otherwise.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.app.placed_robots import only_robot
from executive.app.simulated import simulate
from executive.run.outcome import Outcome
from tests.benchmarks.manipulation import CLASSES, ROBOT, TARGET, attempts, run_texts
from tests.benchmarks.manipulation_room import PERSON, TAKEN, room


def attempt(chosen: tuple[str, int]) -> dict[str, Any]:
    """Take an object of a class and hand it over; what the plant's truth says of it."""
    class_name, seed = chosen
    with tempfile.TemporaryDirectory() as folder:
        world = room(Path(folder), class_name, (), "table", seed, person=True)
        simulation = simulate(world, {ROBOT: only_robot(ROBOT, world)}, seed=seed, record=False)
        texts = (
            f"Take [Nothing] to [{TAKEN}] and do [grasp] to [{class_name}]",
            f"Take [{class_name}] to [{PERSON}] and do [Nothing] to [Nothing]",
        )
        result = run_texts(simulation, world, texts, seed).result
    target = simulation.referee.objects[TARGET]
    given, claimed = target.on_tray_of == PERSON, result.outcome is Outcome.SUCCESS
    return {
        "class": class_name,
        "seed": seed,
        "taken": bool(target.lifts),
        "given": given,
        "false_claim": claimed != given,
        "drops": target.drops,
        "collisions": len(simulation.referee.collisions),
        "cause": "" if claimed else f"{result.cause}: {result.message}",
        "sim_time_s": round(simulation.clock.now(), 1),
    }


def trial_line(run: Mapping[str, Any]) -> str:
    """One line of a trial."""
    ended = "given" if run["given"] else "not given" if run["taken"] else "not taken"
    false = ", false claim" if run["false_claim"] else ""
    return (
        f"{run['class']:12} seed {run['seed']:3} {ended:9} drops {run['drops']} bumps {run['collisions']} "
        f"{run['sim_time_s']:5.0f} s{false}  {run['cause']}"
    )


def summary(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How many were taken and given, by class as well, and how many claims were false."""
    classes = sorted({run["class"] for run in runs})
    return {
        "taken": sum(run["taken"] for run in runs),
        "given": sum(run["given"] for run in runs),
        "false_claims": sum(run["false_claim"] for run in runs),
        "given_by_class": {name: sum(run["given"] for run in runs if run["class"] == name) for name in classes},
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--classes", default=",".join(CLASSES))
    parser.add_argument("--trials", type=int, default=5, help="of each class, one by each seed")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end")
    options = parser.parse_args()
    chosen = [(name, options.seed + n) for name in options.classes.split(",") for n in range(options.trials)]
    runs = list(attempts(attempt, chosen, options.jobs, trial_line))
    print(json.dumps({"runs": runs, **summary(runs)}, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
