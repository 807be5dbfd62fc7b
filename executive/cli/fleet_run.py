"""Runs what is queued with several robots in one plant, each mission by the robot that is done with it first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from executive.cli.backend import Backend
from executive.cli.fleet_missions import FleetMission, RobotNow, bid_for, rest_of
from executive.cli.fleet_progress import Progress, ProgressJournal
from executive.cli.mission_run import entry_for
from executive.cli.requests import Prepared
from executive.cli.signals import cancelled_by_signals
from executive.cli.starts import PlacedRobot
from executive.fleet.auction import Bid
from executive.fleet.dispatcher import Dispatcher
from executive.mission.errors import listing
from executive.mission.scenario import Scenario
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.record.work import Work
from executive.run.control import Control
from executive.run.dispatch import MissionEnd
from executive.run.outcome import Outcome, RobotResult
from executive.run.runner import RunEntry, RunSettings, run
from executive.run.worker import LockStepWorker
from executive.store.given import GivenMissions
from executive.store.missions import MissionState, MissionStore
from skills.robot import Pose2D

__all__ = ["FleetDispatch", "run_fleet"]

TIME_LIMIT_S: Final = 1200.0
"""For each mission of the queue, on the robots' clock."""


@dataclass
class _Robot:
    """A robot of the fleet: where it is free next, and from when (s on the robots' clock)."""

    placed: PlacedRobot
    pose: Pose2D
    charge: float = 1.0
    free_at_s: float = 0.0
    entry: RunEntry | None = None
    journal: ProgressJournal | None = None
    faults: tuple[str, ...] = ()


