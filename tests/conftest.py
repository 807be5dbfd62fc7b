"""Lets the tests see the distribution errand-train as installed where only its source is there."""

import gc
import shutil
import sys
import tempfile
import tomllib
from functools import partial
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

from tests import affected, durations

TRAINING = Path(__file__).parents[1] / "training"


def pytest_addoption(parser):
    durations.add_option(parser)
    affected.add_option(parser)


def pytest_configure(config):
    file, revision = config.getoption("durations_file"), config.getoption("affected")
    if file and not hasattr(config, "workerinput"):
        config.pluginmanager.register(durations.Durations(file))
    if config.getoption("fast"):
        config.pluginmanager.register(durations.Fast())
    if revision:
        config.pluginmanager.register(affected.Affected(revision))
    try:
        distribution("errand-train")
    except PackageNotFoundError:
        folder = Path(tempfile.mkdtemp(prefix="errand-train-"))
        config.add_cleanup(partial(shutil.rmtree, folder))
        write_metadata(folder / "errand_train.dist-info")
        sys.path.append(str(folder))


def write_metadata(info):
    """Write what an installer would write of the distribution's name, summary and entry points."""
    project = tomllib.loads((TRAINING / "pyproject.toml").read_text())["project"]
    info.mkdir()
    facts = {"Metadata-Version": "2.1", "Name": project["name"], "Version": project["version"]}
    facts["Summary"] = project["description"]
    (info / "METADATA").write_text("".join(f"{name}: {value}\n" for name, value in facts.items()))
    groups = project["entry-points"].items()
    lines = [f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in each.items()) for group, each in groups]
    (info / "entry_points.txt").write_text("".join(lines))


LONG_SUITES = ("approach.skilltest.yaml", "place.skilltest.yaml")
"""Skill tests whose suites run nightly, since each run plans the arm's reach anew."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leaves long suites to the night; `test_every_skill` holds the same faults against every skill by day."""
    for item in items:
        if item.path.name in LONG_SUITES and ": " in item.name:
            item.add_marker(pytest.mark.nightly)


def pytest_collection_finish(session):
    """Excludes what was collected from garbage collection: a whole collection takes half a second with it.

    A run freezes what it has built, and would thaw these objects, too.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(30_000, 20, 50)
    gc.freeze = gc.unfreeze = lambda: None
