"""Broken mission files, made by seeded mutation of good ones: each gives a located message, never a traceback."""

import shutil
import time
from pathlib import Path

import pytest

from executive.app.prepare.checker import Checker
from executive.mission.request import Request
from skills.inputs.errors import InputError
from tests.executive.mission import mutations

COUNT, SEED = 300, 7
RANDOM = 100
EVERY_BLOCK = Path(__file__).with_name("every_block.yaml")


@pytest.fixture(scope="module")
def checker(parser):
    one = Checker()
    one.parser = parser
    return one


def test_unchanged_files_compile(checker, missions):
    faults = {path.name: list(map(str, checker.check(Request(file=path)).errors)) for path in missions}
    assert not any(faults.values()), faults


def test_every_broken_file_is_refused_with_a_place_and_a_hint(checker, mission_folder, missions):
    wrong = []
    for name, raw in mutations.broken_files(missions, COUNT, SEED):
        path = mission_folder / "mission.yaml"
        path.write_bytes(raw)
        errors = checker.check(Request(file=path)).errors
        if not errors:
            wrong.append((name, "accepted"))
        for error in errors:
            if error.file is None or error.line is None or not error.message or not error.hint:
                wrong.append((name, str(error)))
            if "\n" in str(error) or "Traceback" in str(error) or len(str(error)) > 2000:
                wrong.append((name, str(error)[:300]))
            lines = error.file.read_bytes().count(b"\n") + 1 if error.file is not None else 0
            if error.line is not None and not 1 <= error.line <= lines:
                wrong.append((name, f"line {error.line} of {lines}"))
    assert not wrong, f"{len(wrong)}: {wrong[:10]}"


def test_every_construct_is_in_the_example_and_it_compiles(compile_file):
    text = EVERY_BLOCK.read_text(encoding="utf-8")
    assert compile_file(EVERY_BLOCK).path_ids
    assert not [part for part in mutations.PARTS if part not in text and part not in ("use", "door", "look")]


def test_files_with_random_changes_are_refused_in_their_lines_or_compile(compile_file, mission_folder, missions):
    shutil.copy(EVERY_BLOCK, mission_folder)
    path, wrong = mission_folder / "mission.yaml", []
    for name, raw in mutations.mutated_files([*missions, EVERY_BLOCK, EVERY_BLOCK], RANDOM, SEED):
        path.write_bytes(raw)
        begun = time.process_time()
        try:
            compile_file(path)
        except InputError as error:
            for each in (error, *error.others):
                lines = 0 if each.file is None else each.file.read_bytes().count(b"\n") + 1
                if each.line is None or not 1 <= each.line <= lines or len(str(each)) > 2000:
                    wrong.append((name, str(each)[:300]))
        if time.process_time() - begun > 1.0:
            wrong.append((name, "it takes too long"))
    assert not wrong, f"{len(wrong)}: {wrong[:10]}"
