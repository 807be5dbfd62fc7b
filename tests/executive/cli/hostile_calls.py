"""Calls of every command with a hostile text in one place, and what is wrong with how such a call ends."""

import contextlib
import io
import os
import re
import signal
import sys
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final
from unittest.mock import patch

import cv2
import numpy as np

from executive.cli import entry
from executive.mission.request import Request
from executive.store.missions import MissionStore
from executive.store.standing_missions import StandingMissions
from executive.store.triggers import Missed, OnCall
from tests.hostile_values import TEXTS
from tests.tables import yaml_beside

__all__ = ["Place", "WorkBegins", "arguments", "called", "commands", "defect", "hostile_texts", "places", "prepare"]

LIMIT_S: Final = 120
CALLS: Final = yaml_beside(__file__, "hostile_calls.yaml")
GOOD: Final[Mapping[str, Mapping[str, str]]] = CALLS["good"]
_UNTOLD: Final = re.compile(r"Traceback|<class|NoneType| object at 0x|\b[A-Z][A-Za-z]+Error\b|re\.compile|\(\?:|\\d")
_CONTROL: Final = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\x80-\x9f]")


class WorkBegins(BaseException):
    """All options are read, and what was asked for would begin to be done."""


@dataclass(frozen=True)
class Place:
    """An option or argument of a command that takes a text, by the name that is typed."""

    command: str
    name: str
    is_option: bool

    @property
    def title(self):
        """The command and the option, as people write them."""
        return f"{self.command} {self.name}"


@dataclass(frozen=True)
class Ended:
    """How a call ended: its status (None: its work would begin), what it printed, the traceback of a defect."""

    status: int | None
    output: str
    trace: str = ""


def prepare(folder):
    """Put the good files of the calls into a folder; all but the log, the results and the recording."""
    grey = np.full((60, 80), 254, np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    written = {
        "good.yaml": b"name: good\nsteps:\n  - to: hall\n",
        "map.yaml": b"image: m.pgm\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n"
        b"free_thresh: 0.196\n",
        "m.pgm": cv2.imencode(".pgm", grey)[1].tobytes(),
        "good.png": cv2.imencode(".png", grey)[1].tobytes(),
        "good.py": b"raise SystemExit(0)\n",
        "good.json": b'{"cylinders": [[1, 1, 0.2, 1]]}',
        "good.stl": b"solid\n" + b"".join(_facet(corners) for corners in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))),
    }
    for name, content in written.items():
        (folder / name).write_bytes(content)
    (folder / "data").mkdir()
    for name in ("train.json", "val.json"):
        (folder / "data" / name).write_text('{"images": [], "annotations": [], "categories": []}')
    request = Request("go to the hall", world="flat")
    (folder / "queue").mkdir()
    with MissionStore(folder / "queue" / "missions.sqlite") as missions:
        missions.add(request, queued=True)
    with MissionStore(folder / "calls.sqlite") as missions:
        StandingMissions(missions).add(request, OnCall("beer"), Missed.SKIP)


def _facet(corners):
    points = ("0 0 0", "0.1 0 0", "0 0.1 0", "0 0 0.1")
    lines = "\n".join(f"vertex {points[corner]}" for corner in corners)
    return f"facet normal 0 0 0\nouter loop\n{lines}\nendloop\nendfacet\n".encode()


def places():
    """Every option and argument of every command that takes a text."""
    return [
        Place(command, *typed_name(each))
        for command, found in commands().items()
        for each in found.params
        if not getattr(each, "is_flag", False) and each.name != "help"
    ]


@cache
def commands():
    """All commands by the words that call them."""
    top = {name: entry.shipped_command(name) for name in entry.COMMANDS}
    top |= {name.replace(".", " "): entry.plugin_command(name) for name in entry.help_lines()}
    return {" ".join(words): found for name, each in top.items() for words, found in _below((name,), each)}


def _below(words, found):
    below = getattr(found, "commands", None)
    if below is None:
        yield words, found
        return
    for name, each in below.items():
        yield from _below((*words, name), each)


def typed_name(parameter):
    """The name of a parameter as it is typed, and whether it is an option."""
    option = parameter.param_type_name == "option"
    return (parameter.opts[0] if option else parameter.name), option


def hostile_texts():
    """The hostile texts that can stand on a command line."""
    return tuple(dict.fromkeys([*filter(_can_be_typed, TEXTS), "\udcff", "a\udcffb"]))


def _can_be_typed(text):
    try:
        return b"\0" not in os.fsencode(text)
    except UnicodeEncodeError:
        return False


def arguments(place, text):
    """The words of a call with a text in a place, and with good values where else one is needed."""
    found = commands()[place.command]
    told = {**GOOD.get(place.command, {}), place.name: text}
    options = [
        f"{name}={value}" if value or name == place.name else name
        for name, value in told.items()
        if name.startswith("-")
    ]
    plain = [told[each.name] for each in found.params if each.param_type_name == "argument" and each.name in told]
    return [*place.command.split(), *options, *(["--", *plain] if plain else [])]


def called(words):
    """Call `errand` in this process with the words, in the folder that is current."""
    handlers = ("strict", "backslashreplace")
    streams = [io.TextIOWrapper(io.BytesIO(), "utf-8", errors, write_through=True) for errors in handlers]
    with contextlib.ExitStack() as stack:
        for name in CALLS["work"]:
            stack.enter_context(patch(name, side_effect=WorkBegins))
        stack.enter_context(patch("executive.cli.listen_command.load_whisper", return_value=None))
        stack.enter_context(patch.object(sys, "argv", ["errand", *words]))
        stack.enter_context(patch.object(sys, "stdin", io.StringIO()))
        stack.enter_context(contextlib.redirect_stdout(streams[0]))
        stack.enter_context(contextlib.redirect_stderr(streams[1]))
        status, trace = _status()
    output = "".join(each.buffer.getvalue().decode("utf-8", "replace") for each in streams)
    return Ended(status, output, trace)


def _status():
    def too_long(*_):
        raise TimeoutError(f"it takes more than {LIMIT_S} s")

    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(LIMIT_S)
    try:
        entry.command_line()
    except SystemExit as end:
        return (end.code if isinstance(end.code, int) else 0 if end.code is None else 1), ""
    except WorkBegins:
        return None, ""
    except BaseException:
        return 1, traceback.format_exc()
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return 0, ""


def defect(words):
    """What is wrong with how a call ends; nothing where it is refused in plain words, or accepted."""
    ended = called(words)
    if ended.trace:
        return ended.trace[-1500:]
    if ended.status not in (None, 0, 1, 2):
        return f"status {ended.status}"
    if ended.status == 2 and not ended.output.strip():
        return "refused without a word"
    found = _UNTOLD.search(ended.output) or _CONTROL.search(ended.output)
    if found is not None and ended.status == 2:
        return f"{found.group()!r} in {ended.output[max(0, found.start() - 200) : found.end() + 100]!r}"
    longest = max(
        (len(line) for line in ended.output.splitlines() if line.startswith(("errand:", "Error:"))), default=0
    )
    return f"a message of {longest} letters" if longest > 3_000 else ""
