"""Builds the policy of a step or of a whole mission as nodes around its subtree.

From the inside: the subtree, its timeout, its retries, its guards, and the action after a failure (skip, ask, go back).
So each attempt has its own time, and a violated guard ends all attempts.
"""

from dataclasses import field
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import (
    ExplainedDecorator,
    ExplainedLeaf,
    MemoryComposite,
    StoppableTime,
    cause_of,
    message_of,
)
from executive.tree.board import FromBoard
from executive.tree.context import RunContext
from executive.tree.estimate import Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.guard import BatteryAtLeast, KnowsPlace, NotAfter
from executive.tree.plan import PlanBuilder
from executive.words.step import Guards, OnFailure, OperatorQuestion, Policy
from skills.api import Asked, Cause, Failed, Part, Question
from skills.robot import Clock, Pose2D

FINAL_CAUSES: Final = frozenset({Cause.ERROR, Cause.CANCELLED})
"""Defects and cancellations are neither skipped, nor asked about, nor tried again."""
RETRY: Final = "retry"
SKIP: Final = "skip"
STOP: Final = "stop"


class Timeout(ExplainedDecorator):
    """Decorator with a time limit on the robot's clock; suspended time does not count. `late` is the failure's message.

    | child | time | status |
    |---|---|---|
    | RUNNING, SUCCESS | in time | as the child |
    | RUNNING | over | FAILURE with TIMEOUT; the child is halted |
    | SUCCESS | over | FAILURE with TIMEOUT |
    | FAILURE | any | FAILURE with its cause |
    | halted | any | INVALID with CANCELLED |
    """

    kind = "timeout"
    limit_s: float
    clock: Clock
    late: str = "not done"

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Limits the child's estimate to the timeout."""
        taken, limit_s = walk.all_of(node, first), node.options["limit_s"]
        return taken if taken.most_s <= limit_s else taken.up_to(limit_s, f"{limit_s:g} s at most")

    def initialise(self) -> None:
        """Starts to count the time limit."""
        self._time = StoppableTime(self.clock)

    def suspend(self) -> None:
        """Stops counting until the next tick."""
        self._time.stop()

    def update(self) -> Status:
        """Returns the child's status, or FAILURE when the time limit is exceeded."""
        self._time.go_on()
        late = self._time.elapsed_s() > self.limit_s
        if late and self.decorated.status != Status.FAILURE:
            return self.fail(Failed(Cause.TIMEOUT, f"{self.late} within {self.limit_s:g} s"))
        return self.pass_on()


class Retry(ExplainedDecorator):
    """Decorator that starts its child again after failures with the given causes.

    | child | status |
    |---|---|
    | RUNNING, SUCCESS | as the child |
    | FAILURE with one of `causes`, attempts left | RUNNING; the next tick starts the child again, without memory |
    | FAILURE with another cause, or no attempts left | FAILURE with its cause |
    | halted | INVALID with CANCELLED |
    """

    kind = "retry"
    counts = True
    attempts: int
    causes: frozenset[Cause]
    attempt: int = field(default=1, init=False)

    def initialise(self) -> None:
        """Begins with the first attempt."""
        self.attempt = 1

    def update(self) -> Status:
        """Returns the child's status, or RUNNING when another attempt follows."""
        status = self.pass_on()
        if status != Status.FAILURE:
            return status
        if self.cause in self.causes and self.attempt < self.attempts:
            self.attempt += 1
            self.cause, self.message = None, f"attempt {self.attempt} of {self.attempts}, since {self.message}"
            return Status.RUNNING
        if self.attempt > 1:
            self.message = f"{self.message} (after {self.attempt} attempts)"
        return Status.FAILURE


class Skip(ExplainedDecorator):
    """Decorator that turns a step's failure into a success; `step` describes the step in words.

    | child | status |
    |---|---|
    | RUNNING, SUCCESS | as the child |
    | FAILURE with ERROR or CANCELLED | FAILURE with its cause |
    | FAILURE with another cause | SUCCESS; `skipped` has the reason |
    | halted | INVALID with CANCELLED |
    """

    kind = "skip"
    skips = True
    step: str
    skipped: str | None = field(default=None, init=False)
    achieved: bool = field(default=False, init=False)

    def initialise(self) -> None:
        """Clears the reason for an earlier skip."""
        self.skipped = None

    def update(self) -> Status:
        """Returns the child's status, or SUCCESS instead of a failure that may be skipped."""
        status = self.pass_on()
        if status != Status.FAILURE or self.cause in FINAL_CAUSES:
            return status
        return self.skip()

    def omission(self) -> str | None:
        """Returns the skipped step with the reason."""
        is_skipped = self.skipped is not None and self.status is Status.SUCCESS
        return f"{self.step} ({self.skipped})" if is_skipped else None

    def pass_on(self) -> Status:
        """Returns the child's status; `achieved` stays True once the child has done something, also in later rounds."""
        self.achieved = self.achieved or (self.decorated.status == Status.SUCCESS and _achieves(self.decorated))
        return super().pass_on()

    def skip(self) -> Status:
        """Returns SUCCESS, and records the child's failure as the reason for the skip."""
        self.skipped, self.cause = self.message, None
        self.message = f"skipped: {self.skipped}"
        return Status.SUCCESS


