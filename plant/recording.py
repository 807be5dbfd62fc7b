"""Recordings of the plant: positions over time, shown afterwards in one HTML file or live in a browser."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatParams, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram, build_diagram
from skills.robot import FloatArray

FRAMES_PER_SECOND = 16.0
_MOST_BYTES = 9.5e6
_BODY_BYTES = 105.0
_FEWEST_FRAMES = 400
"""A frame takes `_BODY_BYTES` of a file for each body; the shapes of a world take about ten megabytes."""
BESIDE_M = (-0.4, -1.0, 3.6)
"""Offset of the following camera from the robot, in the axes of the world: steep, to look over a wall behind it."""
_OVERLAY = Path(__file__).parent / "recording_overlay.html"
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

    @staticmethod
    def close_up(p_W: FloatArray) -> View:
        """Returns a view of a point in which a robot of about a metre fills the picture."""
        x, y, z = (float(value) for value in p_W)
        dx, dy, dz = BESIDE_M
        return View((x + dx, y + dy, z + dz), (x, y, z))


def prepare_view(meshcat: Meshcat, view: View | None) -> None:
    """Removes the grid and the axes, lays ground below the world, sets the light, and sets the camera to `view`."""
    meshcat.SetObject("/ground", Box(_GROUND_M, _GROUND_M, 0.02), _GROUND)
    meshcat.SetTransform("/ground", RigidTransform([0.0, 0.0, -0.06]))
    for helper in ("/Grid", "/Axes"):
        meshcat.SetProperty(helper, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.6)
    if view is not None:
        set_camera(meshcat, view)


def set_camera(meshcat: Meshcat, view: View) -> None:
    """Sets the camera of all browsers to a view."""
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
    page, end = meshcat.StaticHtml().rsplit("</body>", 1)
    data = f'<script id="recorded-run" type="application/json">{told}</script>'
    path.write_text(f"{page}{data}\n{_OVERLAY.read_text(encoding='utf-8')}</body>{end}", encoding="utf-8")


HOST = "127.0.0.1"
PERIOD_WALL_S = 0.1
EASY_PERIOD_WALL_S = 0.7


class LiveScene:
    """Live scene of the plant in browsers; call it after every tick, from the thread that created it.

    It only reads the plant's context, so a run is the same with and without it.
    """

    def __init__(self, world: WorldDiagram, context: Context, view: View | None = None) -> None:
        """Shows the plant of `context` from `view`. Raises RuntimeError when no port is free."""
        self._plant, self._context, self._view = world.plant, context, view
        self._followed = next((robot.body for _, robot in sorted(world.robots.items())), None)
        self._follows, self._camera_at = False, view
        self._meshcat = Meshcat(MeshcatParams(host=HOST, port=0, show_stats_plot=False))
        prepare_view(self._meshcat, view)
        self._shown = build_diagram(replace(world.config, render=False), self._meshcat)
        self._root_context = self._shown.diagram.CreateDefaultContext()
        self._shown_context = self._shown.plant.GetMyMutableContextFromRoot(self._root_context)
        self._period_s = PERIOD_WALL_S
        self.publish()

    @property
    def url(self) -> str:
        """Address of the scene; its host name differs, so that a browser gives the scene a process of its own."""
        return f"http://localhost:{self._meshcat.port()}"

    def __call__(self, now_s: float) -> None:
        """Refreshes the scene when a refresh is due in wall-clock time."""
        if time.perf_counter() - self._published_s >= self._period_s:
            self._root_context.SetTime(now_s)
            self.publish()

    def refresh_seldom(self) -> None:
        """Refreshes less often, for a browser without a GPU; callable from any thread."""
        self._period_s = EASY_PERIOD_WALL_S

    def follow(self, wanted: bool) -> None:
        """Lets the camera follow the first robot, or show the whole world; callable from any thread."""
        self._follows = wanted

    def publish(self) -> None:
        """Refreshes the scene now."""
        camera = self._view
        if self._follows and self._followed is not None:
            camera = View.close_up(self._followed.EvalPoseInWorld(self._context).translation())
        if camera is not None and camera != self._camera_at:
            set_camera(self._meshcat, camera)
            self._camera_at = camera
        self._shown.plant.SetPositions(self._shown_context, self._plant.GetPositions(self._context))
        self._shown.arms.pose(self._root_context)
        self._shown.diagram.ForcedPublish(self._root_context)
        self._published_s = time.perf_counter()
