"""Random missions over all constructs and nestings, run with scripted skills to an end: what must always hold.

    python -m tests.benchmarks.random_missions --trees 20000 --seed 1 [--limit 480] [--kill]
    python -m tests.benchmarks.random_missions --trees 5000 --claims

Failures, presses of buttons, answers, pauses, cancels and other missions in between come at random; one seed gives the
same mission and the same run. Prints how many missions ran within the limit (s), how they ended, and what was found
wrong, each with its seed. With `--kill` each is killed in some tick and taken up again.

With `--claims` the skills act on a small world, and in every other mission some lie. The referee judges by that world's
history: its verdict must be that of somebody who looked on, and without a lie it must be the tree's claim.
"""

import contextlib
import random
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from executive.app.runs.goal_conditions import verdict_of
from executive.mission.request import Request
from executive.run.control import Control
from executive.run.outcome import Outcome
from executive.run.runner import run
from executive.run.visitor import RunEntry, RunSettings, RunVisitor
from executive.run.worker import LockStepWorker
from executive.store.missions import MissionStore
from executive.store.resuming import resumed_tree
from executive.tree.compiler import compile_mission
from executive.words.command import parse_command
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Look, Not, ValueIs
from executive.words.leaf_steps import Awaited, CallSkill, Charging, Check, Do, Dock, Say, Set, Speak, UseMission, Wait
from executive.words.mission import Mission
from executive.words.step import Guards, OnFailure, OperatorQuestion, Policy
from executive.words.steps import Ask, Choose, Group, Handler, Loop, Repeat, Together, Try, While
from skills.api import WHOLE_ROBOT, Cause, Failed, ObjectKind, ObjectObservation, Part, Running, Skill, Succeeded
from skills.inputs.errors import InputError
from skills.small.doors import CheckDoorInputs
from tests.benchmarks.harness import command
from tests.benchmarks.scripted_world import WORLD, Clock, ScriptedWorld, expected
from tests.executive.conftest import GRIPPER, PORTS, EmptyCostmap, Script, StandingRobot, StillLocaliser, VirtualClock
from tests.executive.conftest import default_end as usual_end
from tests.visitors import OnMessage

LYING, ACCIDENTS = 0.05, 0.01
TICK_S, LIMIT_S, ENDINGS_S = 0.5, 120.0, 30.0
MOST_TICKS = 3000
GRASP, FIND = ("Take [Nothing] to [{}] and do [" + task + "] to [{}]" for task in ("grasp", "find"))
BRING = "Take [{}] to [{}] and do [Nothing] to [Nothing]"
COMMANDS = (
    *(BRING.format("Nothing", place) for place in ("kitchen", "hall", "start", "Sam")),
    GRASP.format("kitchen", "drink"),
    *(BRING.format("drink", place) for place in ("bedroom", "Robin")),
    FIND.format("kitchen", "coke"),
    "Take [Nothing] to [Nothing] and do [wait] to [3 second]",
    "Take [Nothing] to [Nothing] and do [charge] to [Nothing]",
)
PAIRS = tuple(
    (GRASP.format(source, thing), BRING.format(thing, goal))
    for source, thing, goal in (
        ("kitchen", "drink", "bedroom"),
        ("counter", "coke", "shelf"),
        ("shelf", "coke", "counter"),
        ("kitchen", "beer", "Robin"),
        ("bedroom", "coke", "start"),
        ("kitchen", "2 drink", "bedroom"),
    )
)
LOOKS = (FIND.format("kitchen", "beer"), FIND.format("hall", "person"), FIND.format("bedroom", "coke"))
NUMBERS = ("n", "n + 1", "n * 2 - 3", "min(n, 4)", "7 // (n + 1)", "battery * 10", "1 / n", "elapsed", "length(word)")
TRUTHS = (
    "n > 2", "n == 0 or flag", "not flag", "word == 'tea'", "battery < 0.3", "localised", "holding", "elapsed < 20",
    "clock < '08:01'", "1 / n > 0", "flag",
)  # fmt: skip
TEXTS = ("'tea'", "word", "word + '!' if length(word) < 9 else 'tea'", "lower('NO')")
BUTTONS = ("go", "stop")
SKILLS = ("stow", "clear_costmap", "relocalise", "back_off")
CAUSES = (Cause.PRECONDITION, Cause.PLANNING, Cause.EXECUTION, Cause.POSTCONDITION, Cause.TIMEOUT)
INJECTED = "injected"
REQUEST = Request("at random", seed=3, name="random", world_name="flat", robot="Alice", fingerprint="print")


