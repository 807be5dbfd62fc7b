"""Views of people in `home`: which pose, gesture and colour of clothes the robot perceives; figures as JSON.

    python plugins/errand-home/tests/home_people.py [--seed 1] [--people 20] [--jobs 1] [--out FOLDER]

Each seed draws a person with a pose, a gesture and clothes, at a free spot of the world or on a seat or bed. Each is
seen from three sides at two distances, by the camera of Spot's hand with its noise. `right` and `wrong` are shares of
the views by trait; the rest is not sure.
"""

from pathlib import Path

import cv2
import numpy as np
from pydrake.math import RigidTransform

from errand_people.appearance import PICTURES_S, Look
from errand_people.looks import TRAITS
from tests.benchmarks.harness import benchmark
from tests.benchmarks.person_pictures import camera_pose, pictures, scene_of

CAMERA_M = 1.0


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
