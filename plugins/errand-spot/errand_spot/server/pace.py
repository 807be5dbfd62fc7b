"""Our own service for clients that step the robot, for repeatable tests of programs."""

from __future__ import annotations

from typing import Any, Final

import grpc
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from errand_spot.launch import ADVANCE
from errand_spot.messages import seconds, timestamp
from errand_spot.server.computer import PERIOD_S, Computer

_MOST_S: Final = 60.0


class Pacer(grpc.GenericRpcHandler):  # type: ignore[misc]
    """Steps the robot by a call's duration, at least once, and returns the new robot time."""

    def __init__(self, computer: Computer) -> None:
        self._computer = computer

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler | None:
        """Returns the handler of the one call."""
        if handler_call_details.method != ADVANCE:
            return None
        return grpc.unary_unary_rpc_method_handler(self._advance, bytes, Timestamp.SerializeToString)

    def _advance(self, data: bytes, context: grpc.ServicerContext) -> Any:
        try:
            asked_s = seconds(Duration.FromString(data))
        except DecodeError:
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, "the message is no google.protobuf.Duration")
        if not 0.0 <= asked_s <= _MOST_S:
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, f"{asked_s:g} s are not 0 to {_MOST_S:.0f} s")
        steps, step = max(1, round(asked_s / PERIOD_S)), self._computer.step
        self._computer.do(lambda: [step() for _ in range(steps)]).result()
        return timestamp(self._computer.now_s())
