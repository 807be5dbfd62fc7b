"""Rendering for the cameras: the scene at any positions of the plant, and the lights of a world.

Drake's renderer keeps Python's lock while it draws, so that the plant and a server's answers would wait. A run draws in
a process of its own, which is forked before the run has threads. Both draw the same bytes.
"""

import gc
import mmap
import os
import signal
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    ColorRenderCamera,
    DepthRenderCamera,
    FrameId,
    LightParameter,
    MakeRenderEngineVtk,
    QueryObject,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram

from executive.words.variation import DAY_LIGHT, Light

RENDERER = "vtk"
_MOST_FILES: Final = 65_536
MESA_THREADS: Final = "LP_NUM_THREADS"
"""Environment variable of Mesa's software renderer: the number of its threads."""


@dataclass(frozen=True)
class MountedCamera:
    """Camera on a link: how picture and depth are rendered, and its pose X_FC in the link's geometry frame."""

    colour: ColorRenderCamera
    depth: DepthRenderCamera
    frame: FrameId
    X_FC: RigidTransform


class Scene:
    """Renders a Diagram at any positions, in a context of its own.

    The renderer exists only in this context: in the stepped context it would follow every step, at a third of the time.
    """

    def __init__(
        self,
        diagram: Diagram,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        parameters: RenderEngineVtkParams | None = None,
        pose: Callable[[Context], None] = lambda _: None,
    ) -> None:
        """`parameters` set light and sky; the renderer's name is `RENDERER`; `pose` poses what is only seen."""
        self._plant, self._pose = plant, pose
        self._root_context = diagram.CreateDefaultContext()
        self._context = plant.GetMyMutableContextFromRoot(self._root_context)
        self._geometry_context = scene_graph.GetMyMutableContextFromRoot(self._root_context)
        self._query_port = scene_graph.get_query_output_port()
        self._scene_graph, self._parameters = scene_graph, parameters or RenderEngineVtkParams()
        self._rendering = False
        self._cameras: list[MountedCamera] = []
        self._aside: _Renderer | None = None

    def mount(self, camera: MountedCamera) -> int:
        """Adds a camera, before `render_aside`; returns its number."""
        self._cameras.append(camera)
        return len(self._cameras) - 1

    def render_aside(self) -> None:
        """Forks a process that renders for the cameras from now on. Call it while no other thread works."""
        if self._cameras:
            self._aside = _Renderer(self, self._cameras)

    def picture(self, positions: NDArray[np.float64], camera: int, *, depth: bool, time_s: float = 0.0) -> NDArray[Any]:
        """Renders a camera's picture (H, W, 3) RGB, or its depth (H, W) in m, 0 or infinite out of range.

        Raises RuntimeError when the rendering process has ended.
        """
        if self._aside is not None:
            return self._aside.picture(positions, camera, depth=depth, time_s=time_s)
        query, one = self.query_at(positions, time_s), self._cameras[camera]
        if depth:
            return np.array(query.RenderDepthImage(one.depth, one.frame, one.X_FC).data[..., 0])
        return np.ascontiguousarray(query.RenderColorImage(one.colour, one.frame, one.X_FC).data[..., :3])

    def query_at(self, positions: NDArray[np.float64], time_s: float = 0.0) -> QueryObject:
        """Returns the scene with the plant at `positions`, and gestures at a time; it is valid until the next call.

        The first call creates the renderer, which loads all meshes. Without a graphics card it draws in the calling
        thread, unless the environment says otherwise: for small pictures, other threads cost as much as the drawing.
        """
        if not self._rendering:
            self._rendering = True
            os.environ.setdefault(MESA_THREADS, "0")
            self._scene_graph.AddRenderer(self._geometry_context, RENDERER, MakeRenderEngineVtk(self._parameters))
        self._root_context.SetTime(time_s)
        self._plant.SetPositions(self._context, positions)
        self._pose(self._root_context)
        query = self._query_port.Eval(self._geometry_context)
        assert isinstance(query, QueryObject)
        return query


