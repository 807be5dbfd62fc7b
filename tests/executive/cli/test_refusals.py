"""Wrong words and files on the command line: one line with status 2 that names the place, and nothing is written."""

import shlex

import pytest

from tests.executive.cli.calls import errand
from tests.tables import yaml_beside

REFUSALS = yaml_beside(__file__, "refusals.yaml")


def contents(folder):
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case['input'][:60]}: {case['message'][:30]}")
def test_a_wrong_call_is_refused_in_one_line_and_changes_no_file(case, request, tmp_path, monkeypatch):
    request.getfixturevalue(case.get("given", "tmp_path"))
    for name, text in case.get("files", {}).items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    before = contents(tmp_path)
    words = shlex.split(case["input"])
    refused = errand(*words)
    (line,) = refused.stderr.splitlines()
    place = case.get("place", "")
    assert (refused.exit_code, line.startswith("errand: "), contents(tmp_path) == before) == (2, True, True), line
    assert place in line and case["message"] in line.partition(place or ": ")[2], line
    assert refused.stdout in ("", f"✗ {''.join(words[1:2])}: 1 error\n")
