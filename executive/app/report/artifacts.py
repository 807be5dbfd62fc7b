"""Pictures of a run: detections of the hand camera, answers to questions, grasps, hand-overs, and a map with paths."""

import base64
import json
import math
import re
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import cv2
import numpy as np

from executive.record.history import Event
from executive.run.visitor import RunVisitor
from executive.tree.context import ANSWER_TOPIC
from executive.view.map_picture import newest_zones
from executive.view.text import ROBOT_COLOURS, rgb_of
from executive.words.schemas import ACTIVITY, DESTINATION, TRANSITIONS, TREE
from executive.words.slug import slug
from plant.scene_pictures import PATH_COLOUR, best_view, draw_detection, draw_map, render_view, save_png, top_view
from plant.simulation import Simulation
from skills.api import PICTURES
from skills.robot import Picture

DETECTIONS: Final = "detections"
MOST_BYTES: Final = 1_500_000
MOST_SHOWN: Final = 12
"""Number of pictures of skills in the report of a robot."""
UNEXPLAINED: Final = "what_is_this"
MOST_VIEWS: Final = 24
"""Number of views of an unexplained object in its folder."""
_SAME_M: Final = 0.08
"""Horizontal distance within which unexplained objects of two searches are one."""
FEWEST_VIEWS: Final = 4
"""Number of views that the import needs."""
_SIDES_MM: Final = (10, 600)
"""Least and longest side of an object that is imported by its views."""
_FACTS: Final = ("of", "robot", "camera", "stamp_s", "pose")
"""Facts on a picture that stand in `pictures.json`."""
_MARGIN_M: Final = 0.3
_WIDEST_PX: Final = 720
_JPEG_QUALITY: Final = 78
_MOST_LOOKS: Final = 12
_SMALL_PX: Final = (320, 240)
_ROW: Final = 4
_EMPTY: Final = 225
"""Grey of the places in a grid of pictures that no picture fills."""
_LEFT: Final = re.compile(r", [\d.]+ m to go$")
"""Distance left, which is logged once and soon wrong."""
_MOMENTS: Final[Mapping[str, str]] = MappingProxyType({"hand-over": "hand_over", "place": "place"})
_AHEAD_M: Final[Mapping[str, float]] = MappingProxyType({"hand_over": 0.4})
"""Distance of a picture's subject ahead of the retracted hand."""


@dataclass
class RobotArtifacts:
    """Recorded detections of one robot, the times (s) of its hand-over and placement, and pictures from its skills.

    `looked` are the latest detections with their numbers, `begun` how many there were when each node began, `confirmed`
    those that confirmed an object since the last answer.
    """

    seen: Mapping[str, Any] | None = None
    confirmed: list[Mapping[str, Any]] = field(default_factory=list)
    looked: deque[tuple[int, Mapping[str, Any]]] = field(default_factory=lambda: deque(maxlen=_MOST_LOOKS))
    looks: int = 0
    begun: dict[str, int] = field(default_factory=dict)
    detection: Mapping[str, Any] | None = None
    moments: dict[str, float] = field(default_factory=dict)
    shown: list[tuple[str, bytes]] = field(default_factory=list)


@dataclass
class UnexplainedObject:
    """Object that nothing recognised, at p_W: its views as PNG files, its size, and its picture with caption."""

    p_W: Sequence[float]
    views: list[bytes] = field(default_factory=list)
    size_m: Sequence[float] = ()
    shown: tuple[str, bytes] | None = None


