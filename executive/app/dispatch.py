"""Gives what is queued out to the robots of a fleet, and keeps what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from executive.app.auction import Auction
from executive.app.backend import Backend
from executive.app.chain import chained
from executive.app.fleet import (
    EndedMission,
    FleetMission,
    FleetRobot,
    MissionProgress,
    Offers,
    ProgressJournal,
    charging_time_s,
    is_lost,
    is_plain,
    missions_json,
    missions_message,
    rest_of,
    surfaces_of,
)
from executive.app.goal_conditions import Share
from executive.app.mission_run import entry_for, robot_report
from executive.app.placed_robots import PlacedRobot
from executive.app.prepared import Prepared
from executive.app.report_file import EndedTree
from executive.mission.scenario import Scenario
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.record.schemas import MISSIONS
from executive.run.outcome import Outcome, RobotResult, RobotStatus
from executive.run.visitor import Assigner, MissionEnd, Progress, RunEntry
from executive.store.assignments import GivenMissions
from executive.store.missions import MissionState, MissionStore
from executive.tree.node_view import node_view
from executive.words.knowledge import BatteryFacts
from skills.files.errors import listing
from skills.robot import Pose2D

LEFT_M: Final = 1.5
"""A robot that has come so far has left the table where it put something down for another."""


def silence(line: str) -> None:
    """Shows nothing."""


@dataclass
class Dispatch(Assigner):
    """Assigns the missions of a store to robots of a backend by an auction, and keeps in the store whose each is, how
    it ended and what a referee saw.

    A robot whose `battery` is low gives its mission back once it has nothing in hand, and charges by its mission of
    `docks`. `tell` shows a line, `offers` makes what the robots offer.
    """

    store: MissionStore
    missions: dict[int, FleetMission]
    robots: Mapping[str, PlacedRobot]
    backend: Backend
    faults: Mapping[str, Sequence[str]] = field(default_factory=dict)
    docks: Mapping[str, Prepared] = field(default_factory=dict)
    battery: BatteryFacts = field(default_factory=BatteryFacts)
    tell: Callable[[str], None] = field(default=silence)
    log: EventLog | None = None
    offers: Callable[[Mapping[str, FleetRobot], BatteryFacts, Callable[[], float], Auction], Offers] = Offers

    def __post_init__(self) -> None:
        self._given = GivenMissions(self.store)
        self._auction = Auction(
            (), self.robots, lambda number: surfaces_of(next(iter(self.missions[number].options.values())))
        )
        self._parts = {number: each for number, each in self._given.all().items() if each.part_of is not None}
        for number in self.missions:
            follows = self._parts[number].follows if number in self._parts else None
            self._auction.add(number, after=follows if follows in self.missions else None)
        self._robots = {
            name: FleetRobot(placed, placed.start, dock=self.docks.get(name), faults=tuple(self.faults.get(name, ())))
            for name, placed in self.robots.items()
        }
        self._offers = self.offers(self._robots, self.battery, self.backend.clock.now, self._auction)
        self._gone: dict[str, str] = {}
        self._recalled: set[str] = set()
        self._to_dock: list[str] = []
        self._leaving: dict[str, tuple[int, Pose2D]] = {}
        self.over: list[EndedMission] = []
        self._stopped: str | None = None

    def stop(self, reason: str) -> None:
        """The run is ended from outside: what robots have under way stays in the queue; from signal handlers."""
        self._stopped = reason

    def assign(self) -> Sequence[RunEntry]:
        """The missions that begin now."""
        entries: list[RunEntry] = []
        self._let_follow({})
        given = self._auction.assign(lambda number, name: self._offers.known(self.missions[number], name))
        refused = {number: why for number, why in given.refused.items() if not self._split(number)}
        for number, why in refused.items():
            self._finish(number, MissionState.FAILURE, why)
        for award in given.begun:
            robot, mission = self._robots[award.robot], self.missions[award.mission]
            robot.free_at_s = self._now_s + award.ends_s
            self._given.give(award.mission, award.robot)
            self.store.begin(award.mission)
            if mission.since_s is None:
                self.missions[award.mission] = replace(mission, since_s=self._now_s)
            self.tell(f"{award.robot} has mission {award.mission}: {mission.stored.request.name}")
            entries.append(self._entry(award.robot, mission))
        if given.begun:
            self._log_missions()
        self._to_dock += given.charging
        if self._auction.waiting or self._auction.under_way:
            entries += [self._dock_entry(name) for name in self._to_dock if name in self._auction.resting]
            self._to_dock = []
        return entries if len(refused) == len(given.refused) else [*entries, *self.assign()]

    def _split(self, number: int) -> bool:
        """Has a mission done in two parts, as no robot can do it alone; whether two can."""
        mission = self.missions[number]
        chain = None if number in self._parts else chained(mission, self._offers.new, self._offers.takes_from)
        if chain is None:
            return False
        names = [f"{mission.stored.request.name}, part {part} of 2" for part in (1, 2)]
        added: list[int] = []
        for name, options in zip(names, (chain.first, chain.second), strict=True):
            request = next(iter(options.values())).request
            request = replace(request, sentence=None, file=None, text=None, name=name)
            stored = self.store.add(request, queued=True)
            self.missions[stored.id] = FleetMission(stored, options)
            self._auction.add(stored.id, after=added[0] if added else None)
            added.append(stored.id)
        self._given.split(number, added)
        self._parts = {part: each for part, each in self._given.all().items() if each.part_of is not None}
        self.store.begin(number)
        by = "" if chain.table is None else f", by the {chain.table}"
        self.tell(f"No robot can do mission {number} alone: missions {added[0]} and then {added[1]} do it{by}")
        return True

    def recall(self, seen: Mapping[str, RobotStatus]) -> Mapping[str, str]:
        """The robots that are low and have nothing in hand; and those that charge when nothing is left to do."""
        self._let_follow(seen)
        under_way = self._auction.under_way
        low = {name: each for name, each in seen.items() if name in under_way and self._may_leave(name, each)}
        idle = self._auction.resting if not under_way and not self._auction.waiting else ()
        self._recalled = {*low, *idle}
        why = {name: f"its battery is at {each.charge:.0%}" for name, each in low.items()}
        return {**why, **dict.fromkeys(idle, "nothing is left to do")}

    def _let_follow(self, seen: Mapping[str, RobotStatus]) -> None:
        """The next part begins when the robot of the one before has left the table, or does not leave it."""
        for name, (number, from_W) in tuple(self._leaving.items()):
            pose = seen[name].pose if name in seen else None
            gone_m = 0.0 if pose is None else math.hypot(pose.x_m - from_W.x_m, pose.y_m - from_W.y_m)
            if name not in self._auction.resting or gone_m > LEFT_M:
                del self._leaving[name]
                self._auction.done(number)

    def _may_leave(self, name: str, seen: RobotStatus) -> bool:
        """Returns whether a robot is low, can charge, and leaves nothing half done."""
        robot = self._robots[name]
        low = seen.charge is not None and seen.charge < self.battery.low
        return low and robot.dock is not None and not seen.holding and not robot.progress.begun

    def tick(self, progress: Progress) -> None:
        """Sees how far the missions are."""
        for name, note in progress.notes.items():
            journal = self._robots[name].journal
            if journal is not None:
                journal.note(note)

    def mission_ended(self, end: MissionEnd) -> None:
        """A robot's mission is over, or another robot goes on with it."""
        name = end.result.robot_name
        robot, recalled = self._robots[name], name in self._recalled
        self._recalled.discard(name)
        gone = self._look(robot, end)
        if gone is not None:
            self._gone[name] = gone
            self._auction.lose(name)
            self.tell(f"{name} is given no more work: {gone}")
        if name not in self._auction.under_way:
            self._charged(name, end.result, recalled=recalled)
            return
        if self._stopped is not None and end.result.outcome is Outcome.CANCELLED:
            self._leave_in_queue(name, end)
            return
        if end.result.outcome is Outcome.SUCCESS:
            self._over(name, end.result)
            return
        if gone is None and not recalled:
            if not self._given_to_another(name, end):
                self._over(name, end.result)
            return
        why = self._stuck(name, holding=end.seen is not None and end.seen.holding)
        if why is not None or not self._auction.robots:
            reason = f"{name} failed ({gone})"
            self._over(name, replace(end.result, message=f"{reason}; {why or 'there is no other robot'}"))
            return
        self._hand_on(name, end.result)
        if gone is None:
            self._leave_for_dock(name)

    def _leave_in_queue(self, name: str, end: MissionEnd) -> None:
        """The next run goes on with a robot's mission; one of which it cannot be said how far it came is cancelled."""
        why = self._stuck(name, holding=end.seen is not None and end.seen.holding)
        if why is not None:
            self._over(name, replace(end.result, message=f"{end.result.message}; {why}"))
            return
        number = self._auction.hand_back(name)
        self._go_on_later(number, self._robots[name], end.result)
        self.tell(f"Mission {number} stays in the queue: {end.result.message}")

    def _given_to_another(self, name: str, end: MissionEnd) -> bool:
        """Offers to the others, once, what one robot did not manage: it has nothing in its gripper, and has put nothing
        down anywhere. Whether another can do it."""
        number, robot = self._auction.under_way[name], self._robots[name]
        mission = self.missions[number]
        clear = end.seen is not None and not end.seen.holding and not robot.progress.put
        again = replace(mission, tried={name: f"it tried: {end.result.message}"})
        others = (other for other in self._auction.robots if other != name)
        if (
            end.result.outcome is not Outcome.FAILURE
            or mission.tried
            or not (clear and is_plain(mission.options[name].tree))
            or all(self._offers.new(again, other).problems for other in others)
        ):
            return False
        self.missions[number] = again
        self._hand_on(name, end.result)
        return True

    def _hand_on(self, name: str, result: RobotResult) -> None:
        """What is left of a robot's mission waits for another."""
        number = self._auction.hand_back(name)
        self._go_on_later(number, self._robots[name], result)
        self.tell(f"Mission {number} waits for another robot: {result.message}")

    def _leave_for_dock(self, name: str) -> None:
        """A robot is to go to its dock."""
        self._auction.resting.add(name)
        self._to_dock.append(name)

    def _look(self, robot: FleetRobot, end: MissionEnd) -> str | None:
        """Sees where a robot is at the end of a mission; why nothing more can be asked of it (None: it can)."""
        robot.free_at_s = self._now_s
        if end.seen is None:
            return end.gone
        robot.pose = end.seen.pose or robot.pose
        robot.charge = robot.charge if end.seen.charge is None else end.seen.charge
        if end.gone is not None or end.result.outcome is Outcome.SUCCESS:
            return end.gone
        states = end.result.states
        number = self._auction.under_way.get(end.result.robot_name)
        prepared = robot.dock if number is None else self.missions[number].options[end.result.robot_name]
        lost = prepared is not None and is_lost(
            prepared.tree, lambda path: states[path].status if path in states else None
        )
        return "it does not know where it is" if lost or end.seen.pose is None else None

    def _charged(self, name: str, result: RobotResult, *, recalled: bool) -> None:
        """A robot's way to its dock is over. Where it could not charge, it is not sent there again."""
        self._auction.resting.discard(name)
        robot = self._robots[name]
        if result.outcome is not Outcome.SUCCESS and not recalled:
            robot.dock = None
        self.tell(f"{name} is at {robot.charge:.0%}: {result.message}")

    def close(self) -> None:
        """What no robot has at the end stays in the queue; what was handed back is told as failed."""
        handed_back = self._given.all()
        for number in self._auction.waiting if self._stopped is None else ():
            given = handed_back.get(number)
            if given is not None and given.robot is not None:
                why = {**self._gone, **self.missions[number].tried}
                reasons = listing([f"{name}: {each}" for name, each in why.items()])
                self._finish(number, MissionState.FAILURE, f"no robot went on with it ({reasons})")

    @property
    def _now_s(self) -> float:
        return self.backend.clock.now()

    def _dock_entry(self, name: str) -> RunEntry:
        """A robot goes to its dock and charges."""
        robot = self._robots[name]
        assert robot.dock is not None
        robot.free_at_s = self._now_s + charging_time_s(robot.charge, self.battery.charged)
        robot.journal = None
        self.tell(f"{name} goes to its dock: its battery is at {robot.charge:.0%}")
        self._announce(robot.dock)
        return replace(self._robot_entry(name, robot.dock), tree=robot.dock.tree)

    def _entry(self, name: str, mission: FleetMission) -> RunEntry:
        robot, prepared = self._robots[name], mission.options[name]
        number = mission.stored.id

        def note(progress: MissionProgress) -> None:
            """Keeps how far the mission is."""
            self._given.progress(number, mission.done + progress.done, "it was begun" if progress.begun else None)

        robot.journal = ProgressJournal(prepared.tree, note)
        speaker_W = next(iter(self.robots.values())).start
        entry = self._robot_entry(name, prepared)
        self._announce(prepared)
        return replace(entry, tree=prepared.tree, speaker_W=speaker_W)

    def spare(self) -> Sequence[RunEntry]:
        """The robots before they have a mission."""
        options = next((mission.options for mission in self.missions.values()), {})
        return [self._robot_entry(name, options[name]) for name in self.robots if name in options]

    def _robot_entry(self, name: str, prepared: Prepared) -> RunEntry:
        """The robot with its faults and estimators, which stay the same from mission to mission."""
        robot = self._robots[name]
        if robot.entry is None:
            disturbed = replace(prepared.request, scenario=Scenario(robot.faults))
            robot.entry = entry_for(replace(prepared, request=disturbed), self.backend, None)
        return robot.entry

    def _announce(self, prepared: Prepared) -> None:
        if self.log is not None:
            world, seed = prepared.world.name, prepared.request.seed
            kinds = {name: robot.kind for name, robot in self.robots.items()}
            announce(
                self.log, self.backend.clock, prepared.tree, prepared.knowledge, world=world, seed=seed, robots=kinds
            )

    def _stuck(self, name: str, *, holding: bool) -> str | None:
        """Why no other robot can go on with the mission of one that is gone; None: one can."""
        robot, mission = self._robots[name], self.missions[self._auction.under_way[name]]
        progress = robot.progress
        if not progress.begun:
            return None
        commands = mission.options[name].tree.commands[progress.done :]
        if holding:
            thing = next((each.object or each.item for each in commands if each.object or each.item), None)
            return f"the {thing or 'thing'} is in {name}'s gripper"
        return f"{name} had begun it, and how far it came is not known"

    def _go_on_later(self, number: int, robot: FleetRobot, result: RobotResult) -> None:
        """What is left of a mission that is handed back."""
        mission, done = self.missions[number], robot.progress.done
        if done:
            share = Share(mission.options[result.robot_name].tree, result, done)
            options = {name: rest_of(each, done) for name, each in mission.options.items()}
            shares, done = (*mission.shares, share), mission.done + done
            self.missions[number] = replace(mission, options=options, done=done, shares=shares)
        self._given.hand_back(number)
        self.store.finish(number, MissionState.QUEUED, "")
        self._log_missions()

    def _over(self, name: str, result: RobotResult) -> None:
        """A mission has come to its end."""
        number = self._auction.under_way.pop(name)
        mission = self.missions[number]
        tree, since_s = mission.options[name].tree, mission.since_s or 0.0
        report = self.backend.judge(tree, result, before=mission.shares, since_s=since_s)
        seen = None if report is None else {key: value for key, value in vars(report).items() if key != "events"}
        self._given.judge(number, seen)
        ended = EndedTree(
            tree,
            node_view(tree.root, result.states),
            robot_report(result, self.robots[name].kind, report),
        )
        self.over.append(EndedMission(number, ended, since_s, self._now_s))
        if number in self._parts:
            self._part_over(number, Share(tree, result, len(tree.parts)), seen)
        tried = {} if result.outcome is Outcome.SUCCESS else mission.tried
        message = "; ".join([result.message, *(f"{other} before: {why}" for other, why in tried.items())])
        self._finish(number, MissionState(result.outcome.value), message)

    def _part_over(self, number: int, share: Share, seen: Mapping[str, Any] | None) -> None:
        """The next part goes on from what this one did, and its robot leaves the table to the other; after the last,
        all are judged together."""
        mission, whole = self.missions[number], self._parts[number].part_of
        following = [part for part, each in self._parts.items() if each.follows == number]
        for part in following:
            shares = (*mission.shares, share)
            self.missions[part] = replace(self.missions[part], since_s=mission.since_s, shares=shares)
        name = share.tree.robot_name
        if following and name in self._auction.robots and self._robots[name].dock is not None:
            self._leave_for_dock(name)
            self._leaving[name] = (number, self._robots[name].pose)
        if whole is not None and not following:
            self._given.judge(whole, seen)

    def _finish(self, number: int, state: MissionState, message: str) -> None:
        self.store.finish(number, state, message)
        self.tell(f"Mission {number}: {state.value}: {message}")
        if state is MissionState.SUCCESS:
            if all(number != part for part, _ in self._leaving.values()):
                self._auction.done(number)
        else:
            self._auction.drop(number)
        self._given.settle()
        self._log_missions()

    def _log_missions(self) -> None:
        """Log whose each mission is by now."""
        if self.log is not None:
            self.log(MISSIONS, missions_message(self.store, missions_json(self.store, list(self.missions))))
