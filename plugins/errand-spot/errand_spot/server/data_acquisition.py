"""Data acquisition: pictures and states that clients ask for, and a store that clients read and write."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from threading import Lock
from typing import Any, Final

from bosdyn.api import data_acquisition_pb2, data_acquisition_store_pb2, header_pb2, image_pb2
from google.protobuf.json_format import MessageToDict
from google.protobuf.message import Message

from errand_spot.messages import InvalidRequestError, seconds, timestamp
from errand_spot.server.calls import Call, Service, chunks
from errand_spot.server.identity import DOMAIN
from errand_spot.server.pictures import ImageService
from errand_spot.server.refusals import check_values
from errand_spot.server.state import RobotStateService, WorldObjectService

_Status = data_acquisition_pb2.GetStatusResponse
_Acquired = data_acquisition_pb2.AcquireDataResponse
_Cancelled = data_acquisition_pb2.CancelAcquisitionResponse
_MOST_BYTES: Final = 512 * 1024**2
"""Most bytes of all captures in the store."""
_FIXED: Final = ("odom", "vision")
_KEPT: Final = 1000
"""Acquisitions whose status is remembered."""


@dataclass(frozen=True)
class Capture:
    """One capture: its identifier, its kind (a field of the API's result of a query), and the message."""

    data_id: Any
    kind: str
    content: Message


class Store:
    """Captures in the order of their numbers, in memory until the server ends."""

    def __init__(self) -> None:
        self._lock, self._captures, self._size = Lock(), list[Capture](), 0

    def add(self, kind: str, data_id: Any, content: Message) -> Any:
        """Stores a capture and returns its identifier. Raises InvalidRequestError when the store is full."""
        stored = data_acquisition_pb2.DataIdentifier()
        stored.CopyFrom(data_id)
        with self._lock:
            if self._size + content.ByteSize() > _MOST_BYTES:
                raise InvalidRequestError(f"the store of captures is full: it takes {_MOST_BYTES // 1024**2} MiB")
            self._size += content.ByteSize()
            stored.id = len(self._captures) + 1
            self._captures.append(Capture(stored, kind, content))
        return stored

    def find(self, fits: Callable[[Capture], bool] = lambda _: True) -> list[Capture]:
        """Captures that fit, the oldest first."""
        with self._lock:
            return [each for each in self._captures if fits(each)]


def _of_actions(capture: Capture, action_ids: Sequence[Any]) -> bool:
    """True when a capture belongs to one of the actions, by the fields that each of them gives."""
    own = capture.data_id.action_id
    return any(all(getattr(own, name.name) == value for name, value in each.ListFields()) for each in action_ids)


def _in_time(capture: Capture, time_range: Any) -> bool:
    """True when the action of a capture has a time within the range, which may have one end."""
    at_s = seconds(capture.data_id.action_id.timestamp)
    ends = not time_range.HasField("to_timestamp") or at_s <= seconds(time_range.to_timestamp)
    return ends and at_s >= seconds(time_range.from_timestamp)


def _fits(query: Any) -> Callable[[Capture], bool]:
    """Returns a function that tells whether a capture fits a query by time or by actions."""
    if query.WhichOneof("query") == "time_range":
        return lambda each: _in_time(each, query.time_range)
    if query.WhichOneof("query") == "action_ids":
        return lambda each: _of_actions(each, query.action_ids.action_ids)
    return lambda _: True


def _actions(captures: Sequence[Capture]) -> list[Any]:
    """The actions of captures, each once."""
    return [*{each.data_id.action_id.SerializeToString(): each.data_id.action_id for each in captures}.values()]


def _listing(name: str, kind: str) -> Callable[[Any, Any, Call], Any]:
    """Returns a call that lists the identifiers of captures of a kind."""

    def answer(service: DataAcquisitionStoreService, request: Any, _call: Call) -> Any:
        fits = _fits(request.query)
        found = service.store.find(lambda each: each.kind == kind and fits(each))
        return getattr(data_acquisition_store_pb2, f"{name}Response")(data_ids=[each.data_id for each in found])

    return answer


def _storing(name: str, kind: str, content: Callable[[Any], Message]) -> Callable[[Any, Any, Call], Any]:
    """Returns a call that stores a capture of a client."""

    def answer(service: DataAcquisitionStoreService, request: Any, _call: Call) -> Any:
        stored = service.store.add(kind, request.data_id, content(request))
        return getattr(data_acquisition_store_pb2, f"{name}Response")(id=stored.id)

    return answer


def _data(data: bytes, extension: str) -> Message:
    return data_acquisition_store_pb2.StoredCapturedData(data=data, file_extension=extension)


class DataAcquisitionStoreService(Service):
    """Lists, returns and takes captures."""

    name, type = "data-acquisition-store", "bosdyn.api.DataAcquisitionStoreService"
    authority, checks_values = f"dataacquisitionstore.{DOMAIN}", True

    def __init__(self, store: Store) -> None:
        self.store = store

    ListStoredImages = _listing("ListStoredImages", "image")
    ListStoredMetadata = _listing("ListStoredMetadata", "metadata")
    ListStoredAlertData = _listing("ListStoredAlertData", "alert_data")
    ListStoredData = _listing("ListStoredData", "data")
    StoreImage = _storing("StoreImage", "image", lambda request: request.image)
    StoreMetadata = _storing("StoreMetadata", "metadata", lambda request: request.metadata)
    StoreAlertData = _storing("StoreAlertData", "alert_data", lambda request: request.alert_data)
    StoreData = _storing("StoreData", "data", lambda request: _data(request.data, request.file_extension))

    def StoreDataStream(self, requests: Sequence[Any], _call: Call) -> Any:
        """Stores data that come in chunks."""
        joined = b"".join(each.chunk.data for each in requests)
        stored = self.store.add("data", requests[0].data_id, _data(joined, requests[0].file_extension))
        return data_acquisition_store_pb2.StoreStreamResponse(id=stored.id)

    def ListCaptureActions(self, request: Any, _call: Call) -> Any:
        """Lists the actions that have captures."""
        found = _actions(self.store.find(_fits(request.query)))
        return data_acquisition_store_pb2.ListCaptureActionsResponse(action_ids=found)

    def QueryMaxCaptureId(self, _request: Any, _call: Call) -> Any:
        """Returns the number of the newest capture."""
        return data_acquisition_store_pb2.QueryMaxCaptureIdResponse(max_capture_id=len(self.store.find()))

    def QueryStoredCaptures(self, request: Any, _call: Call) -> Iterator[Any]:
        """Yields the answer with all captures that fit, in chunks."""
        query, made = request.query, data_acquisition_store_pb2.QueryStoredCapturesResponse()
        flags = {"image": "include_images", "data": "include_data", "metadata": "include_metadata"}
        flags["alert_data"] = "include_alerts"
        wanted = {kind for kind, flag in flags.items() if getattr(query, flag)} or set(flags)

        def fits(each: Capture) -> bool:
            timed = not query.HasField("time_range") or _in_time(each, query.time_range)
            acted = not query.action_ids or _of_actions(each, query.action_ids)
            named = not query.channels or each.data_id.channel in query.channels
            return timed and acted and named and each.kind in wanted and each.data_id.id >= query.captures_from_id

        found = self.store.find(fits)
        for each in reversed(found) if query.order_descending else found:
            result = made.results.add(data_id=each.data_id)
            if not query.only_include_identifiers:
                getattr(result, each.kind).CopyFrom(each.content)
        made.action_ids.extend(_actions(found))
        made.max_capture_id = max((each.data_id.id for each in found), default=0)
        made.header.request_header.CopyFrom(request.header)
        made.header.error.code = header_pb2.CommonError.CODE_OK
        yield from chunks(made)


@dataclass
class _Acquisition:
    """One acquisition: its captures by channel and kind, and how far it has come."""

    action_id: Any
    captures: Sequence[tuple[str, str, Callable[[], Message]]]
    status: int = _Status.STATUS_ACQUIRING
    saved: list[Any] = field(default_factory=list)
    errors: list[Any] = field(default_factory=list)


class DataAcquisitionService(Service):
    """Takes pictures and states for the store, one acquisition after the other."""

    name, type, authority = "data-acquisition", "bosdyn.api.DataAcquisitionService", f"dataacquisition.{DOMAIN}"
    checks_values = True

    def __init__(self, images: ImageService, states: Mapping[str, Callable[[Call], Any]], store: Store) -> None:
        """`states` give the values that are stored as metadata, by the name of the capture."""
        self._images, self._states, self._store, self._ids = images, states, store, count(1)
        self._acquisitions, self._worker = dict[int, _Acquisition](), ThreadPoolExecutor(1, "acquisitions")

    def GetServiceInfo(self, _request: Any, call: Call) -> Any:
        """Lists what can be captured."""
        made = data_acquisition_pb2.GetServiceInfoResponse()
        for name in self._states:
            made.capabilities.data_sources.add(name=name, channel_name=name, service_name=self.name)
        sources = self._images.ListImageSources(image_pb2.ListImageSourcesRequest(), call).image_sources
        names = [each.name for each in sources]
        made.capabilities.image_sources.add(
            service_name=self._images.name, image_source_names=names, image_sources=sources
        )
        return made

    def AcquireData(self, request: Any, call: Call) -> Any:
        """Starts an acquisition; one that names an unknown capture captures nothing."""
        action_id, asked = data_acquisition_pb2.CaptureActionId(), request.acquisition_requests
        action_id.CopyFrom(request.action_id)
        if not action_id.HasField("timestamp"):
            action_id.timestamp.CopyFrom(timestamp(call.received_s))
        captures = list[tuple[str, str, Callable[[], Message]]]()
        if request.metadata.data.fields:
            captures.append(("metadata", "metadata", partial(_metadata, action_id, request.metadata)))
        for each in sorted(asked.image_captures, key=lambda capture: capture.order.value):
            picture = image_pb2.ImageRequest(image_source_name=each.image_source, pixel_format=each.pixel_format)
            picture.MergeFrom(each.image_request)
            check_values(picture, "image_request")
            service, source = each.image_service or self._images.name, picture.image_source_name
            if service != self._images.name or not self._images.has(source):
                return _Acquired(status=_Acquired.STATUS_UNKNOWN_CAPTURE_TYPE)
            captures.append((f"{service}-{source}", "image", partial(self._picture, picture)))
        for each in sorted(asked.data_captures, key=lambda capture: capture.order.value):
            if (state := self._states.get(each.name)) is None:
                return _Acquired(status=_Acquired.STATUS_UNKNOWN_CAPTURE_TYPE)
            captures.append((each.name, "metadata", partial(_state, action_id, state, call)))
        if asked.network_compute_captures:
            return _Acquired(status=_Acquired.STATUS_UNKNOWN_CAPTURE_TYPE)
        number, acquisition = next(self._ids), _Acquisition(action_id, captures)
        self._acquisitions[number] = acquisition
        self._acquisitions.pop(number - _KEPT, None)
        self._worker.submit(self._acquire, acquisition)
        return _Acquired(status=_Acquired.STATUS_OK, request_id=number)

    def GetStatus(self, request: Any, _call: Call) -> Any:
        """Tells how far an acquisition has come, and what it has saved."""
        acquisition = self._acquisitions.get(request.request_id)
        if acquisition is None:
            return _Status(status=_Status.STATUS_REQUEST_ID_DOES_NOT_EXIST)
        return _Status(status=acquisition.status, data_saved=acquisition.saved, data_errors=acquisition.errors)

    def CancelAcquisition(self, request: Any, _call: Call) -> Any:
        """Cancels an acquisition that is not complete; what it has saved stays."""
        acquisition = self._acquisitions.get(request.request_id)
        if acquisition is None:
            return _Cancelled(status=_Cancelled.STATUS_REQUEST_ID_DOES_NOT_EXIST)
        if acquisition.status != _Status.STATUS_ACQUIRING:
            return _Cancelled(status=_Cancelled.STATUS_FAILED_TO_CANCEL)
        acquisition.status = _Status.STATUS_ACQUISITION_CANCELLED
        return _Cancelled(status=_Cancelled.STATUS_OK)

    def GetLiveData(self, request: Any, _call: Call) -> Any:
        """Refuses each capture: none has live data."""
        made = data_acquisition_pb2.LiveDataResponse()
        for each in request.data_captures:
            made.live_data.add(name=each.name).status = made.CapabilityLiveData.STATUS_UNKNOWN_CAPTURE_TYPE
        return made

    def _acquire(self, acquisition: _Acquisition) -> None:
        """Captures and saves one after the other, until it is cancelled."""
        for channel, kind, capture in acquisition.captures:
            if acquisition.status != _Status.STATUS_ACQUIRING:
                return
            data_id = data_acquisition_pb2.DataIdentifier(action_id=acquisition.action_id, channel=channel)
            try:
                acquisition.saved.append(self._store.add(kind, data_id, capture()))
            except Exception as failed:  # its reason is for the client
                acquisition.errors.append(
                    data_acquisition_pb2.DataError(data_id=data_id, error_message=str(failed) or repr(failed))
                )
        if acquisition.status == _Status.STATUS_ACQUIRING:
            acquisition.status = _Status.STATUS_DATA_ERROR if acquisition.errors else _Status.STATUS_COMPLETE

    def _picture(self, request: Any) -> Message:
        """Takes a picture. Raises InvalidRequestError with the image service's status when there is none."""
        taken = self._images.take(request)
        if taken.status != image_pb2.ImageResponse.STATUS_OK:
            raise InvalidRequestError(image_pb2.ImageResponse.Status.Name(taken.status))
        shot: Message = taken.shot
        return shot


def _metadata(action_id: Any, metadata: Any) -> Message:
    """Metadata of an action, in the form of the store."""
    reference = data_acquisition_pb2.DataIdentifier(action_id=action_id)
    return data_acquisition_pb2.AssociatedMetadata(reference_id=reference, metadata=metadata)


def _state(action_id: Any, state: Callable[[Call], Any], call: Call) -> Message:
    """A state as metadata of an action."""
    made = data_acquisition_pb2.Metadata()
    made.data.update(state(call))
    return _metadata(action_id, made)


def states_of(states: RobotStateService, objects: WorldObjectService) -> Mapping[str, Callable[[Call], Any]]:
    """Values of the robot's state, by the names of the API's captures."""

    def state(call: Call) -> Any:
        return _values(states.GetRobotState(None, call).robot_state)

    return {
        "robot-state": state,
        "basic-position-data": lambda _: {f"{frame}_tform_body": _values(states.body_in(frame)) for frame in _FIXED},
        "detailed-position-data": lambda call: {"robot_kinematics": state(call)["kinematic_state"]},
        "detected-objects": lambda _: {"world_objects": [_values(each) for each in objects.objects()]},
    }


def _values(message: Message) -> Any:
    return MessageToDict(message, preserving_proto_field_name=True)
