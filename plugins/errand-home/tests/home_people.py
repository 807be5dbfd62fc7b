"""Views of people in `home`: which pose, gesture and colour of clothes the robot perceives; figures as JSON.

    python plugins/errand-home/tests/home_people.py [--seed 1] [--people 20] [--jobs 1] [--out FOLDER]

Each seed draws a person with a pose, a gesture and clothes, at a free spot of the world or on a seat or bed. Each is
seen from three sides at two distances, by the camera of Spot's hand with its noise. `right` and `wrong` are shares of
the views by trait; the rest is not sure.
"""

import math
from pathlib import Path

import cv2
import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from errand_people.appearance import PICTURES_S, Look
from errand_people.looks import TRAITS
from executive.app.prepare.worlds import open_world
from executive.words.outlines import inside
from executive.words.variation import DAY_LIGHT
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.models.catalogue import load_catalogue
from plant.models.person_figure import CLOTHES, Figure, shade
from plant.people.ground import Ground
from plant.rendering import render_parameters
from tests.benchmarks.harness import benchmark
from tests.benchmarks.person_pictures import camera_pose, pictures

WORLD, DISTANCES_M, CAMERA_M, BEHIND_M, TRIES = "home", (1.75, 2.55), 1.0, 0.55, 2000
SIDES_RAD = ((-1.25, -0.6), (-0.35, 0.35), (0.6, 1.25))
CLEAR_M, PERSON_CLEAR_M, AWAY_M = 0.4, 0.45, 0.15
GESTURES = ("none", "waving", "raising_left_arm", "raising_right_arm", "pointing_left", "pointing_right")
POSTURES = {"standing": 0.5, "sitting": 0.3, "lying": 0.2}


def person_of(seed, world):
    """Figure and pose (x, y, yaw, z) of the person of a seed."""
    rng = np.random.default_rng([seed, 90])
    posture = str(rng.choice(list(POSTURES), p=list(POSTURES.values())))
    colour = list(CLOTHES)[int(rng.integers(len(CLOTHES)))]
    gesture = "none" if posture == "lying" else GESTURES[int(rng.integers(len(GESTURES)))]
    figure = Figure(posture, gesture, shade(colour, rng), float(rng.uniform(0.0, math.tau)))
    spots = [spot for rule in world.seed_rules.people for spot in rule.stands if spot.posture == posture]
    return rng, figure, colour, spots


def viewpoints(rng, ground, world, at, yaw_rad, posture):
    """Camera positions (x, y) from three sides at two distances; None when they are not all free."""
    room = next(outline for outline in world.rooms.values() if inside(outline, at))
    sides = SIDES_RAD if posture == "standing" else [(-1.3, 1.3)] * 3 if posture == "sitting" else [(-2.0, 2.0)] * 3
    found = []
    for distance_m in DISTANCES_M:
        for low_rad, high_rad in sides:
            for _ in range(30):
                away_m, bearing_rad = (
                    distance_m + rng.uniform(-AWAY_M, AWAY_M),
                    yaw_rad + rng.uniform(low_rad, high_rad),
                )
                step = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
                camera, body = at + away_m * step, at + (away_m + BEHIND_M) * step
                if all(inside(room, each) for each in (camera, body)) and ground._clear_m(body[None])[0] > CLEAR_M:
                    found.append(camera)
                    break
            else:
                return None
    return found


def scene_of(seed):
    """Diagram of the world with the person, the truth by trait, the person's place, and the camera positions."""
    world = open_world(WORLD)
    rng, figure, colour, spots = person_of(seed, world)
    empty = build_diagram(DiagramConfig(directives=world.directives_path, render=False))
    ground = Ground.from_plant(empty.plant, empty.scene_graph.model_inspector(), world.corners)
    (x0, y0), (x1, y1) = np.min(world.corners, axis=0), np.max(world.corners, axis=0)
    for _ in range(TRIES):
        if figure.posture == "standing":
            at, yaw_rad, z_m = np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)]), rng.uniform(-math.pi, math.pi), 0.0
            if ground._clear_m(at[None])[0] < PERSON_CLEAR_M:
                continue
        else:
            spot = spots[int(rng.integers(len(spots)))]
            at, yaw_rad, z_m = np.array([spot.x, spot.y]), spot.yaw, spot.z_m
        if not any(inside(outline, at) for outline in world.rooms.values()):
            continue
        if (cameras := viewpoints(rng, ground, world, at, yaw_rad, figure.posture)) is not None:
            break
    else:
        raise RuntimeError(f"no free views of a {figure.posture} person")
    path = load_catalogue()["person"].forms["standing"].path()
    X_WP = RigidTransform(RotationMatrix.MakeZRotation(yaw_rad), [*at, z_m])
    models = [LooseModel("person", path, X_WP, fixed=True, figure=figure)]
    parameters = render_parameters(DAY_LIGHT)
    built = build_diagram(DiagramConfig(world.directives_path, models, renderer_parameters=parameters))
    truth = {"pose": figure.posture, "gesture": figure.gesture, "clothes_colour": colour}
    return built, truth, at, cameras, rng


def cases(seed: int = 1, people: int = 20):
    """Seeds of the people."""
    return ((number,) for number in range(seed, seed + people))


def run_case(seed, folder: Path | None):
    """Looks at a person from all sides; returns what was seen in each view."""
    built, truth, at, cameras, rng = scene_of(seed)
    views = []
    for number, camera in enumerate(cameras):
        guess = at + rng.normal(0.0, 0.08, 2)
        p_W = np.array([*camera, CAMERA_M])
        begun_s = float(rng.uniform(0.0, 10.0))

        def look(height_m, p_W=p_W, guess=guess, begun_s=begun_s):
            X_WC = camera_pose(p_W, np.array([*guess, height_m]))
            return pictures(built, X_WC, [begun_s + each for each in PICTURES_S], rng)

        seen, first = Look(guess), None
        while (height_m := seen.next_height_m) is not None:
            images = look(height_m)
            first = images[0] if first is None else first
            seen.add(images, RigidTransform())
        found = seen.result
        told = {trait: getattr(found, trait) for trait in TRAITS}
        views.append(told)
        if folder is not None and told != truth:
            name = "-".join(str(told[trait]) for trait in TRAITS)
            cv2.imwrite(str(Path(folder) / f"{seed}-{number}-{name}.png"), first.colour[..., ::-1])
    return {"truth": truth, "views": views}


def summary(results):
    """Shares of right, wrong and unsure views by trait, and who was taken for what."""
    figures = {}
    for trait in TRAITS:
        pairs = [(getattr(each.truth, trait), getattr(view, trait)) for each in results for view in each.views]
        wrong = [pair for pair in pairs if pair[1] not in (None, pair[0])]
        figures[trait] = {
            "views": len(pairs),
            "right": round(sum(told == true for true, told in pairs) / len(pairs), 3),
            "wrong": round(len(wrong) / len(pairs), 3),
            "unsure": round(sum(told is None for _, told in pairs) / len(pairs), 3),
            "confused": [f"{true} as {told}" for true, told in wrong],
            "unsure_of": sorted(true for true, told in pairs if told is None),
        }
    return figures


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
