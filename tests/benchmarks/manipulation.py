"""How well the robot takes, holds and puts down single objects among others; prints a line a trial, JSON at the end.

    python -m tests.benchmarks.manipulation [--classes a,b] [--surfaces table,shelf,floor] [--trials N] [--clutter 0-4]
        [--seed S] [--models DIR | --shapes N] [--jobs 1] [--sheet FILE.png] [--out FOLDER] [--json]

Each trial is a room of its own: a table of random height, an open shelf or the floor with one object of the class and
others around it, all set by the seed, and a second table. The robot goes to the object, takes it, holds it for ten
seconds and puts it on the second table. The plant's truth judges: `lifted`, `held_10s`, `placed_upright` (None for what
was not put down), and how many others were pushed over or off. `place_error_m` is from the spot that the place skill
lowered the object on, as it believed, to where the middle of the object's bounding box is. `planning_s` is the wall
time of planning each single arm motion with its goal, `grasp_planning_s` that of each grasp with the motions to it.
`pick_s` is the robot's time from when it stood still before the object, all looks included, to when it was lifted.

`--models` takes objects of your own in the place of the catalogue's: a folder of `errand object import`, or one of such
folders. The robot goes for the class of each; one without a class (`--class` when it was imported) it takes as any
object (`thing`), with nothing around.

`--shapes` takes so many random boxes, cylinders and blocks, one by each seed, as any object (`thing`), with nothing
around.

`--sheet` writes a picture of how each failed trial ended. A table of failures by class and cause goes to stderr.
"""

import math
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np

from errand_train.commands.worst_sheet import Shown, contact_sheet
from errand_train.detector.scoring import Judged
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import knowledge_of
from executive.app.runs.simulated import run_entry, simulate
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.leaf_steps import steps_of_commands
from executive.words.mission import Mission
from plant.models.catalogue import FACTS_FILE, read_imported
from plant.scene_pictures import best_view, render_view, save_png
from plant.simulation import Simulation
from plant.worlds.seeding import place_objects
from skills.api import TOUCHES, Worker
from skills.class_forms import ANY_OBJECT
from skills.inputs.errors import InputError
from tests.benchmarks.harness import benchmark, for_each, quantile, share, tell
from tests.benchmarks.manipulation_room import CLASSES, LOOK_S, ROBOT, SECOND, SURFACES, TAKEN, TARGET, room
from tests.benchmarks.shapes import written_shape
from tests.project import core_skills

HELD_S, UPRIGHT_RAD, DISTURBED_M, DISTURBED_RAD, MOVED_M = 10.0, 0.26, 0.05, 0.35, 0.02
MOTION_WORK, GRASP_WORK = "plan arm motion", "plan grasp"
NEAR_SPOT_M = 0.05
OUTCOMES = {
    "lifted": "never lifted",
    "held_10s": "not held for ten seconds",
    "placed": "not on the second table",
    "placed_upright": "fell over on the second table",
}


def failure(trial):
    """Why a trial failed: the mission's cause, else what the truth denies; empty for a good one."""
    return trial.cause or next((words for key, words in OUTCOMES.items() if not getattr(trial, key)), "")


def near_upright(trial):
    """True if the object stands upright within 5 cm of the spot."""
    return bool(trial.placed_upright and trial.place_error_m is not None and trial.place_error_m <= NEAR_SPOT_M)


