"""Every shipped skill has skill tests with the suite."""

import pytest
import yaml

from tests.project import NEEDS_FIGURES, project_skills, skill_tests

NEVER_FAILS = ("clear_costmap", "locate_dock")


@pytest.mark.parametrize("name", sorted(project_skills()))
def test_every_skill_has_skill_tests_with_the_suite(name):
    file = yaml.safe_load(skill_tests(name).read_text())
    assert file["skill"] == name
    assert file["suite"]
    succeeds = any(test["expect"]["outcome"] == "success" and not test.get("faults") for test in file["tests"])
    assert succeeds or name in NEEDS_FIGURES
    assert any(test["expect"]["outcome"] == "failure" for test in file["tests"]) or name in NEVER_FAILS
