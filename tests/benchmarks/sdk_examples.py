"""Examples of Spot's SDK that move nothing, and those that the server refuses, unchanged. Prints JSON.

    python -m tests.benchmarks.sdk_examples --examples FOLDER [--only NAME] [--python COMMAND]

FOLDER holds the examples of the SDK; without it the variable `ERRAND_SDK_EXAMPLES` names the folder. COMMAND is an
interpreter with bosdyn-client, bosdyn-mission and bosdyn-choreography-client. Each program runs alone against a new
server of a scripted robot in real time. `as_listed` counts those with the exit code and the output of `sdk_promises`.
"""

import os
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path

from lock_step import PASSWORD, USER, scripted_spot

from errand_spot.commands import LAUNCH
from errand_spot.server.identity import credentials
from skills.testing.blocks import Block
from tests.benchmarks.harness import command, show
from tests.benchmarks.sdk_promises import REFUSED, SERVED

EXAMPLES = "ERRAND_SDK_EXAMPLES"
LIMIT_S, ENDED_S = 60.0, 10.0
WALL = Block(3.0, -1.5, 3.2, 1.5)


def run(program, folder, python=sys.executable):
    """Runs a program of a folder; returns its exit code, None when it had to be ended, and whether it is as listed."""
    script, *arguments = program.line.split()
    with (
        tempfile.TemporaryDirectory() as made,
        scripted_spot(credentials(Path(made)), blocks=[WALL], downloads=True) as (server, _),
    ):
        (empty := Path(made) / "empty").touch()
        (payload := Path(made) / "payload").write_text(f"{uuid.uuid4()}\nsecret\n")
        values = {"HOST": "127.0.0.1", "EMPTY": str(empty), "PAYLOAD": str(payload)}
        line = [python, LAUNCH, str(server.certificate), str(server.port), "real", str(folder / script)]
        user = {"BOSDYN_CLIENT_USERNAME": USER, "BOSDYN_CLIENT_PASSWORD": PASSWORD}
        user["SPOT_HTTPS_PORT"] = str(server.downloads.port)
        limit_s = LIMIT_S if program.exit_code is not None else ENDED_S
        try:
            done = subprocess.run(
                [*line, *(values.get(each, each) for each in arguments)],
                **{"env": {**os.environ, **user}, "cwd": made, "timeout": limit_s},
                **{"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT},
            )
            code, output = done.returncode, done.stdout.decode(errors="replace")
        except subprocess.TimeoutExpired as late:
            code, output = None, (late.stdout or b"").decode(errors="replace")
    listed = code == program.exit_code and program.says in output
    return {"program": program.line, "exit_code": code, "as_listed": listed, "output": "" if listed else output[-800:]}


def measure(
    examples: Path | None = Path(os.environ[EXAMPLES]) if EXAMPLES in os.environ else None,
    only: str = "",
    python: str = sys.executable,
):
    if examples is None:
        return {"programs": 0, "as_listed": 0}
    programs = {**SERVED, **{folder: refusal.program for folder, refusal in REFUSED.items()}}
    results = []
    for folder, program in sorted(programs.items()):
        if only in folder:
            results.append(run(program, examples / folder, python))
            show(results[-1])
    return {"programs": len(results), "as_listed": sum(each["as_listed"] for each in results)}


if __name__ == "__main__":
    command(measure)
