"""The world in a browser while it is simulated: a Meshcat on 127.0.0.1, refreshed a few times a second."""

from __future__ import annotations

import time

from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.recording import View, prepare_view, set_camera

HOST = "127.0.0.1"
PERIOD_WALL_S = 0.1
EASY_PERIOD_WALL_S = 0.7


class LiveScene:
    """Shows the plant's positions; call it after every tick, from the thread that made it.

    It reads the plant's context and changes nothing there: a run is the same with it and without.
    """

    def __init__(self, world: WorldDiagram, context: Context, view: View | None = None) -> None:
        """Show the plant of `context`, seen from `view`, with the camera behind the first robot where one is followed.

        Raises RuntimeError when no port is free.
        """
        self._plant, self._context, self._view = world.plant, context, view
        self._followed = next((robot.body for _, robot in sorted(world.robots.items())), None)
        self._follows, self._camera_at = False, view
        self._meshcat = Meshcat(MeshcatParams(host=HOST, port=0, show_stats_plot=False))
        prepare_view(self._meshcat, view)
        self._shown = world.rebuild(self._meshcat)
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
        """Let the camera go along with the first robot, or show the whole world again; from any thread."""
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
