"""Getting a real Spot ready, and every ending, with a scripted robot behind a server, both by the robot's time.

not ready         one error that names what is missing
docked            leaves the dock, if the motors may be switched on
ready             lease, policy and motors are held; afterwards only what was there before
exception, signal the same ending
E-stop            pressed or lost: the run ends by it
"""

import os
import signal
import time
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")
from call_faults import Fault
from lock_step import PASSWORD, USER, robot_time, scripted_spot

from errand_spot import backend as real_spot
from errand_spot.adapter import connection, heartbeat
from errand_spot.adapter.connection import CALL_S, Address, Connection
from errand_spot.backend import Access, Spot, connected
from errand_spot.server import computer, estop, identity, keepalive, leases
from errand_spot.server.computer import Motors, Pace
from errand_spot.server.estop import Tablet
from skills.inputs.errors import InputError
from skills.robot import Pose2D, RobotStoppedError


@pytest.fixture
def serve(credentials, monkeypatch, request):
    """Serves a robot, whose time all but a real pace goes by; returns the server, the robot, and the access to it."""
    monkeypatch.setattr(computer, "POWER_ON_S", 0.1)
    settings = {"pace": Pace.CLIENT, **getattr(request, "param", {})}
    with scripted_spot(credentials, **settings) as (server, robot):
        for module in (connection, heartbeat, real_spot, estop, keepalive, leases, request.module):
            if settings["pace"] is Pace.CLIENT:
                monkeypatch.setattr(module, "time", robot_time(server.computer))
        address = Address("127.0.0.1", server.port, credentials.certificate)
        yield SimpleNamespace(server=server, robot=robot, access=Access(address, USER, PASSWORD, power_on=True))


@contextmanager
def ready(serve, **changes):
    """The connection of a robot that is made ready."""
    with connected("Alice", replace(serve.access, **changes)) as made:
        made.make_ready()
        yield made


def beat(made, times):
    """Lets the run beat so often."""
    for _ in range(times):
        made.clock.advance(0.05)


def other_client(serve):
    return Connection(serve.access.address, USER, PASSWORD)


def policies(serve):
    service = next(watch.__self__ for watch in serve.server.computer.watchers)
    assert isinstance(service, keepalive.KeepaliveService)
    return service._live


def holder(serve):
    claim = serve.server.computer.leases._claims.get("mobility")
    return claim and claim.owner.client_name


def is_as_before(serve):
    return (serve.server.computer.motors, holder(serve), len(policies(serve))) == (Motors.OFF, None, 0)


def test_a_ready_robot_stands_and_is_left_as_it_was(serve):
    with ready(serve):
        assert serve.robot.height_m == pytest.approx(0.52, abs=0.02)
        assert (serve.server.computer.motors, holder(serve), len(policies(serve))) == (Motors.ON, "errand", 1)
    assert is_as_before(serve)


def test_motors_that_were_on_stay_on(serve):
    serve.server.computer.do(serve.server.computer.switch_on).result()
    with connected("Alice", replace(serve.access, power_on=False)) as made:
        while not made.robot.powered:
            made.clock.advance(0.05)
        made.make_ready()
    assert (serve.server.computer.motors, holder(serve)) == (Motors.ON, None)


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_error_ends_as_a_run_that_is_done(serve, error):
    with pytest.raises(error), ready(serve):
        raise error
    assert is_as_before(serve)


def test_an_interrupt_before_the_run_ends_as_a_run_that_is_done(serve):
    with pytest.raises(KeyboardInterrupt), connected("Alice", serve.access):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)
    assert is_as_before(serve)


def test_the_motors_are_switched_on_only_with_a_yes(serve):
    with pytest.raises(InputError, match="power_on=yes"), ready(serve, power_on=False):
        pass
    asked = []
    with ready(serve, power_on=False, confirm=lambda question: asked.append(question) or True):
        assert serve.server.computer.motors is Motors.ON
    assert "Switch them on?" in asked[0]


def test_a_docked_robot_leaves_its_dock_only_when_that_is_allowed(serve):
    serve.server.computer.dock_O = Pose2D(0.0, 0.0, 0.0)
    while not serve.server.computer.docked():
        time.sleep(0.05)
    refused = pytest.raises(InputError, match=r"stands on its dock.*power_on=yes")
    with refused, ready(serve, power_on=False, confirm=lambda question: True):
        pass
    assert is_as_before(serve)
    with ready(serve):
        assert serve.robot.pose.x_m > 0.7
        assert serve.robot.height_m == pytest.approx(0.52, abs=0.02)


def test_a_lease_that_another_holds_is_taken_only_when_that_is_allowed(serve):
    other_client(serve).acquire()
    with pytest.raises(InputError, match="take=yes"), connected("Alice", serve.access):
        pass
    with connected("Alice", replace(serve.access, take=True)) as made:
        assert made.robot.lease_holder() is None
    assert holder(serve) is None


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda serve, patch: patch.setattr(identity, "API_VERSION", (3, 2, 0)), "software is 3.2.0.*4.0.0 or later"),
        (lambda serve, patch: setattr(serve.robot, "charge", 0.2), "battery has 20%.*30%"),
        (lambda serve, patch: setattr(serve.robot, "present_faults", ("motor hot",)), "motor hot.*clear it"),
        (lambda serve, patch: patch.setattr(real_spot, "spot_capabilities", without_elbow), "joints arm_knuckle"),
    ],
    ids=["version", "charge", "fault", "joints"],
)
def test_a_robot_that_is_not_fit_is_one_error(serve, monkeypatch, spoil, said):
    spoil(serve, monkeypatch)
    time.sleep(0.2)
    with pytest.raises(InputError, match=said), connected("Alice", serve.access):
        pass
    assert is_as_before(serve)