class MissionMaker:
    """Maker of a random mission of about so many steps; those that are `still` use no part of the robot."""

    def __init__(self, rng, steps):
        self.rng, self.left = rng, steps

    def mission(self):
        rng = self.rng
        watched = self.watched(2) if rng.random() < 0.4 else {}
        steps = self.steps(0)
        policy = self.policy(whole=True) if rng.random() < 0.2 else Policy()
        values = {"n": rng.choice([0, 1, 2.5]), "word": "tea", "flag": False}
        return Mission(name="random", robot="Alice", steps=steps, variables=values, **watched).with_policy(policy)

    def steps(self, depth, still=False):
        many = self.rng.choice([1, 1, 2, 2, 3]) if depth else max(1, min(self.left, self.rng.randint(1, 8)))
        return tuple(self.step(depth, still) for _ in range(many))

    def step(self, depth, still=False):
        rng = self.rng
        self.left -= 1
        policy = self.policy(still=still) if rng.random() < 0.35 else Policy()
        if self.left > 0 and depth < 6 and rng.random() < 0.6:
            made = rng.choice([self.choose, self.repeat, self.try_, self.together, self.group, self.asking, self.used])
            return made(depth + 1, still).with_policy(policy)
        return self.small(still).with_policy(policy)

    def small(self, still):
        rng = self.rng
        kind = rng.randrange(10) if not still else rng.randrange(4)
        if kind > 7:
            return Say(say="get it and bring it").with_commands(tuple(map(parse_command, rng.choice(PAIRS))))
        if kind == 0:
            choice = {"n": NUMBERS, "word": TEXTS, "flag": TRUTHS}
            names = rng.sample(sorted(choice), rng.choice([1, 1, 2]))
            return Set(set={name: rng.choice(choice[name]) for name in names})
        if kind == 1:
            return rng.choice([Wait(awaited=Awaited(seconds=rng.choice([0.5, 3.0]))), self.wait(still)])
        if kind == 2:
            gives = rng.choice([None, {"answer": "flag"}])
            return Check(condition=self.condition(instant=still), gives=gives)
        if kind == 3:
            return self.question({})
        if kind == 4:
            return Speak(speak=rng.choice(["hello", "I have {n} {word}", "{1 / n}"]))
        if kind == 5:
            return Dock(charging=Charging(level=rng.choice([None, 0.5])))
        if kind == 6:
            return CallSkill(skill=rng.choice(SKILLS))
        return Do.from_command(parse_command(rng.choice(COMMANDS)))

    def wait(self, still):
        """A wait for what may never come: a time limit stands around some."""
        if self.rng.random() < 0.2:
            return Wait(awaited=Awaited(until_clock=self.rng.choice(["08:00", "08:01"])))
        return Wait(awaited=Awaited(condition=self.condition(instant=still), every_s=self.rng.choice([1.0, 15.0])))

    def condition(self, *, instant, depth=0):
        """A condition; an `instant` one takes no look."""
        rng = self.rng
        kind, deeper = rng.randrange(8), partial(self.condition, instant=instant, depth=depth + 1)
        if kind < 2 and depth < 3:
            return (AllOf, AnyOf)[kind](parts=tuple(deeper() for _ in range(rng.randint(1, 3))))
        if kind == 2 and depth < 3:
            return Not(part=deeper())
        if kind == 3:
            return ButtonPressed(button=rng.choice(BUTTONS))
        if kind == 4 and not instant:
            return Look.from_command(parse_command(rng.choice(LOOKS)))
        if kind == 5 and not instant:
            return DoorOpen(door=("hall", "kitchen"))
        return ValueIs(text=rng.choice(TRUTHS))

    def choose(self, depth, still):
        otherwise = self.steps(depth, still) if self.rng.random() < 0.6 else ()
        return Choose(condition=self.condition(instant=still), then=self.steps(depth, still), otherwise=otherwise)

    def repeat(self, depth, still):
        """A loop, always with a number of rounds at most."""
        kind = self.rng.randrange(3)
        until = self.condition(instant=still) if kind == 0 else None
        while_ = self.condition(instant=still) if kind == 1 else None
        every_s = self.rng.choice([None, None, 2.0])
        loop = Loop(times=self.rng.randint(1, 3), until=until, while_=while_, every_s=every_s)
        return Repeat(loop=loop, steps=self.steps(depth, still))

    def try_(self, depth, still):
        return Try(steps=self.steps(depth, still), otherwise=self.steps(depth, still))

    def together(self, depth, still):
        """One step that may move, and some that use no part of the robot."""
        steps = [self.step(depth, still), *(self.step(depth, True) for _ in range(self.rng.randint(1, 2)))]
        self.rng.shuffle(steps)
        return Together(steps=tuple(steps), done_when=self.rng.choice([None, 1, 2]))

    def group(self, depth, still):
        steps = self.steps(depth, still)
        return Group(steps=steps, name=self.rng.choice([None, "a group"]), **self.watched(depth, still))

    def watched(self, depth, still=False):
        """Some of what a group or a mission can have around its steps."""
        rng = self.rng
        always = self.steps(depth + 2, still) if rng.random() < 0.6 else ()
        holds = While(holds=self.condition(instant=True)) if rng.random() < 0.2 else None
        when = []
        for _ in range(rng.choice([0, 0, 1, 2])):
            condition, steps = self.condition(instant=True), self.steps(depth + 2, still)
            when.append(Handler(condition=condition, steps=steps, times=rng.randint(1, 3)))
        return {"always": always, "while_": holds, "when": tuple(when) or None}

    def asking(self, depth, still):
        texts = ("tea", "the coffee", "no!")
        return self.question({text: self.steps(depth, still) if self.rng.random() < 0.7 else () for text in texts})

    def question(self, choices):
        """A question, with choices or without."""
        rng = self.rng
        asked = {"ask": rng.choice(["which?", "{n} {word}?", "{1 / n}?"]), "limit_s": rng.choice([2.0, 20.0])}
        if choices:
            default, gives = rng.choice([None, "tea"]), rng.choice([None, {"answer": "word"}])
            return Ask(**asked, choices=choices, default=default, gives=gives)
        kinds = [("number", 3, "n"), ("text", "milk", "word"), ("place", "kitchen", "word"), ("number", None, None)]
        match, usual, gives = rng.choice(kinds)
        answer = {"answer": gives} if gives else None
        return Ask(**asked, match=match, default=rng.choice([None, usual]), gives=answer)

    def used(self, depth, still):
        steps = self.steps(depth, still)
        watched = self.watched(depth, still) if self.rng.random() < 0.4 else {}
        values = {"n": 1, "word": "tea", "flag": True}
        used = Mission(name="used", robot="Alice", steps=steps, variables=values, **watched)
        return UseMission(use="used.yaml").with_mission(used)

    def policy(self, *, whole=False, still=False):
        """A policy; that of a whole mission skips nothing."""
        rng = self.rng
        ways = [OnFailure.STOP, OnFailure.STOP, OnFailure.RETRY, OnFailure.RETURN, OnFailure.ASK, OnFailure.SKIP]
        battery, localised = rng.choice([None, None, None, 0.2]), rng.random() < 0.1
        guards = Guards(battery=battery, localised=localised, time_s=rng.choice([None, None, None, 60.0]))
        on_failure = rng.choice(ways[:5] if whole else [*ways[:3], *ways[4:]] if still else ways)
        question = OperatorQuestion(limit_s=rng.choice([2.0, 10.0]), default="stop" if whole else "skip")
        return Policy(
            timeout_s=rng.choice([None, 1.0, 4.0, 20.0]),
            retries=rng.choice([0, 0, 1, 2]),
            on_failure=on_failure,
            question=question if on_failure is OnFailure.ASK else None,
            guards=guards,
        )


