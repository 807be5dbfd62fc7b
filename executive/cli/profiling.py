"""`errand run --profile`: times the calls of a run that lead from one subsystem into another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from executive.cli.backend import Backend
from executive.record.profile import Profile
from executive.record.work import CountedDetector
from executive.run.runner import RunEntry
from executive.run.worker import LockStepWorker

__all__ = ["profiled"]


def profiled(
    profile: Profile,
    run: Callable[..., Any],
    backend: Backend,
    entry: RunEntry,
    worker: LockStepWorker,
) -> Callable[..., Any]:
    """The run with its parts timed; what none of them takes is the executive's own."""
    backend.attach(profile)
    profile.attach("localiser", entry.localiser, "update")
    profile.attach("costmap", entry.costmap, "update", "add_points", "clearance_m")
    if isinstance(entry.detector, CountedDetector):
        profile.attach("detector", entry.detector, *entry.detector.methods)
    submit = worker.submit

    def submit_timed(work: Callable[[], Any], *, latency_s: float, name: str) -> Any:
        return submit(profile.timed("planning", work), latency_s=latency_s, name=name)

    vars(worker)["submit"] = submit_timed
    if entry.journal is not None:
        profile.attach("journal", entry.journal, "note")
    profile.begin()
    return profile.timed("executive", run)
