"""Triggers of standing missions. Each has a text form that parses back to itself.

    every weekday 09:00                    every monday and friday 08:15 and 17:00
    2026-12-01 09:00                       every 30m
    battery full        battery 80%        call patrol        topic mqtt:home/door

Times of day are local wall time. When clocks go forward, a trigger at a skipped time fires at its usual distance from
midnight: 02:30 fires when clocks show 03:30. When clocks go back, a trigger at a repeated time fires once, at the first
one. A period counts elapsed time, unaffected by changes of the clock.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta, tzinfo
from typing import Final

from skills.inputs.errors import InputError, listing, suggestion
from skills.quantities import seconds_in

FULL: Final = 0.95
NOISE: Final = 0.01
"""Difference by which a charge must lie below the level to count as lower; less may be noise."""
LONGEST: Final = timedelta(days=366)
_WEEK: Final = 7
_LONGEST_SKIP: Final = timedelta(hours=3)
_EXAMPLES: Final = "'every weekday 09:00', 'every monday and friday 08:15' or '2026-12-01 09:00'"
_EVENTS: Final = "'battery full', 'battery 80%', 'call NAME' or 'topic KIND:TOPIC'"


class Missed(enum.Enum):
    """Policy for occurrences while no server runs, or while a mission runs."""

    SKIP = "skip"
    ONCE = "once"


_NAMES: Final = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
"""Days of the week by Python's number of them."""
_SETS: Final = {"day": tuple(range(_WEEK)), "weekday": (0, 1, 2, 3, 4), "weekend": (5, 6)}
_DAYS: Final = {spelled: day for day, name in enumerate(_NAMES) for spelled in (name, f"{name}s", name[:3])}


