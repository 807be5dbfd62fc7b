"""Report of one run: the result that the tree reports, the referee's verdict on the simulation, answers, seen objects.

`--json` prints these dataclasses, and `report.html` shows them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from html import escape as html_text
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rich.markup import escape

from executive.run.outcome import Said
from executive.words.goal import RefereeReport
from skills.inputs.errors import count_text

if TYPE_CHECKING:
    from pydantic import TypeAdapter


@dataclass(frozen=True)
class ReportedAnswer:
    """Answer to a question in the mission, with its time (s) and the place that the command names, if any.

    A count is a number; with `at_least`, there may be more. `picture` is the index of the answer's picture in the run;
    None if there is no picture.
    """

    question: str
    answer: bool | str | int | float | None
    sentence: str
    t_s: float
    place: str | None = None
    picture: int | None = None
    at_least: bool = False


@dataclass(frozen=True)
class ReportedObject:
    """Object seen during a run, with its position in the world frame (m) and the time of the last view (s)."""

    name: str
    surface: str | None
    place: str | None
    position_W: tuple[float, float, float]
    t_s: float

    @property
    def where(self) -> str:
        """Surface and room in words."""
        on = f"on the {self.surface}" if self.surface else ""
        return ", ".join(filter(None, (on, self.place))) or "somewhere else"


@dataclass(frozen=True)
class Verdict:
    """Verdict on a mission: who gives it, whether it is `good` (None: not judged), in one word, and the reason."""

    who: str
    good: bool | None
    word: str
    text: str

    def lines(self) -> Iterator[str]:
        """Yields the verdict with rich markup: one line, or a list of its sentences when it is long."""
        head, sentences = f"[bold]{escape(self.who)}:[/bold] {_MARKS[self.good]} {self.word}:", self.sentences
        if len(sentences) == 1 or len(self.text) <= _LONG_TEXT:
            yield f"{head} {escape(self.text)}"
            return
        yield head
        yield from (f"  • {escape(sentence)}" for sentence in sentences)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Splits the reason into sentences and into parts that end with a semicolon, but not within quotation marks."""
        return tuple(part.strip() for part in _SENTENCE.findall(self.text))


@dataclass(frozen=True)
class Ending:
    """End of a mission: outcome, cause, message, commands, and the referee's verdict (None without a referee)."""

    outcome: str
    cause: str | None
    message: str
    referee: RefereeReport | None
    commands: tuple[str, ...]

    @property
    def claimed(self) -> bool:
        """True if the tree claims success."""
        return self.outcome == "success"

    @property
    def achieved(self) -> bool:
        """True if the tree claims success and no referee denies it."""
        return self.claimed and self.seen.success is not False

    @property
    def false_claim(self) -> bool:
        """True if the tree claims success and the referee denies it."""
        return self.claimed and self.seen.success is False

    @property
    def seen(self) -> RefereeReport:
        """The referee's verdict; without a referee, a verdict that says that nothing was judged."""
        return self.referee or NOT_JUDGED

    def verdicts(self, *, name: str | None = None, counts: bool = False) -> Iterator[Verdict]:
        """Yields what the tree claims, under the robot's `name` if given, and what the referee saw.

        With `counts` the referee's verdict includes collisions and drops. Without a referee, a verdict says so.
        """
        cause = f" ({self.cause})" if self.cause else ""
        who = "The tree claims" if name is None else f"{name}'s tree claims"
        yield Verdict(who, self.claimed, f"{self.outcome}{cause}", self.message)
        if self.referee is None:
            yield Verdict("No referee", None, VERDICTS[None], "nobody saw the truth, so only the tree's claim counts")
            return
        counted, good = f" ({counts_text(self.referee)})" if counts else "", self.referee.success
        yield Verdict("The referee saw", good, VERDICTS[good], f"{self.referee.why}{counted}")


@dataclass(frozen=True)
class RobotReport(Ending):
    """End of one robot's mission, with the kind of the robot."""

    kind: str


