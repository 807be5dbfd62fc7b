"""`errand doctor` looks at what a run needs on this machine; `errand warm-up` compiles the numeric code for it."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import distributions, requires, version
from typing import Annotated, Final

import typer

from executive.cli.defaults import runs_folder
from executive.cli.options import AS_JSON
from executive.cli.output import console_for, finish, progress_bar
from skills.inputs.errors import InputError, Problems, count_text
from skills.inputs.plugins import OURS

_PYTHONS: Final = ((3, 11), (3, 13))
_DEBIAN: Final = "libegl1 libgl1 libgl1-mesa-dri libglib2.0-0 libsm6 libx11-6"
_PORTS: Final = ((8765, "Foxglove"), (8950, "queue serve"))
_CORES, _MEMORY_GB, _DISK_GB = 2, 2.0, 1.0
"""Least cores, memory and free disk with which missions are comfortable."""
_LIMIT_S: Final = 120.0
_MARKS: Final = {True: "[green]✓[/green]", False: "[red]✗[/red]", None: "[yellow]![/yellow]"}


@dataclass(frozen=True)
class Finding:
    """Result of one look: its name, whether it is `good` (None: it works, but could be better), and the mend."""

    name: str
    good: bool | None
    text: str
    mend: str = ""


def doctor(as_json: AS_JSON = False, render: Annotated[bool, typer.Option("--render", hidden=True)] = False) -> None:
    """Looks at Python, packages, rendering, cores, compiled code, ports and plug-ins; names the mend of each fault."""
    if render:
        _render()
        return
    console, found = console_for(as_json), list[Finding]()
    for look in _LOOKS:
        for each in look():
            found.append(each)
            console.print(f"{_MARKS[each.good]} {each.name}:", end=" ")
            console.print(f"{each.text}; {each.mend}" if each.mend else each.text, markup=False)
    good = all(each.good is not False for each in found)
    finish({"good": good, "findings": [asdict(each) for each in found]}, as_json, good=good)


def warm_up() -> None:
    """Compiles the numeric code for this machine, so that the first run begins at once."""
    from executive.app.kernels import kernel_steps, newly_compiled

    begun_s = time.monotonic()
    steps = kernel_steps()
    with progress_bar(console_for(False), "steps", len(steps)) as advance:
        failed = Problems()
        for step in steps:
            with failed:
                step()
            advance()
    typer.echo(f"{count_text(newly_compiled(), 'function')} compiled in {time.monotonic() - begun_s:.0f} s")
    failed.raise_any()


def _python() -> Iterator[Finding]:
    (low, high), now = _PYTHONS, sys.version_info[:2]
    mend = "" if low <= now <= high else "make an environment with Python 3.11, 3.12 or 3.13"
    yield Finding("Python", not mend, f"{sys.version.split()[0]} in {sys.prefix}", mend)


def _packages() -> Iterator[Finding]:
    needed = [line for line in requires(OURS) or () if "extra ==" not in line]
    names = [re.split(r"[<>=!~\[; ]", line, maxsplit=1)[0] for line in needed]
    missing = [name for name in names if not any(distributions(name=name))]
    mend = f"pip install {' '.join(missing)}" if missing else ""
    yield Finding("packages", not missing, f"{OURS} {version(OURS)}, {len(names) - len(missing)} of {len(names)}", mend)


def _rendering() -> Iterator[Finding]:
    """Renders in a process of its own, because a broken driver may end it."""
    command = [sys.executable, "-m", "executive.cli", "doctor", "--render"]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_LIMIT_S)
        trouble = "" if ended.returncode == 0 else ended.stderr.strip().rpartition("\n")[2] or "its process ended"
    except subprocess.TimeoutExpired:
        trouble = f"no picture within {_LIMIT_S:.0f} s"
    mend = f"as root: apt-get install {_DEBIAN}" if trouble else ""
    yield Finding("camera pictures", not trouble, trouble or "rendered", mend)


def _render() -> None:
    """Renders one small picture of an empty world. Raises RuntimeError if it shows nothing."""
    from plant.simulation import Simulation
    from plant.worlds.world import load_world

    engine = Simulation(load_world("flat"), seed=1).engine
    scene, positions = engine.world.scene, engine.world.plant.GetPositions(engine.context)
    if scene is None or not scene.picture(positions, 0, depth=False).any():
        raise RuntimeError("the picture is black")


def _machine() -> Iterator[Finding]:
    cores = len(os.sched_getaffinity(0))
    more = "missions run slower than real time" if cores < _CORES else ""
    yield Finding("cores", None if more else True, str(cores), more)
    memory_gb = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    more = "run few missions at once" if memory_gb < _MEMORY_GB else ""
    yield Finding("memory", None if more else True, f"{memory_gb:.1f} GB", more)


def _compiled() -> Iterator[Finding]:
    from executive.app.runs.simulated import kernels_folder

    folder, done = kernels_folder()
    mend = "" if done else "`errand warm-up` compiles it once, in about half a minute"
    if not os.access(next(each for each in (folder, *folder.parents) if each.exists()), os.W_OK):
        yield Finding("compiled code", False, f"{folder} cannot be written", "set NUMBA_CACHE_DIR to a folder that can")
        return
    yield Finding("compiled code", True if done else None, "cached" if done else "not compiled yet", mend)


def _ports() -> Iterator[Finding]:
    for port, use in _PORTS:
        with socket.socket() as opened:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                opened.bind(("127.0.0.1", port))
            except OSError:
                yield Finding(f"port {port}", None, "another process uses it", f"give {use} another port")
                continue
        yield Finding(f"port {port}", True, f"free for {use}")


def _plugins() -> Iterator[Finding]:
    command = [sys.executable, "-m", "executive.cli", "plugins", "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        plugins = json.loads(ended.stdout.splitlines()[-1])["plugins"]
    except (IndexError, ValueError):
        yield Finding("plug-ins", False, ended.stderr.strip()[-200:], "uninstall the last one that you installed")
        return
    broken = [each for each in plugins if each["broken"]]
    names = sorted({each["distribution"] for each in plugins})
    yield Finding("plug-ins", not broken, ", ".join(names) or "none")
    for each in broken:
        yield Finding(f"plug-in {each['name']}", False, each["broken"], f"mend or uninstall {each['distribution']}")


def _folder() -> Iterator[Finding]:
    try:
        out = runs_folder().resolve()
    except InputError as error:
        yield Finding("defaults", False, error.message, error.hint)
        return
    there = next(each for each in (out, *out.parents) if each.exists())
    free_gb = shutil.disk_usage(there).free / 1e9
    if not os.access(there, os.W_OK):
        yield Finding("folder of runs", False, f"{there} cannot be written", "name another by --out")
    else:
        mend = "" if free_gb > _DISK_GB else "`errand runs clean --older-than 7d` removes old runs"
        yield Finding("folder of runs", True if not mend else None, f"{out}, {free_gb:.0f} GB free", mend)


_LOOKS: Final = (_python, _packages, _rendering, _machine, _compiled, _ports, _plugins, _folder)
