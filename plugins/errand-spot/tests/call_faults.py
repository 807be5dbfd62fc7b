"""Faults of the server for tests of its clients: lost, late and refused calls, and answers with another status."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event
from typing import Any, Final

import grpc
from google.protobuf import descriptor_pool
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

_SET: Final = "a fault was set for this call"


@dataclass(frozen=True)
class Fault:
    """Fault of a call.

    The request comes late by `request_s`, the answer by `answer_s`; `math.inf` loses it. The answer has another gRPC
    `code`, or other values in `fields`, by their paths (`header.error.code`; in a list each element has the value).
    The robot executes the call unless `handled` is false.
    """

    request_s: float = 0.0
    answer_s: float = 0.0
    code: grpc.StatusCode | None = None
    fields: Mapping[str, Any] = field(default_factory=dict)
    handled: bool = True


class Switchboard(grpc.ServerInterceptor):  # type: ignore[misc]
    """Sets and clears the faults of calls."""

    def __init__(self) -> None:
        self._faults: dict[str, Fault] = {}

    @contextmanager
    def fault(self, call: str, fault: Fault) -> Iterator[None]:
        """Sets the fault of a call while a block runs: `bosdyn.api.LeaseService/TakeLease`, or `*` for all calls."""
        self._faults[call] = fault
        try:
            yield
        finally:
            del self._faults[call]

    def intercept_service(self, continuation: Callable[[Any], Any], handler_call_details: Any) -> Any:
        """Returns the handler of a call with its fault."""
        handler, call = continuation(handler_call_details), handler_call_details.method.strip("/")
        fault = self._faults.get(call) or self._faults.get("*")
        if fault is None or handler is None or handler.unary_unary is None:
            return handler

        def answer(request: Any, context: grpc.ServicerContext) -> Any:
            return _answer(fault, call, handler.unary_unary, request, context)

        return grpc.unary_unary_rpc_method_handler(answer, handler.request_deserializer, handler.response_serializer)


def _answer(fault: Fault, call: str, handle: Callable[..., Any], request: Any, context: grpc.ServicerContext) -> Any:
    _wait(fault.request_s, context)
    method = descriptor_pool.Default().FindMethodByName(call.replace("/", "."))
    response = handle(request, context) if fault.handled else GetMessageClass(method.output_type)()
    _wait(fault.answer_s, context)
    if fault.code is not None:
        context.abort(fault.code, _SET)
    for path, value in fault.fields.items():
        _put(response, path, value)
    return response


def _wait(delay_s: float, context: grpc.ServicerContext) -> None:
    """Waits; what is lost waits until the client gives up."""
    ended = Event()
    if math.isfinite(delay_s):
        ended.wait(delay_s)
    elif context.add_callback(ended.set):
        ended.wait()
        context.abort(grpc.StatusCode.CANCELLED, _SET)


def _put(message: Any, path: str, value: Any) -> None:
    """Sets a field of a message, or of each message in a list."""
    name, _, rest = path.partition(".")
    if not rest:
        setattr(message, name, value)
        return
    part = getattr(message, name)
    for each in [part] if isinstance(part, Message) else part:
        _put(each, rest, value)
