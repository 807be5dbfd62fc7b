"""HTTP calls and messages of plug-ins: each queues the standing missions that wait for it, and wakes the server."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Any

from executive.app.durable import as_it_was
from executive.app.feasibility import refuse_impossible
from executive.app.prepare import prepare
from executive.mission.file.parameters import values_in_json
from executive.mission.request import Request
from executive.store.missions import MissionStore, StoredMission
from executive.store.standing import StandingMission, StandingMissions, TooManyError
from executive.store.triggers import OnCall, OnTopic
from executive.store.wakeup import wake_server
from executive.view.calls import CallError
from skills.files.errors import InputError

__all__ = ["TriggerCalls"]


class TriggerCalls:
    """Queues missions of a store from any thread, one call after another; `tell` prints a line."""

    def __init__(self, store: Path, tell: Callable[[str], None]) -> None:
        self._store, self._tell = store, tell
        self._one_at_a_time = threading.Lock()

    def called(self, name: str, body: bytes) -> Mapping[str, Any]:
        """Queue what waits for an HTTP call; the numbers of the missions. Raises CallError."""
        return {"missions": [mission.id for mission in self._queue(OnCall(name), body)]}

    def heard(self, kind: str, topic: str, payload: bytes) -> None:
        """Queue what waits for a message, or print why it cannot be; raises nothing."""
        try:
            self._queue(OnTopic(kind, topic), payload)
        except CallError as refusal:
            self._tell(f"{OnTopic(kind, topic)}: {refusal}")

    def _queue(self, trigger: OnCall | OnTopic, body: bytes) -> tuple[StoredMission, ...]:
        """Queue the standing missions of a trigger, with the values in the body. Raises CallError."""
        try:
            with self._one_at_a_time, MissionStore(self._store, create=False) as store:
                standing = StandingMissions(store)
                chosen = [each for each in standing.missions() if each.trigger == trigger]
                if not chosen:
                    raise CallError(HTTPStatus.NOT_FOUND, f"no standing mission waits for '{trigger}'")
                fired = standing.fire([(each, _request(store, each, body)) for each in chosen], "")
        except TooManyError as error:
            raise CallError(HTTPStatus.TOO_MANY_REQUESTS, str(error)) from error
        except InputError as error:
            raise CallError(HTTPStatus.SERVICE_UNAVAILABLE, str(error)) from error
        except CallError:
            raise
        except Exception as defect:
            said = f"a defect of errand or of a plug-in ({type(defect).__name__}: {defect})"
            raise CallError(HTTPStatus.INTERNAL_SERVER_ERROR, said) from defect
        for mission in fired:
            self._tell(f"Mission {mission.id} is queued: {mission.request.name} ({mission.why})")
        wake_server(self._store)
        return fired


def _request(store: MissionStore, standing: StandingMission, body: bytes) -> Request:
    """The request of a standing mission, checked with the values in a body. Raises CallError, InputError."""
    mission = store.mission(standing.id)
    try:
        values = values_in_json(body)
        if not values:
            return standing.request
        before = as_it_was(mission, store.path)
        prepared = prepare(replace(before, given={**before.given, **values}))
        refuse_impossible(prepared)
    except InputError as error:
        raise CallError(HTTPStatus.BAD_REQUEST, str(error)) from error
    return replace(prepared.request.from_anywhere(), file=standing.request.file)