class _Renderer:
    """A forked process that renders for the cameras of a scene; pictures come back in shared memory."""

    def __init__(self, scene: Scene, cameras: Sequence[MountedCamera]) -> None:
        """Forks the process, which ends with this object."""
        lenses = [(one.colour.core().intrinsics(), one.depth.core().intrinsics()) for one in cameras]
        self._shapes = [((c.height(), c.width(), 3), (d.height(), d.width())) for c, d in lenses]
        self._memory = mmap.mmap(-1, 4 * max(lens.height() * lens.width() for both in lenses for lens in both))
        self._connection, theirs = Pipe()
        process = os.fork()
        if process == 0:
            self._serve(scene, theirs)
        theirs.close()
        weakref.finalize(self, _end, self._connection, process)

    def picture(self, positions: NDArray[np.float64], camera: int, *, depth: bool, time_s: float) -> NDArray[Any]:
        """See `Scene.picture`."""
        try:
            self._connection.send_bytes(bytes([depth, camera]) + np.append(positions, time_s).tobytes())
            trouble = self._connection.recv_bytes()
        except (EOFError, OSError) as error:
            raise RuntimeError("the process that renders the cameras' pictures has ended") from error
        if trouble:
            raise RuntimeError(f"rendering failed: {trouble.decode()}")
        return self._shared(camera, depth=depth).copy()

    def _shared(self, camera: int, *, depth: bool) -> NDArray[Any]:
        """The shared memory as a picture or the depth of a camera."""
        return np.ndarray(self._shapes[camera][depth], np.float32 if depth else np.uint8, self._memory)

    def _serve(self, scene: Scene, connection: Connection) -> None:
        """Renders in the forked process until the other end is closed; never returns."""
        try:
            for ignored in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):  # the run ends, and then this process
                signal.signal(ignored, signal.SIG_IGN)
            gc.disable()
            for first, end in ((3, connection.fileno()), (connection.fileno() + 1, _MOST_FILES)):
                os.closerange(first, end)  # locks, sockets and connections of the run, which end with it
            while True:
                depth, camera, *_ = request = connection.recv_bytes()
                try:
                    *positions, time_s = np.frombuffer(request[2:])
                    shown = scene.picture(np.array(positions), camera, depth=bool(depth), time_s=time_s)
                    self._shared(camera, depth=bool(depth))[:] = shown
                    connection.send_bytes(b"")
                except Exception as error:
                    connection.send_bytes(f"{type(error).__name__}: {error}".encode())
        finally:
            os._exit(0)


def _end(connection: Connection, process: int) -> None:
    """Ends a rendering process and waits for it."""
    connection.close()
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)


SKY = (0.78, 0.87, 0.96)
_BEAMS = (
    ((0.92, 0.20, -0.30), 0.78),
    ((-0.92, 0.20, -0.30), 0.88),
    ((-0.20, 0.92, -0.30), 0.72),
    ((0.20, -0.92, -0.30), 0.82),
    ((0.0, 0.0, 1.0), 0.40),
)


def lights(light: Light = DAY_LIGHT) -> list[LightParameter]:
    """Directional lights of a world: daylight from above, softer from the sides and the floor, scaled by `light`.

    Rooms have no ceiling and rendering casts no shadows, so a few directions are enough.
    """
    beams = [(direction, intensity * light.brightness) for direction, intensity in _BEAMS]
    return [
        LightParameter(
            type="directional",
            frame="world",
            direction=np.array(direction),
            intensity=intensity,
            color=Rgba(*light.colour),
        )
        for direction, intensity in (*beams, *(() if light.sun is None else (light.sun,)))
    ]


def render_parameters(light: Light = DAY_LIGHT) -> RenderEngineVtkParams:
    """Parameters of Drake's VTK renderer: the lights of a world and the colour of its sky."""
    sky = np.clip(np.array(SKY) * np.array(light.colour) * min(1.0, light.brightness), 0.0, 1.0)
    return RenderEngineVtkParams(default_clear_color=sky, lights=lights(light))
