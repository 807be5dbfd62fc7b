"""Standing missions: each is stored with a trigger; whenever the trigger fires, a queued copy is added."""

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from typing import Annotated, Final

from pydantic import BeforeValidator, Json

from executive.mission.request import Request
from executive.store.database import form
from executive.store.missions import MissionState, MissionStore, StoredMission, insert
from executive.store.triggers import Every, Missed, OnBatteryFull, Once, Schedule, Timed, Trigger, trigger_of
from skills.inputs.errors import InputError

LATE: Final = timedelta(seconds=90)
"""Latest handling of an occurrence; later ones are missed, as after the clock was set or the machine slept."""
SET_BACK: Final = timedelta(hours=1)
"""Largest step back of the clock that repeats no occurrence."""
MOST_WAITING: Final = 100
_ENDED: Final = "SELECT request, lowest_charge, last_charge, ended FROM mission WHERE ended AND last_charge IS NOT NULL"


@dataclass(frozen=True)
class StandingMission:
    """Mission that is queued each time its trigger fires.

    `anchor` is when the mission was given, `since` until when its occurrences are handled; both have a time zone.
    """

    id: int
    request: Json[Request]
    trigger: Annotated[Trigger, BeforeValidator(trigger_of)]
    missed: Missed
    anchor: datetime
    since: datetime

    def due_next(self, now: datetime, zone: tzinfo | None) -> datetime | None:
        """Time of the next occurrence after `now` (`zone` None: the system's); None for a trigger without set times."""
        if not isinstance(self.trigger, Timed):
            return None
        return self.trigger.after(max(now, self.since), self.anchor, zone)


class StandingMissions:
    """Table with the standing missions in a store."""

    def __init__(self, store: MissionStore, zone: tzinfo | None = None) -> None:
        """`zone` is the time zone of local times (None: the system's)."""
        self._store, self._zone = store, zone

    def add(self, request: Request, trigger: Trigger, missed: Missed = Missed.SKIP) -> StandingMission:
        """Stores a standing mission with an understood request. Raises InputError when its single time has passed."""
        now = self._store.now()
        if isinstance(trigger, Once) and trigger.latest(now, now, self._zone) is not None:
            raise InputError(f"{trigger} has passed", hint="give a time to come, or queue the mission without --at")
        values = {"trigger": str(trigger), "missed": missed.value, "anchor": now.isoformat(), "since": now.isoformat()}
        with self._store.writing() as connection:
            number = insert(connection, request, state=MissionState.STANDING, queued=False, **values)
        return StandingMission(number, request, trigger, missed, now, now)

    def missions(self) -> tuple[StandingMission, ...]:
        """Returns all standing missions in the order in which they were added."""
        rows = self._store.rows("SELECT * FROM mission WHERE trigger IS NOT NULL ORDER BY id")
        return tuple(form(StandingMission).validate_python(dict(row)) for row in rows)

    def fire(self, chosen: Sequence[tuple[StandingMission, Request]], why: str) -> tuple[StoredMission, ...]:
        """Queues these requests, each as a copy of its standing mission: all of them or none.

        Raises InputError when too many copies of a standing mission wait already, or when it was removed meanwhile.
        """
        with self._store.writing() as connection:
            for each, _ in chosen:
                self._refuse_more(connection, each)
            numbers = [_queue(connection, each.id, request, f"{each.trigger}{why}") for each, request in chosen]
        return tuple(map(self._store.mission, numbers))

    def fire_due(self, *, waiting_since: datetime, serving_since: datetime) -> tuple[StoredMission, ...]:
        """Queues the missions that came due since the last call, by their policies; returns the queued missions.

        A trigger that fires while a mission runs (before `waiting_since`) is not queued, nor is a full battery before
        `serving_since`. One transaction queues the mission and marks its occurrence as handled.
        """
        now, numbers = self._store.now(), list[int]()
        ended = self._store.rows(_ENDED)
        for each in self.missions():
            if each.since - now > SET_BACK:
                self._handle(each, now, None)
                continue
            at = self._latest(each, now, ended)
            if at is None or at <= each.since:
                continue
            begun = waiting_since if isinstance(each.trigger, Timed) else serving_since
            missed = at <= begun or now - at > LATE
            due = f", due {at.astimezone(self._zone):%Y-%m-%d %H:%M}" if isinstance(each.trigger, Timed) else ""
            why = f"{each.trigger}{due}{', missed' if missed else ''}"
            numbers += self._handle(each, now, why if not missed or each.missed is Missed.ONCE else None)
        return tuple(map(self._store.mission, numbers))

    def due_next(self) -> datetime | None:
        """Time of the next occurrence of any standing mission; None when no trigger has set times."""
        now = self._store.now()
        times = (each.due_next(now, self._zone) for each in self.missions())
        return min((at for at in times if at is not None), default=None)

    def _latest(self, each: StandingMission, now: datetime, ended: Sequence[sqlite3.Row]) -> datetime | None:
        """Time of the last occurrence of a standing mission up to now."""
        if isinstance(each.trigger, Schedule | Once | Every):
            return each.trigger.latest(now, each.anchor, self._zone)
        if not isinstance(each.trigger, OnBatteryFull):
            return None
        full, times = each.trigger, list[datetime]()
        for row in ended:
            request = Request.from_json(row["request"])
            same = (request.world_name, request.robot) == (each.request.world_name, each.request.robot)
            if same and full.rises(row["lowest_charge"], row["last_charge"]):
                times.append(datetime.fromisoformat(row["ended"]))
        return max((at for at in times if at <= now), default=None)

    def _handle(self, each: StandingMission, now: datetime, why: str | None) -> list[int]:
        """Marks all occurrences up to now as handled, and queues a mission if there is a reason `why`."""
        with self._store.writing() as connection:
            values = (now.isoformat(), each.id)
            still_there = connection.execute("UPDATE mission SET since = ? WHERE id = ?", values).rowcount
            return [_queue(connection, each.id, each.request, why)] if why is not None and still_there else []

    def _refuse_more(self, connection: sqlite3.Connection, each: StandingMission) -> None:
        if not connection.execute("SELECT 1 FROM mission WHERE id = ?", (each.id,)).fetchone():
            raise InputError(f"standing mission {each.id} was removed", hint="`errand queue list` shows the others")
        counting = "SELECT count(*) FROM mission WHERE standing = ? AND state = 'queued'"
        (waiting,) = connection.execute(counting, (each.id,)).fetchone()
        if waiting >= MOST_WAITING:
            raise TooManyError(f"{waiting} missions of standing mission {each.id} wait already", hint="try again later")


class TooManyError(InputError):
    """Raised for a standing mission that has too many waiting copies."""


def _queue(connection: sqlite3.Connection, standing: int, request: Request, why: str) -> int:
    return insert(connection, request, state=MissionState.QUEUED, queued=True, standing=standing, why=why)
