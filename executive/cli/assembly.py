"""Puts a world, a simulation and the estimators together; the one place that knows the plant."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

from executive.cli.detector_choice import detector_of
from executive.cli.goal_conditions import promises_of
from executive.mission.errors import InputError
from executive.run.outcome import RobotResult
from executive.run.runner import RunEntry
from executive.tree.check import Abilities, PlannedWays
from executive.tree.compiler import CompiledTree
from plant.models.catalogue import load_catalogue
from plant.referee import Verdict
from plant.simulation import Simulation
from plant.snapshot.file import SnapshotError
from plant.spot.capabilities import spot_capabilities
from plant.worlds.world import World, WorldError
from skills.detect.attributes import known_attributes
from skills.detection import Detector
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import GridMap, MapError, load_grid_map
from skills.estimate.localiser import LocaliserOptions, ScanMatchingLocaliser
from skills.navigate.footprint import Footprint
from skills.perception.detector.augmentation import AugmentedDetector
from skills.perception.detector.cascade_files import MODEL_FILE
from skills.perception.detector.onnx_detector import DetectorOptions
from skills.robot import Pose2D

UNSURE_SIGMA = (0.5, 0.5, 0.3)
UNSURE_RADIUS_M = 4.0
LIFT_KG = 5.0
"""What Spot's arm lifts continuously at half a metre, by its data sheet."""


def simulate(world: World, *, seed: int, robot_name: str, record: bool) -> Simulation:
    """The plant of a world, things set by the seed. Raises InputError when they do not fit into it."""
    try:
        return Simulation(world, seed=seed, robot_names=(robot_name,), record=record)
    except WorldError as error:
        raise InputError(str(error)) from error


def run_entry(simulation: Simulation, world: World, tree: CompiledTree, *, believed: Pose2D | None = None) -> RunEntry:
    """The robot of a tree's name with its estimators.

    `believed` is where the robot believed to be before a restart; it looks for its place in a wide circle then.

    Raises:
        InputError: there is no such robot, or the world's maps or the detector's model cannot be read.
    """
    if tree.robot_name not in simulation.robots:
        known = ", ".join(simulation.robots)
        raise InputError(f"there is no robot '{tree.robot_name}' in {world.name}", mend=f"known: {known}")
    try:
        scan_map, keepout_map = load_grid_map(world.scan_map_path), load_grid_map(world.keepout_map_path)
    except (MapError, OSError) as error:
        raise InputError(str(error)) from error
    return RunEntry(
        tree=tree,
        robot=simulation.robots[tree.robot_name],
        localiser=_localiser(scan_map, world.start, believed),
        costmap=LayeredCostmap(keepout_map),
        detector=shared_detector(),
    )


@cache
def shared_detector() -> Detector:
    """The one detector of this process, loaded at the first call. Raises InputError when its model cannot be used."""
    return AugmentedDetector(detector_of(MODEL_FILE, DetectorOptions()))


def _localiser(scan_map: GridMap, start: Pose2D, believed: Pose2D | None) -> ScanMatchingLocaliser:
    if believed is None:
        return ScanMatchingLocaliser(scan_map, start)
    usual = LocaliserOptions()
    wide = LocaliserOptions(
        height_band_m=scan_map.height_band_m or usual.height_band_m,
        initial_sigma=UNSURE_SIGMA,
        search_radius_m=UNSURE_RADIUS_M,
    )
    return ScanMatchingLocaliser(scan_map, believed, wide)


def take_up_plant(simulation: Simulation, path: Path, *, label: str | None) -> None:
    """Let the plant go on from the state that it keeps in a file. Raises InputError."""
    try:
        simulation.restore(path, label=label)
    except SnapshotError as error:
        raise InputError(str(error)) from error


def judge(simulation: Simulation, tree: CompiledTree, result: RobotResult) -> Verdict:
    """What the referee says of the mission's goal conditions."""
    verdict: Verdict = simulation.referee.judge(promises_of(tree, result))
    return verdict


def itinerary_of(world: World) -> PlannedWays:
    """Ways on a world's surveyed map, for the robot's footprint. Raises InputError when the map cannot be read."""
    try:
        keepout_map = load_grid_map(world.keepout_map_path)
    except (MapError, OSError) as error:
        raise InputError(str(error)) from error
    return PlannedWays(LayeredCostmap(keepout_map), Footprint.of(spot_capabilities()))


@cache
def abilities_of() -> Abilities:
    """What the robot can lift, and what the things weigh that there are models of."""
    masses = {name: _mass_kg(one.path()) for name, one in load_catalogue().items() if one.file is not None}
    return Abilities(masses, LIFT_KG, frozenset(shared_detector().class_names), known_attributes())


def _mass_kg(sdf: Path) -> float:
    """The mass of a model, all its links together."""
    return sum(float(mass.text or 0.0) for mass in ElementTree.parse(sdf).iter("mass"))
