"""The pictures of a run: what the hand camera detected, what a question is answered with, the grasp, the hand-over, and
the way walked from above."""

from __future__ import annotations

import base64
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import cv2
import numpy as np

from executive.record.history import Event
from executive.record.schemas import DESTINATION, TRANSITIONS
from executive.run.visitor import RunVisitor
from executive.store.resuming import is_from_before
from executive.tree.nodes.search import ANSWER_TOPIC
from executive.view.styles import ROBOT_COLOURS, rgb_of
from executive.words.slug import slug
from plant.scene_pictures import (
    Bounds,
    best_view,
    draw_detection,
    draw_map,
    draw_path,
    label,
    render_view,
    save_png,
    top_view,
)
from plant.simulation import Simulation
from skills.robot import Picture

DETECTIONS: Final = "detections"
MOST_BYTES: Final = 1_500_000
_MARGIN_M: Final = 0.3
_WIDEST_PX: Final = 720
_JPEG_QUALITY: Final = 78
_MOST_LOOKS: Final = 12
_SMALL_PX: Final = (320, 240)
_ROW: Final = 4
_MOMENTS: Final[Mapping[str, str]] = MappingProxyType({"hand-over": "hand_over", "place": "place"})
_AHEAD_M: Final[Mapping[str, float]] = MappingProxyType({"hand_over": 0.4})
"""So far before the hand, which is drawn in by then, lies what the picture is of."""


@dataclass
class RobotArtifacts:
    """What one robot saw and did that is worth a picture: its first confirmed detection, and when (s) it did what."""

    seen: Mapping[str, Any] | None = None
    confirmed: Mapping[str, Any] | None = None
    looked: deque[Mapping[str, Any]] = field(default_factory=lambda: deque(maxlen=_MOST_LOOKS))
    detection: Mapping[str, Any] | None = None
    moments: dict[str, float] = field(default_factory=dict)


