import os
import subprocess
import sys

import pytest


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
