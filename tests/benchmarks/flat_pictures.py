"""Labelled pictures of held-out objects in the world `flat`, as the robot's cameras show them in the plant.

`python -m tests.benchmarks.flat_pictures OUT --scenes 40 --seed 1` writes pictures and OUT/val.json, which
`errand dataset score --data OUT/val.json` reads. In each scene objects of the classes and others lie on four surfaces,
an extinguisher and a person stand on the floor; every tenth scene holds others only. Eight pictures are taken of each,
three in five by the hand camera, the rest by the body's cameras; noise and light are the plant's.

With `--foreign FOLDER` they are objects that others modelled (`foreign_models.py`), which are written to that folder;
`--scans STL_FOLDER` adds those that others scanned (`scanned_models.py`), `--gazebo-models FOLDER` Gazebo models
(`gazebo_models.py`). With `--drinks` only beers and cokes lie about.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_train.dataset.coco import document
from errand_train.dataset.compose import ONLY_DISTRACTORS_EVERY, Placed
from errand_train.dataset.objects import DISTRACTORS
from errand_train.dataset.render import label_view
from errand_train.dataset.resting import choose_pose, resting_poses
from errand_train.dataset.silhouette import project
from errand_train.dataset.views import (
    BODY_SHARE,
    STANDING_HEIGHT_M,
    View,
    camera_specs,
    distance_to,
    eye_about,
    off_centre,
    roll_deg,
)
from executive.app.prepare.worlds import knowledge_of, open_world
from plant.scene_pictures import look_at
from plant.sensors.noise import PictureDegrader, PictureNoise
from skills.grid_map import load_grid_map
from tests.benchmarks.find_things import LYING_ABOUT, held_out_instance, middle, scattered
from tests.benchmarks.flat_scene import FlatScene, surface_of, viewpoint_of
from tests.benchmarks.foreign_models import CATALOGUES, OTHERS, supplied
from tests.benchmarks.gazebo_models import gazebo
from tests.benchmarks.harness import command, tell
from tests.benchmarks.scanned_models import scanned

VIEWS, SURFACES_IN_USE, TRIES = 8, 4, 100
ROOM_FOR_FEET_M, ROOM_FOR_PEOPLE_M, APART_M = 0.45, 0.3, 0.8
HAND_HEIGHTS_M, REACH_M = (0.3, 1.5), 0.9
LEAST_SHOWN_PX = 40
DRINKS = ("beer", "coke")


HELD_OUT = SimpleNamespace(lying_about=LYING_ABOUT, others=DISTRACTORS, take=held_out_instance)
"""Source of objects: categories that may lie about, those of no class, and a random one of a category."""


def foreign_supply(folder, catalogues, scans, gazebo_models):
    """Objects that others modelled or, with a folder of `scans`, scanned, written to a folder."""
    models = supplied(folder, catalogues)
    for read, source in ((scanned, scans), (gazebo, gazebo_models)):
        for category, more in (read(folder, source) if source is not None else {}).items():
            models[category] = [*models.get(category, ()), *more]

    def take(rng, category):
        return models[category][int(rng.integers(len(models[category])))]

    lying_about = [name for name in LYING_ABOUT if name in models]
    return SimpleNamespace(lying_about=lying_about, others=(OTHERS,), take=take)


class Stage(FlatScene):
    def __init__(self, objects):
        super().__init__([(each.model.path, each.X_WO) for each in objects])
        self.objects = dict(zip(self.bodies, objects, strict=True))
        self.of_classes = {label: each for label, each in self.objects.items() if each.model.class_id}


def furnished(rng, free, supply, *, bare):
    """The flat with objects on some surfaces and on the floor; of no class if `bare`."""
    objects, names = [], sorted(knowledge_of(open_world("flat")).surfaces)
    for name in map(str, rng.choice(names, min(SURFACES_IN_USE, len(names)), replace=False)):
        pose = viewpoint_of(rng, name)
        classes = [] if bare else [str(each) for each in rng.choice(supply.lying_about, 3)]
        models = [supply.take(rng, str(each)) for each in (*classes, *rng.choice(supply.others, 2 + 3 * bare))]
        objects += scattered(rng, models, surface_of(name), pose)
    return Stage([*objects, *(() if bare else _on_the_floor(rng, free, supply))])


def _on_the_floor(rng, free, supply):
    taken = []
    for category in ("person", "extinguisher", str(rng.choice(supply.lying_about))):
        model = supply.take(rng, category)
        rest = choose_pose(rng, model, resting_poses(model))
        places = rng.permutation(_floor_points(free, ROOM_FOR_PEOPLE_M))
        xy = next((p for p in places if all(np.linalg.norm(p - other) > APART_M for other in taken)), None)
        if xy is None or model.kind == "sitting":
            continue
        taken.append(xy)
        turned = RotationMatrix.MakeZRotation(float(rng.uniform(0, 2 * np.pi))).matrix() @ rest.R
        yield Placed(model, RigidTransform(RotationMatrix.ProjectToRotationMatrix(turned), [*xy, rest.height_m]))


def _floor_points(free, room_m):
    known = np.ones_like(free.occupied) if free.unknown is None else ~free.unknown
    return free.centres(np.argwhere((free.distance > room_m) & known))


def views(rng, stage, free):
    """Views in which objects of the classes show, by turns; other objects where there are none."""
    targets = list(stage.of_classes) or list(stage.objects)
    order = rng.permutation(len(targets))
    floor = _floor_points(free, ROOM_FOR_FEET_M)
    for k in range(VIEWS):
        label = targets[order[k % len(order)]]
        thing = stage.objects[label]
        by_body = bool(rng.random() < BODY_SHARE)
        tried = (_body_view(rng, floor, thing) if by_body else _hand_view(rng, floor, thing) for _ in range(TRIES))
        view = next((each for each in tried if each is not None and _shows(stage, each, label)), None)
        if view is not None:
            yield view


def _shows(stage, view, label):
    """Whether an object shows in the picture; one of no class need only lie before the camera."""
    thing = stage.objects[label]
    aim = view.X_WC.inverse() @ middle(thing)
    u, v = project(np.asarray(aim)[None], view.intrinsics)[0]
    if aim[2] < 0.15 or not (0 <= u < view.intrinsics.width and 0 <= v < view.intrinsics.height):
        return False
    return not thing.model.class_id or int((stage.labels(view.X_WC, view.intrinsics) == label).sum()) >= LEAST_SHOWN_PX


def _hand_view(rng, floor, thing):
    """The hand before the object, within the reach of a robot that stands where there is room; None where there is not.

    The object is anywhere in the picture, from as near as fits in to where it is but some pixels long.
    """
    camera, aim = camera_specs()["hand"].intrinsics(), middle(thing)
    eye = eye_about(rng, thing, aim, camera.fx)
    body = np.linalg.norm(floor - eye[:2], axis=1).min()
    if not HAND_HEIGHTS_M[0] < eye[2] < HAND_HEIGHTS_M[1] or body > REACH_M:
        return None
    X_WC = off_centre(rng, look_at(eye, aim), camera, float(rng.normal(0, 0.05)))
    return View("hand", X_WC, camera, False, False)


def _body_view(rng, floor, thing):
    """The robot stands so that one of its body cameras looks about towards the object."""
    specs, aim = camera_specs(), middle(thing)
    spec = specs[str(rng.choice([name for name in specs if name != "hand"]))]
    camera, X_BC = spec.intrinsics(), spec.X_link_camera()
    wished = distance_to(rng, thing, camera.fx) + 0.3
    near = np.argsort(np.abs(np.linalg.norm(floor - aim[:2], axis=1) - wished))
    xy = floor[near[int(rng.integers(min(len(near), 50)))]]
    out_B = X_BC.rotation().matrix()[:, 2]
    yaw = float(np.arctan2(*(aim[:2] - xy)[::-1]) - np.arctan2(out_B[1], out_B[0]) + rng.normal(0, 0.35))
    X_WB = RigidTransform(RollPitchYaw(rng.normal(0, 0.02), rng.normal(0, 0.05), yaw), [*xy, STANDING_HEIGHT_M])
    return View(spec.name, X_WB @ X_BC, camera, not spec.colour, False)


def taken(rng, stage, view):
    """The picture (H, W, 3) RGB or (H, W) grey as the plant's camera gives it, and its labels."""
    lens, shrink = view.intrinsics, camera_specs()[view.camera].picture_shrink
    clean, labels = stage.colour(view.X_WC, lens), stage.labels(view.X_WC, lens)
    colour = PictureDegrader(rng, lens.height, lens.width, PictureNoise(), shrink).colour(clean)
    picture = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8) if view.grey else colour
    labelled = {label: (each.model, each.X_WO, False) for label, each in stage.of_classes.items()}
    return picture, label_view(labelled, labels, view, RigidTransform(), picture)


