"""Answers to "is there a X on Y": right, wrong, or "I cannot tell"; prints JSON.

    python -m tests.benchmarks.questions [--placements 12] [--absent 4] [--seed 1] [--worlds flat,shop,lab]
        [--things beer,coke] [--scores-alone] [--foreign FOLDER] [--jobs 1] [--out FOLDER]

Each placement puts one shipped form of a class on a surface of a world, beside two forms of other classes; where X is
absent, three held-out objects of no class stand there. The robot stands at each viewpoint of the surface in turn, as in
the mission, until it finds X. `--scores-alone` leaves out the shapes in depth (ablation). With `--foreign` objects that
others modelled stand there instead, from a folder that `flat_pictures --foreign FOLDER` has written.
"""

import math
import time
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from errand_train.dataset.objects import DISTRACTORS
from errand_train.dataset.objects.model import read_model
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.testing.bench import SkillBench
from plant.engine import Engine
from plant.models.catalogue import load_catalogue
from plant.robots.robot_kind import PlacedRobot
from skills.detect.skill import Detect, DetectInputs
from skills.estimate.costmap import LayeredCostmap
from skills.estimate.localiser import ScanMatchingLocaliser
from skills.geometry import inside_polygon
from skills.grid_map import load_grid_map
from skills.perception.detector import Cascade
from tests.benchmarks.find_things import held_out_instance, middle, scattered
from tests.benchmarks.flat_scene import FlatScene, surface_of
from tests.benchmarks.foreign_models import OTHERS
from tests.benchmarks.harness import benchmark, quantile, tell

RIM_M, APART_M, TRIES, REACH_M = 0.06, 0.08, 300, 1.5
FORMS = [(name, form) for name, each in load_catalogue().items() if name != "person" for form in each.forms]


def laid(rng, chosen, surface, pose):
    """Shipped forms as they rest on a surface, clear of each other: class, file and pose of each."""
    corners, taken = np.asarray(surface.polygon_W), []
    for name, form in chosen:
        facts = load_catalogue()[name].forms[form]
        reach = math.hypot(*facts.half_extents_m)
        for _ in range(TRIES):
            xy, yaw = rng.uniform(corners.min(axis=0), corners.max(axis=0)), float(rng.uniform(0, 2 * np.pi))
            fits = inside_polygon(xy[None], surface.polygon_W, -RIM_M - 0.7 * reach)[0]
            near = math.dist(xy, (pose.x, pose.y)) < REACH_M
            if fits and near and all(np.linalg.norm(xy - p) > reach + r + APART_M for p, r in taken):
                taken.append((xy, reach))
                X_WO = RigidTransform(RotationMatrix.MakeZRotation(yaw), [*xy, surface.height_m + facts.rest_height_m])
                yield name, facts.path(), X_WO
                break


def cases(
    placements: int = 12,
    absent: int = 4,
    seed: int = 1,
    worlds: tuple[str, ...] = ("flat", "shop", "lab"),
    things: tuple[str, ...] = (),
    scores_alone: bool = False,
    foreign: Path | None = None,
):
    known = {name for name, _ in FORMS} if foreign is None else {*models_in(foreign)}
    for number in range(placements + absent):
        for k, (name, form) in enumerate(each for each in FORMS if each[0] in (things or known)):
            yield (
                name,
                form,
                number < placements,
                worlds[(k + number) % len(worlds)],
                seed,
                number,
                scores_alone,
                foreign,
            )


@cache
def models_in(folder):
    """The models in a folder by category."""
    models = [read_model(each.parent) for each in sorted(folder.glob("*/model.json"))]
    return {name: [each for each in models if each.category == name] for name in {each.category for each in models}}


