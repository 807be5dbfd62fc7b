"""Pictures and states that clients acquire, and the store."""

import threading
import time

import pytest
from bosdyn.api import data_acquisition_pb2, data_acquisition_store_pb2, image_pb2
from bosdyn.client.data_acquisition import DataAcquisitionClient, RequestIdDoesNotExistError, UnknownCaptureTypeError
from bosdyn.client.data_acquisition_helpers import acquire_and_process_request
from bosdyn.client.data_acquisition_store import DataAcquisitionStoreClient
from bosdyn.client.image import build_image_request

from errand_spot.messages import timestamp
from errand_spot.server import data_acquisition
from errand_spot.server.computer import Pace

PACE, SHARED = Pace.CLIENT, True
Status, Query = data_acquisition_pb2.GetStatusResponse, data_acquisition_store_pb2.QueryParameters


def requests(*sources, states=()):
    made = data_acquisition_pb2.AcquisitionRequestList()
    for source in sources:
        made.image_captures.add(image_service="image", image_request=build_image_request(source))
    for name in states:
        made.data_captures.add(name=name)
    return made


@pytest.fixture
def acquire(spot):
    return spot.robot.ensure_client(DataAcquisitionClient.default_service_name)


@pytest.fixture
def store(spot):
    return spot.robot.ensure_client(DataAcquisitionStoreClient.default_service_name)


def actions(group):
    ids = [data_acquisition_pb2.CaptureActionId(group_name=group)]
    return data_acquisition_store_pb2.DataQueryParams(action_ids={"action_ids": ids})


def test_pictures_and_states_are_acquired_and_queried_by_action(acquire, store):
    asked = requests("back_fisheye_image", "hand_color_image", states=["robot-state", "detailed-position-data"])
    assert acquire_and_process_request(acquire, asked, "round", "pump", {"by": "Robin"})
    found = store.query_stored_captures(Query(action_ids=[{"group_name": "round", "action_name": "pump"}]))
    kinds = {each.data_id.channel: each.WhichOneof("result") for each in found.results}
    states = dict.fromkeys(("robot-state", "detailed-position-data", "metadata"), "metadata")
    assert kinds == {"image-back_fisheye_image": "image", "image-hand_color_image": "image", **states}
    values = {each.data_id.channel: each.metadata.metadata.data for each in found.results}
    assert values["metadata"]["by"] == "Robin"
    assert "joint_states" in values["robot-state"]["kinematic_state"]
    assert [each.action_name for each in store.list_capture_actions(actions("round"))] == ["pump"]
    assert [each.channel for each in store.list_stored_images(actions("round"))] == [*kinds][1:3]
    assert store.query_max_capture_id() == max(each.data_id.id for each in found.results)


def test_a_picture_is_that_of_the_image_service(acquire, store, spot):
    assert acquire_and_process_request(acquire, requests("hand_color_image"), "one", "picture")
    (found,) = store.query_stored_captures(Query(channels=["image-hand_color_image"], order_descending=True)).results[
        :1
    ]
    seen = spot.robot.ensure_client("image").get_image_from_sources(["hand_color_image"])[0].shot
    assert (found.image.image.cols, found.image.frame_name_image_sensor) == (640, seen.frame_name_image_sensor)
    assert len(found.image.image.data) > 1000


# a capture that is not served
UNKNOWN = {
    "state": requests(states=["GPS"]),
    "camera": requests("periscope"),
    "service": data_acquisition_pb2.AcquisitionRequestList(image_captures=[{"image_service": "spot-cam-image"}]),
    "network": data_acquisition_pb2.AcquisitionRequestList(network_compute_captures=[{}]),
}


@pytest.mark.parametrize("unknown", UNKNOWN)
def test_an_unknown_capture_is_refused_and_nothing_is_captured(acquire, store, unknown):
    before = store.query_max_capture_id()
    with pytest.raises(UnknownCaptureTypeError):
        acquire.acquire_data(UNKNOWN[unknown], "action", "group")
    assert store.query_max_capture_id() == before


def test_a_picture_that_cannot_be_taken_is_a_data_error(acquire):
    asked = requests("back_fisheye_image")
    asked.image_captures[0].image_request.resize_ratio = 2.0
    number = acquire.acquire_data(asked, "action", "group")
    while (told := acquire.get_status(number)).status == Status.STATUS_ACQUIRING:
        time.sleep(0.05)
    error = told.data_errors[0]
    assert (told.status, error.error_message) == (Status.STATUS_DATA_ERROR, "STATUS_UNSUPPORTED_RESIZE_RATIO_REQUESTED")
    assert error.data_id.channel == "image-back_fisheye_image"


def test_a_cancelled_acquisition_saves_no_more(acquire, store, monkeypatch):
    taking = threading.Event()
    monkeypatch.setattr(data_acquisition.DataAcquisitionService, "_picture", lambda *_: taking.wait(5.0) and shot())
    number = acquire.acquire_data(requests(*["back_fisheye_image"] * 5), "long", "cancelled")
    assert acquire.cancel_acquisition(number).status == data_acquisition_pb2.CancelAcquisitionResponse.STATUS_OK
    taking.set()
    assert acquire_and_process_request(acquire, requests("back_fisheye_image"), "later", "later")  # it waits its turn
    assert acquire.get_status(number).status == Status.STATUS_ACQUISITION_CANCELLED
    assert len(store.list_stored_images(actions("cancelled"))) <= 1


def shot():
    return image_pb2.ImageCapture()


def test_an_unknown_number_does_not_exist(acquire):
    with pytest.raises(RequestIdDoesNotExistError):
        acquire.get_status(12345)
    with pytest.raises(RequestIdDoesNotExistError):
        acquire.cancel_acquisition(12345)


def test_the_service_names_what_can_be_captured(acquire):
    told = acquire.get_service_info()
    assert "back_fisheye_image" in told.image_sources[0].image_source_names
    assert [each.name for each in told.data_sources] == [
        *("robot-state", "basic-position-data", "detailed-position-data", "detected-objects")
    ]


def test_a_client_stores_captures_of_its_own(store):
    action = data_acquisition_pb2.CaptureActionId(action_name="own", group_name="mine", timestamp=timestamp(1000.0))
    data_id = data_acquisition_pb2.DataIdentifier(action_id=action, channel="text")
    store.store_data(b"hello", data_id, ".txt")
    store.store_data_as_chunks(b"x" * 5_000_000, data_id, ".bin")
    store.store_image(shot(), data_id)
    store.store_metadata(data_acquisition_pb2.AssociatedMetadata(), data_id)
    timed = {"from_timestamp": timestamp(999.0), "to_timestamp": timestamp(1001.0)}
    found = store.query_stored_captures(Query(time_range=timed, include_data=True)).results
    assert [(len(each.data.data), each.data.file_extension) for each in found] == [(5, ".txt"), (5_000_000, ".bin")]
    listed = data_acquisition_store_pb2.DataQueryParams(time_range=timed)
    assert len(store.list_stored_data(listed)) == 2
    assert len(store.list_stored_metadata(listed)) == len(store.list_stored_images(listed)) == 1
    assert not store.query_stored_captures(Query(time_range=timed, only_include_identifiers=True)).results[0].data.data


def test_a_full_store_takes_no_more(store, monkeypatch):
    monkeypatch.setattr(data_acquisition, "_MOST_BYTES", 10)
    with pytest.raises(Exception, match="full"):
        store.store_data(b"x" * 20, data_acquisition_pb2.DataIdentifier())
