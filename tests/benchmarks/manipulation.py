"""How well the robot takes, holds and puts down single objects among others; prints a line a trial, JSON at the end.

    python -m tests.benchmarks.manipulation [--classes a,b] [--surfaces table,shelf,floor] [--trials N] [--clutter 0-4]
        [--seed S] [--models DIR | --shapes N] [--jobs 2] [--sheet FILE.png] [--json]

Each trial is a room of its own: a table of random height, an open shelf or the floor with one object of the class and
others around it, all set by the seed, and a second table. The robot goes to the object, takes it, holds it for ten
seconds and puts it on the second table. The plant's truth judges: `lifted`, `held_10s`, `placed_upright` (None for what
was not put down), and how many others were pushed over or off. `place_error_m` is from the spot that the place skill
lowered the object on, as it believed, to where the middle of the object's bounding box is. `planning_s` is the wall
time of planning each single arm motion with its goal, `grasp_planning_s` that of each grasp with the motions to it.
`pick_s` is the robot's time from when it stood still before the object, all looks included, to when it was lifted.

`--models` takes objects of your own in the place of the catalogue's: a folder of `errand object import`, or one of such
folders. Each needs a class (`--class` when it was imported): the robot goes for what its detector knows.

`--shapes` takes so many random boxes, cylinders and blocks, one by each seed, as any object (`thing`), with nothing
around.

`--sheet` writes a picture of how each failed trial ended. A table of failures by class and cause goes to stderr.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform

from errand_train.commands.worst_sheet import Shown, contact_sheet
from errand_train.detector.scoring import Judged
from executive.app.placed_robots import only_robot
from executive.app.simulated import run_entry, simulate
from executive.app.worlds import knowledge_of
from executive.run.outcome import Outcome, RobotResult
from executive.run.runner import run
from executive.run.visitor import Progress, RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.tree.registry import built_in_skills
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.mission import Mission
from plant.models.catalogue import FACTS_FILE, read_imported
from plant.scene_pictures import best_view, render_view, save_png
from plant.simulation import Simulation
from plant.worlds.seeding import place_objects
from plant.worlds.world import SurfaceTop, World
from skills.api import Job, Worker
from skills.files.errors import InputError
from skills.perception.class_forms import ANY_OBJECT
from skills.robot import FloatArray, Picture
from tests.benchmarks.manipulation_room import SECOND, SURFACES, TAKEN, room
from tests.benchmarks.shapes import written_shape
from tests.visitors import OnMessage

ResultT = TypeVar("ResultT")
JobT = TypeVar("JobT")
ReadT = TypeVar("ReadT")

TARGET: Final = "target"
CLASSES: Final = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
ROBOT: Final = "Alice"
HELD_S, UPRIGHT_RAD, DISTURBED_M, DISTURBED_RAD, LOOK_S, MOVED_M = 10.0, 0.26, 0.05, 0.35, 0.1, 0.02
MOTION_WORK, GRASP_WORK = "plan arm motion", "plan grasp"
NEAR_SPOT_M: Final = 0.05
OUTCOMES: Final = {
    "lifted": "never lifted",
    "held_10s": "not held for ten seconds",
    "placed": "not on the second table",
    "placed_upright": "fell over on the second table",
}


@dataclass(frozen=True)
class Trial:
    """What is tried: with an object of the catalogue, or the imported one in the folder `model`."""

    class_name: str
    surface: str
    clutter: int
    seed: int
    model: Path | None = None
    pictured: bool = False

    @property
    def name(self) -> str:
        """That of the class, or of the model."""
        return self.class_name if self.model is None else self.model.name


@dataclass
class Watch:
    """What the truth shows of one object: how long it was off its support without a break (s).

    `pick_s` is from when the robot stood still before it to when it was lifted first.
    """

    simulation: Simulation
    pick_s: float = math.nan
    lifted_since_s: float | None = None
    longest_s: float = 0.0
    lifted: bool = False
    _due_s: float = 0.0
    _stands_since_s: float = 0.0
    _base_W: FloatArray = field(default_factory=lambda: np.zeros(2))

    def __call__(self, now_s: float) -> None:
        """Look, ten times a second."""
        if now_s < self._due_s:
            return
        self._due_s = now_s + LOOK_S
        history, base_W = self.simulation.referee.objects[TARGET], base_xy_W(self.simulation)
        if float(np.linalg.norm(base_W - self._base_W)) > MOVED_M:
            self._stands_since_s, self._base_W = now_s, base_W
        if not history.in_the_air:
            self.lifted_since_s = None
            return
        if not self.lifted:
            self.lifted, self.pick_s = True, round(now_s - self._stands_since_s, 1)
        self.lifted_since_s = now_s if self.lifted_since_s is None else self.lifted_since_s
        self.longest_s = max(self.longest_s, now_s - self.lifted_since_s)


@dataclass(frozen=True)
class TimedWorker:
    """A worker that notes the wall time (s) of each piece of work by its name, also of work that fails."""

    within: Worker
    spent_s: dict[str, list[float]] = field(default_factory=dict)

    def submit(self, work: Callable[[], ResultT], *, latency_s: float, name: str) -> Job[ResultT]:
        """As the worker within."""
        return self.within.submit(lambda: self._timed(name, work), latency_s=latency_s, name=name)

    def sense(
        self, read: Callable[[], ReadT], work: Callable[[ReadT], ResultT], *, latency_s: float, name: str
    ) -> Job[ResultT]:
        """As the worker within; reading is not timed."""
        return self.within.sense(
            read, lambda given: self._timed(name, lambda: work(given)), latency_s=latency_s, name=name
        )

    def _timed(self, name: str, work: Callable[[], ResultT]) -> ResultT:
        begun_s = time.perf_counter()
        try:
            return work()
        finally:
            self.spent_s.setdefault(name, []).append(round(time.perf_counter() - begun_s, 4))


@dataclass
class LastSpot(RunVisitor):
    """Keeps where the place skill last lowered something: x and y (m) in the world, None for nowhere."""

    spot_W: tuple[float, float] | None = None

    def tick(self, progress: Progress) -> None:
        """Keep the spot of a running skill's checkpoint."""
        for checkpoint in (each for note in progress.notes.values() for each in note.checkpoints.values()):
            if "spot_W" in checkpoint:
                x, y = checkpoint["spot_W"]
                self.spot_W = (x, y)