def run_case(name, form, there, world, seed, number, scores_alone, foreign, folder):
    rng = np.random.default_rng([seed, number, FORMS.index((name, form)), 85])
    known = knowledge_of(open_world(world))
    surface = surface_of(str(rng.choice(sorted(known.tops))), world)
    views = known.surfaces[surface.name].viewpoints
    if foreign is not None:
        given = models_in(foreign)
        drawn = [
            given[each][int(rng.integers(len(given[each])))] for each in (name if there else OTHERS, OTHERS, OTHERS)
        ]
        placed = list(scattered(rng, drawn, surface, views[int(rng.integers(len(views)))].pose_2d()))
        models = [(each.model.path, each.X_WO) for each in placed]
        places = [middle(each) for each in placed if each.model.category == name]
    elif there:
        others = [FORMS[k] for k in rng.permutation(len(FORMS)) if FORMS[k][0] != name][:2]
        objects = list(laid(rng, [(name, form), *others], surface, views[int(rng.integers(len(views)))]))
        models, places = [(file, X) for _, file, X in objects], [X.translation() for n, _, X in objects if n == name]
    else:
        pose = views[int(rng.integers(len(views)))].pose_2d()
        held = [held_out_instance(rng, each) for each in rng.choice(DISTRACTORS, 3)]
        objects = list(scattered(rng, held, surface, pose))
        models, places = [(each.model.path, each.X_WO) for each in objects], []
    asked = SimpleNamespace(name=name, form=form, world=world, surface=surface.name, there=bool(places), number=number)
    if there and not places:
        return vars(asked) | {"answer": "did not fit", "message": "", "looks_s": 0.0, "busy_s": 0.0}
    begun = time.process_time()
    answer, message, looks_s = answered(world, surface, views, name, models, places, seed + number, scores_alone)
    tell(f"{world} {surface.name} {name} {form} there={there}: {answer}: {message}")
    return vars(asked) | {
        "answer": answer,
        "message": message,
        "looks_s": looks_s,
        "busy_s": round(time.process_time() - begun, 1),
    }


def answered(world, surface, views, name, models, places, seed, scores_alone):
    """Answer, message of the last look, and time of the looks in the plant (s)."""
    facts, doubts, spent_s = open_world(world), [], 0.0
    message = ""
    for view in views:
        pose = view.pose_2d()
        engine = Engine(FlatScene(models, [PlacedRobot("Alice", "spot", pose)], world).built, seed=seed)
        bench = SkillBench(
            engine.robots["Alice"],
            engine,
            localiser=ScanMatchingLocaliser(load_grid_map(facts.scan_map_path), pose),
            costmap=LayeredCostmap(load_grid_map(facts.keepout_map_path)),
            detector=Cascade(shapes=not scores_alone).build(),
            seed=seed,
        )
        begun_s = engine.now()
        run = bench.run(Detect, DetectInputs((name,), (surface,)))
        spent_s, message = spent_s + engine.now() - begun_s, run.message
        if run.outcome == "success":
            seen = np.array(run.outputs["observation"].position_W)
            right = any(np.linalg.norm(seen - place) < 0.15 for place in places)
            return "right yes" if right else "wrong yes", message, round(spent_s, 1)
        if f"no {name} seen" not in run.message:
            doubts.append(message)
    if doubts:
        return "cannot tell", doubts[0], round(spent_s, 1)
    return "wrong no" if places else "right no", message, round(spent_s, 1)


def summary(asked):
    asked = [each for each in asked if each.answer != "did not fit"]
    there, absent = ([each for each in asked if each.there is is_there] for is_there in (True, False))
    open_ones = [vars(each) for each in asked if "right" not in each.answer]
    return {"there": figures(there), "absent": figures(absent), "not_right": open_ones}


def figures(asked):
    kinds = ("right yes", "right no", "wrong yes", "wrong no", "cannot tell")
    counts = {kind.replace(" ", "_"): sum(each.answer == kind for each in asked) for kind in kinds}
    return {"asked": len(asked), **counts, "looks_s": quantile([each.looks_s for each in asked], digits=1)}


if __name__ == "__main__":
    benchmark(cases, run_case, summary)