@dataclass
class Watch(RunVisitor):
    """Observer of the target: time off its support without a break, and from when the robot stood to the lift (s).

    As a visitor it stores where the place skill lowers the target last (m), and whether a pick-up claims to hold it.
    """

    simulation: Simulation
    pick_s: float | None = None
    lifted_since_s: float | None = None
    longest_s: float = 0.0
    spot_W: tuple[float, float] | None = None
    claimed: bool = False
    _due_s: float = 0.0
    _stands_since_s: float = 0.0
    _base_W: tuple[float, float] = (0.0, 0.0)

    def __call__(self, now_s):
        if now_s < self._due_s:
            return
        self._due_s = now_s + LOOK_S
        pose = self.simulation.true_pose(ROBOT)
        if math.dist((pose.x_m, pose.y_m), self._base_W) > MOVED_M:
            self._stands_since_s, self._base_W = now_s, (pose.x_m, pose.y_m)
        history = self.simulation.referee.objects[TARGET]
        if not (history._carried and history.holder is not None and not history._supported):
            self.lifted_since_s = None
            return
        self.pick_s = round(now_s - self._stands_since_s, 1) if self.pick_s is None else self.pick_s
        self.lifted_since_s = now_s if self.lifted_since_s is None else self.lifted_since_s
        self.longest_s = max(self.longest_s, now_s - self.lifted_since_s)

    def tick(self, progress):
        for checkpoint in (each for note in progress.notes.values() for each in note.checkpoints.values()):
            self.spot_W = checkpoint.get("spot_W", self.spot_W)

    def message(self, topic, message):
        if topic == TOUCHES:
            self.simulation.referee.expect_touch(ROBOT, message["until_s"])
        ends = topic == "transitions" and message["to"] == "SUCCESS" and ends_pick(message["node"])
        self.claimed = self.claimed or ends
        return message


def ends_pick(node):
    """True for the path id of a node whose success claims that the object is held."""
    return "grasp" in node.rsplit("/", 1)[-1] or node.endswith("in-hand/only-if")


@dataclass(frozen=True)
class TimedWorker:
    """Worker that notes the wall time (s) of each piece of work by its name, also of work that fails."""

    within: Worker
    spent_s: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))

    def submit(self, work, *, latency_s, name):
        return self.within.submit(lambda: self._timed(name, work), latency_s=latency_s, name=name)

    def sense(self, read, work, *, latency_s, name):
        def timed(given):
            return self._timed(name, lambda: work(given))

        return self.within.sense(read, timed, latency_s=latency_s, name=name)

    def _timed(self, name, work):
        begun_s = time.perf_counter()
        try:
            return work()
        finally:
            self.spent_s[name].append(round(time.perf_counter() - begun_s, 4))


def poses(simulation):
    plant, context = simulation.engine.world.plant, simulation.engine.context
    models = {name: plant.GetModelInstanceByName(name) for name in simulation.referee.objects}
    bodies = {name: plant.get_body(plant.GetBodyIndices(model)[0]) for name, model in models.items()}
    return {name: plant.EvalBodyPoseInWorld(context, body) for name, body in bodies.items()}


def tilt_rad(before, after):
    up = after.rotation().matrix() @ before.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))


def disturbed(before, after):
    """True if something else was pushed well away or knocked over."""
    moved = float(np.linalg.norm(after.translation() - before.translation()))
    return moved > DISTURBED_M or tilt_rad(before, after) > DISTURBED_RAD


def within(surface, X_WO):
    x, y, z = X_WO.translation()
    corners = np.array(surface.polygon_W)
    inside = np.all(corners.min(axis=0) <= [x, y]) and np.all([x, y] <= corners.max(axis=0))
    return bool(inside and surface.height_m - 0.02 < z < surface.height_m + 0.4)


def middle_W(simulation, X_WO):
    """Middle (3,) of the target's bounding box in its own frame, in the world."""
    plant = simulation.engine.world.plant
    body = plant.get_body(plant.GetBodyIndices(plant.GetModelInstanceByName(TARGET))[0])
    inspector = query_of(simulation).inspector()
    geometries = plant.GetCollisionGeometriesForBody(body)
    boxes = [(inspector.GetPoseInFrame(each), inspector.GetObbInGeometryFrame(each)) for each in geometries]
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
    corners = [X_OG @ box.pose() @ (signs * box.half_width()[:, None]) for X_OG, box in boxes if box is not None]
    corners_O = np.hstack(corners)
    return np.asarray(X_WO @ ((corners_O.min(axis=1) + corners_O.max(axis=1)) / 2.0))


