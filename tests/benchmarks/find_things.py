"""How often the detect skill finds what is there, and says of what is not there that it is absent; prints JSON.

    python -m tests.benchmarks.find_things [--flat 5] [--rooms 5] [--seed 1] [--true-boxes] [--jobs 1] [--out FOLDER]

Each placement puts held-out instances of some classes and distractors on a surface, stands the robot before it and asks
for one class that is there and one that is not. In the flat the whole plant runs; in generated rooms an arm that moves
as it is told carries a camera that renders the room, and `--true-boxes` gives it the boxes of a perfect detector.
"""

import math
import time
from dataclasses import replace

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from errand_train.dataset.compose import Placed, compose
from errand_train.dataset.lighting import random_lighting
from errand_train.dataset.objects import CLASSES, DISTRACTORS, instance, numbers
from errand_train.dataset.render import is_validation
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.views import View, camera_specs
from executive.app.prepare.placed_robots import shared_detector
from executive.app.prepare.worlds import open_world
from executive.testing.bench import SkillBench
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from plant.robots.spot.kind import spot_capabilities
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.api import Surface
from skills.detect.skill import Detect, DetectInputs
from skills.detection import Detector
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.localiser import ScanMatchingLocaliser
from skills.geometry import inside_polygon
from skills.grid_map import load_grid_map
from skills.robot import FrameTree, Image, Pose2D
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import ScriptedRobot, Start
from tests.benchmarks.flat_scene import SURFACES, FlatScene, surface_of, viewpoint_of
from tests.benchmarks.harness import benchmark, by, for_each, quantile, share
from tests.benchmarks.position_scenes import DepthStage, truths, well_seen

LYING_ABOUT = tuple(name for name in CLASSES if name not in ("person", "extinguisher"))
RIM_M, CLEAR_M, FRONT_M, STAND_OFF_M, REACH_M = 0.05, 0.05, 0.55, 0.92, 0.5
RIGHT_WITHIN_M, TRIES, ROOM_TRIES = 0.12, 200, 40
HEIGHTS_M, LEAST_ROOM_M = (0.35, 1.05), 0.4


def ask(world, bench, surface, name, places):
    """Asks for a class whose objects stand at some places, none where it is absent."""
    begun = time.perf_counter()
    run, off_m = bench.run(Detect, DetectInputs((name,), (surface,))), None
    if claimed := run.outcome == "success":
        seen = np.array(run.outputs["observation"].position_W)
        off_m = min((float(np.linalg.norm(seen - place)) for place in places), default=None)
    right = off_m is not None and off_m < RIGHT_WITHIN_M if places else not claimed and f"no {name} seen" in run.message
    asked = {"world": world, "class_name": name, "there": bool(places)}
    told = {"message": run.message, "wall_s": round(time.perf_counter() - begun, 1)}
    return asked | told | {"right": right, "claimed": claimed, "off_m": off_m}


def middle(placed):
    points = placed.model.surface.points
    return np.asarray(placed.X_WO @ (0.5 * (points.min(axis=0) + points.max(axis=0))))


def held_out_instance(rng, category):
    """A random instance of a category that served not in training."""
    return instance(str(category), int(rng.choice(numbers(str(category), for_training=False))))


def scattered(rng, models, surface, pose):
    """Objects laid on a surface where they fit, clear of each other and not too far from the robot."""
    corners, taken = np.asarray(surface.polygon_W), []
    for model in models:
        rest = choose_pose(rng, model, resting_poses(model))
        points = model.surface.points @ rest.R.T
        reach = float(np.linalg.norm(points[:, :2], axis=1).max())
        for _ in range(TRIES):
            xy, yaw = rng.uniform(corners.min(axis=0), corners.max(axis=0)), float(rng.uniform(0, 2 * np.pi))
            R = RotationMatrix.MakeZRotation(yaw).matrix()
            fits = bool(np.all(inside_polygon(xy + points[:, :2] @ R[:2, :2].T, surface.polygon_W, -RIM_M)))
            near = math.dist(xy, (pose.x_m, pose.y_m)) < STAND_OFF_M + FRONT_M + REACH_M
            if fits and near and all(np.linalg.norm(xy - other) > reach + size + CLEAR_M for other, size in taken):
                taken.append((xy, reach))
                turn = RotationMatrix.ProjectToRotationMatrix(R @ rest.R)
                yield Placed(model, RigidTransform(turn, [*xy, surface.height_m + rest.height_m]))
                break


def in_flat(seed, number):
    """One placement in the flat: two classes and three other objects on one surface."""
    rng, world = np.random.default_rng([seed, number, 11]), open_world("flat")
    surface = surface_of(str(rng.choice(SURFACES)))
    pose = viewpoint_of(rng, surface.name)
    classes = [str(each) for each in rng.permutation(LYING_ABOUT)]
    there, absent = classes[:2], classes[2]
    models = [held_out_instance(rng, each) for each in (*there, *rng.choice(DISTRACTORS, 3))]
    objects = list(scattered(rng, models, surface, pose))
    scene = FlatScene([(each.model.path, each.X_WO) for each in objects], [PlacedRobot("Alice", "spot", pose)])
    engine = Engine(scene.built, seed=seed * 1000 + number)
    bench = SkillBench(
        engine.robots["Alice"],
        engine,
        localiser=ScanMatchingLocaliser(load_grid_map(world.scan_map_path), pose),
        costmap=LayeredCostmap(load_grid_map(world.keepout_map_path)),
        detector=shared_detector(),
        seed=number,
    )
    for name in classes[:3]:
        places = [middle(each) for each in objects if each.model.category == name]
        if places or name == absent:
            yield ask("flat", bench, surface, name, places)


