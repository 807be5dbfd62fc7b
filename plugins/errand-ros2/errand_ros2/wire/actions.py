"""Server and client of an action: three services and two topics, as `rcl_action` defines them."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from errand_ros2.wire.node import Node, Request
from errand_ros2.wire.types import LATCHED, ros_types

MOST_GOALS, _RESULT_S = 64, 3600.0  # goals whose results are kept; time for which a client waits for a result
_CANCEL = "action_msgs/srv/CancelGoal"
_REJECTED, _UNKNOWN_GOAL, _TERMINATED = 1, 2, 3  # its answers

GoalStatus = IntEnum("GoalStatus", "UNKNOWN ACCEPTED EXECUTING CANCELING SUCCEEDED CANCELED ABORTED", start=0)
"""Status of a goal (action_msgs/msg/GoalStatus); from SUCCEEDED on it has ended."""


@dataclass
class Goal:
    """Goal of a client: its UUID, its message, its status, and its result once it has ended."""

    identity: Any
    message: Any
    accepted_ns: int
    status: GoalStatus = GoalStatus.ACCEPTED
    result: Any = None
    waiting: list[Request] = field(default_factory=list)

    @property
    def has_ended(self) -> bool:
        """Returns whether the status is final."""
        return self.status >= GoalStatus.SUCCEEDED

    @property
    def info(self) -> dict[str, Any]:
        """Fields of action_msgs/msg/GoalInfo."""
        sec, nanosec = divmod(self.accepted_ns, 10**9)
        return {"goal_id": self.identity, "stamp": {"sec": sec, "nanosec": nanosec}}


class ActionServer:
    """Server of one action. All methods are thread-safe."""

    def __init__(
        self, node: Node, name: str, kind: str, pool: Executor, accept: Callable[..., bool], cancel: Callable[..., Any]
    ) -> None:
        """`accept`, which the `pool` calls, returns whether a goal is pursued; `cancel` begins to end one."""
        self.kind, self._lock = kind, threading.RLock()
        self._accept, self._cancel = accept, cancel
        self._goals: dict[bytes, Goal] = {}
        base = f"{node.absolute(name)}/_action"
        self._feedback = node.publisher(f"{base}/feedback", f"{kind}_FeedbackMessage")
        self._status = node.publisher(f"{base}/status", "action_msgs/msg/GoalStatusArray", LATCHED)
        node.serve(f"{base}/cancel_goal", _CANCEL, self._cancel_goal)
        node.serve(f"{base}/send_goal", f"{kind}_SendGoal", node.later(pool, self._send_goal))
        node.serve(f"{base}/get_result", f"{kind}_GetResult", self._get_result)

    def tell(self, goal: Goal, **feedback: Any) -> None:
        """Publishes feedback on a goal by its fields."""
        self._feedback.put({"goal_id": goal.identity, "feedback": feedback})

    def end(self, goal: Goal, status: GoalStatus, **result: Any) -> None:
        """Ends a goal, and answers all clients that wait for its result, whose fields are given. Idempotent."""
        with self._lock:
            if goal.has_ended:
                return
            goal.result, waiting, goal.waiting = self._result(**result), goal.waiting, []
            self.set_status(goal, status)
        for request in waiting:
            self._reply(request, goal)

    def set_status(self, goal: Goal, status: GoalStatus) -> None:
        """Records how far a goal is, unless it has ended."""
        with self._lock:
            if goal.has_ended:
                return
            goal.status = status
            every = [{"goal_info": each.info, "status": each.status} for each in self._goals.values()]
            self._status.put({"status_list": every})

    def _send_goal(self, request: Request) -> None:
        identity = request.message.goal_id.uuid.tobytes()
        goal = Goal(request.message.goal_id, request.message.goal, time.time_ns())
        with self._lock:
            is_new = identity not in self._goals
            if is_new:
                ended = [each for each, other in self._goals.items() if other.has_ended]
                for each in ended[: max(0, len(self._goals) - MOST_GOALS + 1)]:
                    del self._goals[each]
                self._goals[identity] = goal
        accepted = False
        try:
            accepted = is_new and self._accept(goal)
        finally:
            if is_new and not accepted:
                with self._lock:
                    self._goals.pop(identity, None)
            request.reply({"accepted": accepted, "stamp": goal.info["stamp"]})

    def _cancel_goal(self, request: Request) -> None:
        """Cancels one goal, or all goals up to a time, or all."""
        info = request.message.goal_info
        identity, until_ns = info.goal_id.uuid.tobytes(), info.stamp.sec * 10**9 + info.stamp.nanosec
        with self._lock:
            named = self._goals.get(identity)
            every = until_ns == 0 and not any(identity)
            asked = [each for each in self._goals.values() if every or each is named or each.accepted_ns <= until_ns]
            found = [goal for goal in asked if not goal.has_ended]
            for goal in found:
                self.set_status(goal, GoalStatus.CANCELING)
        for goal in found:
            self._cancel(goal)
        code = _REJECTED if not any(identity) else _UNKNOWN_GOAL if named is None else _TERMINATED
        request.reply({"return_code": 0 if found else code, "goals_canceling": [goal.info for goal in found]})

    def _get_result(self, request: Request) -> None:
        """Answers with a goal's result, at once or when the goal ends."""
        with self._lock:
            goal = self._goals.get(request.message.goal_id.uuid.tobytes())
            if goal is not None and not goal.has_ended:
                goal.waiting = [*goal.waiting[-MOST_GOALS:], request]
                return
        self._reply(request, goal)

    def _reply(self, request: Request, goal: Goal | None) -> None:
        status = GoalStatus.UNKNOWN if goal is None else goal.status
        request.reply({"status": status, "result": self._result() if goal is None else goal.result})

    def _result(self, **fields: Any) -> Any:
        """Returns a result in the form of the newest distribution; older clients get the fields that they know."""
        return ros_types().make(f"{self.kind}_Result", **fields)