def query_of(simulation):
    engine = simulation.engine
    return engine.world.scene.query_at(engine.world.plant.GetPositions(engine.context))


def place_error_m(spot_W, p_W):
    """Distance (m) along the surface from the spot that something was lowered on; None where it never was."""
    return None if spot_W is None else round(float(np.linalg.norm(np.asarray(spot_W) - p_W[:2])), 4)


def is_false_claim(claimed, *, lifted, held_s):
    """True if "holding" was claimed of what was never lifted, or never of what was held for long.

    What falls as it is lifted, and is not claimed, is reported rightly.
    """
    return (claimed and not lifted) or (not claimed and held_s >= HELD_S)


def cases(
    classes: tuple[str, ...] = CLASSES,
    models: Path | None = None,
    shapes: int = 0,
    surfaces: tuple[str, ...] = SURFACES,
    trials: int = 3,
    clutter: str = "0-4",
    seed: int = 1,
):
    """Class, surface, number of others, seed, and the folder of a model or the number of a shape.

    `trials` of each class over the surfaces in turn; the seed chooses the clutter.
    """
    for index in range(shapes):
        for number in range(trials):
            surface = surfaces[(index + number) % len(surfaces)]
            yield ANY_OBJECT, surface, 0, seed + index + 1000 * number, f"shape {seed + index}"
    low, _, high = clutter.partition("-")
    targets = [(name, "") for name in classes] if models is None else own(models)
    for class_name, model in targets if not shapes else ():
        for number in range(trials):
            others = int(np.random.default_rng([seed + number, 3]).integers(int(low), int(high or low) + 1))
            others = 0 if class_name == ANY_OBJECT else others
            yield class_name, surfaces[number % len(surfaces)], others, seed + number, model


def own(folder):
    """Class and folder of each imported object in a folder, or of the one that it is; `thing` for one without a class.

    Raises SystemExit.
    """
    folders = sorted(path.parent for path in folder.glob(f"*/{FACTS_FILE}"))
    folders = [folder] if (folder / FACTS_FILE).exists() else folders
    try:
        named = [(read_imported(each).class_name, str(each.resolve())) for each in folders]
    except InputError as error:
        raise SystemExit(str(error)) from error
    if not named:
        raise SystemExit(f"{folder}: there is no imported object; make one by `errand object import`")
    return [(class_name if class_name in CLASSES else ANY_OBJECT, each) for class_name, each in named]


def run_case(class_name, surface, clutter, seed, source, folder):
    others = np.random.default_rng([seed, 5]).choice([each for each in CLASSES if each != class_name], clutter)
    shape = source.startswith("shape ")
    model = written_shape(int(source.split()[1]), folder) if shape else Path(source) if source else None
    world = room(folder / "room", class_name, [str(each) for each in others], surface, seed, model)
    simulation = simulate(world, {ROBOT: only_robot(ROBOT, world)}, seed=seed, record=False)
    watch, before = Watch(simulation), poses(simulation)
    simulation.engine.observe(watch)
    commands = (
        f"Take [Nothing] to [{TAKEN}] and do [grasp] to [{class_name}]",
        "Take [Nothing] to [Nothing] and do [wait] to [12 second]",
        f"Take [{class_name}] to [{SECOND}] and do [Nothing] to [Nothing]",
    )
    steps = steps_of_commands([parse_command(each) for each in commands])
    mission = Mission(name="trial", world=str(world.folder), robot=ROBOT, steps=steps)
    tree = compile_mission(mission, knowledge=knowledge_of(world), registry=core_skills())
    entry = run_entry(simulation.robots[ROBOT], world, tree, start=simulation.starts[ROBOT])
    with LockStepWorker(simulation.clock) as lock_step:
        worker, settings = TimedWorker(lock_step), RunSettings(seed=seed, time_limit_s=600.0)
        clock = simulation.clock
        result = run([entry], clock=clock, worker=worker, visitors=[watch], settings=settings).worst
    after, target = poses(simulation), simulation.referee.objects[TARGET]
    p_W, lifted = middle_W(simulation, after[TARGET]), watch.pick_s is not None
    placed = target.resting and within(world.surfaces[SECOND], after[TARGET])
    trial = SimpleNamespace(
        name=class_name if model is None else model.name,
        model=str(place_objects(world, seed)[0].form.file),
        surface=surface,
        clutter=len(before) - 1,
        seed=seed,
        lifted=lifted,
        held_10s=watch.longest_s >= HELD_S,
        placed=placed,
        placed_upright=tilt_rad(before[TARGET], after[TARGET]) < UPRIGHT_RAD if placed else None,
        place_error_m=place_error_m(watch.spot_W, p_W) if placed else None,
        others_disturbed=sum(disturbed(before[name], after[name]) for name in before if name != TARGET),
        false_claim=is_false_claim(watch.claimed, lifted=lifted, held_s=watch.longest_s),
        collisions=len(simulation.referee.collisions),
        cause="" if result.outcome is Outcome.SUCCESS else f"{result.cause}: {result.message}",
        sim_time_s=round(simulation.clock.now(), 1),
        pick_s=watch.pick_s,
        planning_s=worker.spent_s[MOTION_WORK],
        grasp_planning_s=worker.spent_s[GRASP_WORK],
        ending=None,
    )
    if not failure(trial):
        return trial
    query = query_of(simulation)
    save_png(folder / "ending.png", render_view(query, best_view(query, p_W), (800, 600)))
    trial.ending = folder / "ending.png"
    return trial


