"""gRPC services from plain classes, with one place for headers, tokens and malformed messages.

A service is a class whose methods have the names of the API's calls. Each takes the request and the `Call`, and returns
the response. A stream of requests comes as a list, or as it arrives to a `live` service; a stream of responses is
returned as an iterable. Calls of the API that the class lacks are answered with UNIMPLEMENTED and their names.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import grpc
from bosdyn.api import data_chunk_pb2, header_pb2
from google.protobuf import descriptor_pool
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from errand_spot.messages import InvalidRequestError, timestamp
from errand_spot.server.refusals import check_values

_LOG: Final = logging.getLogger(__name__)
_MALFORMED: Final = object()
"""Stands for a message that cannot be parsed; for None grpc would answer itself."""
MOST_STREAMED_BYTES: Final = 256 * 1024**2
"""Most bytes of all requests of a stream."""
_CHUNK_BYTES: Final = 1024**2
UserOf = Callable[[str], str | None]
"""Returns the user of a token; None for an invalid one."""


@dataclass(frozen=True)
class Call:
    """Context of a call: its user, and the time of its receipt (robot time, s since 1970)."""

    user: str
    client_name: str
    received_s: float


class Service:
    """One service of the API: its name in the directory, its type, and the authority under which it is reached."""

    name: ClassVar[str]
    type: ClassVar[str]
    authority: ClassVar[str]
    needs_token: ClassVar[bool] = True
    checks_values: ClassVar[bool] = False
    """Whether its calls check values themselves, because the API has a status for that."""
    aborts: ClassVar[bool] = False
    """Whether an error ends a call, because clients read no error in the header."""
    live: ClassVar[bool] = False
    """Whether its calls take the messages of a stream as they arrive."""


def handlers(services: Sequence[Service], user_of: UserOf, now: Callable[[], float]) -> list[grpc.GenericRpcHandler]:
    """Returns the handlers of services; the last one answers all other calls. `now` gives the robot's time (s)."""
    made = [_ServiceHandler(service, user_of, now).generic() for service in services]
    return [*made, _OtherCalls()]


def service_calls(service: type[Service]) -> tuple[str, ...]:
    """Names of the API's calls that a service answers."""
    return tuple(name for name in vars(service) if name[0].isupper() and callable(getattr(service, name)))


class _ServiceHandler:
    """Handlers of the calls of one service."""

    def __init__(self, service: Service, user_of: UserOf, now: Callable[[], float]) -> None:
        self._service, self._user_of, self._now = service, user_of, now

    def generic(self) -> grpc.GenericRpcHandler:
        described = descriptor_pool.Default().FindServiceByName(self._service.type)
        methods = {method.name: self._handler(method) for method in described.methods}
        return grpc.method_handlers_generic_handler(self._service.type, methods)

    def _handler(self, method: Any) -> grpc.RpcMethodHandler:
        """Returns the handler of one call; calls with streams both ways are not served."""
        answer, streams = getattr(self._service, method.name, None), (method.client_streaming, method.server_streaming)
        if answer is None or all(streams):
            return _unimplemented(f"{self._service.type}/{method.name}")
        request_type, response_type = GetMessageClass(method.input_type), GetMessageClass(method.output_type)

        def parse(data: bytes) -> Message | object:
            try:
                parsed: Message = request_type.FromString(data)
            except DecodeError:
                return _MALFORMED
            return parsed

        def handle(given: Any, context: grpc.ServicerContext) -> Any:
            received_s, user = self._now(), self._user_of(_token(context)) if self._service.needs_token else ""
            if user is None:
                context.abort(grpc.StatusCode.UNAUTHENTICATED, "401: the token is missing, not valid or expired")
            live = self._service.live and method.client_streaming
            several = given if method.client_streaming else (given,)
            requests = [request_type()] if live else _collected(several, context)
            call = Call(user or "", requests[0].header.client_name, received_s)
            asked = _arriving(given) if live else requests if method.client_streaming else requests[0]

            def answered() -> Any:
                if not (self._service.checks_values or method.client_streaming):
                    check_values(asked)
                return answer(asked, call)

            def responses() -> Iterator[Any]:
                for response, error in self._answered(answered, response_type, many=method.server_streaming):
                    headed = "header" in response.DESCRIPTOR.fields_by_name
                    if error.code != error.CODE_OK and (self._service.aborts or not headed):
                        context.abort(grpc.StatusCode.INVALID_ARGUMENT, error.message)
                    if headed:
                        _fill_header(response, requests[0], error, received_s, self._now())
                    yield response

            return responses() if method.server_streaming else next(responses())

        handler_of = {
            (False, False): grpc.unary_unary_rpc_method_handler,
            (True, False): grpc.stream_unary_rpc_method_handler,
            (False, True): grpc.unary_stream_rpc_method_handler,
        }[streams]
        return handler_of(handle, parse, response_type.SerializeToString)

    def _answered(self, answer: Callable[[], Any], response_type: Any, *, many: bool) -> Iterator[tuple[Any, Any]]:
        """Yields the responses, one unless there are `many`, each with the API's error for an exception, the last."""
        Error = header_pb2.CommonError
        try:
            for response in answer() if many else [answer()]:
                yield response, Error(code=Error.CODE_OK)
        except (InvalidRequestError, DecodeError) as invalid:  # a message within a message is decoded late
            yield response_type(), Error(code=Error.CODE_INVALID_REQUEST, message=str(invalid))
        except Exception as failed:
            _LOG.exception("%s failed", self._service.type)
            yield response_type(), Error(code=Error.CODE_INTERNAL_SERVER_ERROR, message=str(failed))


