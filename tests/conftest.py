"""Options of a test run, what is left to the night, and the collection of garbage."""

import gc
import os
from pathlib import Path

import pytest

from tests import affected, costs, durations, missing

os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")  # as errand_spot sets it; gRPC reads it when it is imported


def pytest_addoption(parser):
    durations.add_option(parser)
    parser.addoption(
        "--costs-file", type=Path, help="counts what tests cost, and fails above the budgets of costs.yaml"
    )
    affected.add_option(parser)


def pytest_configure(config):
    file, revision = config.getoption("durations_file"), config.getoption("affected")
    if file and not hasattr(config, "workerinput"):
        config.pluginmanager.register(durations.Durations(file))
    if config.getoption("costs_file"):
        config.pluginmanager.register(costs.Costs(config.getoption("costs_file"), not hasattr(config, "workerinput")))
    if os.environ.get("CI"):
        config.pluginmanager.register(missing.NothingMissing())
    if config.getoption("fast"):
        config.pluginmanager.register(durations.Fast())
    if revision:
        config.pluginmanager.register(affected.Affected(revision))


LONG_SUITES = ("approach.skilltest.yaml", "place.skilltest.yaml")
"""Skill tests whose suites run nightly, since each run plans the arm's reach anew."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leaves long suites to the night, and all but the first of a file; `test_every_skill` holds faults by day."""
    first = {}
    for item in items:
        is_suite = item.path.name.endswith(".skilltest.yaml") and ": " in item.name
        if is_suite and (item.path.name in LONG_SUITES or first.setdefault(item.path, item.index) != item.index):
            item.add_marker(pytest.mark.nightly)
    durations.slowest_first(items)


COLLECTED_AFTER = 100_000
"""Objects from which on garbage is collected after a test."""


def pytest_collection_finish(session):
    """Leaves the collection of garbage to the main thread, between tests: to it belong the renderers of plants.

    A server's thread that collects one aborts the process. What was collected as tests is no garbage: a run freezes
    what it has built, and would thaw these objects, too.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    gc.set_threshold(0)  # some libraries enable it again
    gc.freeze = gc.unfreeze = lambda: None


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown():
    """Collects garbage once a test has left enough of it."""
    if gc.get_count()[0] > COLLECTED_AFTER:
        gc.collect()
