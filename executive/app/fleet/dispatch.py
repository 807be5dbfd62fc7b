"""Assigns queued missions to the robots of a fleet by an auction; stores each mission's robot and outcome."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from executive.app.fleet.auction import Auction
from executive.app.fleet.chain import best_split, options_for
from executive.app.fleet.fleet_mission import (
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
from executive.app.prepare.prepared import Prepared
from executive.app.report.report_page import EndedTree
from executive.app.runs.backend import Backend
from executive.app.runs.goal_conditions import Share
from executive.app.runs.one_run import entry_for, robot_report
from executive.mission.scenario import Scenario
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.record.schemas import MISSIONS
from executive.run.outcome import Outcome, RobotResult, RobotStatus
from executive.run.visitor import Assigner, MissionEnd, Progress, RunEntry
from executive.store.missions import GivenMissions, MissionState, MissionStore
from executive.tree.board import Sign
from executive.tree.node_view import node_view
from executive.words.knowledge import BatteryFacts
from plant.robots.robot_kind import PlacedRobot
from skills.inputs.errors import listing

LEFT_M: Final = 1.5
"""Distance from a hand-over table beyond which a robot leaves space for the next one."""


def silence(line: str) -> None:
    """Discards a line instead of showing it."""


@dataclass
class Dispatch(Assigner):
    """Dispatcher of a fleet: assigns the missions in a store to the robots of a backend.

    A robot whose battery is low returns its mission once its gripper is empty, and charges by its mission in `docks`.
    `tell` shows a line; `offers` builds the bids of the robots.
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
        given = self._given.all()
        for number in self.missions:
            follows = given[number].follows if number in given else None
            self._auction.add(number, after=follows if follows in self.missions else None)
        self._robots = {
            name: FleetRobot(placed, placed.start, dock=self.docks.get(name), faults=tuple(self.faults.get(name, ())))
            for name, placed in self.robots.items()
        }
        self._offers = self.offers(self._robots, self.battery, self.backend.clock.now, self._auction)
        self.over: list[EndedMission] = []
        self._stopped: str | None = None

    def stop(self, reason: str) -> None:
        """Ends the run; missions under way stay in the queue. Signal handlers may call it."""
        self._stopped = reason

    def assign(self) -> Sequence[RunEntry]:
        """Runs a round of the auction; returns the missions that begin now."""
        entries: list[RunEntry] = []
        self._release_following({})
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
        for name in given.charging:
            self._robots[name].to_dock = True
        if self._auction.waiting or self._auction.under_way:
            resting = [name for name in self.robots if name in self._auction.resting]
            entries += [self._dock_entry(name) for name in resting if self._robots[name].to_dock]
        return entries if len(refused) == len(given.refused) else [*entries, *self.assign()]

    def _split(self, number: int) -> bool:
        """Splits a mission that no robot can do alone into two parts; returns whether two robots can do them."""
        mission, given = self.missions[number], self._given.all()
        if number in given and given[number].part_of is not None:
            return False
        split = best_split(mission, self._offers.new, self._offers.takes_from)
        if split is None:
            return False
        names = [f"{mission.stored.request.name}, part {part} of 2" for part in (1, 2)]
        added: list[int] = []
        for name, commands in zip(names, (split.first, split.second), strict=True):
            options = options_for(mission, commands)
            request = next(iter(options.values())).request
            request = replace(request, sentence=None, file=None, text=None, name=name)
            stored = self.store.add(request, queued=True)
            self.missions[stored.id] = FleetMission(stored, options)
            self._auction.add(stored.id, after=added[0] if added else None)
            added.append(stored.id)
        self._given.split(number, added)
        self.store.begin(number)
        by = "" if split.table is None else f", by the {split.table}"
        self.tell(f"No robot can do mission {number} alone: missions {added[0]} and then {added[1]} do it{by}")
        return True

    def recall(self, seen: Mapping[str, RobotStatus]) -> Mapping[str, str]:
        """Returns the robots that must stop, each with the reason: its battery is low, or no mission is left."""
        self._release_following(seen)
        under_way = self._auction.under_way
        low: dict[str, RobotStatus] = {}
        for name, each in seen.items():
            robot, is_low = self._robots[name], each.charge is not None and each.charge < self.battery.low
            if name in under_way and is_low and robot.dock and not each.holding and not robot.progress.begun:
                low[name] = each
        idle = self._auction.resting if not under_way and not self._auction.waiting else ()
        for name, robot in self._robots.items():
            robot.recalled = name in low or name in idle
        why = {name: f"its battery is at {each.charge:.0%}" for name, each in low.items()}
        return {**why, **dict.fromkeys(idle, "nothing is left to do")}

    def _release_following(self, seen: Mapping[str, RobotStatus]) -> None:
        """Lets the second part of a split mission begin once the first robot has left the table or does not charge."""
        for name, robot in self._robots.items():
            if robot.leaves is None:
                continue
            number, from_W = robot.leaves
            pose = seen[name].pose if name in seen else None
            away_m = 0.0 if pose is None else math.hypot(pose.x_m - from_W.x_m, pose.y_m - from_W.y_m)
            if name not in self._auction.resting or away_m > LEFT_M:
                robot.leaves = None
                self._auction.done(number)

    def tick(self, progress: Progress) -> None:
        """Updates the progress of each robot's mission with the changes of its tree."""
        for name, note in progress.notes.items():
            journal = self._robots[name].journal
            if journal is not None:
                journal.note(note)

    def mission_ended(self, end: MissionEnd) -> None:
        """Ends the mission of a robot, or queues the unfinished part for another robot."""
        name = end.result.robot_name
        robot = self._robots[name]
        recalled, robot.recalled = robot.recalled, False
        lost = self._update_robot(robot, end)
        if lost is not None:
            robot.lost = lost
            self._auction.lose(name)
            self.tell(f"{name} is given no more work: {lost}")
        if name not in self._auction.under_way:
            self._auction.resting.discard(name)
            if end.result.outcome is not Outcome.SUCCESS and not recalled:
                robot.dock = None  # it could not charge, and is not sent there again
            self.tell(f"{name} is at {robot.charge:.0%}: {end.result.message}")
            return
        if self._stopped is not None and end.result.outcome is Outcome.CANCELLED:
            self._leave_in_queue(name, end)
            return
        if end.result.outcome is Outcome.SUCCESS:
            self._end(name, end.result)
            return
        if lost is None and not recalled:
            if not self._try_another(name, end):
                self._end(name, end.result)
            return
        why = self._stuck(name, holding=end.seen is not None and end.seen.holding)
        if why is not None or not self._auction.robots:
            reason = f"{name} failed ({lost})"
            self._end(name, replace(end.result, message=f"{reason}; {why or 'there is no other robot'}"))
            return
        self._hand_on(name, end.result)
        if lost is None:
            self._send_to_dock(name)

    def _leave_in_queue(self, name: str, end: MissionEnd) -> None:
        """Leaves the rest of a robot's mission in the queue, or ends the mission if no other robot can continue it."""
        why = self._stuck(name, holding=end.seen is not None and end.seen.holding)
        if why is not None:
            self._end(name, replace(end.result, message=f"{end.result.message}; {why}"))
            return
        number = self._requeue(name, end.result)
        self.tell(f"Mission {number} stays in the queue: {end.result.message}")

    def _try_another(self, name: str, end: MissionEnd) -> bool:
        """Offers a failed mission to the other robots, once; returns whether one of them can do it.

        The robot's gripper must be empty, and it must not have released an object.
        """
        number, robot = self._auction.under_way[name], self._robots[name]
        mission, known = self.missions[number], self._robots[name].last_known
        let_go = robot.progress.put or (known is not None and known.sign is Sign.RELEASED)
        clear = end.seen is not None and not end.seen.holding and not let_go
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
        """Queues the unfinished part of a robot's mission for another robot."""
        number = self._requeue(name, result)
        self.tell(f"Mission {number} waits for another robot: {result.message}")

    def _send_to_dock(self, name: str) -> None:
        """Sends a robot to its dock at the next round."""
        self._auction.resting.add(name)
        self._robots[name].to_dock = True

    def _update_robot(self, robot: FleetRobot, end: MissionEnd) -> str | None:
        """Updates a robot's state at the end of a mission; returns why the robot must stop working, or None."""
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

    def close(self) -> None:
        """Fails the missions that a robot returned and no other robot took; all others stay in the queue."""
        assigned = self._given.all()
        for number in self._auction.waiting if self._stopped is None else ():
            given = assigned.get(number)
            if given is not None and given.robot is not None:
                lost = {name: robot.lost for name, robot in self._robots.items() if robot.lost is not None}
                why = {**lost, **self.missions[number].tried}
                reasons = listing([f"{name}: {each}" for name, each in why.items()])
                self._finish(number, MissionState.FAILURE, f"no robot went on with it ({reasons})")

    @property
    def _now_s(self) -> float:
        return self.backend.clock.now()

    def _dock_entry(self, name: str) -> RunEntry:
        """Begins a robot's charging mission."""
        robot = self._robots[name]
        assert robot.dock is not None
        robot.to_dock = False
        robot.free_at_s = self._now_s + charging_time_s(robot.charge, self.battery.charged)
        robot.journal = None
        self.tell(f"{name} goes to its dock: its battery is at {robot.charge:.0%}")
        self._announce(robot.dock)
        return replace(self._robot_entry(name, robot.dock), tree=robot.dock.tree)

    def _entry(self, name: str, mission: FleetMission) -> RunEntry:
        """Begins a mission of a robot."""
        robot, prepared = self._robots[name], mission.options[name]
        number = mission.stored.id
        done_before = self._given.all()[number].done

        def note(progress: MissionProgress) -> None:
            """Stores the progress of the mission."""
            self._given.progress(number, done_before + progress.done, "it was begun" if progress.begun else None)

        robot.journal = ProgressJournal(prepared.tree, note)
        speaker_W = next(iter(self.robots.values())).start
        entry = self._robot_entry(name, prepared)
        self._announce(prepared)
        return replace(entry, tree=prepared.tree, speaker_W=speaker_W)

    def spare(self) -> Sequence[RunEntry]:
        """Returns the robots at their starts, before any of them has a mission."""
        options = next((mission.options for mission in self.missions.values()), {})
        return [self._robot_entry(name, options[name]) for name in self.robots if name in options]

    def _robot_entry(self, name: str, prepared: Prepared) -> RunEntry:
        """Returns the robot with its faults and estimators, which are built once and serve all its missions."""
        robot = self._robots[name]
        if robot.entry is None:
            disturbed = replace(prepared.request, scenario=Scenario(robot.faults))
            robot.entry = entry_for(replace(prepared, request=disturbed), self.backend, None)
        return robot.entry

    def _announce(self, prepared: Prepared) -> None:
        if self.log is not None:
            world, seed = prepared.world.name, prepared.request.seed
            kinds = {name: robot.kind for name, robot in self.robots.items()}
            tree, clock, known = prepared.tree, self.backend.clock, prepared.knowledge
            announce(self.log, clock, tree.robot_name, tree.commands, known, world=world, seed=seed, robots=kinds)

    def _stuck(self, name: str, *, holding: bool) -> str | None:
        """Returns why no other robot can continue a robot's mission; None if one can."""
        robot, mission = self._robots[name], self.missions[self._auction.under_way[name]]
        progress = robot.progress
        if not progress.begun:
            return None
        commands = mission.options[name].tree.commands[progress.done :]
        if holding:
            held = next((each.object or each.item for each in commands if each.object or each.item), None)
            return f"the {held or 'object'} is in {name}'s gripper"
        return f"{name} had begun it, and it is not known how far it came"

    def _requeue(self, name: str, result: RobotResult) -> int:
        """Queues the unfinished part of a robot's mission; returns the number of the mission."""
        number = self._auction.hand_back(name)
        mission, robot = self.missions[number], self._robots[name]
        done, known = robot.progress.done, robot.last_known
        shares = (Share(mission.options[name].tree, result, done),) if done else ()
        options = {other: rest_of(each, done, known) for other, each in mission.options.items()}
        self.missions[number] = replace(mission, options=options, shares=(*mission.shares, *shares))
        self._given.hand_back(number, known)
        self.store.finish(number, MissionState.QUEUED, "")
        self._log_missions()
        return number

    def _end(self, name: str, result: RobotResult) -> None:
        """Judges and ends a robot's mission."""
        number = self._auction.under_way.pop(name)
        mission = self.missions[number]
        tree, since_s = mission.options[name].tree, mission.since_s or 0.0
        report = self.backend.judge(tree, result, before=mission.shares, since_s=since_s)
        seen = None if report is None else {key: value for key, value in vars(report).items() if key != "events"}
        self._given.judge(number, seen)
        ended = EndedTree(
            tree, node_view(tree.root, result.states), robot_report(result, self.robots[name].kind, report)
        )
        self.over.append(EndedMission(number, ended, since_s, self._now_s))
        self._end_part(number, Share(tree, result, len(tree.parts)), seen)
        tried = {} if result.outcome is Outcome.SUCCESS else mission.tried
        known, reasons = self._robots[name].last_known, (f"{other} before: {why}" for other, why in tried.items())
        lies = known is not None and known.sign is not Sign.SEEN and result.outcome is not Outcome.SUCCESS
        message = "; ".join([result.message, *([str(known)] if lies else []), *reasons])
        self._finish(number, MissionState(result.outcome.value), message)

    def _end_part(self, number: int, share: Share, seen: Mapping[str, Any] | None) -> None:
        """Ends one part of a split mission; the referee judges the whole mission at the end of the last part.

        A robot that has a dock then leaves the table free for the next robot. Does nothing for an unsplit mission.
        """
        given = self._given.all()
        mission, whole = self.missions[number], given[number].part_of
        following = [part for part, each in given.items() if each.follows == number]
        for part in following:
            shares = (*mission.shares, share)
            self.missions[part] = replace(self.missions[part], since_s=mission.since_s, shares=shares)
        name = share.tree.robot_name
        if following and name in self._auction.robots and self._robots[name].dock is not None:
            self._send_to_dock(name)
            self._robots[name].leaves = (number, self._robots[name].pose)
        if whole is not None and not following:
            self._given.judge(whole, seen)

    def _finish(self, number: int, state: MissionState, message: str) -> None:
        """Stores the end of a mission, and releases or drops the missions that wait for it."""
        self.store.finish(number, state, message)
        self.tell(f"Mission {number}: {state.value}: {message}")
        if state is MissionState.SUCCESS:
            if all(robot.leaves is None or robot.leaves[0] != number for robot in self._robots.values()):
                self._auction.done(number)
        else:
            self._auction.drop(number)
        self._given.settle()
        self._log_missions()

    def _log_missions(self) -> None:
        """Writes the assignments of the missions into the log."""
        if self.log is not None:
            self.log(MISSIONS, missions_message(self.store, missions_json(self.store, list(self.missions))))
