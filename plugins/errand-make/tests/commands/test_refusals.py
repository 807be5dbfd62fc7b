"""Wrong words and files for the commands of errand-make are refused in one line; nothing is written."""

import pytest

from tests.executive.cli.calls import refused_in_one_line
from tests.tables import yaml_beside

REFUSALS = yaml_beside(__file__, "refusals.yaml")


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case['input'][:60]}: {case['message'][:30]}")
def test_a_wrong_call_is_refused_in_one_line_and_changes_no_file(case, request, tmp_path, monkeypatch):
    request.getfixturevalue(case.get("given", "tmp_path"))
    refused_in_one_line(case, tmp_path, monkeypatch)
