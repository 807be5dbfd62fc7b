"""How often the detect skill finds what is there, and says of what is not there that it is absent.

Run it by hand, it takes a while: `python -m tests.benchmarks.find_things --flat 20 --rooms 20 --seed 1`. Each placement
puts held-out instances of some classes and distractors on a surface, stands the robot before it and asks for one class
that is there and one that is not. In the flat the whole plant runs; in generated rooms an arm that moves as it is told
carries a camera that renders the room. Prints JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from errand_train.dataset.compose import Placed, Scene, compose
from errand_train.dataset.lighting import random_lighting
from errand_train.dataset.objects import CLASSES, DISTRACTORS, ObjectModel, instance, numbers
from errand_train.dataset.render import is_validation
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.room import Support
from errand_train.dataset.views import View, camera_specs
from executive.app.placed_robots import shared_detector
from executive.app.worlds import knowledge_of, open_world
from executive.testing.bench import SkillBench
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.engine import Engine
from plant.rendering import render_parameters
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import spot_capabilities
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.api import Detection, Detector, Surface
from skills.detect.skill import Detect, DetectInputs
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.grid_map import load_grid_map
from skills.estimate.localiser import ScanMatchingLocaliser
from skills.geometry import inside_polygon
from skills.robot import FrameTree, Image, Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start
from tests.benchmarks.position_scenes import DepthStage, truths, well_seen

LYING_ABOUT = tuple(name for name in CLASSES if name not in ("person", "extinguisher"))
SURFACES = ("coffee table", "sideboard", "dresser", "bathroom cabinet", "desk", "workbench", "kitchen counter")
RIM_M, CLEAR_M, FRONT_M = 0.05, 0.05, 0.55
STAND_OFF_M = 0.92
RIGHT_WITHIN_M = 0.12
HEIGHTS_M = (0.35, 1.05)


@dataclass(frozen=True)
class Asked:
    """One question and what came of it; `off_m` is how far from the true middle the object was said to be."""

    world: str
    placement: int
    class_name: str
    there: bool
    right: bool
    claimed: bool
    off_m: float | None
    message: str
    wall_s: float


def ask(
    bench: SkillBench, surface: Surface, name: str, places: Sequence[NDArray[np.float64]]
) -> tuple[bool, float | None, str]:
    """Whether an object of a class is claimed to be there, how far off the nearest true place, and what was said."""
    run = bench.run(Detect, DetectInputs((name,), (surface,)))
    if run.outcome != "success":
        return False, None, run.message
    seen = np.array(run.outputs["observation"].position_W)
    off = min((float(np.linalg.norm(seen - place)) for place in places), default=None)
    return True, off, run.message


def asked(
    world: str, number: int, bench: SkillBench, surface: Surface, name: str, places: Sequence[NDArray[np.float64]]
) -> Asked:
    """Ask for a class whose objects stand at some places, none where it is absent."""
    begun = time.perf_counter()
    claimed, off, message = ask(bench, surface, name, places)
    right = (
        claimed and off is not None and off < RIGHT_WITHIN_M if places else not claimed and f"no {name} seen" in message
    )
    return Asked(world, number, name, bool(places), right, claimed, off, message, round(time.perf_counter() - begun, 1))


def middle(placed: Placed) -> NDArray[np.float64]:
    """The middle of an object's bounding box in the world."""
    points = placed.model.surface.points
    return np.asarray(placed.X_WO @ (0.5 * (points.min(axis=0) + points.max(axis=0))))


def in_flat(seed: int, number: int) -> Iterator[Asked]:
    """One placement in the flat: two classes and three other objects on one surface."""
    rng = np.random.default_rng([seed, number, 11])
    world = open_world("flat")
    facts = knowledge_of(world).surfaces
    name = str(rng.choice(SURFACES))
    surface = Surface(name, tuple((float(x), float(y)) for x, y in facts[name].polygon), facts[name].height)
    view = facts[name].viewpoints[int(rng.integers(len(facts[name].viewpoints)))]
    pose = Pose2D(view.x, view.y, view.yaw)
    classes = [str(each) for each in rng.permutation(LYING_ABOUT)]
    there, absent = classes[:2], classes[2]
    models = [held_out_instance(rng, each) for each in (*there, *rng.choice(DISTRACTORS, 3))]
    objects = list(scattered(rng, models, surface, pose))
    loose = [LooseModel(f"thing{k}", thing.model.path, thing.X_WO, fixed=True) for k, thing in enumerate(objects)]
    built = build_diagram(
        DiagramConfig(
            directives=world.directives_path,
            models=loose,
            robots=[PlacedRobot("Alice", "spot", pose)],
            visuals=False,
            renderer_parameters=render_parameters(),
        )
    )
    engine = Engine(built, seed=seed * 1000 + number)
    bench = SkillBench(
        engine.robots["Alice"],
        engine,
        localiser=ScanMatchingLocaliser(load_grid_map(world.scan_map_path), pose),
        costmap=LayeredCostmap(load_grid_map(world.keepout_map_path)),
        detector=shared_detector(),
        seed=number,
    )
    for each in there:
        places = [middle(thing) for thing in objects if thing.model.category == each]
        if places:
            yield asked("flat", number, bench, surface, each, places)
    yield asked("flat", number, bench, surface, absent, [])


