"""Programs that name an address and a login of their own, and interpreters without a fitting SDK."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from lock_step import PASSWORD, USER, scripted_spot

from errand_spot import launch
from errand_spot.commands import LAUNCH

PROGRAM = """
import bosdyn.client
from bosdyn.api.data_acquisition_pb2 import AcquisitionRequestList, DataCapture
from bosdyn.api.data_acquisition_store_pb2 import DataQueryParams, TimeRangeQuery
from bosdyn.client.data_acquisition_helpers import acquire_and_process_request, download_data_REST
from google.protobuf.timestamp_pb2 import Timestamp
from bosdyn.api.robot_command_pb2 import RobotCommandResponse
from bosdyn.client.robot_command import UnsupportedError

sdk = bosdyn.client.create_standard_sdk("own")
sdk.load_robot_cert("no-such-file.pem")
robot = sdk.create_robot("192.168.80.3")
robot.authenticate("spot", "password of its own robot")
print("state:", robot.ensure_client("robot-state").get_robot_state().battery_states[0].identifier)
acquisition = robot.ensure_client("data-acquisition")
capture = AcquisitionRequestList(data_captures=[DataCapture(name="basic-position-data")])
assert acquire_and_process_request(acquisition, capture, "group", "action", data_timestamp=Timestamp(seconds=9))
span = TimeRangeQuery(to_timestamp=Timestamp(seconds=99))
print("downloaded:", download_data_REST(DataQueryParams(time_range=span), "192.168.80.3", robot.user_token))
error = UnsupportedError(RobotCommandResponse(message="a roll is not simulated"))
print(f"{error} or {error!r}")
"""


def test_a_program_with_its_own_address_and_login_reaches_the_server_and_says_what_is_refused(tmp_path, credentials):
    (tmp_path / "own.py").write_text(PROGRAM)
    with scripted_spot(credentials, downloads=True) as (server, _):
        user = {"BOSDYN_CLIENT_USERNAME": USER, "BOSDYN_CLIENT_PASSWORD": PASSWORD}
        done = subprocess.run(
            [sys.executable, LAUNCH, str(server.certificate), str(server.port), "real", str(tmp_path / "own.py")],
            env={**user, "SPOT_HTTPS_PORT": str(server.downloads.port)},
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
    assert "state: simulated" in done.stdout, done.stderr
    assert "downloaded: True" in done.stdout, done.stdout
    assert done.stdout.count("a roll is not simulated") == 2, done.stdout


@pytest.mark.parametrize(
    ("found", "said"), [("3.1.2.1", "3.1.2.1 is too old; at least 3.2.0"), (None, "is missing"), ("3.2.0", None)]
)
def test_an_interpreter_whose_sdk_is_too_old_is_told_the_least_version(monkeypatch, found, said):
    def version(_name):
        if found is None:
            raise PackageNotFoundError
        return found

    monkeypatch.setattr(launch, "version", version)
    if said is None:
        launch.refuse_old_sdk()
        return
    with pytest.raises(SystemExit) as ended:
        launch.refuse_old_sdk()
    assert said in str(ended.value)
