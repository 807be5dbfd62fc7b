"""The simulation: a world with robots, objects and people in motion, and the referee who sees the truth."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform

from executive.words.variation import NO_VARIATION, Variation, parse_light
from plant.diagram import LooseModel, build_diagram
from plant.engine import Engine
from plant.events import Moves
from plant.recording import LiveScene, Recorder, View, save_html
from plant.referee.referee import Referee
from plant.rendering import render_parameters
from plant.robots.robot_kind import LocomotionLimits
from plant.saved_state import State
from plant.snapshot_file import SnapshotWriter, read_snapshot, restore
from plant.worlds.seeding import Placement, place_clutter, place_objects, place_people
from plant.worlds.world import World
from skills.robot import FloatArray, Pose2D, Robot

REFEREE_PERIOD_STEPS = 4
SETTLING_S = 1.5


class Simulation:
    """A world with its robots at a seed: clock, robots, referee and, where wanted, a recording."""

    def __init__(
        self,
        world: World,
        *,
        seed: int,
        robots: Mapping[str, str] = MappingProxyType({"Alice": "spot"}),
        record: bool = False,
        visuals: bool = True,
        charge: float = 1.0,
        locomotion: Mapping[str, LocomotionLimits] = MappingProxyType({}),
        extra_models: Sequence[LooseModel] = (),
        starts: Mapping[str, Pose2D] = MappingProxyType({}),
        docks: Mapping[str, Pose2D] = MappingProxyType({}),
        variation: Variation = NO_VARIATION,
        spared: Collection[str] = (),
    ) -> None:
        """Builds the plant of `world`; things and people stand where the seed puts them.

        `robots` names the kind of each. They stand at their `starts`, one alone by default at the world's, and charge
        at their `docks`, by default the world's. Batteries begin at `charge` (0 to 1). `extra_models` stand in the
        world though no map knows them; `locomotion` limits what bears each robot. `variation` is how the world differs
        in light, clutter (of none of the classes in `spared`) and friction; its people stand in `world` already.
        Raises WorldError when the things do not fit into the world, or a person's route leads through something.
        Raises ValueError: a robot has no start.
        """
        self.seed, self.world, self.starts = seed, world, {**_default_starts(world, robots), **starts}
        if missing := robots.keys() - self.starts.keys():
            raise ValueError(f"there is no start for {', '.join(sorted(missing))}")
        own_docks = dict(docks) if world.dock is None else {name: docks.get(name, world.dock) for name in robots}
        things, people = place_objects(world, seed), place_people(world, seed)
        things += place_clutter(world, things, variation.clutter, seed, spared=spared)
        built = build_diagram(
            directives=world.directives_path,
            models=[
                *(_loose(each) for each in things),
                *(_person(each) for each in people),
                *extra_models,
            ],
            robots=robots,
            doors=world.doors,
            visuals=visuals,
            locomotion=locomotion,
            renderer_parameters=render_parameters(parse_light(variation.light)),
            friction=variation.friction,
        )
        self.engine = Engine(
            built,
            {name: self.starts[name] for name in robots},
            seed=seed,
            docks=own_docks,
            charge=charge,
            routes={each.name: each.route for each in people if each.route is not None},
            receiving={each.name: each.receiving for each in people if each.receiving is not None},
            doors=world.doors,
        )
        if world.moves:
            moves = Moves(built.plant, self.engine.context, world, things, seed=seed, tell=self.engine.note)
            moves.listen(self._moved)
            self.engine.moves = moves
        self.referee = Referee(
            built.plant,
            [*things, *people],
            robots={name: body.kind for name, body in built.robots.items()},
            persons=[each.name for each in people],
            scenery=built.scenery,
            doors=self.engine.doors.history,
        )
        self.recorder = Recorder(built, self.engine.context) if record else None
        self._watch()

    def _watch(self) -> None:
        self.referee.observe(self.engine.context, 0.0)
        self.engine.observe(self._referee_looks, every=REFEREE_PERIOD_STEPS)
        if self.recorder is not None:
            self.engine.observe(self.recorder)

    def _moved(self, name: str) -> None:
        self.referee.moved_by_others(name, self.engine.context, self.engine.now())

    def _referee_looks(self, now_s: float) -> None:
        self.referee.observe(self.engine.context, now_s, asleep=self.engine.asleep)

    @property
    def clock(self) -> Engine:
        """The only clock; advancing it steps the plant."""
        return self.engine

    @property
    def robots(self) -> Mapping[str, Robot]:
        """The robots by name."""
        return self.engine.robots

    def true_pose(self, robot_name: str) -> Pose2D:
        """Where a robot's body really is, for judging afterwards; no robot is told. Raises KeyError."""
        body = self.engine.world.robots[robot_name].body
        return Pose2D.from_transform(self.engine.world.plant.EvalBodyPoseInWorld(self.engine.context, body))

    def work(self) -> Mapping[str, int]:
        """What this process has had to do so far, by name: counts that the same run repeats, whatever the machine."""
        return {**self.engine.work, "contact_points": self.referee.contact_points}

    def keep_in(self, path: Path, *, label: str = "") -> Callable[[], None]:
        """Writes the whole state to a file now, once a second, and when what is given back is called.

        `label` says what it is for.
        """
        writer = SnapshotWriter(path, self.engine, self.referee, {**self._facts(), "label": label}, sorted(self.robots))
        writer()
        self.engine.after_advance(writer.when_due)
        return writer

    def restore(self, path: Path, *, label: str | None = "") -> None:
        """Takes up the state in a file, as after a power failure: nobody commands the robots, which come to a stop.

        With `label` None it may have been written for anything, and the referee begins a new chapter.

        Raises:
            SnapshotError: the file cannot be read, is damaged, or is that of another simulation.
        """
        facts = self._facts() if label is None else {**self._facts(), "label": label}
        restore(read_snapshot(path), self.engine, self.referee, facts)
        if label is None:
            self.referee.forget_past()
        self.engine.advance(SETTLING_S)

    def _facts(self) -> State:
        """What must be equal in the simulation that takes a state up."""
        plant = self.engine.world.plant
        return {
            "world": self.world.name,
            "seed": self.seed,
            "robots": sorted(self.robots),
            "positions": plant.num_positions(),
            "velocities": plant.num_velocities(),
        }

    def query_at(self, time_s: float) -> QueryObject:
        """The scene as it was recorded at a time, for pictures afterwards. Raises LookupError without a recording."""
        positions, scene = self._positions_at(time_s), self.engine.world.scene
        assert scene is not None
        return scene.query_at(positions)

    def hand_pose_at(self, robot_name: str, time_s: float) -> RigidTransform:
        """X_WH of a robot's hand as it was recorded at a time. Raises LookupError without a recording."""
        plant = self.engine.world.plant
        context = plant.CreateDefaultContext()
        plant.SetPositions(context, self._positions_at(time_s))
        return plant.EvalBodyPoseInWorld(context, self.engine.world.robots[robot_name].hand)

    def _positions_at(self, time_s: float) -> FloatArray:
        if self.recorder is None:
            raise LookupError("nothing was recorded: build the simulation with record=True")
        return np.asarray(self.recorder.at(time_s).positions)

    def show_live(self) -> LiveScene:
        """Shows the world in a browser from now on. Raises RuntimeError when no port is free."""
        scene = LiveScene(self.engine.world, self.engine.context, self._overview())
        self.engine.after_advance(lambda: scene(self.engine.now()))
        return scene

    def save_recording(self, path: Path) -> None:
        """Writes what was recorded as one HTML file. Raises LookupError when nothing was."""
        if self.recorder is None or not self.recorder.frames:
            raise LookupError("nothing was recorded: build the simulation with record=True and advance its clock")
        save_html(self.engine.world, self.recorder.frames, path, self._overview())

    def _overview(self) -> View:
        return View.over(self.world.corners)


def _loose(placement: Placement) -> LooseModel:
    return LooseModel(placement.name, placement.model_path, placement.X_WO)


def _person(placement: Placement) -> LooseModel:
    """Somebody who stands is welded to the world and costs nothing."""
    walks = placement.route is not None
    return replace(_loose(placement), fixed=not walks, slides=walks, receives=placement.receiving is not None)


def _default_starts(world: World, robots: Mapping[str, str]) -> Mapping[str, Pose2D]:
    """The world's start for a robot that is alone."""
    return dict.fromkeys(robots, world.start) if len(robots) == 1 else {}