def held_out_instance(rng: np.random.Generator, category: str) -> ObjectModel:
    return instance(str(category), int(rng.choice(numbers(str(category), for_training=False))))


def scattered(
    rng: np.random.Generator, models: Sequence[ObjectModel], surface: Surface, pose: Pose2D
) -> Iterator[Placed]:
    """Objects laid on a surface where they fit, clear of each other and not too far from the robot."""
    corners = np.asarray(surface.polygon_W)
    taken: list[tuple[NDArray[np.float64], float]] = []
    for model in models:
        rest = choose_pose(rng, model, resting_poses(model))
        points = model.surface.points @ rest.R.T
        reach = float(np.linalg.norm(points[:, :2], axis=1).max())
        for _ in range(200):
            xy, yaw = rng.uniform(corners.min(axis=0), corners.max(axis=0)), float(rng.uniform(0, 2 * np.pi))
            outline = xy + points[:, :2] @ RotationMatrix.MakeZRotation(yaw).matrix()[:2, :2].T
            fits = bool(np.all(inside_polygon(outline, surface.polygon_W, -RIM_M)))
            near = float(np.hypot(*(xy - [pose.x_m, pose.y_m]))) < STAND_OFF_M + FRONT_M + 0.5
            if fits and near and all(np.linalg.norm(xy - other) > reach + size + CLEAR_M for other, size in taken):
                taken.append((xy, reach))
                turn = RotationMatrix.ProjectToRotationMatrix(RotationMatrix.MakeZRotation(yaw).matrix() @ rest.R)
                yield Placed(model, RigidTransform(turn, [*xy, surface.height_m + rest.height_m]))
                break


class TrueBoxes:
    """A perfect detector, to judge all that comes after it: the boxes of what the last picture shows."""

    class_names = CLASSES

    def __init__(self) -> None:
        self.latest: tuple[Detection, ...] = ()

    def detect(self, pictures: Sequence[NDArray[np.uint8]]) -> list[tuple[Detection, ...]]:
        """The same boxes for each picture."""
        return [self.latest for _ in pictures]


class RoomRobot(ScriptedRobot):
    """A robot whose arm moves as it is told, in a rendered room. `boxes` is told what its pictures show."""

    def __init__(self, clock: VirtualClock, stage: DepthStage, pose: Pose2D, seed: int, boxes: TrueBoxes) -> None:
        super().__init__(clock, capabilities=spot_capabilities(), start=Start(pose))
        self._stage, self._spec, self._X_WO = stage, camera_specs()["hand"], pose.transform()
        self._boxes = boxes
        rng, lens = np.random.default_rng([seed, 5]), self._spec.intrinsics()
        self._degrade = PictureDegrader(rng, lens.height, lens.width, PictureNoise())
        self._degrade_depth = DepthDegrader(rng, lens, self._spec.depth_range_m, DepthNoise())

    def image(self, source: str, *, visual: bool = True, depth: bool = True) -> Image:
        """A rendered picture."""
        edges = {"body": ("odom", self._X_OB()), "hand": ("body", self.arm.X_BH(self.q_rad))}
        frames = FrameTree({**edges, "hand_camera": ("hand", self._spec.X_link_camera())})
        lens = self._spec.intrinsics()
        view = View("hand", self._X_WO @ frames.pose("hand_camera"), lens, False, False)
        clean, labels, depth_m = self._stage.seen(view, self._spec.depth_range_m)
        self._boxes.latest = tuple(truth.detection for truth in truths(self._stage, labels, view) if well_seen(truth))
        colour = self._degrade.colour(clean)
        grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        stamp_s, noisy = self._clock.now(), self._degrade_depth.depth(depth_m, grey)
        return Image(stamp_s, source, "hand_camera", lens, lens, colour, grey, noisy, frames)


def in_room(seed: int, index: int, number: int, detector: Detector) -> Iterator[Asked]:
    """One placement in a generated room: what the room's maker laid on one of its supports; nothing where none fits."""
    rng = np.random.default_rng([seed, index, 13])
    scene = compose(rng, index, for_training=False)
    chosen = next((each for each in _choices(rng, scene)), None)
    if chosen is None:
        return
    surface, pose, objects = chosen
    with tempfile.TemporaryDirectory(prefix="errand-scene-") as folder:
        stage = DepthStage(replace(scene, held=None), random_lighting(rng, scene.room), Path(folder), 1.0)
        clock = VirtualClock()
        boxes = detector if isinstance(detector, TrueBoxes) else TrueBoxes()
        robot = RoomRobot(clock, stage, pose, seed, boxes)
        bench = SkillBench(
            robot, clock, localiser=KnownPlace(pose), costmap=BlockCostmap(), detector=detector, seed=number
        )
        categories = list(dict.fromkeys(thing.model.category for thing in objects))
        absent = [name for name in LYING_ABOUT if name not in {thing.model.category for thing in scene.objects}]
        for name in categories[:2]:
            alike = [thing for thing in scene.objects if thing.model.category == name and _lies_on(thing, surface)]
            yield asked("room", number, bench, surface, name, [middle(thing) for thing in alike])
        if absent:
            yield asked("room", number, bench, surface, str(rng.choice(absent)), [])


