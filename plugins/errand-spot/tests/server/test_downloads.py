"""Captures as a ZIP file by HTTPS, as the SDK's client asks for it."""

import json
from urllib.error import HTTPError
from urllib.request import Request, urlopen
from zipfile import ZipFile

import pytest
from bosdyn.api import data_acquisition_pb2, data_acquisition_store_pb2, image_pb2
from bosdyn.client import data_acquisition_helpers as helpers

from errand_spot.messages import timestamp
from errand_spot.server.data_acquisition import Store
from errand_spot.server.downloads import PATH, Downloads

TOKEN = "right"


def stored():
    """A store with two actions of one group, and one of another."""
    store = Store()
    for at_s, group, action in ((100.0, "round", "pump"), (200.0, "round", "tank"), (300.0, "later", "pump")):
        made = data_acquisition_pb2.CaptureActionId(action_name=action, group_name=group, timestamp=timestamp(at_s))
        shot = image_pb2.ImageCapture(image={"data": action.encode(), "format": image_pb2.Image.FORMAT_JPEG})
        store.add("image", data_acquisition_pb2.DataIdentifier(action_id=made, channel="image-back"), shot)
        metadata = data_acquisition_pb2.AssociatedMetadata()
        metadata.metadata.data.update({"by": "Robin"})
        store.add("metadata", data_acquisition_pb2.DataIdentifier(action_id=made, channel="metadata"), metadata)
    return store


@pytest.fixture
def port(credentials):
    downloads = Downloads(stored(), credentials, {TOKEN: "user"}.get)
    with downloads.running():
        yield downloads.port


def between(first_s, last_s):
    span = {"from_timestamp": timestamp(first_s), "to_timestamp": timestamp(last_s)}
    return data_acquisition_store_pb2.DataQueryParams(time_range=span)


def test_the_captures_of_a_time_come_in_a_folder_for_each_group(port, tmp_path):
    assert helpers.download_data_REST(between(50.0, 250.0), f"127.0.0.1:{port}", TOKEN, str(tmp_path))
    with ZipFile(tmp_path / "REST" / "download.zip") as archive:
        assert sorted(archive.namelist()) == [
            "round/metadata.json",
            "round/pump image-back.jpg",
            "round/tank image-back.jpg",
        ]
        assert archive.read("round/pump image-back.jpg") == b"pump"
        pump, tank = json.loads(archive.read("round/metadata.json"))["actions"]
    assert pump["data"]["image-back"][0]["filename"] == "pump image-back.jpg"
    assert (tank["action_id"]["action_name"], tank["metadata"]["metadata"][0]["data"]) == ("tank", {"by": "Robin"})


def test_a_time_without_captures_gives_no_file(port, tmp_path):
    assert not helpers.download_data_REST(between(400.0, 500.0), f"127.0.0.1:{port}", TOKEN, str(tmp_path))


@pytest.mark.parametrize(
    ("path", "token", "status"),
    [(PATH, "wrong", 401), ("/v1/logs/", TOKEN, 404), (f"{PATH}?from_nsec=today", TOKEN, 400)],
)
def test_a_wrong_token_path_or_time_is_refused(port, path, token, status):
    request = Request(f"https://127.0.0.1:{port}{path}", headers={"Authorization": f"Bearer {token}"})
    with pytest.raises(HTTPError) as refused:
        urlopen(request, context=helpers.ssl._create_unverified_context())
    assert refused.value.code == status