@dataclass(frozen=True)
class Ran:
    """A mission that was run: result, log notes by time (s), last spot, seconds that each piece of work took."""

    result: RobotResult
    notes: Sequence[tuple[float, Mapping[str, Any]]]
    spot_W: tuple[float, float] | None
    spent_s: Mapping[str, Sequence[float]]


def run_texts(simulation: Simulation, world: World, texts: Sequence[str], seed: int) -> Ran:
    """Run a mission of commands in their text form, timed and noted."""
    steps = tuple(Do.from_command(parse_command(text)) for text in texts)
    mission = Mission(name="trial", world=str(world.folder), robot=ROBOT, steps=steps)
    tree = compile_mission(mission, knowledge=knowledge_of(world), registry=built_in_skills())
    spot = LastSpot()
    entry = run_entry(simulation.robots[tree.robot_name], world, tree, start=simulation.starts[tree.robot_name])
    clock, notes = simulation.clock, list[tuple[float, Mapping[str, Any]]]()

    def note(topic: str, message: Mapping[str, Any]) -> None:
        if topic == "transitions":
            notes.append((clock.now(), message))

    with LockStepWorker(clock) as lock_step:
        worker = TimedWorker(lock_step)
        result = run(
            [entry],
            clock=clock,
            worker=worker,
            visitors=[spot, OnMessage(note)],
            settings=RunSettings(seed=seed, time_limit_s=600.0),
        ).worst
    return Ran(result, notes, spot.spot_W, worker.spent_s)


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


def base_xy_W(simulation: Simulation) -> FloatArray:
    """Where the robot's body is (2,)."""
    (robot,) = simulation.engine.world.robots.values()
    return np.array(
        simulation.engine.world.plant.EvalBodyPoseInWorld(simulation.engine.context, robot.body).translation()[:2]
    )


