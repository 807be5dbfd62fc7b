"""How many household objects the robot recognises on the surfaces of `home`, among each other; prints JSON.

    python plugins/errand-home/tests/home_objects.py [--scenes 2] [--seed 1] [--strangers 0]

The seed places all objects, as it does in a run. From the first viewpoint of each surface, an arm that moves as it is
told looks for everything, through a camera with the plant's noise. `wrong` are claimed objects that do not stand there.
With `--strangers`, so many objects of the plant's own classes, which no model describes, stand among them.
"""

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from executive.app.prepare.worlds import knowledge_of, open_world
from plant.worlds.seeding import place_objects
from plant.worlds.world import ObjectRule
from skills.detect.skill import Detect, DetectInputs
from skills.detection import NoDetector
from skills.perception.model_matching import ModelDetector
from skills.perception.object_model import read_model
from tests.benchmarks.find_things import room_bench
from tests.benchmarks.flat_scene import FlatScene
from tests.benchmarks.harness import command, share, tell

NEAR_M = 0.05
KINDS = ("beer", "coke", "hammer", "screwdriver", "wrench", "cylinder", "cube")
"""Classes of the plant whose objects stand among the household's."""


class HomeStage(FlatScene):
    """The world with its objects, as the robot of a rendered room sees it."""

    labelled: Mapping[int, Any] = {}

    def seen(self, view, range_m):
        """Clean picture, labels and depth (m)."""
        lens = view.intrinsics
        return self.colour(view.X_WC, lens), self.labels(view.X_WC, lens), self.depth_m(view.X_WC, lens, range_m)


def look(stage, detector, knowledge, name, placed, seed):
    """Looks at a surface from each viewpoint; returns what stands there, what was found, and what was wrong."""
    facts, found = knowledge.surfaces[name], {}
    for view in facts.viewpoints:
        bench = room_bench(stage, view.pose_2d(), detector, seed, seed)
        run = bench.run(Detect, DetectInputs(tuple(knowledge.things), (facts.surface(name),), count=0))
        for each in run.outputs.get("observations", ()) if run.outcome == "success" else ():
            found[each.kind.name] = each
    there = {
        each.class_name: each.X_WO.translation()
        for each in placed
        if each.surface == name and each.class_name not in KINDS
    }
    near = {kind for kind in found if kind in there and math.dist(found[kind].position_W[:2], there[kind][:2]) < NEAR_M}
    return there, near, {*found} - near


def with_strangers(world, number, rng):
    """World with objects of other kinds on its surfaces."""
    names, tops = [*KINDS], [*world.seed_rules.fronts]
    rules = tuple(
        ObjectRule(name=f"stranger {k}", model=names[k % len(names)], surfaces=tuple(map(str, rng.permutation(tops))))
        for k in range(number)
    )
    objects = (*world.seed_rules.objects, *rules)
    return replace(world, seed_rules=world.seed_rules.model_copy(update={"objects": objects}))


def measure(scenes: int = 2, seed: int = 1, strangers: int = 0):
    """Looks at all surfaces with objects."""
    world = with_strangers(open_world("home"), strangers, np.random.default_rng([seed, 4]))
    knowledge = knowledge_of(world)
    detector = ModelDetector(NoDetector(), [read_model(each.folder) for each in world.imports.values()])
    asked, right, wrong = Counter[str](), Counter[str](), Counter[str]()
    for number in range(seed, seed + scenes):
        placed = place_objects(world, number)
        stage = HomeStage([(each.model_path, each.X_WO) for each in placed], world="home")
        for name in dict.fromkeys(each.surface for each in placed):
            begun = time.perf_counter()
            there, hit, false = look(stage, detector, knowledge, name, placed, number)
            asked.update([*there]), right.update(hit), wrong.update(false)
            missed = sorted({*there} - hit)
            wall_s = time.perf_counter() - begun
            tell(f"{number} {name}: {sorted(hit)}, missed {missed}, wrong {sorted(false)}, {wall_s:.0f} s")
    return {
        "objects": asked.total(),
        "found": share([n < right[kind] for kind in asked for n in range(asked[kind])]),
        "wrong": wrong.total(),
        "missed_by_object": {kind: asked[kind] - right[kind] for kind in asked if asked[kind] > right[kind]},
        "wrong_by_object": dict(wrong),
    }


if __name__ == "__main__":
    command(measure)