@dataclass
class FleetDispatch:
    """Gives the missions of a store to robots of a backend (`executive.run.dispatch.Dispatch`), and keeps in the store
    whose each is, how it ended and what a referee saw."""

    store: MissionStore
    missions: dict[int, FleetMission]
    robots: Mapping[str, PlacedRobot]
    backend: Backend
    faults: Mapping[str, Sequence[str]] = field(default_factory=dict)
    console: Console | None = None
    log: EventLog | None = None

    def __post_init__(self) -> None:
        self._given = GivenMissions(self.store)
        self._dispatcher = Dispatcher(self.missions, self.robots)
        self._robots = {
            name: _Robot(placed, placed.start, faults=tuple(self.faults.get(name, ())))
            for name, placed in self.robots.items()
        }
        self._bids: dict[tuple[int, str, int, Pose2D], Bid] = {}
        self._gone: dict[str, str] = {}
        self._work = Work()

    @property
    def waiting(self) -> tuple[int, ...]:
        """The missions that no robot has."""
        return self._dispatcher.waiting

    def begin(self) -> Sequence[RunEntry]:
        """The missions that begin now."""
        entries: list[RunEntry] = []
        given = self._dispatcher.assign(self._bid)
        for number, why in given.refused.items():
            self._finish(number, MissionState.FAILURE, why)
        for award in given.begun:
            robot, mission = self._robots[award.robot], self.missions[award.mission]
            robot.free_at_s = self._now_s + award.ends_s
            self._given.give(award.mission, award.robot)
            self.store.begin(award.mission)
            self._tell(f"{award.robot} has mission {award.mission}: {mission.stored.request.name}")
            entries.append(self._entry(award.robot, mission))
        return entries

    def ended(self, end: MissionEnd) -> None:
        """A robot's mission is over, or another robot goes on with it."""
        name = end.result.robot_name
        robot = self._robots[name]
        robot.free_at_s = self._now_s
        gone = end.gone
        if end.seen is not None:
            robot.pose = end.seen.pose or robot.pose
            robot.charge = robot.charge if end.seen.charge is None else end.seen.charge
            if end.seen.pose is None and gone is None and end.result.outcome is not Outcome.SUCCESS:
                gone = "it does not know where it is"
        if gone is not None:
            self._gone[name] = gone
            self._dispatcher.lose(name)
            self._tell(f"{name} is given no more work: {gone}")
        if gone is None or end.result.outcome is Outcome.SUCCESS:
            self._over(name, end.result)
            return
        why = self._stuck(name, holding=end.seen is not None and end.seen.holding)
        if why is not None or not self._dispatcher.robots:
            reason = f"{name} failed ({gone})"
            self._over(name, replace(end.result, message=f"{reason}; {why or 'there is no other robot'}"))
            return
        number = self._dispatcher.hand_back(name)
        self._go_on_later(number, robot)
        self._tell(f"Mission {number} waits for another robot")

    def close(self) -> None:
        """What no robot has at the end stays in the queue; what was handed back is told as failed."""
        handed_back = self._given.all()
        for number in self.waiting:
            given = handed_back.get(number)
            if given is not None and given.reassigned:
                reasons = listing([f"{name}: {why}" for name, why in self._gone.items()])
                self._finish(number, MissionState.FAILURE, f"no robot is left to go on with it ({reasons})")

    @property
    def _now_s(self) -> float:
        return self.backend.clock.now()

    def _bid(self, mission: int, name: str) -> Bid:
        """What a robot offers; the route is planned once for each place that it offers it from."""
        robot, wanted = self._robots[name], self.missions[mission]
        key = (mission, name, wanted.done, robot.pose)
        ready_s = max(0.0, robot.free_at_s - self._now_s)
        if key not in self._bids:
            self._bids[key] = bid_for(wanted, name, RobotNow(robot.pose, 0.0, robot.charge))
        return replace(self._bids[key], ready_s=ready_s)

    def _entry(self, name: str, mission: FleetMission) -> RunEntry:
        robot, prepared = self._robots[name], mission.options[name]
        entry = self._with_estimators(name, prepared)
        robot.journal = ProgressJournal(prepared.tree, lambda progress: self._progress(mission, progress))
        self._announce(prepared)
        speaker_W = next(iter(self.robots.values())).start
        return replace(entry, tree=prepared.tree, journal=robot.journal, speaker_W=speaker_W)

    def spare(self) -> Sequence[RunEntry]:
        """The robots before they have a mission."""
        options = next((mission.options for mission in self.missions.values()), {})
        return [self._with_estimators(name, options[name]) for name in self.robots if name in options]

    def _with_estimators(self, name: str, prepared: Prepared) -> RunEntry:
        """The robot with its faults and estimators, which stay the same from mission to mission."""
        robot = self._robots[name]
        if robot.entry is None:
            disturbed = replace(prepared.request, scenario=Scenario(robot.faults))
            robot.entry = entry_for(replace(prepared, request=disturbed), self.backend, None, self._work)
        return robot.entry

    def _progress(self, mission: FleetMission, progress: Progress) -> None:
        done = mission.done + progress.done
        self._given.progress(mission.stored.id, done, "it was begun" if progress.begun else None)

    def _announce(self, prepared: Prepared) -> None:
        if self.log is not None:
            world, seed = prepared.world.name, prepared.request.seed
            announce(self.log, self.backend.clock, prepared.tree, prepared.knowledge, world=world, seed=seed)

    def _stuck(self, name: str, *, holding: bool) -> str | None:
        """Why no other robot can go on with the mission of one that is gone; None: one can."""
        robot, mission = self._robots[name], self.missions[self._dispatcher.under_way[name]]
        progress = robot.journal.progress if robot.journal is not None else Progress(0, False)
        if not progress.begun:
            return None
        commands = mission.options[name].tree.commands[progress.done :]
        if holding:
            thing = next((each.object or each.item for each in commands if each.object or each.item), None)
            return f"the {thing or 'thing'} is in {name}'s gripper"
        return f"{name} had begun it, and how far it came is not known"

    def _go_on_later(self, number: int, robot: _Robot) -> None:
        """What is left of a mission that is handed back."""
        mission = self.missions[number]
        done = robot.journal.progress.done if robot.journal is not None else 0
        options = {name: rest_of(each, done) for name, each in mission.options.items()} if done else mission.options
        self.missions[number] = FleetMission(mission.stored, options, mission.done + done)
        self._given.hand_back(number)
        self.store.finish(number, MissionState.QUEUED, "")

    def _over(self, name: str, result: RobotResult) -> None:
        """A mission has come to its end."""
        number = self._dispatcher.over(name)
        report = self.backend.judge(self.missions[number].options[name].tree, result)
        seen = None if report is None else {key: value for key, value in vars(report).items() if key != "events"}
        self._given.judge(number, seen)
        self._finish(number, MissionState(result.outcome.value), result.message)

    def _finish(self, number: int, state: MissionState, message: str) -> None:
        self.store.finish(number, state, message)
        self._tell(f"Mission {number}: {state.value}: {message}")

    def _tell(self, line: str) -> None:
        if self.console is not None:
            self.console.print(line, markup=False)


def run_fleet(dispatch: FleetDispatch, *, out: Path, seed: int, time_limit_s: float | None = None) -> None:
    """Run until no mission can be given out any more; the log is written into a folder. Raises InputError."""
    clock = dispatch.backend.clock
    dispatch.log = EventLog(out / "log.mcap", clock)
    limit_s = TIME_LIMIT_S * max(1, len(dispatch.missions)) if time_limit_s is None else time_limit_s
    try:
        with cancelled_by_signals(Control(pace=None)) as control, LockStepWorker(clock) as worker:
            run(
                (),
                clock=clock,
                worker=worker,
                publish=dispatch.log,
                settings=RunSettings(seed=seed, time_limit_s=limit_s),
                control=control,
                dispatch=dispatch,
                spare=dispatch.spare(),
            )
    finally:
        dispatch.log.close()
    dispatch.close()


def told(store: MissionStore, numbers: Sequence[int]) -> list[dict[str, Any]]:
    """Missions as JSON values: whose each is or was, and how it ended."""
    given = GivenMissions(store).all()
    missions = {mission.id: mission for mission in store.missions()}
    return [
        {
            "id": number,
            "robot": given[number].robot if number in given else None,
            "outcome": missions[number].state.value,
            "referee": given[number].referee if number in given else None,
            "reassigned": given[number].reassigned if number in given else 0,
            "message": missions[number].message,
        }
        for number in numbers
    ]
