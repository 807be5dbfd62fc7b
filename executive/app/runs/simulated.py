"""Simulated backend: robots with their estimators in the plant of a world, with people, referee and recorder."""

import logging
import math
import subprocess
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from executive.app.prepare.placed_robots import robot_stack, shared_detector
from executive.app.report.artifacts import Artifacts, draw_artifacts
from executive.app.runs.backend import Backend, Durable
from executive.app.runs.goal_conditions import Share, verdict_of
from executive.record.history import RECORDING
from executive.run.control import Control
from executive.run.control_state import OpenQuestion
from executive.run.outcome import RobotResult
from executive.run.visitor import Progress, RunEntry, RunVisitor
from executive.run.worker import WorkThread
from executive.tree.compiler import CompiledTree
from executive.words.goal import RefereeReport
from executive.words.schemas import POSE, SPEECH, TRUTH, pose_values
from executive.words.variation import NO_VARIATION, Variation
from plant.engine import Pipeline
from plant.recording import LiveScene
from plant.referee import Referee
from plant.robots.robot_kind import PlacedRobot
from plant.simulation import Simulation
from plant.snapshot_file import SnapshotError
from plant.worlds.world import World, WorldError
from skills.api import PICTURES, TOUCHES, Publish
from skills.compiled import distances
from skills.grid_map import load_grid_map, map_columns
from skills.inputs.errors import InputError
from skills.robot import Clock, Pose2D, Robot
from skills.stack import RobotStack, default_stack

_LOG: Final = logging.getLogger(__name__)
ANSWERS_AFTER_S: Final = 1.0
"""Time between a question and its answer, on the robots' clock."""


class SimulatedBackend(Backend):
    """Backend with robots in the plant of a world."""

    def __init__(
        self,
        world: World,
        robots: Mapping[str, PlacedRobot],
        *,
        seed: int,
        record: bool,
        variation: Variation = NO_VARIATION,
        spared: Collection[str] = (),
    ) -> None:
        """Builds the plant; the seed places the objects. Raises InputError if robots or objects do not fit."""
        self._world, self._robots, self._record = world, robots, record
        self._simulation = simulate(world, robots, seed=seed, record=record, variation=variation, spared=spared)
        self._steps = WorkThread("errand-plant")
        self._pipeline = Pipeline(self._simulation.engine, self._steps.do)
        self._keep: Callable[[], None] | None = None

    @property
    def clock(self) -> Clock:
        """The plant's clock, which steps it."""
        return self._pipeline

    @property
    def referee(self) -> Referee:
        """The plant's referee."""
        return self._settled().referee

    def _settled(self) -> Simulation:
        """Returns the simulation after the step under way is finished."""
        self._pipeline.settle()
        return self._simulation

    def entry(self, tree: CompiledTree, durable: Durable | None) -> RunEntry:
        """Returns the robot with its estimators; with `durable` the plant's state is stored or resumed."""
        robot = self._robots.get(tree.robot_name)
        if robot is None:
            hint = f"known: {', '.join(self._robots)}"
            raise InputError(f"there is no robot '{tree.robot_name}' in {self._world.name}", hint=hint)
        known, believed = robot.start_known, None
        if durable is not None:
            known, believed = robot.start_known and not durable.take_up, durable.poses.get(tree.robot_name)
        start = believed or (self._simulation.starts[tree.robot_name] if known else None)
        simulated, stack = self._simulation.robots[tree.robot_name], robot_stack(robot)
        entry = run_entry(simulated, self._world, tree, stack, start=start, surely=known and believed is None)
        if durable is not None:
            durable.journals[tree.robot_name].keep_world = self._world_keeper(durable)
        return replace(entry, robot=self._pipeline.robots[tree.robot_name])

    def _world_keeper(self, durable: Durable) -> Callable[[], None]:
        """Returns a function that stores the plant's state; first restores an earlier state if `durable` says so.

        Raises InputError if that state cannot be restored.
        """
        if self._keep is None:
            if durable.take_up:
                try:
                    self._simulation.restore(durable.plant, label=durable.take_up_label)
                except SnapshotError as error:
                    raise InputError(str(error)) from error
            keep = self._simulation.save_snapshots(durable.plant, label=durable.label)

            def keep_settled() -> None:
                self._pipeline.settle()
                keep()

            self._keep = keep_settled
        return self._keep

    def happened(self) -> Sequence[tuple[float, str]]:
        """Events of doors, people and moved objects, as times (s) and sentences."""
        return self._pipeline.events

    def visitors(self, control: Control, log: Publish) -> Sequence[RunVisitor]:
        """Returns the people of the plant, who hear the robots and answer, and the logger of the true poses."""
        return Bystanders(self._simulation, self._pipeline, control), TruthLog(self._pipeline, log)

    def work(self) -> Mapping[str, int]:
        """The plant's work counters by name."""
        return self._settled().work()

    def show_live(self) -> LiveScene:
        """Starts the plant's live picture."""
        return self._simulation.show_live()

    def judge(
        self, tree: CompiledTree, result: RobotResult, *, before: Sequence[Share] = (), since_s: float = 0.0
    ) -> RefereeReport:
        """Returns the report of the plant's referee."""
        verdict = verdict_of(tree, result, self._settled().referee.judge, before=before, since_s=since_s)
        return replace(verdict, events=self._simulation.referee.events)

    def hurry(self) -> None:
        """Leaves few frames in the recording."""
        if (recorder := self._settled().recorder) is not None:
            recorder.shorten()

    def leave(self, artifacts: Artifacts, out: Path) -> Path | None:
        """Writes recording and pictures of a recorded run; returns the recording's path."""
        if not self._record:
            return None
        recording = out / RECORDING
        self._settled().save_recording(recording, artifacts.steps)
        draw_artifacts(artifacts, self._simulation, sorted(self._robots), out)
        return recording


