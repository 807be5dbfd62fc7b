"""Files of every kind with random changes: each is refused in its file and line, or is read; never a traceback.

    python -m tests.benchmarks.mutated_files --files 5000 --seed 1 [--kinds mission,map]

Tells for each kind how many were refused and how many were read, how much memory came on top, and what was wrong.
"""

import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "plugins/errand-make/tests"))
from mesh_forms import collada

from errand_make.objects import ObjectImportError
from errand_make.objects.mesh_files import read_mesh
from errand_make.objects.solid import solid_of
from executive.app.evaluate.evaluation_file import load_evaluation
from executive.app.prepare.scenarios import read_scenario
from executive.language.parser import load_parser
from executive.mission.load import knowledge_of_mission, load_mission, load_stack, mission_of_robot
from executive.mission.resolve import mission_from_file
from executive.testing.skill_test import load_skill_tests
from executive.tree.compiler import compile_mission
from executive.tree.registry import installed_skills
from executive.words.knowledge import load_knowledge
from plant.models.catalogue import read_imported
from plant.worlds.world import WORLDS_FOLDER, load_world
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from tests.benchmarks.errand_process import ROOT
from tests.benchmarks.harness import command
from tests.executive.mission.mutations import mutated_files, some_bytes
from tests.hostile_values import FILES

MOST_S, MOST_MB = 3.0, 300.0
FLAT = WORLDS_FOLDER / "flat"
CAMERAS = ("hand", "frontleft", "frontright", "left", "right", "back")


@dataclass(frozen=True)
class Kind:
    """Good files of a kind as they are called, where a changed one is put, and what reads it.

    Those that are `raw` are changed by bytes, the others as YAML as well.
    """

    good: Mapping[str, bytes]
    target: str
    read: Callable[[Path], object]
    raw: bool = False


def missions():
    """Reader that loads and compiles a mission in its world; the worlds, skills and the parser are loaded once."""
    known = {file.parent.name: load_knowledge(file) for file in WORLDS_FOLDER.glob("*/knowledge.yaml")}
    skills, parser = installed_skills(), load_parser()

    def compile_path(path):
        loaded = load_mission(path)
        knowledge = knowledge_of_mission(loaded, known.get(str(loaded.world), known["flat"]))
        for part in [mission_of_robot(loaded, name, name) for name in loaded.parts] if loaded.parts else [loaded]:
            mission = mission_from_file(part, parser=parser, knowledge=knowledge)
            compile_mission(mission, knowledge=knowledge, registry=skills)

    return compile_path


def scenarios():
    knowledge, rules = load_knowledge(FLAT / "knowledge.yaml"), load_world("flat").seed_rules
    objects = {rule.name: rule.model for rule in rules.objects}
    people = {rule.name: rule.route is not None for rule in rules.people}
    return lambda path: read_scenario(path, knowledge, cameras=CAMERAS, objects=objects, people=people)


def read_body(path):
    """Reads a mesh file as far as its solid. Raises InputError, which names the file."""
    try:
        solid_of(np.concatenate([patch.triangles for patch in read_mesh(path).patches]))
    except ObjectImportError as error:
        raise InputError(error.message, hint=error.hint, file=path) from error


def contents(*files):
    return {file.name: file.read_bytes() for file in files}


def pictures():
    grey = np.full((12, 16), 254, np.uint8)
    grey[0] = 0
    pgm, png = (cv2.imencode(ending, grey)[1].tobytes() for ending in (".pgm", ".png"))
    return {"pgm": pgm, "png": png, "p2": b"P2\n# c\n16 12\n255\n" + b" ".join(b"%d" % value for value in grey.flat)}


