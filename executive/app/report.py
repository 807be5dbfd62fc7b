"""The report of one run: what the tree claimed, what the referee saw, and what was found out.

The same dataclasses are what `--json` prints and what `report.html` shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from rich.markup import escape

from executive.run.outcome import Said
from executive.words.goal import RefereeReport
from skills.files.errors import count_text

if TYPE_CHECKING:
    from pydantic import TypeAdapter


@dataclass(frozen=True)
class ReportedAnswer:
    """An answer that the mission gave, or was given, when (s), and about which place where that is known.

    `picture` is the number of its picture among those of the run, from 0, where there is one.
    """

    question: str
    answer: bool | str | int | float | None
    sentence: str
    t_s: float
    place: str | None = None
    picture: int | None = None


@dataclass(frozen=True)
class ReportedObject:
    """An object that was seen on the way: where (position in the world frame, m), and when last (s)."""

    name: str
    surface: str | None
    place: str | None
    position_W: tuple[float, float, float]
    t_s: float

    @property
    def where(self) -> str:
        """The surface and the room in words."""
        on = f"on the {self.surface}" if self.surface else ""
        return ", ".join(filter(None, (on, self.place))) or "somewhere else"


@dataclass(frozen=True)
class Verdict:
    """What somebody says of a mission: who, whether it is good (None: not judged), in one word, and why."""

    who: str
    good: bool | None
    word: str
    text: str

    def line(self) -> str:
        """The verdict in one line, with rich markup."""
        return f"[bold]{escape(self.who)}:[/bold] {_MARKS[self.good]} {self.word}: {escape(self.text)}"


@dataclass(frozen=True)
class Ending:
    """How a mission ended, what it was to do, and what the referee saw; None where nobody but the robot saw it."""

    outcome: str
    cause: str | None
    message: str
    referee: RefereeReport | None
    commands: tuple[str, ...]

    @property
    def claimed(self) -> bool:
        """The tree says that the mission is achieved."""
        return self.outcome == "success"

    @property
    def achieved(self) -> bool:
        """The tree says so, and no referee denies it."""
        return self.claimed and self.seen.success is not False

    @property
    def false_claim(self) -> bool:
        """The tree says so and the referee denies it."""
        return self.claimed and self.seen.success is False

    @property
    def seen(self) -> RefereeReport:
        """What the referee saw: nothing judged where there is none."""
        return self.referee or NOT_JUDGED

    def verdicts(self, *, name: str | None = None, counts: bool = False) -> Iterator[Verdict]:
        """What the tree claims, of the robot that is named, and what the referee saw, with its counts if asked for."""
        cause = f" ({self.cause})" if self.cause else ""
        who = "The tree claims" if name is None else f"{name}'s tree claims"
        yield Verdict(who, self.claimed, f"{self.outcome}{cause}", self.message)
        if self.referee is not None:
            counted = f" ({counts_text(self.referee)})" if counts else ""
            good = self.referee.success
            yield Verdict("The referee saw", good, VERDICTS[good], f"{self.referee.why}{counted}")


@dataclass(frozen=True)
class RobotReport(Ending):
    """How the mission of one robot ended, and which kind of robot it is."""

    kind: str


@dataclass(frozen=True)
class RunReport(Ending):
    """One run, with the keys that scripts rely on.

    Times in seconds; `log` is the event log's path, `work` what was computed, as counters by name. `answers` has all
    answers in order, `said` what the robot said, `seen_objects` what it is sure to have seen. `scenario` tells what
    went wrong and happened by intention.
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
    robots: Mapping[str, RobotReport] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The report as JSON values; the referee's events are for people only."""
        no_events = {"referee": {"events"}}
        without: dict[str, Any] = {**no_events, "robots": {"__all__": no_events}}
        for name in ("scenario", "robots"):
            if not getattr(self, name):
                without[name] = True
        plain = replace(self, work=dict(self.work), robots=dict(self.robots))
        values: dict[str, Any] = _adapter().dump_python(plain, mode="json", exclude=without)
        return values

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> RunReport:
        """A report that another process has printed."""
        return _adapter().validate_python(dict(values))

    def lines(self) -> Iterator[str]:
        """The verdicts and the figures, with rich markup."""
        figures = (
            f"{self.sim_time_s:.1f} s simulated in {self.wall_time_s:.1f} s ({self.real_time_factor:.1f} x real time), "
            f"{self.ticks} ticks"
        )
        if self.robots:
            for name, robot in self.robots.items():
                yield from (verdict.line() for verdict in robot.verdicts(name=name, counts=True))
            yield figures
            return
        yield from (verdict.line() for verdict in self.verdicts())
        yield figures if self.referee is None else f"{counts_text(self.referee)}; {figures}"
        yield from (escape(f"  {event}") for event in self.seen.events)


NOT_JUDGED: Final = RefereeReport(None, "there is no referee", 0, 0)
VERDICTS: Final[Mapping[bool | None, str]] = {True: "fulfilled", False: "not fulfilled", None: "not judged"}
_MARKS: Final[Mapping[bool | None, str]] = {
    True: "[green]✓[/green]",
    False: "[red]✗[/red]",
    None: "[yellow]?[/yellow]",
}


@cache
def _adapter() -> TypeAdapter[RunReport]:
    from pydantic import TypeAdapter

    return TypeAdapter(RunReport)


def counts_text(referee: RefereeReport) -> str:
    """The counts; those with people where there were any."""
    with_whom = ((referee.people_hit, "with people"), (referee.robots_hit, "between robots"))
    people = "".join(f" ({count} {whom})" for count, whom in with_whom if count)
    counts = [f"{count_text(referee.collisions, 'collision')}{people}", count_text(referee.drops, "drop")]
    if referee.hit_by_people:
        counts.append(f"{count_text(referee.hit_by_people, 'time')} somebody walked into the robot")
    return ", ".join(counts)
