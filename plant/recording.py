"""What happens in the plant: kept as states over time and shown afterwards as one HTML file, or shown while it does."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram, build_diagram
from skills.robot import FloatArray

FRAMES_PER_SECOND = 16.0
_MOST_BYTES = 9.5e6
_BODY_BYTES = 105.0
_FEWEST_FRAMES = 400
"""A frame takes so much of a file for each body; the shapes of a world take about ten megabytes."""
BESIDE_M = (-0.7, -1.5, 3.0)
"""Where a camera that goes along stands from the robot, in the world's axes."""


@dataclass(frozen=True)
class Frame:
    """All positions of the plant at one time."""

    time_s: float
    positions: FloatArray


class Recorder:
    """Keeps the plant's positions at a fixed rate, and in a long run fewer of them; call it after every step.

    When there are too many frames, those go that the frames before and after tell best: while little moves there are
    few, and while a robot works there are many.
    """

    def __init__(
        self,
        world: WorldDiagram,
        context: Context,
        frames_per_second: float = FRAMES_PER_SECOND,
        *,
        most_frames: int | None = None,
    ) -> None:
        """Record from the plant's `context`, `most_frames` at most (None: as many as fit into a file of 20 MB)."""
        self._plant, self._context = world.plant, context
        self._period_s = 1.0 / frames_per_second
        self._frames: list[Frame] = []
        self._most = most_frames or max(_FEWEST_FRAMES, round(_MOST_BYTES / (_BODY_BYTES * world.plant.num_bodies())))

    def __call__(self, now_s: float) -> None:
        """Keeps a frame when one is due."""
        if not self._frames or now_s - self._frames[-1].time_s >= self._period_s - 1e-9:
            self._frames.append(Frame(now_s, self._plant.GetPositions(self._context).copy()))
        if len(self._frames) > self._most:
            self._frames = thinned(self._frames)

    @property
    def frames(self) -> Sequence[Frame]:
        """All frames so far."""
        return self._frames

    def at(self, time_s: float) -> Frame:
        """The last frame at or before a time, or the first. Raises LookupError when nothing was recorded."""
        if not self._frames:
            raise LookupError("nothing was recorded")
        earlier = [frame for frame in self._frames if frame.time_s <= time_s + 1e-9]
        return earlier[-1] if earlier else self._frames[0]


def thinned(frames: Sequence[Frame]) -> list[Frame]:
    """A quarter fewer frames: of every second one, the half that the frames before and after tell best.

    The first and the last frame stay.
    """
    inner = np.arange(1, len(frames) - 1, 2)
    times_s = np.array([frame.time_s for frame in frames])
    positions = np.array([frame.positions for frame in frames])
    share = (times_s[inner] - times_s[inner - 1]) / (times_s[inner + 1] - times_s[inner - 1])
    between = positions[inner - 1] + share[:, None] * (positions[inner + 1] - positions[inner - 1])
    off = np.max(np.abs(positions[inner] - between), axis=1, initial=0.0)
    gone = set(inner[np.argsort(off, kind="stable")[: (len(inner) + 1) // 2]].tolist())
    return [frame for number, frame in enumerate(frames) if number not in gone]


@dataclass(frozen=True)
class View:
    """Where a camera stands and what it looks at, in the world frame (m)."""

    p_WCamera: tuple[float, float, float]
    p_WTarget: tuple[float, float, float]

    @staticmethod
    def over(corners_W: Sequence[tuple[float, float]]) -> View:
        """From the south and above, so that all corners (x, y) are seen."""
        low, high = np.min(corners_W, axis=0), np.max(corners_W, axis=0)
        x, y = (float(value) for value in (low + high) / 2)
        size = float(np.linalg.norm(high - low))
        return View((x, y - 0.30 * size, 0.62 * size), (x, y, 0.0))

    @staticmethod
    def beside(p_W: FloatArray) -> View:
        """Near a point, from where a robot of about a metre fills the picture."""
        x, y, z = (float(value) for value in p_W)
        dx, dy, dz = BESIDE_M
        return View((x + dx, y + dy, z + dz), (x, y, z))


def prepare_view(meshcat: Meshcat, view: View | None) -> None:
    """Light without a grid and axes, and the camera on `view`."""
    for helper in ("/Grid", "/Axes"):
        meshcat.SetProperty(helper, "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.6)
    if view is not None:
        set_camera(meshcat, view)


def set_camera(meshcat: Meshcat, view: View) -> None:
    """Puts the camera of all browsers there."""
    meshcat.SetCameraPose(np.array(view.p_WCamera), np.array(view.p_WTarget))


def save_html(world: WorldDiagram, frames: Sequence[Frame], path: Path, view: View | None = None) -> None:
    """Writes an animation of `frames` as one HTML file that needs no server and opens on `view`."""
    meshcat = Meshcat()
    prepare_view(meshcat, view)
    shown = build_diagram(replace(world.config, render=False), meshcat)
    root_context = shown.diagram.CreateDefaultContext()
    context = shown.plant.GetMyMutableContextFromRoot(root_context)
    meshcat.StartRecording(frames_per_second=FRAMES_PER_SECOND)
    for frame in frames:
        root_context.SetTime(frame.time_s)
        shown.plant.SetPositions(context, frame.positions)
        shown.diagram.ForcedPublish(root_context)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    path.write_text(meshcat.StaticHtml())


HOST = "127.0.0.1"
PERIOD_WALL_S = 0.1
EASY_PERIOD_WALL_S = 0.7


class LiveScene:
    """Shows the plant's positions; call it after every tick, from the thread that made it.

    It reads the plant's context and changes nothing there: a run is the same with it and without.
    """

    def __init__(self, world: WorldDiagram, context: Context, view: View | None = None) -> None:
        """Shows the plant of `context`, seen from `view`, with the camera behind the first robot where one is followed.

        Raises RuntimeError when no port is free.
        """
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
        """The address of the scene; by another name of this machine, so that a browser draws it in a process apart."""
        return f"http://localhost:{self._meshcat.port()}"

    def __call__(self, now_s: float) -> None:
        """Refresh the scene when it is time again on the wall's clock."""
        if time.perf_counter() - self._published_s >= self._period_s:
            self._root_context.SetTime(now_s)
            self.publish()

    def go_easy(self) -> None:
        """Refresh seldom, for a browser that draws without a graphics processor; from any thread."""
        self._period_s = EASY_PERIOD_WALL_S

    def follow(self, wanted: bool) -> None:
        """Lets the camera go along with the first robot, or shows the whole world again; from any thread."""
        self._follows = wanted

    def publish(self) -> None:
        """Refresh the scene now."""
        camera = self._camera()
        if camera is not None and camera != self._camera_at:
            set_camera(self._meshcat, camera)
            self._camera_at = camera
        self._shown.plant.SetPositions(self._shown_context, self._plant.GetPositions(self._context))
        self._shown.diagram.ForcedPublish(self._root_context)
        self._published_s = time.perf_counter()

    def _camera(self) -> View | None:
        if self._follows and self._followed is not None:
            return View.beside(self._followed.EvalPoseInWorld(self._context).translation())
        return self._view