class Artifacts(RunVisitor):
    """Visitor that collects what the pictures of a run need, and adds a picture to each answer in the log.

    `pictures` are small JPEG files of the answers, at most `MOST_BYTES` in all. `numbers` maps a node's path id and a
    time (s) to the index of an answer's picture. `drawn` are the written files by name, `trees` the logged trees,
    `steps` what each robot does, with the times (s). `unexplained` are the objects that nothing recognised.
    """

    def __init__(self) -> None:
        self._of_robot: dict[str, RobotArtifacts] = {}
        self.answer: Picture | None = None
        self.pictures: list[bytes] = []
        self.numbers: dict[tuple[str, float], int] = {}
        self.drawn: dict[str, Path] = {}
        self.trees: list[Mapping[str, Any]] = []
        self.steps: dict[str, list[tuple[float, str]]] = {}
        self.unexplained: list[UnexplainedObject] = []
        self._step_of: dict[str, str] = {}
        self._running: dict[str, dict[str, str]] = {}

    def of_robot(self, robot_name: str) -> RobotArtifacts:
        """Returns what was collected for a robot."""
        return self._of_robot.setdefault(robot_name, RobotArtifacts())

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Collects from a logged message; returns the message, with a picture added if it is an answer."""
        own = self.of_robot(str(message.get("robot", "")))
        if topic == TREE:
            self.trees.append(message)
            self._step_of |= _steps_of(message["root"], message["root"]["name"])
        if topic in (ACTIVITY, TRANSITIONS):
            self._caption(message)
        if topic == DETECTIONS:
            own.looked.append((own.looks, message))
            own.looks += 1
            own.seen = message if message["detections"] else own.seen
        if topic == PICTURES and "of" in message:
            own.looked.clear()
            own.looked.append((own.looks, {**message, "detections": ()}))
        elif topic == PICTURES:
            self._show(message, own)
        if topic == DESTINATION:
            own.confirmed += [] if own.seen is None else [own.seen]
            own.detection = own.detection or own.seen
        if topic == ANSWER_TOPIC:
            message = self._with_picture(message, own)
        if topic == TRANSITIONS and message["to"] == "RUNNING":
            own.begun[str(message["node"])] = own.looks
        if topic == TRANSITIONS and message["to"] == "SUCCESS" and not message.get("restored", False):
            name = _MOMENTS.get(str(message["node"]).rsplit("/", 1)[-1])
            if name is not None:
                own.moments[name] = float(message["t"])
        return message

    def _caption(self, message: Mapping[str, Any]) -> None:
        """Adds what a robot does: the node that began or spoke last of those that run, else the result of the last."""
        node, robot, t_s = str(message["node"]), str(message.get("robot", "")), round(float(message["t"]), 2)
        own, running = self.steps.setdefault(robot, []), self._running.setdefault(robot, {})
        runs = message.get("to", "RUNNING") == "RUNNING"
        if (step := self._step_of.get(node)) is None or not (running.pop(node, "") or runs):
            return
        text = " – ".join(filter(None, (step, _LEFT.sub("", str(message.get("message", ""))))))
        running |= {node: text} if runs else {}
        while own and own[-1][0] == t_s:
            own.pop()
        text = next(reversed(running.values()), text)
        own += [(t_s, text)] if not own or own[-1][1] != text else []

    def _show(self, message: Mapping[str, Any], own: RobotArtifacts) -> None:
        """Shows a picture of a skill; collects the views of an unexplained object, which is shown once."""
        shown = (str(message["caption"]), to_jpeg(message["image"]))
        if "views" in message:
            p_W = message["position_W"]
            near = (one for one in self.unexplained if math.dist(p_W[:2], one.p_W[:2]) < _SAME_M)
            if (known := next(near, None)) is None:
                known = UnexplainedObject(p_W)
                self.unexplained.append(known)
            known.views.extend(map(base64.b64decode, message["views"]))
            own.shown = [each for each in own.shown if each is not known.shown]
            known.size_m, known.shown = message["size_m"], shown
        own.shown += [shown] if len(own.shown) < MOST_SHOWN else []

    def add_to_caption(self, shown: tuple[str, bytes] | None, sentence: str) -> None:
        """Adds a sentence to the caption of a shown picture."""
        for own in self._of_robot.values():
            own.shown = [(each[0] + sentence, each[1]) if each is shown else each for each in own.shown]

    def _with_picture(self, message: Mapping[str, Any], own: RobotArtifacts) -> Mapping[str, Any]:
        """Adds a picture to an answer: the views with the found objects or the person, or all views if none was found.

        Only views since the answering node began count. A leaf, such as a question to a person, looks at nothing. The
        answer to a wanted picture is that picture.
        """
        node, confirmed = str(message["node"]), own.confirmed
        wanted = own.looked[-1][1] if own.looked and "of" in own.looked[-1][1] else None
        looked = [each for number, each in own.looked if number >= own.begun.get(node, own.looks)]
        own.confirmed = []
        own.looked.clear()
        if wanted is None and (not looked or any(_is_leaf(tree["root"], node) for tree in self.trees)):
            return message
        finds = [each for each in looked if each["detections"]] if message["answer"] else []
        found = [each for each in finds if any(each is one for one in confirmed)] or finds[-1:]
        pictures = [detection_picture(each) for each in ([wanted] if wanted else found or looked)]
        self.answer = pictures[0] if wanted or len(found) == 1 else _sheet(pictures)
        self._keep(message, self.answer)
        return {**message, "image": self.answer}

    def recall(self, events: Iterable[Event]) -> None:
        """Restores the pictures of answers that were logged before a restart."""
        for event in events:
            if event.topic == ANSWER_TOPIC and event.data.get("format") == "jpeg" and "t" in event.data:
                data = np.frombuffer(base64.b64decode(event.data["data"]), np.uint8)
                picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
                if picture is not None:
                    self._keep(event.data, np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8))

    def _keep(self, message: Mapping[str, Any], picture: Picture) -> None:
        """Stores the small picture of an answer unless it is stored already, up to `MOST_BYTES` in all."""
        key = str(message["node"]), float(message.get("t", 0.0))
        if key in self.numbers or sum(map(len, self.pictures)) >= MOST_BYTES:
            return
        small = to_jpeg(picture)
        if sum(map(len, self.pictures)) + len(small) <= MOST_BYTES:
            self.numbers[key] = len(self.pictures)
            self.pictures.append(small)


def _steps_of(node: Mapping[str, Any], step: str) -> dict[str, str]:
    """Returns the step of the mission for each leaf of a logged tree, by the leaf's path id."""
    step = str(node["name"]) if node.get("step") else step
    if not node["children"]:
        return {node["id"]: step}
    return {path_id: name for child in node["children"] for path_id, name in _steps_of(child, step).items()}