@dataclass
class Robotics:
    rng: random.Random
    robot: StandingRobot
    failing: float
    world: ScriptedWorld | None = None
    active: list[Any] = field(default_factory=list)
    raised: int = 0

    def registry(self):
        ports = {**PORTS, "check_door": (CheckDoorInputs, {"open": bool})}
        return {name: self._skill(name, *both) for name, both in ports.items()}

    def _skill(self, skill_name, inputs, outputs_):
        mine = self

        class Scripted(Skill[Any]):
            name = skill_name
            Inputs = inputs
            outputs = outputs_
            gripper_before, gripper_after = GRIPPER.get(skill_name, (None, None))
            uses = {"speak": frozenset({Part.VOICE})}.get(skill_name, WHOLE_ROBOT)
            default_timeout_s = 30.0

            def begin(self, inputs):
                self.inputs, self.left = inputs, mine.rng.choice([1, 2, 3] if mine.world is None else [2, 3])
                mine.active.append(self)

            def step(self):
                robot, lease = self.context.robot, self.context.lease
                robot.drive(0.1, 0.0, 0.0, until_s=self.context.clock.now() + 1.0, lease=lease)
                self.left -= 1
                return Running(f"{skill_name} goes on") if self.left > 0 else mine.end_of(self, skill_name)

            def end(self):
                if self in mine.active:
                    mine.active.remove(self)
                    self.context.robot.stop(lease=self.context.lease)

        return Scripted

    def end_of(self, skill, name):
        if self.rng.random() < self.failing:
            if self.rng.random() < 0.05:
                self.raised += 1
                raise RuntimeError(INJECTED)
            looks = self.world is not None and name in ("detect", "find_people")  # "not seen" would be an answer
            causes = [each for each in CAUSES if not looks or each is not Cause.POSTCONDITION]
            return Failed(self.rng.choice(causes), f"{name} does not work")
        if self.world is not None and (done := self._in_world(skill, name, self.world)) is not None:
            return done
        if name == "check_door":
            return Succeeded("seen", {"open": self.rng.random() < 0.5})
        if name == "find_people":
            seen = ObjectObservation(0.0, ObjectKind("person"), (0.5, 4.5, 0.9), (0.5, 0.5, 1.7), 0.0, 0.9)
            some = Succeeded("seen", {"observation": seen, "observations": (seen,), "unexplained": ()})
            return some if self.rng.random() < 0.5 else Failed(Cause.POSTCONDITION, "nobody is there")
        if name == "meet_person":
            at, size = (*skill.inputs.place_W, 0.9), (0.5, 0.5, 1.7)
            return Succeeded("met", {"person": ObjectObservation(0.0, ObjectKind("person"), at, size, 0.0, 0.9)})
        if name in ("place", "hand_over"):
            self.robot.holding = False
        return usual_end(Script(steps=2), name)(skill)

    def _in_world(self, skill, name, world):
        """End of an attempt that acts on the world; None where a skill does not."""
        now_s, inputs = self.robot.clock.now(), skill.inputs
        if name == "speak" and world.says(now_s, inputs.text):
            skill.context.publish("speech", {"robot": self.robot.name, "text": inputs.text, "t": now_s})
        act = getattr(world, name, None)
        done = None if act is None else act(now_s, inputs)
        if isinstance(done, Succeeded) and name in GRIPPER:
            self.robot.holding = name == "grasp"
        return done


