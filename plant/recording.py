"""Recordings of the plant: positions over time, shown afterwards in one HTML file or live in a browser."""

from __future__ import annotations

import gzip
import json
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatParams, Rgba
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram, build_diagram
from skills.robot import FloatArray

FRAMES_PER_SECOND = 16.0
_MOST_BYTES = 9.5e6
_BODY_BYTES = 105.0
_FEWEST_FRAMES = 400
"""A frame takes `_BODY_BYTES` of a file for each body; the shapes of a world take about ten megabytes."""
_OVERLAY = Path(__file__).parent / "recording_overlay.html"
_SCENE_OVERLAY = Path(__file__).parent / "scene_overlay.html"
_WALLS = Path(__file__).parent / "scene_walls.html"
_HEAD = '<meta name="viewport" content="width=device-width, initial-scale=1"><title>Robots in 3D – Errand</title>'
_DIGITS = 4
_TRACK_PERIOD_S = 0.2
_WIDE_RATIO = 1.4
"""Width of a window for its height in which the overview shows the whole world."""
_GROUND_M = 200.0
_GROUND = Rgba(0.52, 0.54, 0.5)
Steps = Mapping[str, Sequence[tuple[float, str]]]
"""What each robot does, in words, from which times (s) on."""


@dataclass(frozen=True)
class Frame:
    """All positions of the plant at one time."""

    time_s: float
    positions: FloatArray


class Recorder:
    """Records the plant's positions at a fixed rate; call it after every step.

    When there are too many frames, it drops those that their neighbours interpolate best: few frames remain from times
    with little motion, many from times of work.
    """

    def __init__(
        self,
        world: WorldDiagram,
        context: Context,
        frames_per_second: float = FRAMES_PER_SECOND,
        *,
        most_frames: int | None = None,
    ) -> None:
        """Records from the plant's `context`, at most `most_frames` (None: as many as fit into a file of 20 MB)."""
        self._plant, self._context = world.plant, context
        self._period_s = 1.0 / frames_per_second
        self.frames: list[Frame] = []
        self._most = most_frames or max(_FEWEST_FRAMES, round(_MOST_BYTES / (_BODY_BYTES * world.plant.num_bodies())))

    def __call__(self, now_s: float) -> None:
        """Records a frame when one is due."""
        if not self.frames or now_s - self.frames[-1].time_s >= self._period_s - 1e-9:
            self.frames.append(Frame(now_s, self._plant.GetPositions(self._context).copy()))
        if len(self.frames) > self._most:
            self.frames = thin_out(self.frames)

    def shorten(self) -> None:
        """Drops frames until few are left, which are soon written."""
        while len(self.frames) > _FEWEST_FRAMES:
            self.frames = thin_out(self.frames)

    def frame_at(self, time_s: float) -> Frame:
        """Returns the last frame at or before a time, or the first. Raises LookupError when there are no frames."""
        if not self.frames:
            raise LookupError("nothing was recorded")
        earlier = [frame for frame in self.frames if frame.time_s <= time_s + 1e-9]
        return earlier[-1] if earlier else self.frames[0]