class AskOperator(Skip):
    """Decorator that asks the operator what to do when a step fails.

    | child | answer | status |
    |---|---|---|
    | RUNNING, SUCCESS | - | as the child |
    | FAILURE with ERROR or CANCELLED | - | FAILURE with its cause |
    | FAILURE with another cause | none yet | RUNNING until the time is over, when `default` is the answer |
    | FAILURE with another cause | retry | RUNNING; the next tick starts the child again |
    | FAILURE with another cause | skip | SUCCESS; `skipped` has the reason |
    | FAILURE with another cause | stop | FAILURE with its cause |
    | halted | withdrawn | INVALID with CANCELLED |
    """

    kind = "ask"
    options: tuple[str, ...]
    default: str
    limit_s: float
    text: str | None
    context: RunContext
    _asked: Asked | None = field(default=None, init=False)

    def update(self) -> Status:
        """Returns the child's status; asks the question when it fails."""
        status = self.pass_on()
        if status != Status.FAILURE or self.cause is None or self.cause in FINAL_CAUSES:
            return status
        before, self.before = self.before, None
        if before is Status.SUCCESS:
            return self.skip()
        self._failure = Failed(self.cause, self.message)
        text = f"{self.text} ({self.message})" if self.text else f"{self.message}. What now?"
        question = Question(self.path_id, text, self.options, self.default, self.limit_s)
        self._asked = self.context.ask(question)
        return self.say(f"asks the operator: {text}", Status.RUNNING)

    def stop(self, new_status: Status) -> None:
        """Withdraws an open question when the node is stopped from outside."""
        if new_status == Status.INVALID and self._asked is not None:
            self._asked.withdraw()
            self._asked = None
        super().stop(new_status)

    def _held_back(self) -> Status | None:
        """Acts on the operator's answer once there is one."""
        if self._asked is None or not self._asked.done():
            return None if self._asked is None else Status.RUNNING
        answer, self._asked, failure = self._asked.result(), None, self._failure
        if answer == RETRY:
            return self.say(f"tries again, as the operator said, since {failure.message}", Status.RUNNING)
        if answer != SKIP:
            return self.fail(failure)
        self.message = failure.message
        return self.skip()


class GoBack(MemoryComposite):
    """Composite that drives back (second child) if the work (first child) fails.

    | work | drive back | status |
    |---|---|---|
    | RUNNING, SUCCESS | idle | as the work |
    | FAILURE with ERROR or CANCELLED | idle | FAILURE with its cause |
    | FAILURE with another cause | idle, ticked from the next tick on | RUNNING |
    | FAILURE | RUNNING | RUNNING |
    | FAILURE | SUCCESS, FAILURE | FAILURE with the cause of the work |
    | halted | halted | INVALID with CANCELLED |
    """

    kind = "go back"
    usual = slice(1)

    def _following(self, child: Behaviour) -> int | None:
        return None

    def _take_over(self, child: Behaviour) -> None:
        action, drive_back = self.children
        if child is action and action.status == Status.FAILURE and cause_of(action) not in FINAL_CAUSES:
            self._index = 1
            self._go_on(f"goes back, since {message_of(action)}")
        elif child is action:
            super()._take_over(action)
        elif drive_back.status == Status.RUNNING:
            self.message = f"goes back ({message_of(drive_back)})"
        else:
            back = drive_back.status == Status.SUCCESS
            end = "is back where it started" if back else f"could not go back: {message_of(drive_back)}"
            self._end(cause_of(action), f"{message_of(action)}; the robot {end}")