class Operator(RunVisitor):
    """Does things at random while a mission runs; every pause ends, and every button is released.

    A `calm` one leaves what is in the gripper alone.
    """

    def __init__(self, rng, control, robot, other, *, calm=False):
        self.calm = calm
        self.rng, self.control, self.robot, self.other = rng, control, robot, other
        cancels = [None, None, None, rng.randint(0, 10), rng.randint(0, 80)]
        self.cancel_at = None if calm and rng.random() < 0.9 else rng.choice(cancels)
        self.insist_after = rng.choice([None, None, rng.randint(0, 6)])
        self.busy = rng.choice([0.0, 0.02, 0.1])
        self.cancelled = self.insisted = self.preempted = False
        self.asked = []
        asking = control.ask

        def ask(question, clock, robot):
            self.asked.append(asking(question, clock, robot))
            return self.asked[-1]

        control.ask = ask

    def tick(self, progress):
        rng, control, ticks = self.rng, self.control, progress.ticks
        if ticks > MOST_TICKS:
            raise RuntimeError("the run does not end")
        if self.cancel_at is not None and ticks >= self.cancel_at:
            if not self.cancelled:
                self.cancelled = True
                control.cancel("enough")
            elif self.insist_after is not None and ticks > self.cancel_at + self.insist_after:
                self.insisted = True
                control.cancel("at once")
        for question in control.state.questions:
            if rng.random() < 0.3:
                said = question.options or ("3", "kitchen", "what?", "nan")
                control.answer(question.id, rng.choice(said))
        if rng.random() < self.busy:
            self._interfere()
        elif rng.random() < 0.3:
            control.resume()
            control.release_stop_button()

    def _interfere(self):
        rng, control, robot = self.rng, self.control, self.robot
        what = rng.randrange(8)
        if what < 3:
            with contextlib.suppress(ValueError):  # no node decides by it
                control.press(rng.choice(BUTTONS))
        elif what == 3:
            control.pause()
        elif what == 4:
            control.stop_button()
        elif what == 5:
            robot.charge = rng.choice([0.05, 0.5, 0.9])
        elif what == 6 and not self.calm:
            robot.holding = not robot.holding
        elif what == 7 and not self.preempted and self.control.state.mode.value != "ended":
            self.preempted = True
            control.preempt(self.other)


