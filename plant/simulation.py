"""The simulation: a moving world with robots, objects and people, and the referee who observes the true state."""

import gc
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform

from executive.words.variation import NO_VARIATION, Variation, parse_light
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.events import Moves
from plant.people.listeners import Listeners
from plant.recording import LiveScene, Recorder, Steps, View, save_html
from plant.referee.object_history import TakenPicture
from plant.referee.referee import Referee
from plant.rendering import render_parameters
from plant.robots.robot_kind import PlacedRobot
from plant.saved_state import State
from plant.snapshot_file import SnapshotWriter, read_snapshot, restore
from plant.worlds.seeding import Placement, place_clutter, place_objects, place_people
from plant.worlds.world import World
from skills.robot import FloatArray, Pose2D, Robot

REFEREE_PERIOD_STEPS = 4
SETTLING_S = 1.5


class Simulation:
    """A world with its robots, built from a seed: clock, robots, referee and, on request, a recording."""

    def __init__(
        self,
        world: World,
        *,
        seed: int,
        robots: Sequence[PlacedRobot] | None = None,
        record: bool = False,
        visuals: bool = True,
        extra_models: Sequence[LooseModel] = (),
        variation: Variation = NO_VARIATION,
        spared: Collection[str] = (),
    ) -> None:
        """Builds the plant of `world`; the seed places objects and people.

        Without `robots`, Alice the Spot stands at the world's start. `extra_models` are on no map. `variation` changes
        light, friction and clutter, which contains no class in `spared`; its people are part of `world` already. Raises
        WorldError when the objects do not fit into the world, or a person's route leads through an obstacle.
        """
        self.seed, self.world = seed, world
        robots = [PlacedRobot("Alice", "spot", world.start, world.dock)] if robots is None else robots
        self.starts = {robot.name: robot.start for robot in robots}
        objects, people = place_objects(world, seed), place_people(world, seed)
        objects += place_clutter(world, objects, variation.clutter, seed, spared=spared)
        built = build_diagram(
            DiagramConfig(
                directives=world.directives_path,
                models=[*map(_loose, objects), *map(_person, people), *extra_models],
                robots=robots,
                doors=world.doors,
                visuals=visuals,
                renderer_parameters=render_parameters(parse_light(variation.light)),
                friction=variation.friction,
            )
        )
        self.engine = self.clock = Engine(built, seed=seed)
        self.robots: Mapping[str, Robot] = self.engine.robots
        if world.moves:
            moves = Moves(built.plant, self.engine.context, world, objects, seed=seed, tell=self.engine.record_event)
            moves.listen(lambda name: self.referee.record_move(name, self.engine.context, self.engine.now()))
            self.engine.moves = moves
        self.referee = Referee(
            built.plant,
            [*objects, *people],
            robots={name: body.kind for name, body in built.robots.items()},
            persons=[each.name for each in people],
            scenery=built.scenery,
            doors=self.engine.doors.history,
        )
        self.referee.observe(self.engine.context, 0.0)
        self.engine.observe(self._referee_observes, every=REFEREE_PERIOD_STEPS)
        self.listeners = Listeners(built, self.engine.context, self.engine.doors, people, seed=seed)
        self.recorder = Recorder(built, self.engine.context) if record else None
        if self.recorder is not None:
            self.engine.observe(self.recorder)

    def _referee_observes(self, now_s: float) -> None:
        self.referee.observe(self.engine.context, now_s, asleep=self.engine.asleep)

    def true_pose(self, robot_name: str) -> Pose2D:
        """True pose of a robot's body, for judging afterwards. Raises KeyError for an unknown name."""
        body = self.engine.world.robots[robot_name].body
        return Pose2D.from_transform(self.engine.world.plant.EvalBodyPoseInWorld(self.engine.context, body))

    def record_picture(self, robot_name: str, camera: str, stamp_s: float) -> None:
        """Lets the referee record what a robot's camera sees now, before any fault, as the picture of time `stamp_s`.

        Raises KeyError or ValueError.
        """
        image, world = self.robots[robot_name].image(camera, visual=False), self.engine.world
        X_WB = world.plant.EvalBodyPoseInWorld(self.engine.context, world.robots[robot_name].body)
        X_WC = X_WB @ image.frames.pose(image.camera_frame, "body")
        taken = TakenPicture(robot_name, stamp_s, X_WC, image.depth_intrinsics, image.depth_m)
        self.referee.record_picture(taken)

    def work(self) -> Mapping[str, int]:
        """Counters of the work so far by name; the same run gives the same counts on any machine."""
        return {**self.engine.work, "contact_points": self.referee.contact_points}

    def save_snapshots(self, path: Path, *, label: str = "") -> Callable[[], None]:
        """Writes the whole state to a file now and once a second; the returned function writes it at once.

        `label` names the run to which the state belongs.
        """
        writer = SnapshotWriter(path, self.engine, self.referee, {**self._facts(), "label": label})
        writer()
        self.engine.after_advance(writer.write_if_due)
        return writer

    def restore(self, path: Path, *, label: str | None = "") -> None:
        """Restores the state in a file, as after a power failure: no command runs, and the robots come to a stop.

        With `label` None the state of any run is accepted, and the referee judges only later events. Raises
        SnapshotError when the file cannot be read, is damaged, or belongs to another simulation.
        """
        facts = self._facts() if label is None else {**self._facts(), "label": label}
        restore(read_snapshot(path), self.engine, self.referee, facts)
        if label is None:
            self.referee.forget_past()
        self.engine.advance(SETTLING_S)

    def _facts(self) -> State:
        """Facts that must be equal in the simulation that restores a snapshot."""
        plant = self.engine.world.plant
        return {
            "world": self.world.name,
            "seed": self.seed,
            "robots": sorted(self.robots),
            "positions": plant.num_positions(),
            "velocities": plant.num_velocities(),
        }

    def query_at(self, time_s: float) -> QueryObject:
        """Returns the scene at a recorded time, to render it afterwards. Raises LookupError without a recording."""
        positions, scene = self._positions_at(time_s), self.engine.world.scene
        assert scene is not None
        return scene.query_at(positions)

    def hand_pose_at(self, robot_name: str, time_s: float) -> RigidTransform:
        """Pose X_WH of a robot's hand at a recorded time. Raises LookupError without a recording."""
        plant = self.engine.world.plant
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, self._positions_at(time_s))
        return plant.EvalBodyPoseInWorld(context, self.engine.world.robots[robot_name].hand)

    def _positions_at(self, time_s: float) -> FloatArray:
        if self.recorder is None:
            raise LookupError("nothing was recorded: build the simulation with record=True")
        return np.asarray(self.recorder.frame_at(time_s).positions)

    def show_live(self) -> LiveScene:
        """Returns a live scene of the world, which is refreshed after each step."""
        scene = LiveScene(self.engine.world, self.engine.context, self._overview())
        self.engine.after_advance(scene)
        return scene

    def save_recording(self, path: Path, steps: Steps = MappingProxyType({})) -> None:
        """Writes the recording as one HTML file, with what each robot does. Raises LookupError without a recording."""
        if self.recorder is None:
            raise LookupError("nothing was recorded: build the simulation with record=True")
        self.recorder(self.engine.now())  # the only frame of a run that ends before its first step
        gc.disable()
        try:
            save_html(self.engine.world, self.recorder.frames, path, self._overview(), steps)
        finally:
            gc.collect()  # in this thread: Meshcat ends the process when another one frees it
            gc.enable()

    def _overview(self) -> View:
        return View.from_above(self.world.corners)


def _loose(placement: Placement) -> LooseModel:
    return LooseModel(placement.name, placement.model_path, placement.X_WO)


def _person(placement: Placement) -> LooseModel:
    """The model of a person; a standing person is welded to the world, at no cost in a step."""
    route, figure = placement.route, placement.figure
    return replace(_loose(placement), fixed=route is None, route=route, receiving=placement.receiving, figure=figure)