class TrueBoxes(Detector):
    """A perfect detector, to judge all that comes after it: the boxes of what the last picture shows."""

    class_names = CLASSES

    def __init__(self):
        self.latest = ()

    def detect(self, pictures):
        return [self.latest for _ in pictures]


class RoomRobot(ScriptedRobot):
    """A robot whose arm moves as it is told, in a rendered room. `boxes` is told what its pictures show."""

    def __init__(self, clock, stage, pose, seed, boxes):
        super().__init__(clock, capabilities=spot_capabilities(), start=Start(pose))
        self._stage, self._spec, self._X_WO, self._boxes = stage, camera_specs()["hand"], pose.transform(), boxes
        rng, lens = np.random.default_rng([seed, 5]), self._spec.intrinsics()
        self._degrade = PictureDegrader(rng, lens.height, lens.width, PictureNoise())
        self._degrade_depth = DepthDegrader(rng, lens, self._spec.depth_range_m, DepthNoise())

    def image(self, source, *, visual=True, depth=True):
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


def room_bench(stage, pose, detector, seed, number):
    clock, boxes = VirtualClock(), detector if isinstance(detector, TrueBoxes) else TrueBoxes()
    robot, place = RoomRobot(clock, stage, pose, seed, boxes), KnownPlace(pose)
    return SkillBench(robot, clock, localiser=place, costmap=BlockCostmap(), detector=detector, seed=number)


def in_room(seed, index, number, detector, folder):
    """One placement in a generated room: what the room's maker laid on one of its supports."""
    rng, scene, (surface, pose, objects) = room_of(seed, index)
    stage = DepthStage(replace(scene, held=None), random_lighting(rng, scene.room), folder, 1.0)
    bench = room_bench(stage, pose, detector, seed, number)
    absent = [name for name in LYING_ABOUT if name not in {each.model.category for each in scene.objects}]
    for name in list(dict.fromkeys(each.model.category for each in objects))[:2]:
        alike = [each for each in scene.objects if each.model.category == name and _lies_on(each, surface)]
        yield ask("room", bench, surface, name, [middle(each) for each in alike])
    if absent:
        yield ask("room", bench, surface, str(rng.choice(absent)), [])


def room_of(seed, index):
    """A generated room, and a support before which the robot can stand with objects of the classes on it, if any."""
    rng = np.random.default_rng([seed, index, 13])
    scene = compose(rng, index, for_training=False)
    return rng, scene, next(_choices(rng, scene), None)


def _choices(rng, scene):
    for k in rng.permutation(len(scene.room.supports)):
        support = scene.room.supports[k]
        if not HEIGHTS_M[0] < support.height_m < HEIGHTS_M[1] or support.room_m < LEAST_ROOM_M:
            continue
        c, s, (x, y), (a, b) = math.cos(support.yaw_rad), math.sin(support.yaw_rad), support.centre, support.half
        corners = tuple((x + c * u - s * v, y + s * u + c * v) for u, v in ((-a, -b), (a, -b), (a, b), (-a, b)))
        surface = Surface("support", corners, support.height_m)
        objects = [each for each in scene.objects if each.model.category in LYING_ABOUT and _lies_on(each, surface)]
        for pose in _stands(scene, support):
            near = [o for o in objects if math.dist(middle(o)[:2], (pose.x_m, pose.y_m)) < STAND_OFF_M + FRONT_M]
            if near:
                yield surface, pose, near


def _stands(scene, support):
    """Free poses before each side of a support."""
    width, depth, _ = scene.room.size_m
    for quarter in range(4):
        yaw = support.yaw_rad + 0.5 * math.pi * quarter
        ahead, off = np.array([math.cos(yaw), math.sin(yaw)]), support.half[quarter % 2] + STAND_OFF_M
        x, y = support.centre - off * ahead
        feet = [np.array([x, y]) + along * ahead for along in (0.0, 0.35, -0.35)]
        free = not any(_blocks(o.low, o.high, foot) for o in scene.room.obstacles for foot in feet)
        if 0.5 < x < width - 0.5 and 0.5 < y < depth - 0.5 and free:
            yield Pose2D(x, y, yaw)


def _blocks(low, high, foot):
    return bool(np.all(foot > low[:2] - 0.25) and np.all(foot < high[:2] + 0.25) and low[2] < 1.0)


def _lies_on(thing, surface):
    points = np.asarray(thing.X_WO @ thing.model.surface.points.T).T
    on = inside_polygon(middle(thing)[None, :2], surface.polygon_W)[0]
    return bool(on and abs(points[:, 2].min() - surface.height_m) < 0.03)


def cases(flat: int = 5, rooms: int = 5, seed: int = 1, true_boxes: bool = False):
    for number in range(flat):
        yield "flat", seed, 0, number, true_boxes
    number = 0
    for index in filter(is_validation, range(1, ROOM_TRIES * rooms + 1)):
        if number < rooms and room_of(seed, index)[2] is not None:
            yield "room", seed, index, number, true_boxes
            number += 1


def run_case(world, seed, index, number, true_boxes, folder):
    if world == "flat":
        return list(in_flat(seed, number))
    return list(in_room(seed, index, number, TrueBoxes() if true_boxes else shared_detector(), folder))


def summary(placements):
    asked = [each for placement in placements for each in placement]
    return {"summary": for_each("world", figures)(asked), "asked": asked}


def figures(asked):
    there, absent = ([each for each in asked if each.there is so] for so in (True, False))
    return {
        "there": len(there),
        "found": share([each.right for each in there]),
        "absent": len(absent),
        "reported_absent": share([each.right for each in absent]),
        "off_m_median": quantile([each.off_m for each in there if each.right and each.off_m is not None], digits=4),
        "found_by_class": {
            name: f"{sum(each.right for each in own)}/{len(own)}" for name, own in by(there, "class_name").items()
        },
    }


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