def kinds(folder):
    shutil.copytree(Path(__file__).with_name("good_files"), folder, dirs_exist_ok=True)
    good = [*sorted((ROOT / "missions").glob("*.yaml")), ROOT / "tests/executive/mission/every_block.yaml"]
    for each in good:
        shutil.copy(each, folder)
    home, skills = folder / "home", installed_skills()
    for each in (FLAT / "knowledge.yaml", FLAT / "objects.yaml"):
        shutil.copy(each, home)
    (folder / "m.pgm").write_bytes(pictures()["pgm"])
    knowledge, stacks = contents(FLAT / "knowledge.yaml"), contents(*sorted((ROOT / "skills").glob("*_stack.yaml")))
    suites, walls = contents(*(ROOT / "tests/skills").rglob("*.skilltest.yaml")), contents(home / "walls.obj")

    def world(_):
        return load_world(home)

    def tests(path):
        return load_skill_tests(path, skills)

    return {
        "mission": Kind(contents(*good), "mission.yaml", missions()),
        "knowledge": Kind(knowledge, "knowledge.yaml", load_knowledge),
        "world": Kind(knowledge, "home/knowledge.yaml", world),
        "objects": Kind(contents(FLAT / "objects.yaml"), "home/objects.yaml", world),
        "directives": Kind(contents(home / "world.dmd.yaml"), "home/world.dmd.yaml", world),
        "model": Kind(contents(home / "walls.sdf"), "home/walls.sdf", world, raw=True),
        "map": Kind(contents(folder / "m.yaml"), "map.yaml", load_grid_map),
        "picture": Kind(pictures(), "m.pgm", lambda _: load_grid_map(folder / "m.yaml"), raw=True),
        "stack": Kind(stacks, "stack.yaml", load_stack),
        "scenario": Kind(contents(*(ROOT / "missions/scenarios").glob("*.yaml")), "scenario.yaml", scenarios()),
        "evaluation": Kind(contents(folder / "evaluation.yaml"), "evaluation.yaml", load_evaluation),
        "skill test": Kind(suites, "test.yaml", tests),
        "object": Kind(contents(folder / "object.yaml"), "object.yaml", lambda path: read_imported(path.parent)),
        "obj": Kind(walls, "m.obj", read_body, raw=True),
        "dae": Kind({"m": collada().encode()}, "m.dae", read_body, raw=True),
    }


def changed(kind, count, seed, folder):
    """So many changed files of a kind; every tenth is none of that kind at all."""
    hostile = [(f"hostile-{number}", FILES[(seed + number) % len(FILES)]) for number in range(-(-count // 10))]
    texts, left = list(kind.good.values()), count - len(hostile)
    if kind.raw:
        rng = np.random.default_rng(seed)
        drawn = [texts[int(rng.integers(len(texts)))] for _ in range(left)]
        return [*hostile, *((f"bytes-{number}", some_bytes(text, rng)) for number, text in enumerate(drawn))]
    for number, content in enumerate(texts):
        (folder / f"good-{number}").write_bytes(content)
    return [*hostile, *mutated_files([folder / f"good-{number}" for number in range(len(texts))], left, seed)]


def fault(path, read, most_s=MOST_S):
    """End of a file ("read", "refused", "traceback"), and what is wrong with that."""
    begun = time.process_time()
    try:
        read(path)
        how, wrong = "read", ""
    except InputError as error:
        how, wrong = "refused", next(filter(None, map(_told_badly, (error, *error.others))), "")
    except Exception:
        how, wrong = "traceback", traceback.format_exc()[-1500:]
    spent_s = time.process_time() - begun
    return how, wrong or (f"it takes {spent_s:.1f} s" if spent_s > most_s else "")


def _told_badly(error):
    if error.file is None or not error.message:
        return f"no place: {error}"
    if error.line is None and error.file.suffix in (".yaml", ".sdf"):
        return f"no line: {error}"
    lines = error.file.read_bytes().count(b"\n") + 1 if error.file.is_file() else 0
    if error.line is not None and not 1 <= error.line <= lines:
        return f"line {error.line} of {lines}: {error}"
    return f"too long: {str(error)[:300]}" if len(str(error)) > 2000 else ""


def benchmark(files, seed, chosen, tell, most_s=MOST_S):
    """Tries so many; returns the number of those with something wrong."""
    bad, begun = 0, time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = kinds(folder)
        start_mb = _memory_mb()
        for number, (title, kind) in enumerate(every.items()):
            if chosen and title not in chosen:
                continue
            target, found = folder / kind.target, Counter()
            before = target.read_bytes() if target.exists() else None
            for each, content in kind.good.items():
                target.write_bytes(content)
                if (ends := fault(target, kind.read, most_s)) != ("read", ""):
                    tell(f"{title}: the good file {each}: {ends}")
                    bad += 1
            for each, content in changed(kind, -(-files // len(chosen or every)), seed + number, folder):
                target.write_bytes(content)
                how, wrong = fault(target, kind.read, most_s)
                found[how] += 1
                if wrong:
                    bad += 1
                    tell(f"{title}: {each}: {wrong}")
            if before is not None:
                target.write_bytes(before)
            tell(f"{title}: {dict(found)}")
    more_mb = _memory_mb() - start_mb
    bad += more_mb > MOST_MB
    tell(f"{files} files in {time.perf_counter() - begun:.0f} s: {bad} with a defect, {more_mb:.0f} MB more")
    return bad


def _memory_mb():
    pages = Path("/proc/self/statm")
    return int(pages.read_text().split()[1]) * 4096 / 1e6 if pages.exists() else 0.0


def measure(files: int = 5000, seed: int = 1, kinds: tuple[str, ...] = ()):
    return int(benchmark(files, seed, kinds, lambda text: print(text, flush=True)) > 0)


if __name__ == "__main__":
    command(measure)
