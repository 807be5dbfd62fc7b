"""What tests cost is counted, summed up by folder and held to budgets."""

import os
import subprocess
import time
from types import SimpleNamespace

import pytest
import yaml

from plant.engine import TIME_STEP_S
from tests import costs
from tests.costs import Costs, folder_of

pytest_plugins = ["pytester"]


@pytest.fixture
def run(pytester, monkeypatch):
    """Runs a test in this process with budgets for its folder; gives the exit code and the sums by folder."""
    for owner, name in ((subprocess.Popen, "__init__"), (os, "fork"), (time, "sleep")):
        monkeypatch.setattr(owner, name, getattr(owner, name))  # put back at the end

    def ran(body, **budget):
        budgets = pytester.path / "costs.yaml"
        budgets.write_text(yaml.safe_dump({"tests/here": budget}))
        monkeypatch.setattr(costs, "BUDGETS", budgets)
        monkeypatch.setattr(costs, "ROOT", pytester.path)
        folder = pytester.mkdir("tests") / "here"
        folder.mkdir()
        (folder / "test_one.py").write_text(f"import subprocess, sys, time\ndef test_one():\n    {body}\n")
        counted = Costs(None, reports=True)
        ended = pytester.inline_run("tests", "-p", "no:cacheprovider", plugins=[counted])
        return ended.ret, dict(counted.sums["tests/here"])

    return ran


def test_sleeps_and_processes_of_a_test_are_counted(run):
    code, sums = run("time.sleep(0.06), time.sleep(0.01), subprocess.run(['true'])", cases=1, processes=1, waited_s=1)
    assert (code, sums) == (0, {"cases": 1, "processes": 1, "waited_s": pytest.approx(0.06)})


def test_a_run_fails_where_a_folder_costs_more_than_its_budget(run):
    code, sums = run("subprocess.run(['true'])", cases=1)
    assert (code, sums["processes"]) == (pytest.ExitCode.TESTS_FAILED, 1)


def test_the_steps_of_a_plant_are_counted_as_seconds():
    counted, module = Costs(None, reports=True), SimpleNamespace(do_steps=lambda engine, steps: None)
    (amount,) = (amount for name, _, _, amount in costs.IMPORTED if name == "plant.engine")
    counted.count(module, "do_steps", "plant_s", amount)
    module.do_steps(object(), round(1.0 / TIME_STEP_S))
    assert counted.now["plant_s"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("nodeid", "folder"),
    [
        ("tests/skills/detect/test_skill.py::test_one[a/b]", "tests/skills"),
        ("plugins/errand-spot/tests/server/test_pace.py::test_one", "plugins/errand-spot"),
        ("tests/test_words.py::test_one", "tests"),
    ],
)
def test_a_test_counts_for_the_folder_with_its_budget(nodeid, folder):
    assert folder_of(nodeid) == folder