@dataclass(frozen=True)
class RunReport(Ending):
    """Report of one run, with the keys that scripts rely on.

    Times are in seconds. `log` is the path of the event log, and `work` has the work counters by name. `answers` and
    `said` are in the order of time, `seen_objects` are the confirmed objects, and `scenario` lists the faults and
    events of the run's scenario. `notes` describe a real robot's sensing. `zones` are the rules of the zones in force.
    `log_time_s` is the time that the logs span, which for a resumed run includes the part before the restart.
    """

    world: str
    seed: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    ticks: int
    log: str
    work: Mapping[str, int] = field(default_factory=dict)
    answers: tuple[ReportedAnswer, ...] = ()
    said: tuple[Said, ...] = ()
    seen_objects: tuple[ReportedObject, ...] = ()
    scenario: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    zones: tuple[str, ...] = ()
    robots: Mapping[str, RobotReport] = field(default_factory=dict)
    log_time_s: float = 0.0

    def every_verdict(self) -> Iterator[Verdict]:
        """Yields the verdicts on the run; those of several robots have the robot's name, and count its contacts."""
        for name, robot in self.robots.items():
            yield from robot.verdicts(name=name, counts=True)
        if not self.robots:
            yield from self.verdicts()

    @property
    def duration_text(self) -> str:
        """Duration in words; says "simulated" only for a run with a referee."""
        simulated = "" if self.referee is None else f" simulated in {self.wall_time_s:.1f} s"
        own = f"{self.sim_time_s:.1f} s{simulated}"
        resumed = self.log_time_s > self.sim_time_s + 0.1
        return f"{self.log_time_s:.1f} s, of which {own} since the restart" if resumed else own

    def to_json(self) -> dict[str, Any]:
        """Returns the report as JSON values, without the events that the referee saw."""
        no_events = {"referee": {"events"}}
        without: dict[str, Any] = {**no_events, "robots": {"__all__": no_events}}
        for name in ("scenario", "notes", "zones", "robots"):
            if not getattr(self, name):
                without[name] = True
        if not any(one.silent for one in self.said):
            without["said"] = {"__all__": {"silent"}}
        plain = replace(self, work=dict(self.work), robots=dict(self.robots))
        values: dict[str, Any] = _adapter().dump_python(plain, mode="json", exclude=without)
        return values

    def _repr_html_(self) -> str:
        """Returns the verdicts as HTML; shows `report.html` in a frame if the file lies beside the log."""
        verdicts = [verdict for robot in self.robots.values() or (self,) for verdict in robot.verdicts()]
        lines = "".join(f"<p>{html_text(f'{each.who}: {each.word}: {each.text}')}</p>" for each in verdicts)
        page = Path(self.log).with_name("report.html")
        if not self.log or not page.is_file():
            return lines
        shown = html_text(page.read_text(encoding="utf-8"))
        return f'{lines}<iframe srcdoc="{shown}" width="100%" height="700" style="border:0"></iframe>'

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> RunReport:
        """Reads a report from the JSON values of `to_json`."""
        return _adapter().validate_python(dict(values))

    def lines(self) -> Iterator[str]:
        """Yields the verdicts and the figures as lines with rich markup."""
        pace = "" if self.referee is None else f" ({self.real_time_factor:.1f} x real time)"
        figures = f"{self.duration_text}{pace}, {self.ticks} ticks"
        yield from (line for verdict in self.every_verdict() for line in verdict.lines())
        yield figures if self.robots or self.referee is None else f"{counts_text(self.referee)}; {figures}"
        events = dict.fromkeys(event for one in self.robots.values() or (self,) for event in one.seen.events)
        yield from (escape(f"  {event}") for event in (*self.zones, *self.notes, *events))


DATE: Final = "%Y-%m-%d %H:%M"
"""Form of the date in reports."""
_LONG_TEXT: Final = 100
"""Longest reason that fits on the line of its verdict, in characters."""
_QUOTED: Final = r"""“[^”]*”|"[^"]*"|(?<!\w)'(?:[^']|(?<=\w)'(?=\w))*'(?!\w)"""
"""Quotation; an apostrophe within a word does not end it."""
_SENTENCE: Final = re.compile(rf"(?:{_QUOTED}|\S|(?<![.!?;])\s|(?<=[.!?])\s(?=[a-z]))+")
_MOST_NAMED: Final = 3
"""Number of missions that a title names."""
NOT_JUDGED: Final = RefereeReport(None, "there is no referee", 0, 0)
VERDICTS: Final[Mapping[bool | None, str]] = {True: "fulfilled", False: "not fulfilled", None: "not judged"}
_MARKS: Final[Mapping[bool | None, str]] = {True: "[green]✓[/green]", False: "[red]✗[/red]", None: "[yellow]?[/yellow]"}


def title_of(names: Iterable[str]) -> str:
    """Title of a report on several missions: their names, each once."""
    each = list(dict.fromkeys(names))
    more = [f"{len(each) - _MOST_NAMED} more"] if len(each) > _MOST_NAMED else []
    *first, last = [*each[:_MOST_NAMED], *more]
    return f"{', '.join(first)} and {last}" if first else last


@cache
def _adapter() -> TypeAdapter[RunReport]:
    from pydantic import TypeAdapter

    return TypeAdapter(RunReport)


def counts_text(referee: RefereeReport) -> str:
    """Formats the counts of collisions and drops; mentions people and robots only if they were hit."""
    with_whom = ((referee.people_hit, "with people"), (referee.robots_hit, "between robots"))
    people = "".join(f" ({count} {whom})" for count, whom in with_whom if count)
    counts = [f"{count_text(referee.collisions, 'collision')}{people}", count_text(referee.drops, "drop")]
    if referee.hit_by_people:
        counts.append(f"{count_text(referee.hit_by_people, 'time')} somebody walked into the robot")
    return ", ".join(counts)
