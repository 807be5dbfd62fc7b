"""The report of one run: what the tree claimed and what the referee saw."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Final

from rich.markup import escape

from executive.run.findings import Said
from skills.files.errors import count_text


@dataclass(frozen=True)
class RefereeReport:
    """The referee's verdict with its counts, and one sentence for each lift, drop and bump.

    `success` is None when the referee has not judged all that was asked for. `people_hit` counts collisions with
    people, `robots_hit` those between two robots, and `hit_by_people` how often somebody walked into the robot while it
    stood: no collision of the robot's. `holds` tells of a run that failed whether the referee sees nevertheless what
    was asked for.
    """

    success: bool | None
    why: str
    collisions: int
    drops: int
    people_hit: int = 0
    hit_by_people: int = 0
    robots_hit: int = 0
    holds: bool | None = None
    events: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReportedAnswer:
    """An answer that the mission gave, or was given, when (s), and about which place where that is known.

    `picture` is the number of its picture among those of the run, from 0, where there is one.
    """

    question: str
    answer: bool | str | float | None
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


@dataclass(frozen=True)
class RobotReport:
    """How the mission of one robot ended, what the referee saw of it, and what it was to do."""

    kind: str
    outcome: str
    cause: str | None
    message: str
    referee: RefereeReport | None
    commands: tuple[str, ...]

    @property
    def achieved(self) -> bool:
        """The tree says that the mission is achieved, and no referee denies it."""
        return self.outcome == "success" and (self.referee is None or self.referee.success is not False)

    def to_json(self) -> dict[str, Any]:
        """The report as JSON values; the referee's events are for people only."""
        values = {**asdict(self), "commands": list(self.commands)}
        if self.referee is not None:
            del values["referee"]["events"]
        return values

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> RobotReport:
        """A report that another process has printed."""
        referee = None if values["referee"] is None else RefereeReport(**values["referee"])
        return RobotReport(**{**values, "referee": referee, "commands": tuple(values["commands"])})


NOT_JUDGED: Final = RefereeReport(None, "there is no referee", 0, 0)
VERDICTS: Final[Mapping[bool | None, str]] = {True: "fulfilled", False: "not fulfilled", None: "not judged"}


@dataclass(frozen=True)
class RunReport:
    """One run, with the keys that scripts rely on.

    Times in seconds; `log` is the event log's path, `work` what was computed, as counters by name. `referee` is None
    where nobody but the robot saw what happened. `answers` has all answers in order, `said` what the robot said,
    `seen_objects` what it is sure to have seen. `scenario` tells what went wrong and happened by intention.
    """

    outcome: str
    cause: str | None
    message: str
    referee: RefereeReport | None
    commands: tuple[str, ...]
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

    @property
    def claimed(self) -> bool:
        """The tree says that the mission is achieved."""
        return self.outcome == "success"

    @property
    def achieved(self) -> bool:
        """The tree says so, and no referee denies it."""
        return self.claimed and self.seen.success is not False

    @property
    def seen(self) -> RefereeReport:
        """What the referee saw: nothing judged where there is none."""
        return self.referee or NOT_JUDGED

    @property
    def false_claim(self) -> bool:
        """The tree says so and the referee denies it."""
        return self.claimed and self.seen.success is False

    def to_json(self) -> dict[str, Any]:
        """The report as JSON values; the referee's events are for people only."""
        robots = {name: robot.to_json() for name, robot in self.robots.items()}
        values = {**asdict(replace(self, work={}, robots={})), "work": dict(self.work), "robots": robots}
        lists = {name: list(values[name]) for name in ("commands", "answers", "said", "seen_objects", "scenario")}
        values = {**values, **lists}
        for name in ("scenario", "robots"):
            if not values[name]:
                del values[name]
        if self.referee is not None:
            del values["referee"]["events"]
        return values

    @staticmethod
    def from_json(values: Mapping[str, Any]) -> RunReport:
        """A report that another process has printed."""
        values = {"scenario": (), "robots": {}, **values}
        own = {each.name: values[each.name] for each in fields(RunReport)}
        referee = None if values["referee"] is None else RefereeReport(**values["referee"])
        lists = {
            "commands": tuple(values["commands"]),
            "answers": tuple(ReportedAnswer(**each) for each in values["answers"]),
            "said": tuple(Said(**each) for each in values["said"]),
            "seen_objects": tuple(_reported_object(each) for each in values["seen_objects"]),
            "scenario": tuple(values["scenario"]),
            "robots": {name: RobotReport.from_json(each) for name, each in values["robots"].items()},
        }
        return RunReport(**{**own, "referee": referee, **lists})

    def lines(self) -> tuple[str, ...]:
        """The two verdicts and the figures, with rich markup."""
        cause = f" ({self.cause})" if self.cause else ""
        figures = (
            f"{self.sim_time_s:.1f} s simulated in {self.wall_time_s:.1f} s ({self.real_time_factor:.1f} x real time), "
            f"{self.ticks} ticks"
        )
        if self.robots:
            return (*(line for name, robot in self.robots.items() for line in _robot_lines(name, robot)), figures)
        claims = f"[bold]The tree claims:[/bold] {_mark(self.claimed)} {self.outcome}{cause}: {escape(self.message)}"
        if self.referee is None:
            return claims, figures
        verdict = f"{_mark(self.referee.success)} {VERDICTS[self.referee.success]}"
        return (
            claims,
            f"[bold]The referee saw:[/bold] {verdict}: {escape(self.referee.why)}",
            f"{counts_text(self.referee)}; {figures}",
            *(escape(f"  {event}") for event in self.referee.events),
        )


def _robot_lines(name: str, robot: RobotReport) -> Iterator[str]:
    """The two verdicts on one robot of several, with rich markup."""
    cause = f" ({robot.cause})" if robot.cause else ""
    claimed = robot.outcome == "success"
    yield f"[bold]{escape(name)}'s tree claims:[/bold] {_mark(claimed)} {robot.outcome}{cause}: {escape(robot.message)}"
    if robot.referee is not None:
        verdict = f"{_mark(robot.referee.success)} {VERDICTS[robot.referee.success]}"
        yield f"[bold]The referee saw:[/bold] {verdict}: {escape(robot.referee.why)} ({counts_text(robot.referee)})"


def _reported_object(values: Mapping[str, Any]) -> ReportedObject:
    x_m, y_m, z_m = values["position_W"]
    return ReportedObject(**{**values, "position_W": (x_m, y_m, z_m)})


def counts_text(referee: RefereeReport) -> str:
    """The counts; those with people where there were any."""
    with_whom = ((referee.people_hit, "with people"), (referee.robots_hit, "between robots"))
    people = "".join(f" ({count} {whom})" for count, whom in with_whom if count)
    counts = [f"{count_text(referee.collisions, 'collision')}{people}", count_text(referee.drops, "drop")]
    if referee.hit_by_people:
        counts.append(f"{count_text(referee.hit_by_people, 'time')} somebody walked into the robot")
    return ", ".join(counts)


def _mark(good: bool | None) -> str:
    return {True: "[green]✓[/green]", False: "[red]✗[/red]", None: "[yellow]?[/yellow]"}[good]
