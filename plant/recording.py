"""What happened in the plant, kept as states over time, and shown afterwards as one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
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
        """Keep a frame when one is due."""
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
    """Put the camera of all browsers there."""
    meshcat.SetCameraPose(np.array(view.p_WCamera), np.array(view.p_WTarget))


def save_html(world: WorldDiagram, frames: Sequence[Frame], path: Path, view: View | None = None) -> None:
    """Write an animation of `frames` as one HTML file that needs no server and opens on `view`."""
    meshcat = Meshcat()
    prepare_view(meshcat, view)
    shown = world.rebuild(meshcat)
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