def thin_out(frames: Sequence[Frame]) -> list[Frame]:
    """Drops a quarter of the frames: among every second frame, the half that the neighbours interpolate best.

    The first and the last frame stay.
    """
    inner = np.arange(1, len(frames) - 1, 2)
    times_s = np.array([frame.time_s for frame in frames])
    positions = np.array([frame.positions for frame in frames])
    share = (times_s[inner] - times_s[inner - 1]) / (times_s[inner + 1] - times_s[inner - 1])
    between = positions[inner - 1] + share[:, None] * (positions[inner + 1] - positions[inner - 1])
    off = np.max(np.abs(positions[inner] - between), axis=1, initial=0.0)
    dropped = set(inner[np.argsort(off, kind="stable")[: (len(inner) + 1) // 2]].tolist())
    return [frame for number, frame in enumerate(frames) if number not in dropped]


@dataclass(frozen=True)
class View:
    """Camera view: position and target, in the world frame (m)."""

    p_WCamera: tuple[float, float, float]
    p_WTarget: tuple[float, float, float]

    @staticmethod
    def from_above(corners_W: Sequence[tuple[float, float]]) -> View:
        """Returns a view from the south and above that shows all corners (x, y)."""
        low, high = np.min(corners_W, axis=0), np.max(corners_W, axis=0)
        x, y = (float(value) for value in (low + high) / 2)
        size = float(np.linalg.norm(high - low))
        return View((x, y - 0.30 * size, 0.62 * size), (x, y, 0.0))


def prepare_view(meshcat: Meshcat, view: View | None) -> None:
    """Removes the grid and the axes, lays ground below the world, sets the light, and sets the camera to `view`."""
    meshcat.SetObject("/ground", Box(_GROUND_M, _GROUND_M, 0.02), _GROUND)
    meshcat.SetTransform("/ground", RigidTransform([0.0, 0.0, -0.06]))
    for helper in ("/Grid", "/Axes"):
        meshcat.SetProperty(helper, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.6)
    if view is not None:
        meshcat.SetCameraPose(np.array(view.p_WCamera), np.array(view.p_WTarget))


def save_html(
    world: WorldDiagram,
    frames: Sequence[Frame],
    path: Path,
    view: View | None = None,
    steps: Steps = MappingProxyType({}),
) -> None:
    """Writes an animation of `frames` as one HTML file without a server, with the robots' `steps` as captions.

    The camera follows the first robot; `view` shows the whole world.
    """
    meshcat = Meshcat(MeshcatParams(host=HOST, port=0, show_stats_plot=False))  # it cannot do without a port
    prepare_view(meshcat, view)
    shown = build_diagram(replace(world.config, render=False), meshcat)
    root_context = shown.diagram.CreateDefaultContext()
    context = shown.plant.GetMyMutableContextFromRoot(root_context)
    tracks: dict[str, list[tuple[float, float, float]]] = {name: [] for name in sorted(shown.robots)}
    meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
    for frame in frames:
        root_context.SetTime(frame.time_s)
        shown.plant.SetPositions(context, frame.positions)
        shown.arms.pose(root_context)
        shown.diagram.ForcedPublish(root_context)
        for name, track in tracks.items():
            if not track or frame.time_s - track[-1][0] >= _TRACK_PERIOD_S:
                x_m, y_m, _ = shown.robots[name].body.EvalPoseInWorld(context).translation()
                track.append((round(frame.time_s, 2), round(x_m, 3), round(y_m, 3)))
    meshcat.StopRecording()
    meshcat.PublishRecording()
    overview = None if view is None else [view.p_WCamera, view.p_WTarget]
    values = {"tracks": tracks, "steps": {**steps}, "view": overview, "ratio": _WIDE_RATIO}
    told = json.dumps(values).replace("<", "\\u003c")
    data = f'<script id="recorded-run" type="application/json">{told}</script>\n'
    path.write_text(_page(meshcat, _OVERLAY, data), encoding="utf-8")


def _page(meshcat: Meshcat, overlay: Path, data: str = "") -> str:
    """Page of a scene that needs no server, with an overlay and its data."""
    page, end = meshcat.StaticHtml().replace("<title>Drake MeshCat</title>", _HEAD, 1).rsplit("</body>", 1)
    added = "".join(each.read_text(encoding="utf-8") for each in (_WALLS, overlay))
    return f"{page}{data}{added}</body>{end}"


HOST = "127.0.0.1"
PERIOD_WALL_S = 0.1
_WRITE_PAGE = "from plant.recording import write_scene_page; write_scene_page()"


class LiveScene:
    """Live scene of the plant for a page; call it after every tick. It only reads the plant: a run stays the same."""

    def __init__(self, world: WorldDiagram, context: Context, view: View | None = None) -> None:
        """Shows the plant of `context` from `view`."""
        self._given, self._context = (replace(world.config, render=False, renderer_parameters=None), view), context
        robots = [robot.body for _, robot in sorted(world.robots.items())]
        bodies = [*robots, *(world.plant.get_body(BodyIndex(index)) for index in range(1, world.plant.num_bodies()))]
        self._bodies = {str(body.scoped_name()).replace("::", "/"): body for body in bodies}  # by Meshcat's path
        self._followed = next(iter(self._bodies)) if robots else None
        self._arms = world.arms
        self._tell: Callable[[Mapping[str, object]], None] = lambda _: None
        self._wanted: Callable[[], bool] = lambda: False
        self._sent: Mapping[str, object] = {}
        self._published_s = -np.inf

    def page(self) -> bytes:
        """Builds the HTML page of the scene, compressed by gzip; callable from any thread. Raises RuntimeError.

        A process of its own builds it, since Meshcat lets any number of clients in, and ends the process if another
        thread than its own frees it.
        """
        command, given = (sys.executable, "-c", _WRITE_PAGE), pickle.dumps(self._given)
        ended = subprocess.run(command, input=given, capture_output=True, check=False)
        if ended.returncode:
            raise RuntimeError(f"the 3D scene cannot be built: {ended.stderr.decode(errors='replace')[-500:]}")
        return ended.stdout

    def send(self, tell: Callable[[Mapping[str, object]], None], wanted: Callable[[], bool]) -> None:
        """Sends the poses of the bodies by `tell` at each refresh, while they are `wanted`."""
        self._tell, self._wanted = tell, wanted

    def __call__(self) -> None:
        """Refreshes the scene when a refresh is wanted, and due in wall-clock time."""
        if time.perf_counter() - self._published_s >= PERIOD_WALL_S and self._wanted():
            self.publish()

    def publish(self) -> None:
        """Refreshes the scene now: X_WB of each body, by columns, without the last row, to a tenth of a millimetre."""
        X_WB = {path: body.EvalPoseInWorld(self._context) for path, body in self._bodies.items()}
        X_WB |= self._arms.poses(self._context)
        poses = {path: X.GetAsMatrix34().T.round(_DIGITS).ravel().tolist() for path, X in X_WB.items()}
        if poses != self._sent:
            self._tell({"followed": self._followed, "poses": poses})
        self._sent, self._published_s = poses, time.perf_counter()


def write_scene_page() -> None:
    """Writes the page of a scene to standard output, from a DiagramConfig and a View in standard input."""
    config, view = pickle.load(sys.stdin.buffer)
    meshcat = Meshcat(MeshcatParams(host=HOST, port=0, show_stats_plot=False))
    prepare_view(meshcat, view)
    shown = build_diagram(config, meshcat)
    root_context = shown.diagram.CreateDefaultContext()
    shown.arms.pose(root_context)
    shown.diagram.ForcedPublish(root_context)
    sys.stdout.buffer.write(gzip.compress(_page(meshcat, _SCENE_OVERLAY).encode(), compresslevel=1))