class Artifacts(RunVisitor):
    """Remembers what is worth a picture, apart for each robot, and adds one to each answer for the log.

    `pictures` are small JPEG files for the answers, and `numbers` says which goes with the answer of a node (path id)
    at a time (s); once they have `MOST_BYTES`, no more are kept. `drawn` are the files that were written, by name.
    """

    def __init__(self) -> None:
        self._of_robot: dict[str, RobotArtifacts] = {}
        self.answer: Picture | None = None
        self.pictures: list[bytes] = []
        self.numbers: dict[tuple[str, float], int] = {}
        self.drawn: dict[str, Path] = {}

    def of(self, robot_name: str) -> RobotArtifacts:
        """What is known of a robot."""
        return self._of_robot.setdefault(robot_name, RobotArtifacts())

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Takes note of a message; an answer gets a picture."""
        own = self.of(str(message.get("robot", "")))
        if topic == DETECTIONS:
            own.looked.append(message)
            own.seen = message if message["detections"] else own.seen
        if topic == DESTINATION:
            own.confirmed = own.seen
            own.detection = own.detection or own.seen
        if topic == ANSWER_TOPIC:
            message = self._shown(message, own)
        if topic == TRANSITIONS and message["to"] == "SUCCESS" and not is_from_before(str(message["message"])):
            name = _MOMENTS.get(str(message["node"]).rsplit("/", 1)[-1])
            if name is not None:
                own.moments[name] = float(message["t"])
        return message

    def _shown(self, message: Mapping[str, Any], own: RobotArtifacts) -> Mapping[str, Any]:
        """The answer with a picture: of what was found, or of all that was looked at in vain."""
        looked = list(own.looked)
        own.looked.clear()
        if not looked:
            return message
        if message["answer"] and own.confirmed is not None:
            self.answer = detection_picture(own.confirmed)
        else:
            self.answer = _sheet([detection_picture(each) for each in looked])
        self._keep(message, self.answer)
        return {**message, "image": self.answer}

    def recall(self, events: Iterable[Event]) -> None:
        """Keeps the pictures of answers that were logged before a restart."""
        for event in events:
            if event.topic == ANSWER_TOPIC and event.data.get("format") == "jpeg" and "t" in event.data:
                data = np.frombuffer(base64.b64decode(event.data["data"]), np.uint8)
                picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
                if picture is not None:
                    self._keep(event.data, np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8))

    def _keep(self, message: Mapping[str, Any], picture: Picture) -> None:
        """Keeps the small picture of an answer, once, as long as there is room."""
        key = str(message["node"]), float(message.get("t", 0.0))
        if key in self.numbers or sum(map(len, self.pictures)) >= MOST_BYTES:
            return
        small = to_jpeg(picture)
        if sum(map(len, self.pictures)) + len(small) <= MOST_BYTES:
            self.numbers[key] = len(self.pictures)
            self.pictures.append(small)


def file_name(what: str, robot_name: str, robots: Sequence[str]) -> str:
    """The name of a robot's file without its ending: among several robots it ends with the robot's."""
    return f"{what}_{slug(robot_name)}" if len(robots) > 1 else what


def draw_artifacts(artifacts: Artifacts, simulation: Simulation, robots: Sequence[str], folder: Path) -> Sequence[Path]:
    """Writes the pictures of a recorded run into `folder` as PNG; gives their paths.

    What happened before a restart was not recorded by this process, and is left out.
    """
    pictures = {"map": _map(simulation, robots)}
    begun_s = simulation.recorder.at(0.0).time_s if simulation.recorder is not None else 0.0
    for robot in robots:
        own = artifacts.of(robot)
        if own.detection is not None:
            pictures[file_name("detection", robot, robots)] = detection_picture(own.detection)
        last = simulation.referee.lifts(robot)[-1:]
        lifts = [("grasp", lift.time_s) for lift in last if lift.time_s >= begun_s]
        for name, time_s in (*lifts, *own.moments.items()):
            pictures[file_name(name, robot, robots)] = _view(simulation, robot, time_s, _AHEAD_M.get(name, 0.0))
    paths = [folder / f"{name}.png" for name in pictures]
    artifacts.drawn.update(zip(pictures, paths, strict=True))
    for path, picture in zip(paths, pictures.values(), strict=True):
        save_png(path, picture)
    return paths


def draw_answer(artifacts: Artifacts, folder: Path) -> Path | None:
    """Writes the picture that goes with an answer as `answer.png`; its path, or None where nothing was asked."""
    if artifacts.answer is None:
        return None
    path = folder / "answer.png"
    save_png(path, artifacts.answer)
    return path


def to_jpeg(picture: Picture) -> bytes:
    """A picture as a JPEG file for a page, at most 720 pixels wide."""
    height, width = picture.shape[:2]
    scale = min(1.0, _WIDEST_PX / width)
    size = (round(width * scale), max(1, round(height * scale)))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    bgr = cv2.cvtColor(small, cv2.COLOR_RGB2BGR) if small.ndim == 3 else small
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _sheet(pictures: Sequence[Picture]) -> Picture:
    """Pictures side by side, smaller, in rows."""
    small = [np.asarray(cv2.resize(each, _SMALL_PX, interpolation=cv2.INTER_AREA), np.uint8) for each in pictures]
    columns = min(len(small), _ROW)
    small += [np.zeros_like(small[0])] * (-len(small) % columns)
    return np.vstack([np.hstack(small[k : k + columns]) for k in range(0, len(small), columns)])


def detection_picture(message: Mapping[str, Any]) -> Picture:
    """A logged picture with its detections drawn on it."""
    picture: Picture = message["image"]
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    for each in message["detections"]:
        picture = draw_detection(picture, tuple(each["box"]), each["class_name"], each["score"])
    return picture


def _map(simulation: Simulation, robots: Sequence[str]) -> Picture:
    """The world from above with the way of each robot; among several in its colour, with its name at the end."""
    rooms = simulation.world.rooms
    view = top_view(simulation.query_at(simulation.clock.now()), _bounds(simulation.world.corners))
    centres = {name: tuple(np.mean(polygon, axis=0)) for name, polygon in rooms.items()}
    start = simulation.world.start
    ways = {name: simulation.referee.path(name) for name in robots}
    marks = {"start": (start.x_m, start.y_m)}
    if len(ways) == 1:
        return draw_map(view, ways[robots[0]], labels=centres, marks=marks)
    picture = draw_map(view, np.zeros((0, 2)), labels=centres)
    for number, (name, way) in enumerate(sorted(ways.items())):
        if len(way):
            pixels = view.pixels(way)
            draw_path(picture, pixels, rgb_of(ROBOT_COLOURS[number % len(ROBOT_COLOURS)]))
            label(picture, name, (int(pixels[-1][0]) + 14, int(pixels[-1][1]) - 14))
    return picture


def _bounds(points: Sequence[tuple[float, float]]) -> Bounds:
    corners = np.array(points)
    low, high = corners.min(axis=0) - _MARGIN_M, corners.max(axis=0) + _MARGIN_M
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _view(simulation: Simulation, robot_name: str, time_s: float, ahead_m: float) -> Picture:
    query = simulation.query_at(time_s)
    X_WH = simulation.hand_pose_at(robot_name, time_s)
    across = X_WH.rotation().matrix() @ np.array([0.2, 1.0, 0.0])
    facing_W = (float(across[0]), float(across[1]))
    X_WC = best_view(query, X_WH @ [ahead_m, 0.0, 0.0], facing_W=facing_W, distance_m=1.5 + ahead_m)
    return render_view(query, X_WC)
