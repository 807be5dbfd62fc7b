"""Every shipped skill has skill tests with the suite."""

from pathlib import Path

import pytest
import yaml

from executive.tree.registry import built_in_skills

ROOT = Path(__file__).resolve().parents[3]
NEVER_FAILS = ("clear_costmap", "locate_dock")


@pytest.mark.parametrize("name", sorted(built_in_skills()))
def test_every_skill_has_skill_tests_with_the_suite(name):
    (path,) = (ROOT / "tests/skills").rglob(f"{name}.skilltest.yaml")
    file = yaml.safe_load(path.read_text())
    assert file["skill"] == name
    assert file["suite"]
    assert any(test["expect"]["outcome"] == "success" and not test.get("faults") for test in file["tests"])
    assert any(test["expect"]["outcome"] == "failure" for test in file["tests"]) or name in NEVER_FAILS