def made_mission(seed):
    rng = random.Random(f"mission {seed}")
    return MissionMaker(rng, int(60 ** rng.random())).mission()


class Trial:
    """The mission of a seed, a robot with scripted skills, and another mission that may come in between.

    Raises InputError if the mission cannot be compiled.
    """

    def __init__(self, seed, clock, world=None):
        self.seed, self.clock, self.robot = seed, clock, StandingRobot(clock)
        rng = random.Random(f"run {seed}")
        failing = rng.choice([0.0, 0.1, 0.4] if world is None else [0.0, 0.02, 0.1])
        self.robotics = Robotics(rng, self.robot, failing, world)
        registry = self.robotics.registry()
        self.tree = compile_mission(made_mission(seed), knowledge=WORLD, registry=registry)
        between = Mission(name="between", robot="Alice", steps=(CallSkill(skill="stow"),))
        self.other = compile_mission(between, knowledge=WORLD, registry=registry)

    def run(self, *visitors):
        control = Control(pace=None)
        operator = Operator(self.robotics.rng, control, self.robot, self.other, calm=self.robotics.world is not None)
        log = []
        logging = OnMessage(lambda topic, message: log.append((topic, repr(message))))
        with LockStepWorker(self.clock) as worker:
            result = run(
                [RunEntry(self.tree, self.robot, StillLocaliser(), EmptyCostmap())],
                clock=self.clock,
                worker=worker,
                visitors=[logging, *visitors, operator],
                settings=RunSettings(
                    seed=self.seed,
                    tick_period_s=TICK_S,
                    verb_limit_s=60.0,
                    time_limit_s=LIMIT_S,
                    endings_limit_s=ENDINGS_S,
                    time_of_day_s=8 * 3600.0,
                ),
                control=control,
            )
        told = tuple(entry for entry in log if entry[0] != "wall")
        wrong = (*self._wrong(result, told, operator), *self._not_done(result.worst.message, told, operator))
        return SimpleNamespace(result=result, log=told, wrong=wrong, nodes=len(self.tree.path_ids))

    def _wrong(self, result, log, operator):
        robot, worst, active = self.robot, result.worst, self.robotics.active
        errors = [message for topic, message in log if topic == "errors" and INJECTED not in message]
        running = [path for path, state in worst.states.items() if state.status.value == "RUNNING"]
        defect = "divides by zero" in worst.message  # in what is watched, that is a defect of the mission
        found = {
            f"an exception: {errors[:1]}": errors,
            f"ended as {worst.outcome}: {worst.message}": (
                worst.outcome is Outcome.ERROR and not self.robotics.raised and not defect
            ),
            "a lease is held": robot.lease is not None,
            "the robot drives": robot.driving,
            f"skills are left: {[skill.name for skill in active]}": active,
            f"nodes still run: {running[:3]}": running,
            "a question is open": any(asked.answer is None for asked in operator.asked),
            "no cause": worst.outcome is not Outcome.SUCCESS and worst.cause is None,
            "no sentence": not worst.message,
        }
        return [what for what, so in found.items() if so]

    def _not_done(self, message, log, operator):
        """What is always to be done in the end, and was not begun although its steps were."""
        if operator.insisted or "in the end, broken off" in message:
            return
        moves = [
            (text.split("'node': '", 1)[1].split("'", 1)[0], text) for topic, text in log if topic == "transitions"
        ]
        began = {path for path, text in moves if "'to': 'INVALID'" not in text}
        # one that came to its end and was reset in the same tick leaves no sentence
        reset = {path for path, text in dict(moves).items() if "'message': ''" in text}
        for node in self.tree.root.walk():
            if node.kind == "always":
                first, last = (child.path_id for child in node.children)
                if first in began and last not in began and node.path_id not in reset:
                    yield f"not done in the end: {node.path_id}"


def ran(seed):
    """Makes the mission of a seed and runs it to its end. Raises InputError if it cannot be compiled."""
    return Trial(seed, VirtualClock()).run()


class KilledError(BaseException):
    stops_run = True