def _achieves(node: Behaviour) -> bool:
    """Returns whether a skill below a node has succeeded and was not skipped; speech does not count."""
    if isinstance(node, Skip) and (node.skipped is not None or node.achieved):
        return node.achieved
    if (skill := getattr(node, "skill", None)) is not None:
        return bool(node.status == Status.SUCCESS and skill.uses != {Part.VOICE})
    return any(map(_achieves, node.children))


class Summary(ExplainedDecorator):
    """Decorator for a mission that may skip steps.

    | child | status |
    |---|---|
    | RUNNING, FAILURE | as the child |
    | SUCCESS, steps were skipped and no skill but speech has succeeded outside them | FAILURE with EXECUTION |
    | SUCCESS | SUCCESS; the message names the skipped steps |
    | halted | INVALID with CANCELLED |
    """

    kind = "summary"
    container = True

    def update(self) -> Status:
        """Returns the child's status, with the skipped steps."""
        status = self.pass_on()
        if status != Status.SUCCESS:
            return status
        nodes = [node for node in self.iterate() if isinstance(node, Skip) and node.status == Status.SUCCESS]
        steps = "; ".join(f"{node.step} ({node.skipped})" for node in nodes if node.skipped is not None)
        if not steps:
            return status
        if not _achieves(self.decorated):
            return self.fail(Failed(Cause.EXECUTION, f"all steps were skipped: {steps}"))
        self.message = f"done, but skipped: {steps}"
        return status


class RememberPose(ExplainedLeaf):
    """Leaf that writes the robot's pose (world frame) to the blackboard.

    RUNNING until the robot is localised, then SUCCESS; FAILURE with PRECONDITION after `patience_s`. With `keep`,
    SUCCESS at once if a pose is stored already, such as that of the mission's speaker.
    """

    kind = "remember"
    plumbing = True
    output_types: ClassVar = {"key": Pose2D}
    key: str
    context: RunContext
    patience_s: float = 5.0
    keep: bool = False

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Stores the pose of the walk under the node's key."""
        walk.noted[node.options["key"]] = walk.pose
        return Estimate()

    def initialise(self) -> None:
        """Starts to count the patience."""
        self._started_s = self.context.clock.now()

    def update(self) -> Status:
        """Writes the pose, or waits for one."""
        if self.keep and self.key in self.context.board:
            return self.say("began before")
        if self.context.localiser.estimate().localised:
            self.context.board.put(self.key, self.context.pose())
            return self.say("knows where it stands")
        if self.context.clock.now() - self._started_s <= self.patience_s:
            return self.say("waits until it knows where it is", Status.RUNNING)
        return self.fail(Failed(Cause.PRECONDITION, "the robot does not know where it is"))


def under_policy(
    body: NodeSpec, policy: Policy, builder: PlanBuilder, words: str, *, may_skip: bool = True
) -> NodeSpec:
    """Builds the nodes of a policy around a subtree; `words` describes the subtree."""
    below = body
    if policy.timeout_s is not None:
        name = f"within {policy.timeout_s:g} s"
        below = builder.node("timeout", name, below, part="timeout", limit_s=policy.timeout_s)
    if policy.further_attempts:
        most, causes = policy.further_attempts + 1, frozenset(Cause) - FINAL_CAUSES
        below = builder.retried(f"up to {most} attempts", below, most, causes, part="retries")
    guards = policy.guards or Guards()
    if guards.localised:
        knows = KnowsPlace(stale=guards.stale)
        below = builder.guarded("knows where it is", below, knows, part="guard-localised")
    if guards.time_s is not None:
        in_time = NotAfter(guards.time_s)
        below = builder.guarded(f"not after {guards.time_s:g} s", below, in_time, part="guard-time")
    if guards.battery is not None:
        charged = BatteryAtLeast(guards.battery, stale=guards.stale)
        below = builder.guarded(f"battery at {guards.battery:.0%} or more", below, charged, part="guard-battery")
    match policy.on_failure:
        case OnFailure.SKIP:
            return builder.node("skip", "skip it if it fails", below, part="skip", step=words)
        case OnFailure.ASK:
            question = policy.question or OperatorQuestion()
            asked = {"default": question.default, "limit_s": question.limit_s, "text": question.text}
            options = (RETRY, SKIP, STOP) if may_skip else (RETRY, STOP)
            return builder.node("ask", "ask if it fails", below, part="ask", step=words, options=options, **asked)
        case OnFailure.RETURN:
            back = builder.at("return")
            drive = back.navigate(FromBoard(back.start_key), "the start")
            return back.node("go back", "go back if it fails", below, drive)
    return below
