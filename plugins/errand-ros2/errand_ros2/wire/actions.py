"""Server and client of an action: three services and two topics, as `rcl_action` defines them."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Final

import numpy as np

from errand_ros2.wire.keys import Qos
from errand_ros2.wire.node import Client, Node, Request
from errand_ros2.wire.types import older_types, ros_types

MOST_GOALS: Final = 64
"""Goals whose results are kept; older ones are forgotten."""
_RESULT_S: Final = 3600.0
"""Time for which a client waits for a result."""
_STATUS_QOS: Final = Qos(depth=1, transient_local=True)


class GoalStatus(IntEnum):
    """Status of a goal (action_msgs/msg/GoalStatus)."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6

    @property
    def is_final(self) -> bool:
        """Returns whether the goal has ended."""
        return self >= GoalStatus.SUCCEEDED


class CancelCode(IntEnum):
    """Answer to a request to cancel goals (action_msgs/srv/CancelGoal)."""

    NONE = 0
    REJECTED = 1
    UNKNOWN_GOAL = 2
    TERMINATED = 3


@dataclass
class Goal:
    """Goal of a client: its identity, its message, its status, and its result once it has ended."""

    identity: bytes
    message: Any
    accepted_ns: int
    status: GoalStatus = GoalStatus.ACCEPTED
    result: Any = None
    waiting: list[Request] = field(default_factory=list)


class ActionServer:
    """Server of one action. All methods are thread-safe."""

    def __init__(
        self,
        node: Node,
        name: str,
        type_name: str,
        *,
        accept: Callable[[Goal], bool],
        cancel: Callable[[Goal], None],
        pool: Executor,
    ) -> None:
        """`accept`, which the `pool` calls, returns whether a goal is pursued; `cancel` begins to end one."""
        types, self._lock = ros_types(), threading.RLock()
        self.kind = types.action(type_name)
        self._accept, self._cancel = accept, cancel
        self._goals: dict[bytes, Goal] = {}
        self._time = types.message("builtin_interfaces/msg/Time").make
        self._uuid = types.message("unique_identifier_msgs/msg/UUID").make
        self._info = types.message("action_msgs/msg/GoalInfo").make
        self._goal_status = types.message("action_msgs/msg/GoalStatus").make
        base = f"{node.absolute(name)}/_action"
        self._feedback = node.publisher(f"{base}/feedback", self.kind.feedback_message.name)
        self._status = node.publisher(f"{base}/status", self.kind.status.name, _STATUS_QOS)
        node.serve(f"{base}/send_goal", self.kind.send_goal, lambda request: _submit(pool, self._send_goal, request))
        node.serve(f"{base}/cancel_goal", self.kind.cancel_goal, self._cancel_goal)
        node.serve(f"{base}/get_result", self.kind.get_result, self._get_result)
        if older_types().has(type_name):  # its result has fewer fields there, and so another key
            node.serve(f"{base}/get_result", older_types().service(f"{type_name}_GetResult"), self._get_result)

    def begin(self, goal: Goal) -> None:
        """Records that a goal is being pursued."""
        self._set(goal, GoalStatus.EXECUTING)

    def tell(self, goal: Goal, feedback: Any) -> None:
        """Publishes feedback on a goal."""
        self._feedback.put(self.kind.feedback_message.make(self._uuid_of(goal), feedback))

    def end(self, goal: Goal, status: GoalStatus, result: Any) -> None:
        """Ends a goal, and answers all clients that wait for its result. Idempotent."""
        with self._lock:
            if goal.status.is_final:
                return
            goal.result, waiting, goal.waiting = result, goal.waiting, []
            self._set(goal, status)
        for request in waiting:
            self._reply(request, goal)

    def _set(self, goal: Goal, status: GoalStatus) -> None:
        with self._lock:
            if goal.status.is_final:
                return
            goal.status = status
            every = [self._goal_status(self._info_of(each), each.status) for each in self._goals.values()]
            self._status.put(self.kind.status.make(every))

    def _send_goal(self, request: Request) -> None:
        """Accepts or rejects a goal."""
        identity, now_ns = request.message.goal_id.uuid.tobytes(), time.time_ns()
        goal = Goal(identity, request.message.goal, now_ns)
        with self._lock:
            is_new = identity not in self._goals
            if is_new:
                self._forget()
                self._goals[identity] = goal
        accepted = False
        try:
            accepted = is_new and self._accept(goal)
        finally:
            if is_new and not accepted:
                with self._lock:
                    self._goals.pop(identity, None)
            request.reply(self.kind.send_goal.response.make(accepted, self._stamp(now_ns)))

    def _forget(self) -> None:
        """Forgets the oldest goals that have ended."""
        ended = [each for each, goal in self._goals.items() if goal.status.is_final]
        for identity in ended[: max(0, len(self._goals) - MOST_GOALS + 1)]:
            del self._goals[identity]

    def _cancel_goal(self, request: Request) -> None:
        """Cancels one goal, or all goals up to a time, or all."""
        info = request.message.goal_info
        identity, until_ns = info.goal_id.uuid.tobytes(), info.stamp.sec * 10**9 + info.stamp.nanosec
        with self._lock:
            named = self._goals.get(identity)
            every = until_ns == 0 and not any(identity)
            asked = [
                goal
                for goal in self._goals.values()
                if every or goal is named or (until_ns > 0 and goal.accepted_ns <= until_ns)
            ]
            found = [goal for goal in asked if not goal.status.is_final]
            for goal in found:
                self._set(goal, GoalStatus.CANCELING)
        for goal in found:
            self._cancel(goal)
        code = CancelCode.NONE if found else CancelCode.REJECTED
        if any(identity) and not found:
            code = CancelCode.UNKNOWN_GOAL if named is None else CancelCode.TERMINATED
        request.reply(self.kind.cancel_goal.response.make(int(code), [self._info_of(goal) for goal in found]))

    def _get_result(self, request: Request) -> None:
        """Answers with a goal's result, at once or when the goal ends."""
        with self._lock:
            goal = self._goals.get(request.message.goal_id.uuid.tobytes())
            if goal is not None and not goal.status.is_final:
                goal.waiting = [*goal.waiting[-MOST_GOALS:], request]
                return
        self._reply(request, goal)

    def _reply(self, request: Request, goal: Goal | None) -> None:
        status = GoalStatus.UNKNOWN if goal is None else goal.status
        result = None if goal is None else goal.result
        request.reply(self.kind.get_result.response.make(int(status), result or self.blank_result()))

    def blank_result(self) -> Any:
        """Returns a result whose fields are all empty."""
        return ros_types().blank(self.kind.result.name)

    def _stamp(self, stamp_ns: int) -> Any:
        return self._time(*divmod(stamp_ns, 10**9))

    def _uuid_of(self, goal: Goal) -> Any:
        return self._uuid(np.frombuffer(goal.identity, np.uint8))

    def _info_of(self, goal: Goal) -> Any:
        return self._info(self._uuid_of(goal), self._stamp(goal.accepted_ns))