def _arriving(given: Iterable[Any]) -> Iterator[Any]:
    """Yields requests as they arrive. Raises InvalidRequestError for a malformed one."""
    for request in given:
        if request is _MALFORMED:
            raise InvalidRequestError("the message cannot be parsed")
        yield request


def _collected(given: Iterable[Any], context: grpc.ServicerContext) -> list[Any]:
    """Returns all requests of a call; refuses malformed ones, and an empty or endless stream."""
    requests, size = list[Any](), 0
    for request in given:
        if request is _MALFORMED:
            context.abort(grpc.StatusCode.INVALID_ARGUMENT, "the message cannot be parsed")
        size += request.ByteSize()
        if size > MOST_STREAMED_BYTES:
            context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, f"the stream has over {MOST_STREAMED_BYTES} bytes")
        requests.append(request)
    if not requests:
        context.abort(grpc.StatusCode.INVALID_ARGUMENT, "the stream has no message")
    return requests


def joined(requests: Sequence[Any], kind: Any) -> Any:
    """The message of a stream of chunks. Raises InvalidRequestError."""
    try:
        return kind.FromString(b"".join(request.chunk.data for request in requests))
    except DecodeError as error:
        raise InvalidRequestError(f"chunk: the data are no {kind.DESCRIPTOR.name}") from error


def chunks(message: Any) -> Iterator[Any]:
    """Yields a message in chunks, one at least."""
    data = message.SerializeToString()
    for start in range(0, max(1, len(data)), _CHUNK_BYTES):
        yield data_chunk_pb2.DataChunk(total_size=len(data), data=data[start : start + _CHUNK_BYTES])


def _fill_header(
    response: Any, request: Any, error: header_pb2.CommonError, received_s: float, answered_s: float
) -> None:
    """Fills the header of a response: both times are needed for the time synchronisation of clients."""
    response.header.request_header.CopyFrom(request.header)
    response.header.request_received_timestamp.CopyFrom(timestamp(received_s))
    response.header.response_timestamp.CopyFrom(timestamp(answered_s))
    response.header.error.CopyFrom(error)


def _token(context: grpc.ServicerContext) -> str:
    """Returns the bearer token of a call; empty without one."""
    for key, value in context.invocation_metadata():
        if key == "authorization" and value.startswith("Bearer "):
            return str(value).removeprefix("Bearer ")
    return ""


def _unimplemented(call: str) -> grpc.RpcMethodHandler:
    """Returns a handler that refuses every call of a name."""

    def refuse(_request: Any, context: grpc.ServicerContext) -> Any:
        context.abort(grpc.StatusCode.UNIMPLEMENTED, f"{call} is not served by Errand")

    return grpc.stream_stream_rpc_method_handler(refuse, bytes, bytes)


class _OtherCalls(grpc.GenericRpcHandler):  # type: ignore[misc]
    """Answers calls of services that are not served."""

    def service(self, handler_call_details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler:
        """Returns the handler of a call."""
        return _unimplemented(handler_call_details.method.strip("/"))