def _choices(rng: np.random.Generator, scene: Scene) -> Iterator[tuple[Surface, Pose2D, list[Placed]]]:
    """Supports before which the robot can stand, with the objects of the classes on them."""
    for k in rng.permutation(len(scene.room.supports)):
        support = scene.room.supports[k]
        if not HEIGHTS_M[0] < support.height_m < HEIGHTS_M[1] or support.room_m < 0.4:
            continue
        surface = Surface("support", tuple(_corners(support)), support.height_m)
        for pose in _stands(scene, support):
            objects = [t for t in scene.objects if t.model.category in LYING_ABOUT and _lies_on(t, surface)]
            near = [t for t in objects if math.hypot(*(middle(t)[:2] - [pose.x_m, pose.y_m])) < STAND_OFF_M + FRONT_M]
            if near:
                yield surface, pose, near


def _corners(support: Support) -> list[tuple[float, float]]:
    c, s = math.cos(support.yaw_rad), math.sin(support.yaw_rad)
    (x, y), (a, b) = support.centre, support.half
    return [(x + c * u - s * v, y + s * u + c * v) for u, v in ((-a, -b), (a, -b), (a, b), (-a, b))]


def _stands(scene: Scene, support: Support) -> Iterator[Pose2D]:
    """Free poses before each side of a support."""
    width, depth, _ = scene.room.size_m
    for quarter in range(4):
        yaw = support.yaw_rad + 0.5 * math.pi * quarter
        off = support.half[quarter % 2] + STAND_OFF_M
        x, y = support.centre[0] - off * math.cos(yaw), support.centre[1] - off * math.sin(yaw)
        inside = 0.5 < x < width - 0.5 and 0.5 < y < depth - 0.5
        feet = (
            np.array([x, y])
            + np.array([[0.0, 0.0], [0.35, 0.0], [-0.35, 0.0]]) @ [[math.cos(yaw), math.sin(yaw)], [0, 0]]
            if inside
            else None
        )
        if feet is not None and not any(_blocks(o.low, o.high, foot) for o in scene.room.obstacles for foot in feet):
            yield Pose2D(x, y, yaw)


def _blocks(low: NDArray[np.float64], high: NDArray[np.float64], foot: NDArray[np.float64]) -> bool:
    return bool(np.all(foot > low[:2] - 0.25) and np.all(foot < high[:2] + 0.25) and low[2] < 1.0)


def _lies_on(thing: Placed, surface: Surface) -> bool:
    points = np.asarray(thing.X_WO @ thing.model.surface.points.T).T
    on = inside_polygon(middle(thing)[None, :2], surface.polygon_W)[0]
    return bool(on and abs(points[:, 2].min() - surface.height_m) < 0.03)


def summary(results: Sequence[Asked]) -> dict[str, object]:
    """Shares of objects found and of absent objects reported absent, by world."""
    told: dict[str, object] = {}
    for world in sorted({each.world for each in results}):
        there = [each for each in results if each.world == world and each.there]
        absent = [each for each in results if each.world == world and not each.there]
        offs = [each.off_m for each in there if each.right and each.off_m is not None]
        told[world] = {
            "there": len(there),
            "found": round(float(np.mean([e.right for e in there])), 3) if there else None,
            "absent": len(absent),
            "reported_absent": round(float(np.mean([e.right for e in absent])), 3) if absent else None,
            "off_m_median": round(float(np.median(offs)), 4) if offs else None,
            "found_by_class": {name: _found_of(there, name) for name in sorted({e.class_name for e in there})},
        }
    return told


def _found_of(there: Sequence[Asked], name: str) -> str:
    """ "3/4"."""
    asked_for = [each for each in there if each.class_name == name]
    return f"{sum(each.right for each in asked_for)}/{len(asked_for)}"


def results(seed: int, flat: int, rooms: int, detector: Detector) -> Iterator[Asked]:
    """All placements, one after the other."""
    for number in range(flat):
        yield from in_flat(seed, number)
    number, index = 0, 0
    while number < rooms and index < 40 * rooms:
        index += 1
        if is_validation(index):
            here = list(in_room(seed, index, number, detector))
            yield from here
            number += bool(here)


def main() -> None:
    """Run the placements and print what came of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flat", type=int, default=5)
    parser.add_argument("--rooms", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--true-boxes", action="store_true", help="in the rooms, boxes of a perfect detector")
    args = parser.parse_args()
    every = []
    for each in results(args.seed, args.flat, args.rooms, TrueBoxes() if args.true_boxes else shared_detector()):
        every.append(each)
        told = "there" if each.there else "absent"
        sys.stderr.write(
            f"{each.world} {each.placement} {each.class_name} ({told}): {each.right} {each.wall_s} s: {each.message}\n"
        )
    sys.stdout.write(
        json.dumps({"summary": summary(every), "asked": [asdict(each) for each in every]}, indent=1) + "\n"
    )


if __name__ == "__main__":
    main()