def kernels_folder(cache: Path | None = None) -> tuple[Path, bool]:
    """Returns the folder of compiled code, and whether it has any; `cache` is by default numba's."""
    folder = cache or Path(distances.machine_code.stats.cache_path)  # type: ignore[attr-defined]
    return folder, any(folder.glob("compiled.distances-*.nbi"))


def compile_first(cache: Path | None = None) -> None:
    """Runs `errand warm-up` with a warning if the numeric code is not compiled for this machine."""
    if kernels_folder(cache)[1]:
        return
    _LOG.warning("errand: compiles its numeric code for this machine, once; that takes about half a minute")
    subprocess.run([sys.executable, "-m", "executive.cli", "warm-up"], stdout=subprocess.DEVNULL, check=False)


def simulate(
    world: World,
    robots: Mapping[str, PlacedRobot],
    *,
    seed: int,
    record: bool,
    variation: Variation = NO_VARIATION,
    spared: Collection[str] = (),
) -> Simulation:
    """Builds the plant of a world, whose cameras are rendered in a forked process; the seed places the objects.

    Raises InputError if robots or objects do not fit.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)  # Drake sets its own level when it is imported
    try:
        simulation = Simulation(
            world,
            seed=seed,
            robots=[replace(robot, locomotion=robot_stack(robot).locomotion) for robot in robots.values()],
            record=record,
            variation=variation,
            spared=spared,
        )
    except WorldError as error:
        raise InputError(str(error)) from error
    if (scene := simulation.engine.world.scene) is not None:
        scene.render_aside()
    return simulation


def run_entry(
    robot: Robot,
    world: World,
    tree: CompiledTree,
    stack: RobotStack | None = None,
    *,
    start: Pose2D | None = None,
    surely: bool = True,
) -> RunEntry:
    """Returns a robot with the components of its stack and the maps of a world.

    With `surely` the robot localises at `start`, else in a wide circle around it; without a start on the whole map.

    Raises:
        InputError: the world's maps or the detector's model cannot be read.
    """
    stack = stack or default_stack()
    seen_from_m = robot.capabilities().lidar_height_m
    scan_map, keepout_map = load_grid_map(world.scan_map_seen_from(seen_from_m)), load_grid_map(world.keepout_map_path)
    scan_maps = [load_grid_map(path) for path in world.scan_map_paths]
    try:
        localiser = stack.localiser.build(scan_map, start, surely=surely and start is not None)
    except InputError as error:
        raise InputError(error.message, hint=error.hint, file=world.scan_map_path) from error
    return RunEntry(
        tree=tree,
        robot=robot,
        localiser=localiser,
        costmap=stack.costmap.build(keepout_map),
        detector=shared_detector(stack, world, tree.tags),
        stack=stack,
        solid_columns=map_columns(scan_maps, tree.surfaces),
    )


class TruthLog(RunVisitor):
    """Logger of the true pose beside each estimated pose. It tells the log alone, so that no skill learns the truth."""

    def __init__(self, pipeline: Pipeline, log: Publish) -> None:
        self._pipeline, self._log = pipeline, log

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Logs a robot's true pose, and the error of its estimated position in the plane."""
        if topic == POSE:
            true = pose_values(self._pipeline.poses_W[message["robot"]])
            off_m = math.hypot(*(true["position"][axis] - message["pose"]["position"][axis] for axis in "xy"))
            head = {key: message[key] for key in ("timestamp", "frame_id", "robot")}
            self._log(TRUTH, {**head, "pose": true, "error_m": round(off_m, 4)})
        return message


