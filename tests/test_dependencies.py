"""Dependencies are ranges, and constraints.txt pins a version in each; the code runs on each declared Python."""

import re
import sys
import tomllib
from itertools import chain

import pytest
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

from tests.sources import PLUGINS, PRODUCT, ROOT, modules, read

VERSIONS = ("3.11", "3.12", "3.13")
PROJECTS = [
    tomllib.loads(file.read_text())["project"]
    for file in (ROOT / "pyproject.toml", *sorted(ROOT.glob("plugins/*/pyproject.toml")))
]
REQUIRED = [
    Requirement(words)
    for project in PROJECTS
    for words in chain(project["dependencies"], *project.get("optional-dependencies", {}).values())
    if Requirement(words).name not in {each["name"] for each in PROJECTS}
]
PINS = dict(line.split("==") for line in (ROOT / "constraints.txt").read_text().splitlines())
GONE = {"asynchat", "asyncore", "audioop", "cgi", "crypt", "distutils", "imghdr", "imp", "pipes", "smtpd", "telnetlib"}
"""Modules that Python 3.12 or 3.13 lacks."""


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.parametrize("required", REQUIRED, ids=lambda each: each.name)
def test_a_dependency_is_a_range_with_a_pin_in_it(required):
    pins = {normal(name): version for name, version in PINS.items()}
    exact = any(each.operator in ("==", "===") for each in required.specifier)
    assert exact is (required.name in EXACT)
    assert required.specifier.contains(pins[normal(required.name)], prereleases=True)


EXACT = {"bosdyn-client"}
"""Without an exact version pip goes back to one of years ago that fits any newer dependency."""


def test_the_three_versions_of_python_are_declared_and_no_other():
    for project in PROJECTS:
        allowed = SpecifierSet(project["requires-python"])
        assert [minor for minor in range(9, 17) if f"3.{minor}" in allowed] == [11, 12, 13]
        declared = [each.rpartition(" ")[2] for each in project["classifiers"] if "Python ::" in each]
        assert declared == list(VERSIONS)


def test_plug_ins_fit_the_version_of_the_core():
    version = (ROOT / "VERSION").read_text().strip()
    wanted = [Requirement(words) for project in PROJECTS[1:] for words in project["dependencies"]]
    cores = [each for each in wanted if each.name.startswith(("spot-errand", "errand-"))]
    assert len(cores) > len(PROJECTS) - 2 and all(each.specifier.contains(version) for each in cores)


def test_no_module_imports_what_a_later_python_lacks():
    sources = modules(*PRODUCT, *PLUGINS)
    imported = {name.partition(".")[0] for text in sources.values() for name in read(text).imports}
    assert len(sources) > 500 and "numpy" in imported
    assert not imported & (GONE - set(sys.builtin_module_names))
