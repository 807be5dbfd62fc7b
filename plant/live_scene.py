"""The world in a browser while it is simulated: a Meshcat on 127.0.0.1, refreshed a few times a second."""

from __future__ import annotations

import time

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.systems.framework import Context

from plant.diagram import WorldDiagram
from plant.recording import View

HOST = "127.0.0.1"
PERIOD_WALL_S = 0.1
EASY_PERIOD_WALL_S = 0.7


class LiveScene:
    """Shows the plant's positions; call it after every step, from the thread that made it.

    It reads the plant's context and changes nothing there: a run is the same with it and without.
    """

    def __init__(self, world: WorldDiagram, context: Context, view: View | None = None) -> None:
        """Show the plant of `context`, seen from `view`. Raises RuntimeError when no port is free."""
        self._plant, self._context = world.plant, context
        self._meshcat = Meshcat(MeshcatParams(host=HOST, port=0, show_stats_plot=False))
        for helper in ("/Grid", "/Axes"):
            self._meshcat.SetProperty(helper, "visible", False)
        if view is not None:
            self._meshcat.SetCameraPose(np.array(view.p_WCamera), np.array(view.p_WTarget))
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

    def publish(self) -> None:
        """Refresh the scene now."""
        self._shown.plant.SetPositions(self._shown_context, self._plant.GetPositions(self._context))
        self._shown.diagram.ForcedPublish(self._root_context)
        self._published_s = time.perf_counter()
