"""`errand run --profile`: times the calls of a run that lead from one subsystem into another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from executive.app.backend import Backend
from executive.record.profile import Profile
from executive.record.work import CountedDetector
from executive.run.runner import RunEntry
from executive.run.worker import LockStepWorker

__all__ = ["profiled"]


def profiled(
    profile: Profile,
    run: Callable[..., Any],
    backend: Backend,
    entries: Sequence[RunEntry],
    worker: LockStepWorker,
) -> Callable[..., Any]:
    """The run with its parts timed; what none of them takes is the executive's own."""
    backend.attach(profile)
    for entry in entries:
        _attach(profile, entry)
    submit = worker.submit

    def submit_timed(work: Callable[[], Any], *, latency_s: float, name: str) -> Any:
        return submit(profile.timed("planning", work), latency_s=latency_s, name=name)

    vars(worker)["submit"] = submit_timed
    profile.begin()
    return profile.timed("executive", run)


def _attach(profile: Profile, entry: RunEntry) -> None:
    """Time what one robot's estimators, detector and journal do."""
    profile.attach("localiser", entry.localiser, "update")
    profile.attach("costmap", entry.costmap, "update", "add_points", "clearance_m")
    if isinstance(entry.detector, CountedDetector):
        profile.attach("detector", entry.detector, *entry.detector.methods)
    if entry.journal is not None:
        profile.attach("journal", entry.journal, "note")