@dataclass(frozen=True)
class Schedule:
    """Trigger at some local times of day on some days (0 is Monday), both in order and without repetition."""

    days: tuple[int, ...]
    times: tuple[time, ...]

    def __str__(self) -> str:
        named = next((name for name, days in _SETS.items() if days == self.days), None)
        days = named or listing(_NAMES[day] for day in self.days)
        return f"every {days} {listing(each.strftime('%H:%M') for each in self.times)}"

    def after(self, moment: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the first occurrence after a moment (aware); `zone` None is the system's, `anchor` is not used."""
        return min(each for each in self._around(moment, range(-1, _WEEK + 2), zone) if each > moment)

    def latest(self, now: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the last occurrence up to now."""
        return max(each for each in self._around(now, range(-_WEEK - 1, 2), zone) if each <= now)

    def _around(self, moment: datetime, offsets: Iterable[int], zone: tzinfo | None) -> list[datetime]:
        """Returns the occurrences on the days at these offsets from the day of a moment."""
        today = moment.astimezone(zone).date()
        dates = (today + timedelta(days=offset) for offset in offsets)
        on = [each for each in dates if each.weekday() in self.days]
        return [_moment(each, at, zone) for each in on for at in self.times]


@dataclass(frozen=True)
class Once:
    """Trigger at one local date and time of day."""

    date: date
    time: time

    def __str__(self) -> str:
        return f"{self.date.isoformat()} {self.time.strftime('%H:%M')}"

    def after(self, moment: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the single occurrence if it is later than a moment, else None."""
        at = _moment(self.date, self.time, zone)
        return at if at > moment else None

    def latest(self, now: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the single occurrence if it is not later than now, else None."""
        at = _moment(self.date, self.time, zone)
        return at if at <= now else None


@dataclass(frozen=True)
class Every:
    """Periodic trigger, in whole seconds from the anchor, which is the time when the user gave the standing mission."""

    period: timedelta

    def __str__(self) -> str:
        seconds = round(self.period.total_seconds())
        unit, size = next((unit, size) for unit, size in _UNITS if seconds % size == 0)
        return f"every {seconds // size}{unit}"

    @staticmethod
    def from_text(text: str) -> Every:
        """Parses "30m", "1 h 30 min", "PT5M" or "1 day". Raises InputError, also for a number without a unit."""
        seconds = seconds_in(text) or 0.0
        if seconds and not re.search("[dhms]", text, re.IGNORECASE):
            raise InputError(f"'{text}' has no unit", hint="write it, as in 7d, 12h, 30m or 90s")
        if not (1.0 <= seconds <= LONGEST.total_seconds() and seconds.is_integer()):
            hint = "give whole seconds, from 1 s to 366 days, as in '30 min' or '1 h 30 min'"
            raise InputError(f"'{text[:60]}' is no period", hint=hint)
        return Every(timedelta(seconds=seconds))

    def after(self, moment: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the first occurrence after a moment."""
        start = anchor.astimezone(UTC)  # between two times of one zone, Python subtracts wall times
        return start + max(1, (moment.astimezone(UTC) - start) // self.period + 1) * self.period

    def latest(self, now: datetime, anchor: datetime, zone: tzinfo | None) -> datetime | None:
        """Returns the last occurrence up to now."""
        start = anchor.astimezone(UTC)
        count = (now.astimezone(UTC) - start) // self.period
        return start + count * self.period if count > 0 else None


@dataclass(frozen=True)
class OnBatteryFull:
    """Trigger at the end of a mission during which the charge (0 to 1) rose to this level, from below by over NOISE."""

    level: float = FULL

    def __str__(self) -> str:
        return "battery full" if self.level == FULL else f"battery {100 * self.level:g}%"

    def rises(self, lowest: float, last: float) -> bool:
        """Returns whether the charge rose enough in a mission with this lowest and this last charge."""
        return lowest < self.level - NOISE and self.level <= last


@dataclass(frozen=True)
class OnCall:
    """Trigger by an HTTP call of this name."""

    name: str

    def __str__(self) -> str:
        return f"call {self.name}"


@dataclass(frozen=True)
class OnTopic:
    """Trigger by a message on a topic; the trigger source of this kind receives the message."""

    kind: str
    topic: str

    def __str__(self) -> str:
        return f"topic {self.kind}:{self.topic}"


Timed = Schedule | Once | Every
Trigger = Timed | OnBatteryFull | OnCall | OnTopic

_UNITS: Final = (("d", 86400), ("h", 3600), ("m", 60), ("s", 1))
_CLOCK: Final = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)")
_ONCE: Final = re.compile(r"(2\d{3})-(\d\d)-(\d\d)[ t](?P<time>\S+)")
_BATTERY: Final = re.compile(r"battery (?:full|(?P<percent>\d{1,3}(?:\.\d+)?) ?%)")
_CALL: Final = re.compile(r"call (?P<name>[A-Za-z0-9_-]{1,64})")
_TOPIC: Final = re.compile(r"topic (?P<kind>[A-Za-z0-9_-]{1,64}):(?P<topic>\S(?:.{0,254}\S)?)")


def trigger_of(text: str) -> Trigger:
    """Parses the text form of a trigger. Raises InputError."""
    first, _, rest = text.partition(" ")
    if first == "every" and (rest[:1].isdigit() or rest[:2].upper() in ("PT", "P1")):
        return Every.from_text(rest)
    return schedule_of(text) if first == "every" or first[:1].isdigit() else event_of(text)


def schedule_of(text: str) -> Schedule | Once:
    """Parses times such as "every weekday 09:00" or "2026-12-01 09:00". Raises InputError."""
    words = " ".join(text.lower().split())
    once = _ONCE.fullmatch(words)
    if once is not None:
        return Once(_date(once, text), _time(once["time"], text))
    head, *named = re.split(r",? and |, ?| at | ", words)
    at = next((number for number, word in enumerate(named) if word[:1].isdigit()), len(named))
    if head != "every" or not 0 < at < len(named):
        raise InputError(f"'{text}' says no times", hint=f"write {_EXAMPLES}")
    days = {day for word in named[:at] for day in _days(word)}
    times = {_time(word, text) for word in named[at:]}
    return Schedule(tuple(sorted(days)), tuple(sorted(times)))


def event_of(text: str) -> OnBatteryFull | OnCall | OnTopic:
    """Parses the trigger of `--on`: a battery's charge, a call or a topic. Raises InputError."""
    words = text.strip()
    first = words.split(" ", 1)[0]
    if (topic := _TOPIC.fullmatch(words)) is not None and topic["topic"].isprintable():
        return OnTopic(topic["kind"], topic["topic"])
    if (call := _CALL.fullmatch(words)) is not None:
        return OnCall(call["name"])
    if (battery := _BATTERY.fullmatch(words.lower())) is not None:
        level = FULL if battery["percent"] is None else round(float(battery["percent"]) / 100.0, 6)
        if 0.0 < level <= 1.0:
            return OnBatteryFull(level)
        raise InputError(f"'{text}': a charge is above 0 % and at most 100 %", hint="write as in 'battery 80%'")
    hint = _HINTS.get(first) or suggestion(first, _HINTS, f"write {_EVENTS}")
    raise InputError(f"'{text}' is no trigger", hint=hint)


_HINTS: Final = {
    "battery": "write 'battery full' or as in 'battery 80%'",
    "call": "give 'call' one name of letters, digits, _ and -, at most 64",
    "topic": "write 'topic KIND:TOPIC', as in 'topic mqtt:home/door'",
}


def _moment(day: date, at: time, zone: tzinfo | None) -> datetime:
    """Converts a local date and time of day to UTC."""
    wall = datetime.combine(day, at)
    if zone is not None:
        return wall.replace(tzinfo=zone).astimezone(UTC)
    moment = wall.astimezone(UTC)
    if moment.astimezone().replace(tzinfo=None) == wall:
        return moment
    before = (wall - _LONGEST_SKIP).astimezone().utcoffset() or timedelta()  # of a time that clocks skip
    return (wall - before).replace(tzinfo=UTC)


def _days(word: str) -> Sequence[int]:
    if word in _DAYS:
        return (_DAYS[word],)
    known = (*_SETS, *_NAMES)
    if word not in _SETS:
        hint = suggestion(word, known, f"write {listing(_SETS, last='or')}, or the names of days")
        raise InputError(f"'{word}' is no day", hint=hint)
    return _SETS[word]


def _time(word: str, text: str) -> time:
    found = _CLOCK.fullmatch(word)
    if found is None:
        raise InputError(f"'{word}' in '{text}' is no time of day", hint="write it from 00:00 to 23:59, as in 09:00")
    return time(int(found[1]), int(found[2]))


def _date(found: re.Match[str], text: str) -> date:
    try:
        return date(int(found[1]), int(found[2]), int(found[3]))
    except ValueError as error:
        raise InputError(f"'{text}': there is no such day", hint="write YEAR-MONTH-DAY, as in 2026-12-01") from error
