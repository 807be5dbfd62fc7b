"""Warming up compiles all that a mission needs, and what plug-ins register in the group `errand.kernels`."""

import os
import subprocess
import sys

import pytest

from executive.app.kernels import kernel_steps
from skills.inputs.errors import InputError
from tests.executive.distribution import module_of_a_plug_in

SAILS = """
import numba

@numba.njit
def area(width):
    return 2.0 * width

def warm():
    area(1.0)

def torn():
    raise RuntimeError("the sail is torn")
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Makes a distribution that registers kernels."""
    with module_of_a_plug_in(tmp_path, monkeypatch, "sails", "errand.kernels", SAILS) as register:
        yield register


def sails():
    """The steps of the distribution."""
    return [step for step in kernel_steps() if "sails" in str(step)]


def test_warming_up_runs_the_kernels_of_plug_ins(install):
    assert sails() == []
    install("sails = sails:warm")
    (step,) = sails()
    step()
    assert len(sys.modules["sails"].area.signatures) == 1


def test_a_kernel_that_fails_is_refused_with_its_distribution(install):
    install("sails = sails:torn")
    (step,) = sails()
    with pytest.raises(InputError, match=r"cannot compile 'sails' \(sails:torn\) of sails: .*the sail is torn"):
        step()


@pytest.mark.nightly
def test_a_mission_after_warming_up_compiles_nothing(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    warm_up = subprocess.run(
        [sys.executable, "-m", "executive.cli", "warm-up"], capture_output=True, text=True, env=environment, check=True
    )
    assert int(warm_up.stdout.split()[0]) > 0
    program = (
        "import sys; from executive.cli.entry import command_line\n"
        f"sys.argv = ['errand', 'run', 'fetch_drink', '--no-record', '--quiet', '--out', {str(tmp_path / 'out')!r}]\n"
        "try: command_line()\n"
        "except SystemExit as end: assert not end.code, end.code\n"
        "from executive.app.kernels import newly_compiled\n"
        "print(newly_compiled())"
    )
    mission = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment, check=True
    )
    assert (mission.stdout.splitlines()[-1], mission.stderr) == ("0", "")