def shots(out, seed, scenes, supply):
    """Pictures written to a folder, with their entries; the same for the same seed."""
    free = load_grid_map(open_world("flat").surveyed.keepout_map_path)
    for index in range(scenes):
        rng = np.random.default_rng([seed, index, 17])
        bare = index % ONLY_DISTRACTORS_EVERY == ONLY_DISTRACTORS_EVERY - 1
        here = furnished(rng, free, supply, bare=bare)
        for number, view in enumerate(list(views(rng, here, free))):
            picture, labels = taken(rng, here, view)
            name = f"{index:04d}_{number}.png"
            if not cv2.imwrite(str(out / name), picture if view.grey else cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)):
                raise OSError(f"{out / name} cannot be written")
            facts = {"file_name": name, "width": view.intrinsics.width, "height": view.intrinsics.height}
            facts |= {"camera": view.camera, "grey": view.grey, "roll_deg": round(roll_deg(view.X_WC), 1)}
            yield {"image": {**facts, "scene": index, "split": "val"}, "annotations": labels}
        tell(f"scene {index + 1} of {scenes}")


def write(
    out: Path,
    scenes: int = 40,
    seed: int = 1,
    foreign: Path | None = None,
    catalogues: Path = CATALOGUES,
    scans: Path | None = None,
    gazebo_models: Path | None = None,
    drinks: bool = False,
):
    if (scans is not None or gazebo_models is not None) and foreign is None:
        raise SystemExit("--scans and --gazebo-models go with --foreign FOLDER, which models are written to")
    out.mkdir(parents=True, exist_ok=True)
    supply = HELD_OUT if foreign is None else foreign_supply(foreign, catalogues, scans, gazebo_models)
    if drinks:
        supply = SimpleNamespace(**{**vars(supply), "lying_about": DRINKS})
    every = list(shots(out, seed, scenes, supply))
    told = document({"description": "Errand: things in the flat", "seed": seed, "split": "val"}, every)
    (out / "val.json").write_text(json.dumps(told), encoding="utf-8")
    counted = sum(not label["ignore"] for shot in every for label in shot["annotations"])
    return {"pictures": len(every), "labels_that_count": counted}


if __name__ == "__main__":
    command(write)