@dataclass
class KillingJournal(RunVisitor):
    journal: Any
    left: int

    def tick(self, progress):
        self.journal.tick(progress)
        self.left -= 1
        if self.left <= 0:
            raise KilledError


def resumed(seed, folder):
    """The same, killed in some tick and taken up again; None when it ended before. Raises InputError as `ran`."""
    trial = Trial(seed, VirtualClock())
    kill_after = int(80 ** trial.robotics.rng.random())
    with MissionStore(folder / f"{seed}.sqlite") as store:
        mission = store.add(REQUEST, queued=False)
        store.begin(mission.id)
        try:
            trial.run(KillingJournal(store.journal(mission.id), kill_after))
        except KilledError:
            trial.tree, recollection = resumed_tree(trial.tree, store.memory(mission.id))
        else:
            return None
        journal = store.journal(mission.id)
        journal.use_recollection(recollection)
        store.begin(mission.id)
        trial.robotics.active.clear()
        trial.robot.holder = None
        return trial.run(journal)


def claimed(seed):
    """Makes the mission of a seed and runs it in the scripted world; in every odd one some skills lie.

    Raises InputError if it cannot be compiled.
    """
    lying, accidents = (LYING, ACCIDENTS) if seed % 2 else (0.0, 0.0)
    world = ScriptedWorld(random.Random(f"world {seed}"), lying, accidents)
    clock = Clock(world)
    trial, transitions = Trial(seed, clock, world), []
    watch = OnMessage(lambda topic, message: transitions.append(message) if topic == "transitions" else None)
    result = trial.run(watch).result.worst
    clock.over = True
    clock.advance(TICK_S)  # what was let go in the last tick comes to rest
    verdict = verdict_of(trial.tree, result, lambda conditions: world.judge(conditions, clock.now()))
    right = expected(trial.tree, result, transitions, world)
    claim, said, wrong = result.outcome is Outcome.SUCCESS, verdict.success, ""
    if said is not (right if claim else False):
        wrong = f"claim {claim}, verdict {said}, right {right}: {verdict.why}"
    elif claim and said is False and not world.lies:
        wrong = f"nothing lied, and the claim is denied: {verdict.why}"
    return SimpleNamespace(claim=claim, verdict=said, lies=tuple(world.lies), wrong=wrong)


def judge_claim(number):
    one = claimed(number)
    words = {True: "fulfilled", False: "denied", None: "not judged"}[one.verdict]
    ended = f"{words}, {'some lied' if one.lies else 'none lied'}" if one.claim else "not claimed"
    return ended, one.wrong, 0, 0


def judge_run(number, folder):
    """Judges a run, with a folder one that is killed and resumed; every tenth must give the same log again."""
    one = ran(number) if folder is None else resumed(number, folder)
    if one is None:
        return "over before the kill", "", 0, 0
    wrong = "; ".join(one.wrong)
    if not wrong and number % 10 == 0 and folder is None and ran(number).log != one.log:
        wrong = "its log differs the second time"
    return one.result.outcome.value, wrong, one.nodes, one.result.ticks


def measure(trees: int = 20_000, seed: int = 1, limit: float = 480.0, kill: bool = False, claims: bool = False):
    """Judges so many missions, or as many as the time (s) allows; returns 1 when something is wrong."""
    begun, ends, bad, nodes, ticks = time.perf_counter(), Counter(), 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        judge = partial(judge_run, folder=Path(folder) if kill else None)
        for number in range(seed * 1_000_000, seed * 1_000_000 + trees):
            if time.perf_counter() - begun > limit:
                break
            try:
                ended, wrong, *sizes = (judge_claim if claims else judge)(number)
            except InputError as error:
                ended, wrong, sizes = f"not compiled: {error.message.rsplit(': ', 1)[-1].split(chr(39))[0]}", "", [0, 0]
            except Exception as defect:
                ended, wrong, sizes = "exception", f"{type(defect).__name__}: {defect}", [0, 0]
            ends[ended] += 1
            nodes, ticks = nodes + sizes[0], ticks + sizes[1]
            if wrong:
                bad += 1
                print(f"seed {number}: {wrong}"[:900], flush=True)
    spent_s, found = time.perf_counter() - begun, "with a wrong verdict" if claims else "with a defect"
    print(f"{ends.total()} missions in {spent_s:.0f} s: {nodes} nodes, {ticks} ticks, {bad} {found}")
    print(", ".join(f"{name} {count}" for name, count in ends.most_common(9)))
    return int(bad > 0)


if __name__ == "__main__":
    command(measure)