def tilt_rad(before: RigidTransform, after: RigidTransform) -> float:
    """How far a body leans against how it stood."""
    up = after.rotation().matrix() @ before.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))


def others_of(trial: Trial) -> tuple[str, ...]:
    """The classes of what stands around: not that of the target, so that its name is clear."""
    rng = np.random.default_rng([trial.seed, 5])
    return tuple(str(each) for each in rng.choice([c for c in CLASSES if c != trial.class_name], trial.clutter))


def attempt(trial: Trial) -> tuple[dict[str, Any], Picture | None]:
    """Take, hold, put down; what the plant's truth says of it, and how it ended where it failed, if pictured."""
    with tempfile.TemporaryDirectory() as folder:
        world = room(Path(folder), trial.class_name, others_of(trial), trial.surface, trial.seed, trial.model)
        simulation = simulate(world, {ROBOT: only_robot(ROBOT, world)}, seed=trial.seed, record=False)
        watch, before = Watch(simulation), poses(simulation)
        simulation.engine.observe(watch)
        texts = (
            f"Take [Nothing] to [{TAKEN}] and do [grasp] to [{trial.class_name}]",
            "Take [Nothing] to [Nothing] and do [wait] to [12 second]",
            f"Take [{trial.class_name}] to [{SECOND}] and do [Nothing] to [Nothing]",
        )
        ran = run_texts(simulation, world, texts, trial.seed)
        after, middle_W = poses(simulation), middle(simulation)
        target = simulation.referee.objects[TARGET]
        put = target.resting and within(world.surfaces[SECOND], after[TARGET])
        upright = tilt_rad(before[TARGET], after[TARGET]) < UPRIGHT_RAD
        claimed, succeeded = has_grasped(ran.notes), ran.result.outcome is Outcome.SUCCESS
        judged = {
            "class": trial.class_name,
            "name": trial.name,
            "model": str(place_objects(world, trial.seed)[0].form.file),
            "surface": trial.surface,
            "clutter": len(before) - 1,
            "seed": trial.seed,
            "lifted": watch.lifted,
            "held_10s": watch.longest_s >= HELD_S,
            "placed": put,
            "placed_upright": upright if put else None,
            "place_error_m": place_error_m(ran.spot_W, middle_W) if put else None,
            "others_disturbed": sum(disturbed(before[name], after[name]) for name in before if name != TARGET),
            "claimed": claimed,
            "false_claim": is_false_claim(claimed, lifted=watch.lifted, held_s=watch.longest_s),
            "collisions": len(simulation.referee.collisions),
            "cause": "" if succeeded else f"{ran.result.cause}: {ran.result.message}",
            "sim_time_s": round(simulation.clock.now(), 1),
            "pick_s": watch.pick_s,
            "planning_s": list(ran.spent_s.get(MOTION_WORK, ())),
            "grasp_planning_s": list(ran.spent_s.get(GRASP_WORK, ())),
        }
        pictured = trial.pictured and failure(judged)
        return judged, ending_picture(simulation, middle_W) if pictured else None


def is_false_claim(claimed: bool, *, lifted: bool, held_s: float) -> bool:
    """Whether "holding" was claimed of what was never lifted, or never of what was held for long.

    What falls as it is lifted, and is not claimed, is reported rightly.
    """
    return (claimed and not lifted) or (not claimed and held_s >= HELD_S)


def has_grasped(notes: Sequence[tuple[float, Mapping[str, Any]]]) -> bool:
    """Whether the grasp skill ever succeeded."""
    return any("grasp" in note["node"].rsplit("/", 1)[-1] and note["to"] == "SUCCESS" for _, note in notes)


def middle(simulation: Simulation) -> FloatArray:
    """The middle (3,) of the target's bounding box in its own frame, where it is in the world now."""
    engine = simulation.engine
    world = engine.world
    plant = world.plant
    body = plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(TARGET))[0])
    inspector = simulation_query(simulation).inspector()
    boxes = [
        (inspector.GetPoseInFrame(each), found)
        for each in plant.GetCollisionGeometriesForBody(body)
        if (found := inspector.GetObbInGeometryFrame(each)) is not None
    ]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
    corners_O = np.hstack([X_OG @ box.pose() @ (signs * box.half_width()[:, None]) for X_OG, box in boxes])
    p_O = (corners_O.min(axis=1) + corners_O.max(axis=1)) / 2.0
    return np.asarray(plant.EvalBodyPoseInWorld(engine.context, body) @ p_O)


