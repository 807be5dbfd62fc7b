"""One mission in the plant at a seed, which a benchmark may change before it runs and watch while it runs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from executive.app.mission_run import run_request
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.report import RunReport
from executive.app.simulated import SimulatedBackend
from executive.mission.request import Request
from executive.run.visitor import RunVisitor
from plant.worlds.world import World


@dataclass(frozen=True)
class Ended:
    """End of a mission: the tree's claim, the referee's verdict with its reason and counts, and the times (s)."""

    what: str
    seed: int
    claimed: bool
    fulfilled: bool | None
    cause: str | None
    message: str
    why: str
    collisions: int
    drops: int
    people_hit: int
    hit_by_people: int
    events: tuple[str, ...]
    sim_time_s: float
    wall_time_s: float

    @property
    def false_claim(self) -> bool:
        """True if the tree claims success and the referee does not confirm it."""
        return self.claimed and not self.fulfilled


class PlantMission:
    """A mission and the plant of its world; `change` makes another world, such as one with people who walk.

    `steps` are the steps of a mission file; `fields` are those of the request.
    """

    def __init__(
        self,
        folder: Path,
        seed: int,
        *,
        change: Callable[[Prepared], World] = lambda prepared: prepared.world,
        steps: str = "",
        **fields: Any,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        if steps:
            fields["file"] = folder / "mission.yaml"
            fields["file"].write_text(f"name: benchmark\nsteps:\n{steps}")
        prepared = prepare(Request(seed=seed, out=folder, record=False, **fields))
        self.prepared = replace(prepared, world=change(prepared))
        self.robot_name = prepared.mission.robot_name
        self.backend = SimulatedBackend(self.prepared.world, prepared.robots, seed=seed, record=False)
        self.simulation = self.backend._simulation

    def run(self, *visitors: RunVisitor) -> RunReport:
        """Runs the mission to its end."""
        return run_request(self.prepared, self.backend, visitors=visitors).report

    def end(self, what: str, *visitors: RunVisitor) -> Ended:
        """Runs the mission; returns its end under a name."""
        report = self.run(*visitors)
        seen, ending = report.seen, (report.claimed, report.seen.success, report.cause, report.message)
        counts = (seen.collisions, seen.drops, seen.people_hit, seen.hit_by_people)
        return Ended(what, report.seed, *ending, seen.why, *counts, seen.events, report.sim_time_s, report.wall_time_s)