def _is_leaf(root: Mapping[str, Any], path_id: str) -> bool:
    """Returns whether a logged tree has a node of this path id without children."""
    below = root["children"]
    return (root["id"] == path_id and not below) or any(_is_leaf(child, path_id) for child in below)


def file_name(what: str, robot_name: str, robots: Sequence[str]) -> str:
    """Returns the name of a picture file without its ending; among several robots it includes the robot's name."""
    return f"{what}_{slug(robot_name)}" if len(robots) > 1 else what


def draw_artifacts(artifacts: Artifacts, simulation: Simulation, robots: Sequence[str], folder: Path) -> Sequence[Path]:
    """Writes the pictures of a recorded run into `folder` as PNG; returns their paths.

    Leaves out events before a restart, because this process did not record them.
    """
    pictures = {"map": _map(simulation, robots, newest_zones(artifacts.trees))}
    begun_s = simulation.recorder.frame_at(0.0).time_s if simulation.recorder is not None else 0.0
    for robot in robots:
        own = artifacts.of_robot(robot)
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
    """Writes the picture of the last answer as `answer.png`; returns its path, None if no question was answered."""
    if artifacts.answer is None:
        return None
    path = folder / "answer.png"
    save_png(path, artifacts.answer)
    return path


def save_pictures(events: Iterable[Event], folder: Path) -> Sequence[Path]:
    """Writes the pictures that the robots took of something into `folder`, with `pictures.json` on them."""
    taken = [event.data for event in events if event.topic == PICTURES and "of" in event.data]
    if not taken:
        return ()
    folder.mkdir(exist_ok=True)
    files, facts = [], []
    for number, each in enumerate(taken, start=1):
        files.append(folder / f"{number:02}-{slug(str(each['of']).removeprefix('the '))}.jpg")
        files[-1].write_bytes(base64.b64decode(each["data"]))
        facts.append({"file": files[-1].name, **{key: each[key] for key in _FACTS}})
    (folder / "pictures.json").write_text(json.dumps(facts, indent=1), encoding="utf-8")
    return files


def save_views(artifacts: Artifacts, folder: Path) -> None:
    """Writes the views of each unexplained object into a folder, and adds to its caption how to import it."""
    low_mm, high_mm = _SIDES_MM
    for number, one in enumerate(artifacts.unexplained, start=1):
        own = folder / f"{UNEXPLAINED}_{number}"
        own.mkdir(exist_ok=True)
        for k, view in enumerate(one.views[:MOST_VIEWS], start=1):
            (own / f"view_{k}.png").write_bytes(view)
        sides_mm = [max(low_mm, round(1e3 * side_m)) for side_m in one.size_m]
        command = f"errand object import {own.name} --name NAME --size {'x'.join(map(str, sides_mm))}"
        if len(one.views) >= FEWEST_VIEWS and max(sides_mm) <= high_mm:
            artifacts.add_to_caption(one.shown, f". Import it from the run's folder: {command}")


