"""Runs missions in processes of their own, as `errand run` with a live page, and stops them."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import sys
import urllib.request
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from skills.inputs.errors import InputError

_PAGE: Final = re.compile(r"The page: (http://\S+)")
MOST_LINES: Final = 500
_MOST_LINE: Final = 10_000_000
_STOP_S: Final = 8.0


@dataclass(frozen=True)
class RunOptions:
    """Options of a run, as the form has them; an empty text leaves the choice to the mission."""

    world: str = ""
    seed: int = 1
    robots: str = ""
    scenario: str = ""
    faults: str = ""
    people: int = 0

    @property
    def keeps_nodes(self) -> bool:
        """Returns whether the run has the nodes of the check: other robots have other names, and so other nodes."""
        return not (self.world.strip() or self.robots.strip())

    def arguments(self) -> list[str]:
        """Returns the arguments for `errand run`; each line of `faults` is one fault."""
        named = {"--world": self.world, "--robots": self.robots, "--scenario": self.scenario}
        values = [f"{name}={value.strip()}" for name, value in named.items() if value.strip()]
        faults = [f"--fault={line.strip()}" for line in self.faults.splitlines() if line.strip()]
        return [*values, *faults, f"--seed={self.seed}", *([f"--people={self.people}"] if self.people else [])]


@dataclass
class Running:
    """Run of a mission: its process, its last lines, the address of its live page, and its report once it has ended."""

    name: str
    process: asyncio.subprocess.Process
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=MOST_LINES))
    page: str = ""
    note: str = ""
    result: Mapping[str, Any] | None = None
    is_stopping: bool = False

    @property
    def is_over(self) -> bool:
        """Returns whether the process has ended, and with it its live page."""
        return self.process.returncode is not None

    @property
    def goes_on(self) -> bool:
        """Returns whether the mission has not ended; the live page stays after its end."""
        return not self.is_over and self.result is None

    async def follow(self, stops: Iterable[str]) -> None:
        """Reads the process's lines until it ends; sets breakpoints at the nodes `stops` once the page is there."""
        stream = self.process.stdout
        while stream is not None and (line := await stream.readline()):
            text = line.decode("utf-8", "replace").rstrip()
            if not self.page and (found := _PAGE.search(text)):
                self.page = found[1]
                self.note = await asyncio.to_thread(_set_breakpoints, self.page, tuple(stops)) or self.note
            elif text.startswith('{"'):
                self.result = json.loads(text)
            else:
                self.lines.append(text)
        await self.process.wait()

    def stop(self) -> None:
        """Ends the mission in order, or at once at the second call, or the live page after it, as Ctrl-C does."""
        self.is_stopping = True
        if not self.is_over:
            os.killpg(self.process.pid, signal.SIGINT)

    async def close(self) -> None:
        """Ends the mission and its page; kills the process if that takes too long."""
        for number in (signal.SIGINT, signal.SIGINT, signal.SIGKILL):
            if self.is_over:
                return
            os.killpg(self.process.pid, number)
            with suppress(TimeoutError):
                await asyncio.wait_for(asyncio.shield(self.process.wait()), _STOP_S)


class MissionRuns:
    """Runs that a studio has started: one at a time."""

    def __init__(self, out: Path, live_port: int = 0) -> None:
        self.out, self._live_port = out, live_port
        self.current: Running | None = None
        self.origins = ""
        """Origins of the studio, which may show the live page in a frame."""
        self._tasks = set[asyncio.Task[None]]()

    async def start(self, file: Path, options: RunOptions, stops: Sequence[str] = ()) -> Running:
        """Starts the mission of a file, and closes the page of the one before. Raises InputError while that runs."""
        if self.current is not None:
            if self.current.goes_on:
                raise InputError(f"{self.current.name} runs already", hint="stop it first")
            await self.current.close()
        command = ["run", str(file), *options.arguments(), "--view", f"--view-port={self._live_port}"]
        command += [f"--out={self.out}", "--json"]
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-u", "-m", "executive.cli", *command),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.STDOUT,
            limit=_MOST_LINE,
            cwd=file.parent,
            env={**os.environ, "ERRAND_VIEW_FRAMES": self.origins},
            start_new_session=True,
        )
        self.current = Running(file.name, process)
        if stops and not options.keeps_nodes:
            stops, self.current.note = (), "No breakpoints are set where world or robots are not the mission's own."
        task = asyncio.create_task(self.current.follow(stops))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return self.current

    async def close(self) -> None:
        """Ends the current run."""
        if self.current is not None:
            await self.current.close()


def _set_breakpoints(page: str, nodes: Sequence[str]) -> str:
    """Sets breakpoints by the actions of a live page; returns a sentence if one cannot be set."""
    parts = urlsplit(page)
    token = parse_qs(parts.query).get("token", [""])[0]
    for node in nodes:
        body = json.dumps({"node": node}).encode()
        request = urllib.request.Request(f"http://{parts.netloc}/action/break", body, {"x-errand-token": token})
        for last in (False, False, True):
            try:
                urllib.request.urlopen(request, timeout=5.0).close()
                break
            except OSError as error:  # a run that begins may be too busy to answer in time
                if last:
                    return f"no breakpoint at {node}: {error}"
    return ""
