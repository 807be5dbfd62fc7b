"""The rooms of the manipulation benchmark: one place to take things from, one to put them on, set by a seed."""

from pathlib import Path
from string import Template

import numpy as np
import yaml

from errand_train.worlds.__main__ import build
from errand_train.worlds.plan import Plan
from plant.diagram import OWN_PACKAGE
from plant.models.catalogue import read_imported
from plant.worlds.seeding import place_objects
from plant.worlds.world import WorldError, load_world

CLASSES = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "cylinder", "cube")
SURFACES = ("table", "shelf", "floor")
ROBOT, TARGET, LOOK_S = "Alice", "target", 0.1
TAKEN, SECOND, PERSON = "bench", "side table", "Robin"
TEMPLATE = Template(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))


def room(folder, class_name, others, surface, seed, model=None, *, person=False):
    """A room with an object called `target` of a class, and others, on a surface; its heights come from the seed.

    The target is one of the catalogue's, or the imported one in the folder `model`. The last of the `others` are left
    out where they do not fit. A `person` stands at the right of the start.
    """
    rng = np.random.default_rng([seed, SURFACES.index(surface)])
    if surface == "table":
        height, depth, from_edge = rng.uniform(0.40, 0.92), rng.uniform(0.6, 0.8), [0.08, 0.25]
    elif surface == "shelf":
        height, depth, from_edge = rng.integers(1, 3) * (1.285 - 0.025) / 3 + 0.025, 0.36, [0.08, 0.20]
    else:
        height, depth, from_edge = 0.01, 0.9, [0.2, 0.7]
    front = 4.35 - depth
    drawn = {"height": round(height, 3), "depth": depth, "front": front, "before": round(front - 0.92, 3)}
    told = yaml.safe_load(TEMPLATE.substitute(drawn, from_edge=from_edge))
    furniture = {"bench": told["places"].get(surface), "second_table": told["second_table"]}
    furniture = {name: piece for name, piece in furniture.items() if piece is not None}
    build(Plan.model_validate({**told["plan"], "furniture": furniture}), folder, OWN_PACKAGE, "map")
    knowledge = {
        **told["knowledge"],
        "things": {name: {"aliases": [], "categories": [], "usual": [TAKEN]} for name in CLASSES},
        "people": {PERSON: {"aliases": [], "at": "room"}} if person else {},
    }
    (folder / "knowledge.yaml").write_text(yaml.safe_dump(knowledge, sort_keys=False), encoding="utf-8")
    target = class_name if model is None else read_imported(model).name
    imports, people = [] if model is None else [str(model.resolve())], [told["person"]] if person else []
    rules = {**told["rules"], "imports": imports, "people": people}
    for number in range(len(others), 0, -1):
        try:
            return _with_objects(folder, rules, target, others[:number], seed)
        except WorldError:
            continue
    return _with_objects(folder, rules, target, (), seed)


def _with_objects(folder, rules, target, others, seed):
    """The room of a folder with these objects. Raises WorldError when they do not fit."""
    models = [("target", target), *((f"other_{n}", each) for n, each in enumerate(others))]
    objects = [{"name": name, "model": model, "surfaces": [TAKEN]} for name, model in models]
    text = yaml.safe_dump({**rules, "objects": objects}, sort_keys=False)
    (folder / "objects.yaml").write_text(text, encoding="utf-8")
    world = load_world(str(folder))
    place_objects(world, seed)
    return world
