"""The first run on a machine has its numeric code compiled."""

import pytest

from executive.app import simulated
from executive.app.simulated import compile_first


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run in place of those that take long."""
    run = []
    monkeypatch.setattr(simulated.subprocess, "run", lambda command, **_: run.append(command))
    return run


def test_the_first_run_on_a_machine_compiles_and_says_so_once(commands, tmp_path, caplog):
    compile_first(tmp_path)
    assert [command[-1] for command in commands] == ["warm-up"]
    assert len(caplog.messages) == 1


def test_a_later_run_compiles_nothing_and_says_nothing(commands, tmp_path, caplog):
    (tmp_path / "lattice.search-93.py311.nbi").touch()
    compile_first(tmp_path)
    assert (commands, caplog.messages) == ([], [])
