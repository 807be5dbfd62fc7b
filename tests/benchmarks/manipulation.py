"""How well the robot takes, holds and puts down single objects among others; prints a line a trial, JSON at the end.

    python -m tests.benchmarks.manipulation [--classes a,b] [--surfaces table,shelf,floor] [--trials N] [--clutter 0-4]
        [--seed S] [--models DIR] [--jobs 2] [--json]

Each trial is a room of its own: a table of random height, an open shelf or the floor with one object of the class and
others around it, all set by the seed, and a second table. The robot goes to the object, takes it, holds it for ten
seconds and puts it on the second table. The plant's truth judges: `lifted`, `held_10s`, `placed_upright` (None for what
was not put down), and how many others were pushed over or off.

`--models` takes objects of your own in the place of the catalogue's: a folder of `errand object import`, or one of such
folders. Each needs a class (`--class` when it was imported): the robot goes for what its detector knows.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydrake.math import RigidTransform

from executive.cli.assembly import run_entry, simulate
from executive.cli.worlds import knowledge_of
from executive.mission.command import parse_command
from executive.mission.file.model import Mission, MissionStep
from executive.run.outcome import Outcome
from executive.run.runner import RunSettings, run
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.tree.registry import built_in_skills
from plant.models.imported import FACTS_FILE, ImportedFolderError, read_imported
from plant.simulation import Simulation
from plant.worlds.placement import place_objects
from plant.worlds.world import SurfaceTop
from tests.benchmarks.manipulation_room import SECOND, SURFACES, TAKEN, room

TARGET: Final = "target"
CLASSES: Final = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
ROBOT: Final = "Alice"
HELD_S, LIFTED_M, UPRIGHT_RAD, DISTURBED_M, DISTURBED_RAD, LOOK_S = 10.0, 0.03, 0.26, 0.05, 0.35, 0.1


@dataclass(frozen=True)
class Trial:
    """What is tried: with an object of the catalogue, or the imported one in the folder `model`."""

    class_name: str
    surface: str
    clutter: int
    seed: int
    model: Path | None = None

    @property
    def name(self) -> str:
        """That of the class, or of the model."""
        return self.class_name if self.model is None else self.model.name


@dataclass
class Watch:
    """What the truth shows of one object: how long it was off its support without a break (s)."""

    simulation: Simulation
    lifted_since_s: float | None = None
    longest_s: float = 0.0
    lifted: bool = False
    _due_s: float = 0.0

    def __call__(self, now_s: float) -> None:
        """Look, ten times a second."""
        if now_s < self._due_s:
            return
        self._due_s = now_s + LOOK_S
        history = self.simulation.referee.objects[TARGET]
        if not history.held_out:
            self.lifted_since_s = None
            return
        self.lifted = True
        self.lifted_since_s = now_s if self.lifted_since_s is None else self.lifted_since_s
        self.longest_s = max(self.longest_s, now_s - self.lifted_since_s)


def poses(simulation: Simulation) -> dict[str, RigidTransform]:
    """The true pose of each loose object."""
    engine = simulation.engine
    plant = engine.world.plant
    return {
        name: plant.EvalBodyPoseInWorld(
            engine.context, plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(name))[0])
        )
        for name in simulation.referee.objects
    }


def tilt_rad(before: RigidTransform, after: RigidTransform) -> float:
    """How far a body leans against how it stood."""
    up = after.rotation().matrix() @ before.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))


def others_of(trial: Trial) -> tuple[str, ...]:
    """The classes of what stands around: not that of the target, so that its name is clear."""
    rng = np.random.default_rng([trial.seed, 5])
    return tuple(str(each) for each in rng.choice([c for c in CLASSES if c != trial.class_name], trial.clutter))


def attempt(trial: Trial) -> dict[str, Any]:
    """Take, hold, put down; what the plant's truth says of it."""
    with tempfile.TemporaryDirectory() as folder:
        world = room(Path(folder), trial.class_name, others_of(trial), trial.surface, trial.seed, trial.model)
        simulation = simulate(world, seed=trial.seed, robot_name=ROBOT, record=False)
        watch, before = Watch(simulation), poses(simulation)
        simulation.engine.observe(watch)
        texts = (
            f"Take [Nothing] to [{TAKEN}] and do [grasp] to [{trial.class_name}]",
            "Take [Nothing] to [Nothing] and do [wait] to [12 second]",
            f"Take [{trial.class_name}] to [{SECOND}] and do [Nothing] to [Nothing]",
        )
        steps = tuple(MissionStep((parse_command(text),)) for text in texts)
        mission = Mission("trial", str(folder), ROBOT, steps)
        tree = compile_mission(mission, knowledge=knowledge_of(world), registry=built_in_skills())
        entry, clock, notes = run_entry(simulation, world, tree), simulation.clock, list[tuple[float, Any]]()
        result = run(
            [entry],
            clock=clock,
            worker=LockStepWorker(clock),
            publish=lambda topic, message: notes.append((clock.now(), message)) if topic == "transitions" else None,
            settings=RunSettings(seed=trial.seed, time_limit_s=600.0),
        ).worst
        after = poses(simulation)
        target = simulation.referee.objects[TARGET]
        put = target.resting and within(world.surfaces[SECOND], after[TARGET])
        upright = tilt_rad(before[TARGET], after[TARGET]) < UPRIGHT_RAD
        grasping = [(at, note["to"]) for at, note in notes if "grasp" in note["node"].rsplit("/", 1)[-1]]
        picks = [at for at, status in grasping if status == "SUCCESS"]
        begun = [at for at, status in grasping if status == "RUNNING" and picks and at < picks[0]]
        claimed = bool(picks)
        return {
            "class": trial.class_name,
            "name": trial.name,
            "model": str(place_objects(world, trial.seed)[0].form.file),
            "surface": trial.surface,
            "clutter": trial.clutter,
            "seed": trial.seed,
            "lifted": watch.lifted,
            "held_10s": watch.longest_s >= HELD_S,
            "placed": put,
            "placed_upright": upright if put else None,
            "others_disturbed": sum(disturbed(before[name], after[name]) for name in before if name != TARGET),
            "claimed": claimed,
            "false_claim": claimed != watch.lifted,
            "collisions": len(simulation.referee.collisions),
            "cause": "" if result.outcome is Outcome.SUCCESS else f"{result.cause}: {result.message}",
            "sim_time_s": round(clock.now(), 1),
            "pick_s": round(picks[0] - begun[-1], 1) if begun else math.nan,
        }