def _submit(pool: Executor, handle: Callable[[Request], None], request: Request) -> None:
    """Lets the pool handle a request; drops it when the pool is closed."""
    with suppress(RuntimeError):
        pool.submit(handle, request)


class NoAnswerError(RuntimeError):
    """Error of a server that does not answer in time: the goal may be pursued."""


@dataclass
class SentGoal:
    """Goal that a server accepted; status and result are set when it ends, by a thread of Zenoh."""

    identity: Any
    status: GoalStatus = GoalStatus.EXECUTING
    result: Any = None


class ActionClient:
    """Client of one action."""

    def __init__(self, node: Node, name: str, type_name: str) -> None:
        self.kind, base = ros_types().action(type_name), f"{node.absolute(name)}/_action"
        self.ended = 0
        """Number of the goals whose result has come."""
        self._send = Client(node, f"{base}/send_goal", self.kind.send_goal)
        self._cancel = Client(node, f"{base}/cancel_goal", self.kind.cancel_goal)
        self._result = Client(node, f"{base}/get_result", self.kind.get_result)
        self._uuid = ros_types().message("unique_identifier_msgs/msg/UUID").make

    def send(self, goal: Any, *, limit_s: float) -> SentGoal | None:
        """Sends a goal; returns None when the server rejects it. Raises NoAnswerError."""
        sent = SentGoal(self._uuid(np.frombuffer(uuid.uuid4().bytes, np.uint8)))
        answer = self._send.call(self.kind.send_goal.request.make(sent.identity, goal), limit_s=limit_s)
        if answer is None:
            self.cancel(sent)
            raise NoAnswerError("the action's server does not answer")
        if not answer.accepted:
            return None

        def take(response: Any) -> None:
            sent.result, self.ended = response.result, self.ended + 1
            sent.status = GoalStatus(response.status) if 0 <= response.status <= max(GoalStatus) else GoalStatus.ABORTED

        self._result.ask(self.kind.get_result.request.make(sent.identity), take, limit_s=_RESULT_S)
        return sent

    def cancel(self, sent: SentGoal) -> None:
        """Asks the server to cancel a goal; does not wait."""
        info = ros_types().blank("action_msgs/msg/GoalInfo")
        info.goal_id = sent.identity
        self._cancel.ask(self.kind.cancel_goal.request.make(info), lambda _: None, limit_s=_RESULT_S)
