"""`errand run --profile`: times the calls of a run that lead from one subsystem into another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from py_trees.behaviour import Behaviour

from executive.app.backend import Backend
from executive.record.profile import Profile
from executive.record.work import CountedDetector
from executive.run.outcome import RunResult
from executive.run.visitor import RunSettings, RunVisitor
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.skill_leaf import SkillLeaf
from skills.api import Worker

__all__ = ["RunProfile"]


class RunProfile(RunVisitor):
    """Times the parts of a run; what none of them takes is the executive's own."""

    def __init__(
        self, profile: Profile, backend: Backend, logs: Iterable[RunVisitor], journals: Iterable[RunVisitor]
    ) -> None:
        """`logs` are those that write the log, `journals` those that write the store."""
        self._profile, self._backend = profile, backend
        self._begun_s = 0.0
        for each in logs:
            profile.attach("log", each, "message", "tick")
        for each in journals:
            profile.attach("journal", each, "tick")

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """Time the backend's subsystems and what the worker does."""
        self._backend.attach(self._profile)
        submit, timed = worker.submit, self._profile.timed

        def submit_timed(work: Callable[[], Any], *, latency_s: float, name: str) -> Any:
            return submit(timed("planning", work), latency_s=latency_s, name=name)

        vars(worker)["submit"] = submit_timed
        self._profile.begin()
        self._begun_s = self._profile.enter()

    def mission_begun(self, nodes: Sequence[Behaviour], context: RunContext) -> None:
        """Time what a robot's estimators, detector and skills do."""
        attach = self._profile.attach
        attach("localiser", context.localiser, "update")
        attach("costmap", context.costmap, "update", "add_points", "clearance_m")
        if isinstance(context.detector, CountedDetector):
            attach("detector", context.detector, *context.detector.methods)
        for leaf in nodes:
            if isinstance(leaf, SkillLeaf):
                attach("skills", leaf, "initialise", "update", "terminate")

    def end(self, result: RunResult) -> None:
        """The executive has done its part."""
        self._profile.leave("executive", self._begun_s)
