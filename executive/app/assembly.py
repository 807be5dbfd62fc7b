"""Puts a world, a simulation and the estimators together; the one place that knows the plant."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path

from executive.app.goal_conditions import Share, verdict_of
from executive.app.robots import PlacedRobot
from executive.run.outcome import RobotResult
from executive.run.visitor import RunEntry
from executive.tree.compiler import CompiledTree
from executive.words.variation import NO_VARIATION, Variation
from plant.referee import Verdict
from plant.simulation import Simulation
from plant.snapshot.file import SnapshotError
from plant.worlds.world import World, WorldError
from skills.detection import Detector
from skills.estimate.grid_map import load_grid_map
from skills.files.errors import InputError
from skills.perception.detector.network_file import ModelFileError
from skills.robot import Pose2D
from skills.stack import DetectorComponent, RobotStack, default_stack


def simulate(
    world: World,
    robots: Mapping[str, PlacedRobot],
    *,
    seed: int,
    record: bool,
    variation: Variation = NO_VARIATION,
    spared: Collection[str] = (),
) -> Simulation:
    """The plant of a world, objects set by the seed. Raises InputError when they do not fit into it."""
    logging.getLogger("drake").setLevel(logging.WARNING)  # Drake sets its own level when it is imported
    try:
        return Simulation(
            world,
            seed=seed,
            robots={name: robot.kind for name, robot in robots.items()},
            record=record,
            locomotion={name: robot.stack.locomotion for name, robot in robots.items()},
            starts={name: robot.start for name, robot in robots.items()},
            docks={name: robot.dock for name, robot in robots.items() if robot.dock is not None},
            variation=variation,
            spared=spared,
        )
    except WorldError as error:
        raise InputError(str(error)) from error


def run_entry(
    simulation: Simulation,
    world: World,
    tree: CompiledTree,
    stack: RobotStack | None = None,
    *,
    believed: Pose2D | None = None,
    told: bool = True,
) -> RunEntry:
    """The robot of a tree's name with the components of its stack.

    `believed` is where the robot believed to be before a restart; it looks for its place in a wide circle then. When it
    is not `told` where it stands either, it looks everywhere.

    Raises:
        InputError: there is no such robot, or the world's maps or the detector's model cannot be read.
    """
    stack = stack or default_stack()
    if tree.robot_name not in simulation.robots:
        known = ", ".join(simulation.robots)
        raise InputError(f"there is no robot '{tree.robot_name}' in {world.name}", hint=f"known: {known}")
    seen_from_m = simulation.robots[tree.robot_name].capabilities().lidar_height_m
    scan_map, keepout_map = load_grid_map(world.scan_map_seen_from(seen_from_m)), load_grid_map(world.keepout_map_path)
    start = believed or (simulation.starts[tree.robot_name] if told else None)
    try:
        localiser = stack.localiser.build(scan_map, start, surely=told and believed is None)
    except InputError as error:
        raise InputError(error.message, hint=error.hint, file=world.scan_map_path) from error
    return RunEntry(
        tree=tree,
        robot=simulation.robots[tree.robot_name],
        localiser=localiser,
        costmap=stack.costmap.build(keepout_map),
        detector=shared_detector(stack),
        stack=stack,
    )


def shared_detector(stack: RobotStack | None = None) -> Detector:
    """The detector of a stack, or the default one, loaded once in this process. Raises InputError."""
    return _built((stack or default_stack()).detector)


@cache
def _built(component: DetectorComponent) -> Detector:
    try:
        return component.build()
    except ModelFileError as error:
        raise InputError(error.message, hint=error.hint, file=error.file) from error


def take_up_plant(simulation: Simulation, path: Path, *, label: str | None) -> None:
    """Let the plant go on from the state that it keeps in a file. Raises InputError."""
    try:
        simulation.restore(path, label=label)
    except SnapshotError as error:
        raise InputError(str(error)) from error


def judge(
    simulation: Simulation,
    tree: CompiledTree,
    result: RobotResult,
    *,
    before: Sequence[Share] = (),
    since_s: float = 0.0,
) -> Verdict:
    """What the referee says of the mission's goal conditions, those included that other robots fulfilled `before`."""
    return verdict_of(tree, result, simulation.referee.judge, before=before, since_s=since_s)
