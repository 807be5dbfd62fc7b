"""Live page of a run (`--view`), which replays the run after its end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.app.prepare.from_request import prepare_checked
from executive.app.prepare.mission_files import shipped_missions
from executive.app.prepare.prepared import Prepared
from executive.app.report.run_report import Verdict
from executive.app.runs.backend import Display, OpenRun
from executive.app.runs.conversations import Conversations, load_ahead
from executive.conversation import ReplyKind
from executive.mission.parameters import parse_values
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.visitor import Progress
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
from skills.inputs.errors import InputError

if TYPE_CHECKING:
    from executive.view.server import Address, PageServer, Scene


class PageView(Display):
    """Live page of one run; call `stay` after it."""

    def __init__(
        self,
        prepared: Prepared | None,
        tell: Callable[[str], None],
        *,
        address: "Address" = ("127.0.0.1", 0),
        later: Callable[[str], str] | None = None,
    ) -> None:
        """Takes the request that the run was prepared from; without `prepared` the page only queues sentences.

        `tell` shows a line. `later` queues a sentence and returns an answer; without `later` the page offers no queue.
        """
        self._tell, self._address, self._later = tell, address, later
        self.control = Control(attended=True)
        self._feed = Feed()
        self._progress = ProgressWatch(self._feed)
        self.conversations = None if prepared is None else Conversations(prepared, self.control)
        if self.conversations is not None:
            self.conversations.listen(lambda name, waiting: self._feed.tell(f"asked/{name}", asked_json(waiting, name)))
        self._server: PageServer | None = None
        self._watch: ControlWatch | None = None
        self._scene: Scene | None = None

    def opened(self, run: OpenRun) -> None:
        """Serves the page and shows its address. Raises InputError if it cannot be served there."""
        from executive.view.server import PageContent, serve

        run.log.listen(lambda each: self._feed(each.topic, each.stamp_s, each.values))
        self._scene = scene = run.backend.show_live()
        sentences: dict[str, Action] = {}
        if self.conversations is not None:
            sentences["say"] = sentence_action(self.hear)
        if (later := self._later) is not None:
            sentences["queue"] = sentence_action(lambda sentence, _: later(sentence))
        if sentences:
            load_ahead()
        actions = {**control_actions(self.control), **sentences}
        self._server = serve(PageContent(self._feed, actions, scene), self._address)
        self._watch = ControlWatch(self.control, self._feed)
        self._tell(self._server.lines)

    def hear(self, sentence: str, robot: str | None) -> str:
        """Returns the robots' reply to a sentence. Raises InputError with the reason of a refusal."""
        assert self.conversations is not None
        reply = self.conversations.hear(sentence, robot)
        if reply.kind in (ReplyKind.REFUSED, ReplyKind.IGNORED):
            raise InputError(reply.text)
        return reply.text

    def tick(self, progress: Progress) -> None:
        """Sends the progress to the page."""
        self._progress.tick(progress)

    def reported(self, recording: Path | None, report: Path, verdicts: Sequence[Verdict]) -> None:
        """Adds the verdicts on the ended run, its report, and its recording if there is one, to the page."""
        if self._server is not None:
            self._server.offer(recording if recording is not None and recording.is_file() else None, report)
            self._feed.tell("verdict", {"verdicts": [asdict(each) for each in verdicts], "report": report.name})

    def stay(self, limit_s: float | None) -> None:
        """Serves the page until Ctrl-C or the limit (s, wall time), and then closes it."""
        from executive.view.server import wait

        try:
            if self._server is not None:
                self._tell("The page stays until Ctrl-C." if limit_s is None else f"The page: {limit_s:g} s more.")
                if self._scene is not None:
                    self._scene.publish()  # for a page that is opened late
                wait(limit_s)
        finally:
            self.close()

    def close(self) -> None:
        """Stops serving; idempotent."""
        if self._watch is not None:
            self._watch.close()
        if self._server is not None:
            self._server.close()


def sentence_action(do: Callable[[str, str | None], str]) -> Action:
    """Returns a page action that calls `do` with the typed sentence and the robot chosen on the page."""

    def say(values: Mapping[str, Any]) -> str:
        sentence = text_of(values, "text")
        try:
            return do(sentence, robot_of(values))
        except (InputError, ValueError) as error:
            raise RefusedError(str(error)) from error

    return say


def queue_function(before: Request, add: Callable[[Request], str]) -> Callable[[str], str]:
    """Returns a function that checks a typed sentence as `errand queue add` does, adds it, and returns the answer.

    World, seed, robots and folder are those of the request `before`; `add` stores the checked request. In place of a
    sentence the function takes the name of a shipped mission, with NAME=VALUE for the mission's parameters.
    """

    def later(text: str) -> str:
        named, *settings = text.split()
        world = before.world or before.world_name
        asked = Request(text, world=world, seed=before.seed, out=before.out, robots=before.robots)
        if named in shipped_missions():
            asked = replace(asked, sentence=None, file=Path(named), given=parse_values(settings))
        return add(prepare_checked(asked).request.from_anywhere())

    return later


def add_to(store: Path, request: Request) -> str:
    """Queues a checked request in a store; returns the answer to show."""
    with MissionStore(store) as missions:
        number = missions.add(request, queued=True).id
    return f"queued as mission {number}: {'; '.join(request.commands)} (errand queue run --store {store})"