def within(surface: SurfaceTop, X_WO: RigidTransform) -> bool:
    """Whether an object lies on a surface."""
    x, y, z = X_WO.translation()
    corners = np.array(surface.polygon_W)
    inside = np.all(corners.min(axis=0) <= [x, y]) and np.all([x, y] <= corners.max(axis=0))
    return bool(inside and surface.height_m - 0.02 < z < surface.height_m + 0.4)


def disturbed(before: RigidTransform, after: RigidTransform) -> bool:
    """Whether something else was pushed well away or knocked over."""
    moved = float(np.linalg.norm(after.translation() - before.translation()))
    return moved > DISTURBED_M or tilt_rad(before, after) > DISTURBED_RAD


def trials(options: argparse.Namespace) -> Iterator[Trial]:
    """`--trials` of each class, over the surfaces in turn; the seed chooses the clutter."""
    low, _, high = options.clutter.partition("-")
    targets = [(name, None) for name in options.classes.split(",")] if options.models is None else own(options.models)
    for class_name, model in targets:
        for number in range(options.trials):
            seed = options.seed + number
            surface = options.surfaces.split(",")[number % len(options.surfaces.split(","))]
            clutter = int(np.random.default_rng([seed, 3]).integers(int(low), int(high or low) + 1))
            yield Trial(class_name, surface, clutter, seed, model)


def own(folder: Path) -> list[tuple[str, Path | None]]:
    """Class and folder of each imported object in a folder, or of the one that it is. Raises SystemExit."""
    folders = (
        [folder] if (folder / FACTS_FILE).exists() else sorted(path.parent for path in folder.glob(f"*/{FACTS_FILE}"))
    )
    try:
        found = [(read_imported(each).class_name, each.resolve()) for each in folders]
    except ImportedFolderError as error:
        raise SystemExit(str(error)) from error
    if not found:
        raise SystemExit(f"{folder}: there is no imported object; make one by `errand object import`")
    for class_name, each in found:
        if class_name not in CLASSES:
            raise SystemExit(f"{each}: no detector knows it; import it with --class, one of {', '.join(CLASSES)}")
    return list(found)


def told(run: dict[str, Any]) -> str:
    """One line of a trial."""
    marks = " ".join(
        name if run[name] else "-" * len(name) for name in ("lifted", "held_10s", "placed", "placed_upright")
    )
    return (
        f"{run['name']:12} {run['surface']:6} clutter {run['clutter']} seed {run['seed']:3} {marks} "
        f"others {run['others_disturbed']} bumps {run['collisions']} {run['sim_time_s']:5.0f} s  {run['cause']}"
    )


def summary(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Rates over all trials."""
    put = [run["placed_upright"] for run in runs if run["placed_upright"] is not None]
    timed = [run["pick_s"] for run in runs if not math.isnan(run["pick_s"])]

    def rate(key: str, chosen: Sequence[dict[str, Any]]) -> float:
        return round(float(np.mean([run[key] for run in chosen])), 3) if chosen else math.nan

    return {
        "lifted_rate": rate("lifted", runs),
        "held_rate": rate("held_10s", runs),
        "placed_rate": rate("placed", runs),
        "upright_rate": round(float(np.mean(put)), 3) if put else math.nan,
        "disturbed_rate": round(float(np.mean([run["others_disturbed"] > 0 for run in runs])), 3),
        "false_claims": sum(run["false_claim"] for run in runs),
        "by_class": {c: rate("held_10s", [r for r in runs if r["name"] == c]) for c in {r["name"] for r in runs}},
        "by_surface": {
            s: rate("held_10s", [r for r in runs if r["surface"] == s]) for s in {r["surface"] for r in runs}
        },
        "causes": dict(Counter(run["cause"] for run in runs if run["cause"]).most_common()),
        "pick_s_median": float(np.median(timed or [math.nan])),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--classes", default=",".join(CLASSES))
    parser.add_argument("--models", type=Path, help="objects of your own, in the place of the classes")
    parser.add_argument("--surfaces", default=",".join(SURFACES))
    parser.add_argument("--trials", type=int, default=3, help="of each class")
    parser.add_argument("--clutter", default="0-4", help="how many others stand around, as LOW-HIGH")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end, and nothing else")
    options = parser.parse_args()
    runs = []
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        for each in pool.imap_unordered(attempt, list(trials(options))):
            runs.append(each)
            print(told(each), file=sys.stderr, flush=True)
    print(json.dumps({"runs": runs, **summary(runs)}, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