def to_jpeg(picture: Picture, widest_px: int = _WIDEST_PX, quality: int = _JPEG_QUALITY) -> bytes:
    """Encodes a picture as JPEG, by default at most 720 pixels wide."""
    height, width = picture.shape[:2]
    scale = min(1.0, widest_px / width)
    size = (round(width * scale), max(1, round(height * scale)))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    bgr = cv2.cvtColor(small, cv2.COLOR_RGB2BGR) if small.ndim == 3 else small
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


def _sheet(pictures: Sequence[Picture]) -> Picture:
    """Arranges pictures, shrunk to equal tiles, in a grid with few empty tiles."""
    columns = min(
        range(min(len(pictures), _ROW - 1), min(len(pictures), _ROW) + 1), key=lambda n: (-len(pictures) % n, -n)
    )
    small = [_within(each, _SMALL_PX) for each in pictures]
    small += [np.full_like(small[0], _EMPTY)] * (-len(small) % columns)
    return np.vstack([np.hstack(small[k : k + columns]) for k in range(0, len(small), columns)])


def _within(picture: Picture, size: tuple[int, int]) -> Picture:
    """Fits a picture into a tile of a size (width, height) in pixels."""
    height, width = picture.shape[:2]
    scale = min(size[0] / width, size[1] / height)
    inner = (max(1, round(width * scale)), max(1, round(height * scale)))
    tile = np.full((size[1], size[0], 3), _EMPTY, np.uint8)
    left, top = (size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2
    tile[top : top + inner[1], left : left + inner[0]] = cv2.resize(picture, inner, interpolation=cv2.INTER_AREA)
    return tile


def detection_picture(message: Mapping[str, Any]) -> Picture:
    """Draws the detections of a logged picture on it."""
    picture: Picture = message["image"]
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    for each in message["detections"]:
        picture = draw_detection(picture, tuple(each["box"]), each["class_name"], each["score"])
    return picture


def _map(simulation: Simulation, robots: Sequence[str], zones: Sequence[Mapping[str, Any]]) -> Picture:
    """Draws the world from above with zones and the path of each robot; each of several robots has its own colour."""
    world, corners = simulation.world, np.array(simulation.world.corners)
    (x0, y0), (x1, y1) = corners.min(axis=0) - _MARGIN_M, corners.max(axis=0) + _MARGIN_M
    view = top_view(simulation.query_at(simulation.clock.now()), (float(x0), float(y0), float(x1), float(y1)))
    centres = {name: tuple(np.mean(polygon, axis=0)) for name, polygon in world.rooms.items()}
    marks = {"start": (world.start.x_m, world.start.y_m)} if len(robots) == 1 else {}
    if world.dock is not None:
        marks["dock"] = (world.dock.x_m, world.dock.y_m)
    colours = [PATH_COLOUR] if len(robots) == 1 else [rgb_of(colour) for colour in ROBOT_COLOURS]
    paths = {
        f"path of {name}": (simulation.referee.path(name), colours[number % len(colours)])
        for number, name in enumerate(sorted(robots))
    }
    tracks = map(
        simulation.referee.points, {rule.name for rule in world.seed_rules.people} & {*simulation.referee.names}
    )
    people = [(float(track[-1][0]), float(track[-1][1])) for track in tracks if len(track)]
    return draw_map(view, paths, labels=centres, marks=marks, zones=zones, people=people)


def _view(simulation: Simulation, robot_name: str, time_s: float, ahead_m: float) -> Picture:
    """Renders the robot's hand at a time (s), from the side with the best view."""
    query = simulation.query_at(time_s)
    X_WH = simulation.hand_pose_at(robot_name, time_s)
    across = X_WH.rotation().matrix() @ np.array([0.2, 1.0, 0.0])
    facing_W = (float(across[0]), float(across[1]))
    X_WC = best_view(query, X_WH @ [ahead_m, 0.0, 0.0], facing_W=facing_W, distance_m=1.5 + ahead_m)
    return render_view(query, X_WC)
