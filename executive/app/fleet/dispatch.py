"""Assigns queued missions to the robots of a fleet by an auction; stores each mission's robot and outcome."""

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final

from executive.app.fleet.auction import Auction
from executive.app.fleet.chain import best_split, options_for
from executive.app.fleet.fleet_mission import (
    NOT_GIVEN,
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
from executive.mission.request import TIME_LIMIT_S, Request
from executive.mission.scenario import Scenario
from executive.record.announce import announce
from executive.record.event_log import EventLog
from executive.run.outcome import Outcome, RobotResult, RobotStatus
from executive.run.visitor import Assigner, MissionEnd, Progress, RunEntry
from executive.store.missions import GivenMissions, MissionState, MissionStore
from executive.tree.board import Sign
from executive.tree.node_view import node_view
from executive.words.knowledge import BatteryFacts
from executive.words.schemas import MISSIONS
from skills.inputs.errors import InputError, listing

LEFT_M: Final = 1.5
"""Distance from a hand-over table beyond which a robot leaves space for the next one."""
_NEXT_RUN: Final = "`errand queue add` queues it for the next run"


def silence(line: str) -> None:
    """Discards a line instead of showing it."""


def limit_of(options: Mapping[str, Prepared]) -> float:
    """Returns the time limit (s) of a mission by itself, for the robot that may take longest."""
    return max((each.time_limit_s for each in options.values()), default=TIME_LIMIT_S)


@dataclass
class Dispatch(Assigner):
    """Dispatcher of a fleet: assigns the missions in a store to the robots of a backend.

    A robot whose battery is low returns its mission once its gripper is empty, and charges by its mission `dock`.
    `prepare` returns a request for each robot that may do it, and the shortest duration (s) of these; each added
    mission extends the time limit by its own if it is `extended`. `tell` shows a line; `offers` builds the bids of the
    robots; `ended` is called whenever a mission has ended, with the `total` of them. The queued missions `left_out` are
    only listed.
    """

    store: MissionStore
    missions: dict[int, FleetMission]
    robots: Mapping[str, FleetRobot]
    backend: Backend
    prepare: Callable[[Request], tuple[Mapping[str, Prepared], float]]
    battery: BatteryFacts = field(default_factory=BatteryFacts)
    tell: Callable[[str], None] = silence
    log: EventLog | None = None
    left_out: Sequence[int] = ()
    extended: bool = False
    ended: Callable[..., None] = lambda **_: None
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
        self._offers = self.offers(self.robots, self.battery, self.backend.clock.now, self._auction)
        self._stopped = self._over = False
        self._left_s = math.inf
        self._adding, self._added = threading.Lock(), deque[FleetMission]()

    def add(self, request: Request) -> str:
        """Queues a checked request during the run, and returns the answer to show. Any thread may call it.

        Raises InputError if no robot may do the mission, the time limit would end it, or the run is ending.
        """
        options, duration_s = self.prepare(request)
        if duration_s > self._left_s + (limit_of(options) if self.extended else 0.0):
            what = f"the time limit ends the run in {self._left_s:.0f} s, and it takes about {duration_s:.0f} s"
            raise InputError(what, hint=_NEXT_RUN)
        with self._adding, MissionStore(self.store.path) as store:
            if self._over or self._stopped:
                raise InputError("the fleet has ended its last mission", hint=_NEXT_RUN)
            mission = FleetMission(store.add(request, queued=True), options)
            self._added.append(mission)
        return f"Mission {mission.number} is queued: {request.name}"

    def _take_added(self) -> None:
        """Takes the added missions into the auction."""
        while self._added:
            mission = self._added.popleft()
            self.missions[mission.number] = mission
            self._auction.add(mission.number)
            self.more_s += limit_of(mission.options) if self.extended else 0.0
            self._log_missions()

    def stop(self, reason: str) -> None:
        """Ends the run; missions under way stay in the queue. Signal handlers may call it."""
        self._stopped = True

    def assign(self) -> Sequence[RunEntry]:
        """Takes the added missions and runs a round of the auction; returns the missions that begin now."""
        with self._adding:
            self._take_added()
            entries = self._round()
            self._over = not (entries or self._auction.under_way or self._auction.waiting)
        return entries

    def _round(self) -> Sequence[RunEntry]:
        entries: list[RunEntry] = []
        self._release_following({})
        given = self._auction.assign(lambda number, name: self._offers.known(self.missions[number], name))
        refused = {number: why for number, why in given.refused.items() if not self._split(number)}
        for number, why in refused.items():
            self._finish(number, MissionState.FAILURE, why)
        for award in given.begun:
            robot, mission = self.robots[award.robot], self.missions[award.mission]
            robot.mission, robot.free_at_s = mission, self._now_s + award.ends_s
            mission.since_s = min(mission.since_s, self._now_s)
            self._given.give(mission.number, robot.name)
            self.store.begin(mission.number)
            self.tell(f"{robot.name} has mission {mission.number}: {mission.stored.request.name}")
            entries.append(self._entry(robot, mission))
        if given.begun:
            self._log_missions()
        for name in given.charging:
            self.robots[name].to_dock = True
        if self._auction.waiting or self._auction.under_way:
            entries += [self._dock_entry(robot) for robot in self.robots.values() if robot.to_dock]
        return entries if len(refused) == len(given.refused) else [*entries, *self._round()]

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
        for name, robot in self.robots.items():
            robot.recalled = self._why_recalled(robot, seen.get(name))
        return {name: robot.recalled for name, robot in self.robots.items() if robot.recalled is not None}

    def _why_recalled(self, robot: FleetRobot, seen: RobotStatus | None) -> str | None:
        """Returns why a robot must stop; None if it need not."""
        if robot.name in self._auction.resting:
            return None if self._auction.under_way or self._auction.waiting else "nothing is left to do"
        if robot.mission is None or robot.dock is None or seen is None or seen.charge is None:
            return None
        low = seen.charge < self.battery.low and not seen.holding and not robot.progress.begun
        return f"its battery is at {seen.charge:.0%}" if low else None

    def _release_following(self, seen: Mapping[str, RobotStatus]) -> None:
        """Lets a second part begin once the robot of the first has left the table or is no longer sent to its dock."""
        for name, robot in self.robots.items():
            if robot.leaves is None:
                continue
            pose, from_W = seen[name].pose if name in seen else None, robot.pose
            away_m = 0.0 if pose is None else math.hypot(pose.x_m - from_W.x_m, pose.y_m - from_W.y_m)
            if name not in self._auction.resting or away_m > LEFT_M:
                part, robot.leaves = robot.leaves, None
                self._auction.done(part)

    def tick(self, progress: Progress) -> None:
        """Updates the progress of each robot's mission with the changes of its tree."""
        self._left_s = progress.left_s
        for name, note in progress.notes.items():
            journal = self.robots[name].journal
            if journal is not None:
                journal.note(note)

    def mission_ended(self, end: MissionEnd) -> None:
        """Ends a robot's mission, or hands its rest to another robot."""
        result, robot = end.result, self.robots[end.result.robot_name]
        mission = robot.mission
        recalled, robot.recalled = robot.recalled is not None, None
        robot.lost = self._update_robot(robot, end)
        if robot.lost is not None:
            self._auction.lose(robot.name)
            self.tell(f"{robot.name} is given no more work: {robot.lost}")
        if mission is None:
            self._auction.resting.discard(robot.name)
            if result.outcome is not Outcome.SUCCESS and not recalled:
                robot.dock = None  # it could not charge, and is not sent there again
            self.tell(f"{robot.name} is at {robot.charge:.0%}: {result.message}")
            return
        why = self._stuck(robot, mission, holding=end.seen is not None and end.seen.holding)
        if result.outcome is Outcome.SUCCESS:
            self._end(robot, mission, result)
        elif self._stopped and result.outcome is Outcome.CANCELLED:
            if why is None:
                self._requeue(robot, mission, result)
                self.tell(f"Mission {mission.number} stays in the queue: {result.message}")
            else:
                self._end(robot, mission, replace(result, message=f"{result.message}; {why}"))
        elif robot.lost is None and not recalled:
            if not self._try_another(robot, mission, end):
                self._end(robot, mission, result)
        elif why is not None or not self._auction.robots:
            reason = f"{robot.name} failed ({robot.lost}); {why or 'there is no other robot'}"
            self._end(robot, mission, replace(result, message=reason))
        else:
            self._hand_on(robot, mission, result)
            if robot.lost is None:
                self._send_to_dock(robot)

    def _try_another(self, robot: FleetRobot, mission: FleetMission, end: MissionEnd) -> bool:
        """Offers a failed mission to the other robots, once; returns whether one of them can do it.

        The robot's gripper must be empty, and it must not have released an object.
        """
        let_go = robot.progress.put or (robot.last_known is not None and robot.last_known.sign is Sign.RELEASED)
        clear = end.seen is not None and not end.seen.holding and not let_go
        again = replace(mission, tried={robot.name: f"it tried: {end.result.message}"})
        others = (other for other in self._auction.robots if other != robot.name)
        if (
            end.result.outcome is not Outcome.FAILURE
            or mission.tried
            or not (clear and is_plain(mission.options[robot.name].tree))
            or all(self._offers.new(again, other).problems for other in others)
        ):
            return False
        mission.tried = again.tried
        self._hand_on(robot, mission, end.result)
        return True

    def _hand_on(self, robot: FleetRobot, mission: FleetMission, result: RobotResult) -> None:
        """Queues the rest of a robot's mission for another robot."""
        self._requeue(robot, mission, result)
        self.tell(f"Mission {mission.number} waits for another robot: {result.message}")

    def _send_to_dock(self, robot: FleetRobot) -> None:
        """Sends a robot to its dock at the next round."""
        self._auction.resting.add(robot.name)
        robot.to_dock = True

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
        prepared = robot.dock if robot.mission is None else robot.mission.options[robot.name]
        lost = prepared is not None and is_lost(
            prepared.tree, lambda path: states[path].status if path in states else None
        )
        return "it does not know where it is" if lost or end.seen.pose is None else None

    def close(self) -> None:
        """Fails the missions that a robot returned and no other robot took; all others stay in the queue."""
        with self._adding:
            self._over = True
            self._take_added()
        assigned = self._given.all()
        lost = {robot.name: robot.lost for robot in self.robots.values() if robot.lost is not None}
        for number in () if self._stopped else self._auction.waiting:
            given = assigned.get(number)
            if given is not None and given.robot is not None:
                why = {**lost, **self.missions[number].tried}
                reasons = listing([f"{name}: {each}" for name, each in why.items()])
                self._finish(number, MissionState.FAILURE, f"no robot went on with it ({reasons})")

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The missions of the run with robots and outcomes, as JSON values."""
        return missions_json(self.store, [*self.missions, *self.left_out])

    @property
    def _now_s(self) -> float:
        return self.backend.clock.now()

    def _dock_entry(self, robot: FleetRobot) -> RunEntry:
        """Begins a robot's charging mission."""
        assert robot.dock is not None
        robot.free_at_s = self._now_s + charging_time_s(robot.charge, self.battery.charged)
        robot.journal, robot.to_dock = None, False
        self.tell(f"{robot.name} goes to its dock: its battery is at {robot.charge:.0%}")
        self._announce(robot.dock)
        return replace(self._robot_entry(robot, robot.dock), tree=robot.dock.tree)

    def _entry(self, robot: FleetRobot, mission: FleetMission) -> RunEntry:
        """Begins a mission of a robot."""
        prepared, number = mission.options[robot.name], mission.number
        done_before = self._given.all()[number].done

        def note(progress: MissionProgress) -> None:
            """Stores the progress of the mission."""
            self._given.progress(number, done_before + progress.done, "it was begun" if progress.begun else None)

        robot.journal = ProgressJournal(prepared.tree, note)
        speaker_W = next(iter(self.robots.values())).placed.start
        entry = self._robot_entry(robot, prepared)
        self._announce(prepared)
        return replace(entry, tree=prepared.tree, speaker_W=speaker_W)

    def spare(self) -> Sequence[RunEntry]:
        """Returns the robots at their starts, before any of them has a mission."""
        options = next((mission.options for mission in self.missions.values()), {})
        return [self._robot_entry(robot, options[name]) for name, robot in self.robots.items() if name in options]

    def _robot_entry(self, robot: FleetRobot, prepared: Prepared) -> RunEntry:
        """Returns the robot with its faults and estimators, which are built once for all its missions."""
        if robot.entry is None:
            disturbed = replace(prepared.request, scenario=Scenario(robot.faults))
            robot.entry = entry_for(replace(prepared, request=disturbed), self.backend, None)
        return robot.entry

    def _announce(self, prepared: Prepared) -> None:
        if self.log is not None:
            world, seed = prepared.world.name, prepared.request.seed
            kinds = {name: robot.placed.kind for name, robot in self.robots.items()}
            tree, clock, known = prepared.tree, self.backend.clock, prepared.knowledge
            announce(self.log, clock, tree.robot_name, tree.commands, known, world=world, seed=seed, robots=kinds)

    def _stuck(self, robot: FleetRobot, mission: FleetMission, *, holding: bool) -> str | None:
        """Returns why no other robot can continue a robot's mission; None if one can."""
        progress, name = robot.progress, robot.name
        if not progress.begun:
            return None
        commands = mission.options[name].tree.commands[progress.done :]
        if holding:
            held = next((each.object or each.item for each in commands if each.object or each.item), None)
            return f"the {held or 'object'} is in {name}'s gripper"
        return f"{name} had begun it, and it is not known how far it came"

    def _requeue(self, robot: FleetRobot, mission: FleetMission, result: RobotResult) -> None:
        """Queues the rest of a robot's mission."""
        robot.mission = None
        self._auction.hand_back(robot.name)
        done, known = robot.progress.done, robot.last_known
        if done:
            mission.shares = (*mission.shares, Share(mission.options[robot.name].tree, result, done))
        mission.options = {other: rest_of(each, done, known) for other, each in mission.options.items()}
        self._given.hand_back(mission.number, known)
        self.store.finish(mission.number, MissionState.QUEUED, "")
        self._log_missions()

    def _end(self, robot: FleetRobot, mission: FleetMission, result: RobotResult) -> None:
        """Judges and ends a robot's mission."""
        robot.mission = None
        number = self._auction.under_way.pop(robot.name)
        tree = mission.options[robot.name].tree
        report = self.backend.judge(tree, result, before=mission.shares, since_s=mission.since_s)
        seen = None if report is None else {key: value for key, value in vars(report).items() if key != "events"}
        self._given.judge(number, seen)
        own_report = robot_report(result, robot.placed.kind, report)
        mission.ended, mission.until_s = EndedTree(tree, node_view(tree.root, result.states), own_report), self._now_s
        self._end_part(robot, mission, Share(tree, result, len(tree.parts)), seen)
        tried = {} if result.outcome is Outcome.SUCCESS else mission.tried
        known, reasons = robot.last_known, (f"{other} before: {why}" for other, why in tried.items())
        lies = known is not None and known.sign is not Sign.SEEN and result.outcome is not Outcome.SUCCESS
        message = "; ".join([result.message, *([str(known)] if lies else []), *reasons])
        self._finish(number, MissionState(result.outcome.value), message)

    def _end_part(self, robot: FleetRobot, mission: FleetMission, share: Share, seen: Mapping[str, Any] | None) -> None:
        """Ends a part of a mission: the robot leaves the table to the next one; the last part judges the whole.

        A robot that has a dock then leaves the table free for the next robot. Does nothing for an unsplit mission.
        """
        given = self._given.all()
        whole = given[mission.number].part_of
        following = [self.missions[part] for part, each in given.items() if each.follows == mission.number]
        for part in following:
            part.since_s, part.shares = mission.since_s, (*mission.shares, share)
        if following and robot.lost is None and robot.dock is not None:
            self._send_to_dock(robot)
            robot.leaves = mission.number
        if whole is not None and not following:
            self._given.judge(whole, seen)

    def _finish(self, number: int, state: MissionState, message: str) -> None:
        """Stores the end of a mission, and releases or drops the missions that wait for it."""
        self.store.finish(number, state, message)
        self.tell(f"Mission {number}: {state.value}: {message}")
        if state is MissionState.SUCCESS:
            if all(robot.leaves != number for robot in self.robots.values()):
                self._auction.done(number)
        else:
            self._auction.drop(number)
        self._given.settle()
        self._log_missions()
        given = self._given.all()
        whole = given.get(number, NOT_GIVEN).part_of or number
        if self.store.mission(whole).state is not MissionState.RUNNING:
            self.ended(total=sum(given.get(each, NOT_GIVEN).part_of is None for each in self.missions))

    def _log_missions(self) -> None:
        """Writes the assignments of the missions into the log."""
        if self.log is not None:
            self.log(MISSIONS, missions_message(self.store, self.rows))