class Bystanders(RunVisitor):
    """Visitor that lets people near the robots hear and answer; a question that nobody hears stays open."""

    def __init__(self, simulation: Simulation, pipeline: Pipeline, control: Control) -> None:
        """`control` receives the answers and remarks; the `pipeline` steps the simulation."""
        self._simulation, self._pipeline, self._control = simulation, pipeline, control
        self._heard: dict[tuple[str, str, float], tuple[float, str | None]] = {}
        self._told = len(pipeline.words)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Passes a robot's speech to the people near it; its pictures and expected touches to the referee."""
        if topic == TOUCHES:
            self._pipeline.settle()
            self._simulation.referee.expect_touch(str(message["robot"]), float(message["until_s"]))
        if topic == PICTURES and "of" in message:
            self._pipeline.settle()
            robot, camera, stamp_s = message["robot"], message["camera"], message["stamp_s"]
            self._simulation.record_picture(str(robot), str(camera), float(stamp_s))
        if topic == SPEECH and not self._simulation.engine.walkers.still:
            self._pipeline.settle()
            robot, walkers = str(message["robot"]), self._simulation.engine.walkers
            walkers.hear(robot)
            if "may i pass" in str(message["text"]).casefold():
                walkers.let_pass(robot, self._simulation.listeners.hearer(robot))
        return message

    def tick(self, progress: Progress) -> None:
        """Passes on what people say, and their answers to open questions."""
        words = self._pipeline.words
        for _, _, said in words[self._told :]:
            self._control.tell(said)
        self._told = len(words)
        for each in self._control.state.questions:
            self._hear(each, progress.now_s)

    def _hear(self, each: OpenQuestion, now_s: float) -> None:
        """Finds the person who hears a new question; passes on that person's answer after a while."""
        key, question = (each.id, each.question.text, each.until_s), each.question
        if key not in self._heard:
            self._pipeline.settle()
            self._heard[key] = (now_s, self._simulation.listeners.hearer(each.robot) if each.robot else None)
        since_s, person = self._heard[key]
        if person is None or now_s < since_s + ANSWERS_AFTER_S - 1e-6:
            return
        self._heard[key] = (since_s, None)
        answer = self._simulation.listeners.answer(person, question.text, question.options)
        if answer is not None:
            with suppress(ValueError):  # somebody else has answered
                self._control.answer(each.id, answer, spoken=True)