@dataclass
class SentGoal:
    """Goal that a server accepted; status and result are set when it ends, by a thread of the wire."""

    identity: Any
    status: GoalStatus = GoalStatus.EXECUTING
    result: Any = None
    ended: threading.Event = field(default_factory=threading.Event)


class ActionClient:
    """Client of one action."""

    def __init__(self, node: Node, name: str, type_name: str) -> None:
        self.ended, base = 0, f"{node.absolute(name)}/_action"  # number of the goals whose result has come
        self._send = node.client(f"{base}/send_goal", f"{type_name}_SendGoal")
        self._cancel = node.client(f"{base}/cancel_goal", _CANCEL)
        self._result = node.client(f"{base}/get_result", f"{type_name}_GetResult")

    def send(self, goal: Any, *, limit_s: float) -> SentGoal | None:
        """Sends a goal or its fields; None when the server rejects it. Raises TimeoutError: it may be pursued."""
        sent = SentGoal({"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)})
        answer = self._send.call({"goal_id": sent.identity, "goal": goal}, limit_s=limit_s)
        if answer is None:
            self.cancel(sent)
            raise TimeoutError("the action's server does not answer")
        if not answer.accepted:
            return None

        def take(response: Any) -> None:
            sent.result, self.ended = response.result, self.ended + 1
            sent.status = GoalStatus(response.status) if 0 <= response.status <= max(GoalStatus) else GoalStatus.ABORTED
            sent.ended.set()

        self._result.ask({"goal_id": sent.identity}, take, limit_s=_RESULT_S)
        return sent

    def cancel(self, sent: SentGoal) -> None:
        """Asks the server to cancel a goal; does not wait."""
        request = {"goal_info": {"goal_id": sent.identity}}
        self._cancel.ask(request, lambda _: None, limit_s=_RESULT_S)
