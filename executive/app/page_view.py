"""`--view`: the live page of one run, which stays as a replay when the run has ended."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.app.backend import Scene
from executive.app.conversations import Talk, load_ahead
from executive.app.feasibility import refuse_impossible
from executive.app.mission_files import shipped_missions
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.conversation import ReplyKind
from executive.mission.parameters import parse_values
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.run.control import Control
from executive.run.visitor import Progress, RunVisitor
from executive.store.missions import MissionStore
from executive.view.feed import Feed
from executive.view.page_control import (
    Action,
    ControlWatch,
    ProgressWatch,
    RefusedError,
    asked_json,
    control_actions,
    robot_of,
    text_of,
)
from skills.files.errors import InputError

if TYPE_CHECKING:
    from executive.view.server import PageServer


class PageView(RunVisitor):
    """The page of one run: `serve` before it, `offer` and `stay` after it."""

    def __init__(
        self,
        prepared: Prepared | None,
        tell: Callable[[str], None],
        *,
        port: int = 0,
        later: Callable[[str], str] | None = None,
    ) -> None:
        """`prepared` is what robots are asked for who can be spoken to; without it the page hears no sentences. `tell`
        shows a line.

        `later` queues a sentence and says so; without it the page offers no queue.
        """
        self._tell, self._port, self._later = tell, port, later
        self.control = Control(attended=True)
        self._feed = Feed()
        self._progress = ProgressWatch(self._feed)
        self.talk = None if prepared is None else Talk(prepared, self.control)
        if self.talk is not None:
            self.talk.listen(lambda name, waiting: self._feed.tell(f"asked/{name}", asked_json(waiting, name)))
        self._server: PageServer | None = None
        self._watch: ControlWatch | None = None

    def serve(self, log: EventLog, scene: Scene | None) -> None:
        """Serves the page and prints its address. Raises InputError when the port is taken."""
        from executive.view.server import PageContent, serve

        log.listen(self._feed)
        sentences: dict[str, Action] = {}
        if self.talk is not None:
            load_ahead()
            sentences["say"] = said(self._hear)
        if (later := self._later) is not None:
            sentences["queue"] = said(lambda sentence, _: later(sentence))
        actions = {**control_actions(self.control), **sentences, **({} if scene is None else scene_actions(scene))}
        content = PageContent(self._feed, actions, scene_url=None if scene is None else scene.url)
        self._server = serve(content, self._port)
        self._watch = ControlWatch(self.control, self._feed)
        self._tell(f"The page: {self._server.url}")

    def tick(self, progress: Progress) -> None:
        """Tells how far the run is."""
        self._progress.tick(progress)

    def offer(self, recording: Path | None) -> None:
        """The run is over; from now on the page shows the recording where there is one."""
        if self._server is not None and recording is not None and recording.is_file():
            self._server.offer_recording(recording)

    def stay(self, limit_s: float | None) -> None:
        """Keeps serving until Ctrl-C or the limit (s, on the wall's clock), and closes."""
        from executive.view.server import wait

        try:
            if self._server is not None:
                self._tell("The page stays until Ctrl-C." if limit_s is None else f"The page: {limit_s:g} s more.")
                wait(limit_s)
        finally:
            self.close()

    def close(self) -> None:
        """Serves no more; idempotent."""
        if self._watch is not None:
            self._watch.close()
        if self._server is not None:
            self._server.close()

    def _hear(self, sentence: str, robot: str | None) -> str:
        """Has what was typed done, or answered; raises InputError with the reason where it cannot be."""
        assert self.talk is not None
        reply = self.talk.hear(sentence, robot)
        if reply.kind in (ReplyKind.REFUSED, ReplyKind.IGNORED):
            raise InputError(reply.text)
        return reply.text


def said(do: Callable[[str, str | None], str]) -> Action:
    """An action that does something with the sentence that was typed, for the robot that it is meant for."""

    def say(values: Mapping[str, Any]) -> str:
        sentence = text_of(values, "text")
        try:
            return do(sentence, robot_of(values))
        except (InputError, ValueError) as error:
            raise RefusedError(str(error)) from error

    return say


def queueing(prepared: Prepared, *, store: Path, out: Path) -> Callable[[str], str]:
    """Keeps a sentence in a store, as `errand queue add` does, for the world, the seed and the robots of a request.

    The name of a mission, as `errand missions` lists it, may stand in its place, with NAME=VALUE for its parameters.
    """
    before = prepared.request

    def later(text: str) -> str:
        """Queue it, and say so."""
        named, *settings = text.split()
        world = before.world or before.world_name
        asked = Request(text, world=world, seed=before.seed, out=out, robots=before.robots)
        if named in shipped_missions():
            asked = replace(asked, sentence=None, file=Path(named), given=parse_values(settings))
        prepared = prepare(asked)
        refuse_impossible(prepared)
        request = prepared.request.from_anywhere()
        with MissionStore(store) as missions:
            number = missions.add(request, queued=True).id
        return f"queued as mission {number}: {'; '.join(request.commands)} (errand queue run --out {out})"

    return later


def scene_actions(scene: Scene) -> Mapping[str, Action]:
    """What a page asks of the scene: fewer pictures for a browser that draws slowly, and where the camera stands."""

    def ease(_: Mapping[str, Any]) -> str:
        scene.go_easy()
        return "the scene is refreshed less often"

    def follow(values: Mapping[str, Any]) -> str:
        wanted = values.get("wanted") is True
        scene.follow(wanted)
        return "the camera follows the robot" if wanted else "the camera shows the whole world"

    return {"ease": ease, "follow": follow}
