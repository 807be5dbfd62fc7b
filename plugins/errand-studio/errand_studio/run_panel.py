"""Panel that starts and stops a run, and shows its live page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from html import escape
from typing import Final

from nicegui import ui

from errand_studio import fragments
from errand_studio.layout import head, panel, tool
from errand_studio.running import MissionRuns, RunOptions
from executive.app.prepare.mission_files import shipped_missions
from plant.worlds.world import known_worlds

_LAST_LINES: Final = 30


class RunPanel:
    """Form of a run, with the page and the last lines of the current run."""

    def __init__(self, runs: MissionRuns, start: Callable[[], Awaitable[None]]) -> None:
        """Builds the panel, which is hidden; `start` is called by its button."""
        self._runs, self._shown_page = runs, ""
        with panel() as self._panel:
            with head("Run"):
                self._state = ui.html("", sanitize=False)
                self._start_button = tool("Start", start, kind="main")
                self._stop_button = tool("Stop", self._stop, kind="stop", hint="Ends the run in order")
            with ui.element("div").classes("form"):
                self._build_form()
            self._live = ui.html("", sanitize=False).classes("grow").style("display:flex;min-height:0")
            self._lines = ui.html("", sanitize=False).style("max-height:26%;overflow:auto;flex:none")
        self._panel.set_visibility(False)

    def _build_form(self) -> None:
        worlds = {"": "world: as the mission says", **{name: f"world: {name}" for name in sorted(known_worlds())}}
        scenarios = sorted(next(iter(shipped_missions().values())).parent.glob("scenarios/*.yaml"))
        named = {"": "no scenario", **{str(file): f"scenario: {file.stem}" for file in scenarios}}
        self._world = ui.select(worlds, value="")
        self._scenario = ui.select(named, value="")
        self._robots = ui.input(placeholder="robots: as the mission says; or alice=spot,bob=fetch")
        self._seed = ui.number(prefix="seed", value=1, min=0, max=2_147_483_647, precision=0)
        self._people = ui.number(prefix="people", value=0, min=0, max=8, precision=0)
        self._faults = ui.input(placeholder="fault: camera.hand: dropout 5 s at 20 s")
        for field in (self._world, self._scenario, self._robots, self._seed, self._people, self._faults):
            field.props("dense outlined")

    @property
    def is_shown(self) -> bool:
        """Returns whether the panel is shown."""
        return bool(self._panel.visible)

    def show(self, shown: bool) -> None:
        """Shows or hides the panel."""
        self._panel.set_visibility(shown)
        self.draw()

    @property
    def options(self) -> RunOptions:
        """Options in the form."""
        return RunOptions(
            world=str(self._world.value or ""),
            seed=int(self._seed.value or 0),
            robots=str(self._robots.value or ""),
            scenario=str(self._scenario.value or ""),
            faults=str(self._faults.value or ""),
            people=int(self._people.value or 0),
        )

    def draw(self) -> None:
        """Shows the state of the current run."""
        current = self._runs.current
        going = current is not None and current.goes_on
        self._start_button.set_visibility(not going)
        self._stop_button.set_visibility(current is not None and not current.is_over)
        stopping = current is not None and current.is_stopping
        self._stop_button.text = "Close the page" if not going else "End at once" if stopping else "Stop"
        if current is None or not self.is_shown:
            return
        self._state.content = fragments.run_html(current.name, current.result, goes_on=going)
        self._lines.content = fragments.lines_html([*current.lines][-_LAST_LINES:], current.note)
        page = "" if current.is_over else current.page
        if page != self._shown_page:
            self._shown_page = page
            frame = f'<iframe class="live" title="live page" src="{escape(page)}"></iframe>'
            self._live.content = frame if page else ""

    def _stop(self) -> None:
        if (current := self._runs.current) is not None:
            current.stop()
            self.draw()
