"""`errand run --view`: the live page of one run, which stays as a replay when the run has ended."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from rich.console import Console

from executive.cli.replay_command import served, wait
from executive.cli.requests import Request
from executive.compiler import compile_mission
from executive.control import Control
from executive.errors import InputError
from executive.language import load_parser
from executive.language.parser import SpacyParser
from executive.mission import mission_from_sentence
from executive.record.event_log import EventLog
from executive.record.schemas import MAP
from executive.record.surroundings import map_message
from executive.registry import built_in_skills
from executive.runner import Progress
from executive.view.actions import Action, RefusedError, control_actions, text_of
from executive.view.feed import Feed
from executive.view.server import PageContent, PageServer
from executive.view.watch import ControlWatch, ProgressWatch
from plant.live_scene import LiveScene
from plant.simulation import Simulation
from skills.estimate.grid_map import load_grid_map


class PageView:
    """The page of one run: `begin` before it, called as an observer while it runs, `end` and `stay` after it."""

    def __init__(self, request: Request, console: Console, *, port: int = 0) -> None:
        self._request, self._console, self._port = request, console, port
        self.control = Control(attended=True)
        self._feed = Feed()
        self._threads = ThreadPoolExecutor(1, thread_name_prefix="errand-parser")
        self._progress = ProgressWatch(self._feed)
        self._parser: Future[SpacyParser] | None = None
        self._server: PageServer | None = None
        self._watch: ControlWatch | None = None

    def begin(self, log: EventLog, simulation: Simulation) -> None:
        """Serve the page and print its address. Raises InputError when the port is taken."""
        log.listen(self._feed)
        self._parser = self._threads.submit(load_parser)
        scene = simulation.show_live()
        actions = {**control_actions(self.control), "say": self._say(), "ease": easing(scene)}
        content = PageContent(self._feed, actions, scene_url=scene.url)
        self._server = served(content, self._port)
        self._watch = ControlWatch(self.control, self._feed)
        self._console.print(f"The page: {self._server.url}", markup=False)

    def __call__(self, progress: Progress) -> None:
        """One tick has passed."""
        self._progress(progress)

    def end(self, recording: Path | None) -> None:
        """The run is over; from now on the page shows the recording where there is one."""
        if self._server is not None and recording is not None and recording.is_file():
            self._server.offer_recording(recording)

    def stay(self, limit_s: float | None) -> None:
        """Keep serving until Ctrl-C or the limit (s, on the wall's clock), and close."""
        try:
            if self._server is not None:
                self._console.print(
                    "The page stays until Ctrl-C." if limit_s is None else f"The page: {limit_s:g} s more."
                )
                wait(limit_s)
        finally:
            self.close()

    def close(self) -> None:
        """Serve no more; idempotent."""
        self._threads.shutdown(wait=False)
        if self._watch is not None:
            self._watch.close()
        if self._server is not None:
            self._server.close()

    def _say(self) -> Action:
        """An action that has a sentence done before all else."""

        def say(values: Mapping[str, Any]) -> str:
            sentence = text_of(values, "text")
            try:
                return f"first: {self._preempt(sentence)}"
            except (InputError, ValueError) as error:
                raise RefusedError(str(error)) from error

        return say

    def _preempt(self, sentence: str) -> str:
        request = self._request
        mission = mission_from_sentence(
            sentence,
            parser=(self._parser or self._threads.submit(load_parser)).result(),
            knowledge=request.knowledge,
            world=request.world.name,
            require_wake=False,
        )
        tree = compile_mission(mission, knowledge=request.knowledge, registry=built_in_skills())
        self.control.preempt(tree)
        return "; ".join(map(str, mission.commands))


def easing(scene: LiveScene) -> Action:
    """An action for a browser that draws slowly: the scene is refreshed less often."""

    def ease(_: Mapping[str, Any]) -> str:
        scene.go_easy()
        return "the scene is refreshed less often"

    return ease


def log_map(log: EventLog, request: Request) -> None:
    """Write the surveyed map into the log, so that the log stands alone."""
    grid = load_grid_map(request.world.scan_map_path)
    log(MAP, map_message(grid, request.knowledge, world=request.world.name))