def without_elbow(whole=real_spot.spot_capabilities):
    can = whole()
    return replace(can, arm=replace(can.arm, joint_names=(*can.arm.joint_names[:-1], "arm_knuckle")))


def test_a_robot_that_answers_slowly_at_first_is_connected(serve, monkeypatch):
    monkeypatch.setattr(connection, "_ROUND_TRIPS", 3)
    slow = Fault(answer_s=1.2 * CALL_S)
    with serve.server.faults.fault("bosdyn.api.TimeSyncService/TimeSyncUpdate", slow), connected("Alice", serve.access):
        pass


@pytest.mark.parametrize("serve", [{"tablet": Tablet.NONE}], indirect=True)
class TestOwnEstop:
    """A robot without a tablet."""

    def test_without_an_estop_the_robot_is_not_ready(self, serve):
        with pytest.raises(InputError, match="estop=own"), ready(serve):
            pass

    def test_our_own_is_released_while_the_run_beats_and_gone_afterwards(self, serve):
        with ready(serve, own_estop=True) as made:
            beat(made, 40)
            assert other_client(serve).estop_trouble() is None
        assert is_as_before(serve)
        assert serve.server.computer.estop._held == {}

    def test_it_does_not_replace_another_while_the_motors_are_on(self, serve):
        with ready(serve, own_estop=True) as made, pytest.raises(InputError, match="motors are on"):
            made.make_ready()

    def test_a_run_whose_estop_another_program_replaces_ends_by_that_cause(self, serve):
        with ready(serve, own_estop=True) as made:
            serve.server.computer.estop._held.clear()
            with pytest.raises(RobotStoppedError, match=r"another program has changed|E-stop is pressed"):
                beat(made, 60)


@pytest.mark.parametrize("serve", [{"tablet": Tablet.NONE, "pace": Pace.REAL}], indirect=True)
def test_our_own_stops_a_run_that_hangs(serve, monkeypatch):
    monkeypatch.setattr(heartbeat, "ESTOP_S", 1.2)
    monkeypatch.setattr(heartbeat, "CUT_S", 1.6)
    with ready(serve, own_estop=True) as made:
        time.sleep(2.0)
        assert serve.server.computer.motors is Motors.OFF
        with pytest.raises(RobotStoppedError, match="E-stop"):
            made.clock.advance(0.05)


def test_the_robot_does_not_act_alone_while_another_client_moves_it(serve):
    with ready(serve) as made:
        other = other_client(serve)
        other.acquire(take=True)
        assert in_time(made.clock, lambda: policies(serve) == {})
        other.give_back()
        assert in_time(made.clock, lambda: made.robot.lease_holder() is None)
        made.robot.acquire_lease("again")
        assert in_time(made.clock, lambda: len(policies(serve)) == 1)
        (live,) = policies(serve).values()
        assert live.policy.actions[0].lease_stale.leases[0] == made.connection.lease


def test_a_lease_that_another_client_takes_is_a_warning_at_once_and_only_one(serve, caplog):
    with ready(serve) as made:
        other = other_client(serve)
        other.acquire(take=True)
        assert in_time(made.clock, lambda: made.robot.lease_holder() is not None)
        assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [
            "Alice: errand has taken the lease; the mission waits"
        ]
        holder = made.robot.lease_holder().holder
        other.give_back()
        beat(made, 4)
        assert holder == "errand"
        assert in_time(made.clock, lambda: made.robot.lease_holder() is None)
    assert len([record for record in caplog.records if record.levelname == "WARNING"]) == 1


def test_the_report_has_the_robots_address_and_serial_number(serve, monkeypatch):
    monkeypatch.setenv("BOSDYN_CLIENT_PASSWORD", PASSWORD)
    place = f"127.0.0.1:{serve.access.address.port}"
    with Spot(user=USER, certificate=serve.access.address.certificate).connect(place, "Alice") as made:
        assert made.notes == (f"Spot at spot://{place}, serial number {identity.SERIAL}.",)


def in_time(clock, true):
    """Lets the run beat until a condition holds, for 4 s at most."""
    for _ in range(80):
        if true():
            return True
        clock.advance(0.05)
    return False


def test_a_pressed_estop_ends_the_run(serve):
    with ready(serve) as made:
        serve.server.computer.estop._held["tablet"].level = 1
        with pytest.raises(RobotStoppedError, match="the E-stop is pressed"):
            beat(made, 20)
        time.sleep(0.05)
        assert serve.server.computer.motors is Motors.OFF


def test_a_robot_acts_alone_when_the_run_falls_silent(serve, monkeypatch):
    monkeypatch.setattr(heartbeat, "LEASE_STALE_S", 1.5)
    monkeypatch.setattr(heartbeat, "MOTORS_OFF_S", 3.0)
    with ready(serve):
        time.sleep(1.8)
        other_client(serve).acquire()
        time.sleep(2.5)
        assert serve.server.computer.motors is Motors.OFF
