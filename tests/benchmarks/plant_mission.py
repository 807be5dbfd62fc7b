"""One mission in the plant at a seed, which a benchmark may change before it runs and watch while it runs."""

from dataclasses import replace
from types import SimpleNamespace

from executive.app.prepare.from_request import prepare
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import SimulatedBackend
from executive.mission.request import Request


class PlantMission:
    """A mission and the plant of its world; `change` makes another world, such as one with people who walk.

    `steps` are the steps of a mission file; `fields` are those of the request.
    """

    def __init__(self, folder, seed, *, change=lambda prepared: prepared.world, steps="", **fields):
        folder.mkdir(parents=True, exist_ok=True)
        if steps:
            fields["file"] = folder / "mission.yaml"
            fields["file"].write_text(f"name: benchmark\nsteps:\n{steps}")
        prepared = prepare(Request(seed=seed, out=folder, record=False, **fields))
        self.prepared = replace(prepared, world=change(prepared))
        self.robot_name = prepared.mission.robot_name
        self.backend = SimulatedBackend(self.prepared.world, prepared.robots, seed=seed, record=False)
        self.simulation = self.backend._simulation

    def run(self, *visitors):
        return run_request(self.prepared, self.backend, visitors=visitors).report

    def end(self, what, *visitors):
        """Runs the mission; returns its claim, the referee's verdict with its reason and counts, and the times (s)."""
        report = self.run(*visitors)
        told = ("seed", "claimed", "cause", "message", "sim_time_s", "wall_time_s")
        seen = ("why", "collisions", "drops", "people_hit", "hit_by_people", "events")
        return SimpleNamespace(
            what=what,
            fulfilled=report.seen.success,
            false_claim=report.claimed and not report.seen.success,
            **{name: getattr(report, name) for name in told},
            **{name: getattr(report.seen, name) for name in seen},
        )
