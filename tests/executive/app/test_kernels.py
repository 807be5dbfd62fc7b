import os
import subprocess
import sys

import pytest

from executive.app import kernels


@pytest.fixture
def commands(monkeypatch):
    """The commands that were run in place of those that take long."""
    run = []
    monkeypatch.setattr(kernels.subprocess, "run", lambda command, **_: run.append(command))
    return run


def test_the_first_run_on_a_machine_compiles_and_says_so_in_one_line(commands, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(kernels, "_cache_folder", lambda: tmp_path)
    kernels.compile_first()
    assert [command[-1] for command in commands] == ["warm-up"]
    assert capsys.readouterr().err.count("\n") == 1


def test_a_later_run_compiles_nothing_and_says_nothing(commands, monkeypatch, tmp_path, capsys):
    (tmp_path / "lattice.search-93.py311.nbi").touch()
    monkeypatch.setattr(kernels, "_cache_folder", lambda: tmp_path)
    kernels.compile_first()
    assert (commands, capsys.readouterr().err) == ([], "")


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
