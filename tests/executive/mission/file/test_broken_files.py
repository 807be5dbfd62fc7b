"""500 broken mission files, made by seeded mutation of good ones: each gives a located message, never a traceback."""

import importlib.util
from pathlib import Path

import pytest

from executive.cli.check_command import Checker

_spec = importlib.util.spec_from_file_location("mission_mutations", Path(__file__).with_name("mutations.py"))
mutations = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(mutations)

COUNT, SEED = 500, 7


@pytest.fixture(scope="module")
def checker(parser):
    one = Checker()
    one.parser = parser
    return one


def test_the_good_ones_are_good(checker, missions):
    faults = {path.name: list(map(str, checker.check(path).errors)) for path in missions}
    assert not any(faults.values()), faults


def test_every_broken_file_is_refused_with_a_place_and_a_hint(checker, mission_folder, missions):
    wrong = []
    for name, raw in mutations.broken_files(missions, COUNT, SEED):
        path = mission_folder / "mission.yaml"
        path.write_bytes(raw)
        errors = checker.check(path).errors
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