def simulation_query(simulation: Simulation) -> QueryObject:
    """The scene as it is now."""
    engine = simulation.engine
    scene = engine.world.scene
    assert scene is not None
    return scene.query_at(engine.world.plant.GetPositions(engine.context))


def place_error_m(spot_W: Sequence[float] | None, p_W: FloatArray) -> float | None:
    """How far (m) along the surface something is from the spot it was lowered on; None where it never was."""
    return None if spot_W is None else round(float(np.linalg.norm(np.asarray(spot_W) - p_W[:2])), 4)


def ending_picture(simulation: Simulation, p_W: FloatArray) -> Picture:
    """What is about a point now, from a side where nothing hides it."""
    query = simulation_query(simulation)
    return render_view(query, best_view(query, p_W), (800, 600))


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
    surfaces, pictured = options.surfaces.split(","), options.sheet is not None
    for class_name, model in targets:
        for number in range(options.trials):
            seed = options.seed + number
            clutter = int(np.random.default_rng([seed, 3]).integers(int(low), int(high or low) + 1))
            yield Trial(class_name, surfaces[number % len(surfaces)], clutter, seed, model, pictured)


def shape_trials(options: argparse.Namespace, folder: Path) -> Iterator[Trial]:
    """`--trials` of each shape, one by each seed, over the surfaces in turn; they are written to a folder."""
    surfaces, pictured = options.surfaces.split(","), options.sheet is not None
    for index in range(options.shapes):
        seed = options.seed + index
        model = written_shape(seed, folder)
        for number in range(options.trials):
            yield Trial(
                ANY_OBJECT, surfaces[(index + number) % len(surfaces)], 0, seed + 1000 * number, model, pictured
            )


def own(folder: Path) -> list[tuple[str, Path | None]]:
    """Class and folder of each imported object in a folder, or of the one that it is. Raises SystemExit."""
    folders = (
        [folder] if (folder / FACTS_FILE).exists() else sorted(path.parent for path in folder.glob(f"*/{FACTS_FILE}"))
    )
    try:
        found = [(read_imported(each).class_name, each.resolve()) for each in folders]
    except InputError as error:
        raise SystemExit(str(error)) from error
    if not found:
        raise SystemExit(f"{folder}: there is no imported object; make one by `errand object import`")
    for class_name, each in found:
        if class_name not in CLASSES:
            raise SystemExit(f"{each}: no detector knows it; import it with --class, one of {', '.join(CLASSES)}")
    return list(found)


def failure(run: Mapping[str, Any]) -> str:
    """Why a trial failed: the mission's cause, else what the truth denies; empty for a good one."""
    return str(run["cause"]) or next((words for key, words in OUTCOMES.items() if not run[key]), "")