def failures(trials):
    """A line for each class and cause with its number of failures, the commonest first."""
    counted = Counter((each.name, failure(each)) for each in trials if failure(each))
    return [f"{number:4}  {name:14} {cause}" for (name, cause), number in counted.most_common()]


def write_sheet(path, trials):
    """Writes a sheet of failed trials; returns a line about it. Raises OSError when it cannot be written."""
    shown = []
    for each in (each for each in trials if each.ending is not None):
        picture = cv2.cvtColor(cv2.imread(str(each.ending)), cv2.COLOR_BGR2RGB)
        caption = f"{each.name} {each.surface} {each.seed}: {failure(each)}"[:55]
        shown.append(Shown(caption, picture, Judged((), (), ())))
    if not shown:
        return f"no trial failed: {path} is not written"
    save_png(path, contact_sheet(shown))
    return f"{path}: {len(shown)} failed trials"


def summary(trials, sheet: Path | None = None):
    """Rates over all trials; tells the failures, and writes a sheet of them."""
    for line in [*failures(trials), *([] if sheet is None else [write_sheet(sheet, trials)])]:
        tell(line)

    def held(own):
        return share([each.held_10s for each in own])

    return {
        "runs": trials,
        "lifted_rate": share([each.lifted for each in trials]),
        "held_rate": held(trials),
        "placed_rate": share([each.placed for each in trials]),
        "upright_rate": share([each.placed_upright for each in trials if each.placed_upright is not None]),
        "placed_near_upright_rate": share(list(map(near_upright, trials))),
        "place_error_m_median": quantile([e.place_error_m for e in trials if e.place_error_m is not None], digits=4),
        "planning_s": spread([spent_s for each in trials for spent_s in each.planning_s]),
        "grasp_planning_s": spread([spent_s for each in trials for spent_s in each.grasp_planning_s]),
        "hit_rate": share([each.collisions > 0 or each.others_disturbed > 0 for each in trials]),
        "disturbed_rate": share([each.others_disturbed > 0 for each in trials]),
        "false_claims": sum(each.false_claim for each in trials),
        "by_class": for_each("name", held)(trials),
        "by_surface": for_each("surface", held)(trials),
        "causes": dict(Counter(each.cause for each in trials if each.cause).most_common()),
        "pick_s_median": quantile([each.pick_s for each in trials if each.pick_s is not None]),
    }


def spread(values):
    return {"median": quantile(values, digits=3), "p95": quantile(values, 0.95, 3)}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
