"""Calls of `errand` in this process, as a user types them."""

import json
import shlex

import cv2
import numpy as np
from typer.testing import CliRunner

from executive.cli import entry

MAP = """image: room.pgm
resolution: 0.05
origin: [2.0, -1.0, {yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def write_room(folder, yaw):
    """Writes the map of a room of 6 x 5 m; returns its file."""
    room = np.full((104, 124), 0, np.uint8)
    room[2:-2, 2:-2] = 254
    cv2.imwrite(str(folder / "room.pgm"), room)
    (folder / "room.yaml").write_text(MAP.format(yaw=yaw))
    return folder / "room.yaml"


def errand(*words, **options):
    """Calls `errand` with the words."""
    return CliRunner().invoke(entry.app, [str(word) for word in words], **options)


def done(*words, **options):
    """Calls `errand` with the words, which succeeds."""
    result = errand(*words, **options)
    assert result.exit_code == 0, result.output
    return result


def refusal(*words, **options):
    """Calls `errand` with words that it refuses with status 2; returns what it says on standard error."""
    result = errand(*words, **options)
    assert result.exit_code == 2, result.output
    return result.stderr


def json_of(result):
    """The JSON on the last line of what a call printed."""
    return json.loads(result.stdout.splitlines()[-1])


def refused_in_one_line(case, folder, monkeypatch):
    """Calls `errand` in a folder with the files of a case; it is refused as the case says, and changes no file."""
    for name, text in case.get("files", {}).items():
        (folder / name).write_text(text)
    monkeypatch.chdir(folder)
    before = contents(folder)
    words = shlex.split(case["input"])
    refused = errand(*words)
    (line,) = refused.stderr.splitlines()
    place = case.get("place", "")
    assert (refused.exit_code, line.startswith("errand: "), contents(folder) == before) == (2, True, True), line
    assert place in line and case["message"] in line.partition(place or ": ")[2], line
    assert refused.stdout in ("", f"✗ {''.join(words[1:2])}: 1 error\n")


def contents(folder):
    """The files below a folder with what is in them."""
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}