def failures(runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each class and cause with its number of failures, the commonest first."""
    counted = Counter((str(run["name"]), failure(run)) for run in runs if failure(run))
    return [f"{number:4}  {name:14} {cause}" for (name, cause), number in counted.most_common()]


def caption(run: Mapping[str, Any]) -> str:
    """A trial in a few words below its picture."""
    return f"{run['name']} {run['surface']} {run['seed']}: {failure(run)}"[:55]


def write_sheet(path: Path, shown: Sequence[tuple[Mapping[str, Any], Picture]]) -> str:
    """Write a sheet of failed trials; what was written, in a line. Raises OSError when it cannot be."""
    if not shown:
        return f"no trial failed: {path} is not written"
    save_png(path, contact_sheet([Shown(caption(each), picture, Judged((), (), ())) for each, picture in shown]))
    return f"{path}: {len(shown)} failed trials"


def attempts(
    attempt: Callable[[JobT], ResultT], jobs: Sequence[JobT], processes: int, line: Callable[[ResultT], str]
) -> Iterator[ResultT]:
    """The results of jobs in processes of their own, each shown in a line with the time left."""
    begun_s = time.monotonic()
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for done, each in enumerate(pool.imap_unordered(attempt, jobs), start=1):
            left_s = (time.monotonic() - begun_s) / done * (len(jobs) - done)
            print(f"{line(each)}  [{done} of {len(jobs)}, {left_s:.0f} s left]", file=sys.stderr, flush=True)
            yield each


def trial_line(run: dict[str, Any]) -> str:
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
    off = [run["place_error_m"] for run in runs if run["place_error_m"] is not None]

    def rate(key: str, chosen: Sequence[dict[str, Any]]) -> float:
        return round(float(np.mean([run[key] for run in chosen])), 3) if chosen else math.nan

    return {
        "lifted_rate": rate("lifted", runs),
        "held_rate": rate("held_10s", runs),
        "placed_rate": rate("placed", runs),
        "upright_rate": round(float(np.mean(put)), 3) if put else math.nan,
        "placed_near_upright_rate": round(float(np.mean([near_upright(run) for run in runs])), 3),
        "place_error_m_median": round(float(np.median(off or [math.nan])), 4),
        "planning_s": spread([spent_s for run in runs for spent_s in run["planning_s"]]),
        "grasp_planning_s": spread([spent_s for run in runs for spent_s in run["grasp_planning_s"]]),
        "disturbed_rate": round(float(np.mean([run["others_disturbed"] > 0 for run in runs])), 3),
        "false_claims": sum(run["false_claim"] for run in runs),
        "by_class": {c: rate("held_10s", [r for r in runs if r["name"] == c]) for c in {r["name"] for r in runs}},
        "by_surface": {
            s: rate("held_10s", [r for r in runs if r["surface"] == s]) for s in {r["surface"] for r in runs}
        },
        "causes": dict(Counter(run["cause"] for run in runs if run["cause"]).most_common()),
        "pick_s_median": float(np.median(timed or [math.nan])),
    }


def spread(values: Sequence[float]) -> dict[str, float]:
    """Their median and 95th percentile, nan without any."""
    median, p95 = np.percentile(values or [math.nan], [50, 95])
    return {"median": round(float(median), 3), "p95": round(float(p95), 3)}


def near_upright(run: Mapping[str, Any]) -> bool:
    """Whether it stands upright within 5 cm of the spot."""
    error_m = run["place_error_m"]
    return bool(run["placed_upright"] and error_m is not None and error_m <= NEAR_SPOT_M)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--classes", default=",".join(CLASSES))
    own_objects = parser.add_mutually_exclusive_group()
    own_objects.add_argument("--models", type=Path, help="objects of your own, in the place of the classes")
    own_objects.add_argument("--shapes", type=int, help="so many random shapes, in the place of the classes")
    parser.add_argument("--surfaces", default=",".join(SURFACES))
    parser.add_argument("--trials", type=int, default=3, help="of each class")
    parser.add_argument("--clutter", help="how many others stand around, as LOW-HIGH (0-4)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--sheet", type=Path, help="a PNG file with a picture of how each failed trial ended")
    parser.add_argument("--json", action="store_true", help="one line of JSON at the end, and nothing else")
    options = parser.parse_args()
    if options.shapes is not None and (options.shapes < 1 or options.clutter not in (None, "0")):
        parser.error("--shapes takes at least one, as any object, alone on its surface: leave --clutter out")
    options.clutter = options.clutter or "0-4"
    with tempfile.TemporaryDirectory() as folder:
        chosen = list(trials(options) if options.shapes is None else shape_trials(options, Path(folder)))
        ended = list(attempts(attempt, chosen, options.jobs, lambda each: trial_line(each[0])))
    runs, shown = [run for run, _ in ended], [(run, picture) for run, picture in ended if picture is not None]
    for line in failures(runs):
        print(line, file=sys.stderr)
    if options.sheet is not None:
        print(write_sheet(options.sheet, shown), file=sys.stderr)
    print(json.dumps({"runs": runs, **summary(runs)}, indent=None if options.json else 1))


if __name__ == "__main__":
    main()
