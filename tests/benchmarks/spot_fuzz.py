"""Hard inputs to the server of Spot's API: malformed messages over all calls, idle clients, a message of 100 MB.

    python -m tests.benchmarks.spot_fuzz [--messages 10000] [--clients 1000] [--seed 1]

Of five messages one is random bytes, one is mutated, and three have random values in random fields, often with the
lease, the clock and the frames that count. The robot moves exactly as commanded, with its motors on. Prints JSON:
how many answers had which gRPC code, error and header; calls that failed inside; errors in the log of the server; and
whether a new client is served beside all that are idle.
"""

import logging
import random
import tempfile
import threading
import time
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

import grpc
from bosdyn.api import estop_pb2, header_pb2
from bosdyn.api.spot.robot_command_pb2 import MobilityParams
from google.protobuf import descriptor_pool
from google.protobuf.message_factory import GetMessageClass

from errand_spot.adapter.connection import Address, Connection
from errand_spot.server.calls import service_calls
from errand_spot.server.computer import Motors
from errand_spot.server.identity import credentials
from errand_spot.server.server import SERVICES
from tests.benchmarks.harness import command
from tests.benchmarks.spot_kills import PASSWORD, USER, server_of

LARGE = 100 * 1024**2
FLOATS = (float("nan"), float("inf"), float("-inf"), -1e30, 1e30, 0.0)
FRAMES = ("body", "odom", "vision", "hand", "flat_body")
TEXTS = ("", "body", "odom", "hand", "moon", "hand_color_image", "hand_depth", "velodyne-point-cloud", "\0" * 5)
INTEGERS = (0, 1, 2, 7, 2**20, 2**31 - 1)
_DEEPEST, _REVIVED_EVERY, _STRANGE = 8, 50, 0.05
_COMMAND = ("bosdyn.api.RobotCommandService", "RobotCommand")


class Errors(logging.Handler):
    def __init__(self):
        super().__init__(logging.WARNING)
        self.texts = []

    def emit(self, record):
        self.texts.append(logging.Formatter().format(record))


class Fuzz:
    """Malformed messages for all calls of a server, by a seed."""

    def __init__(self, connection, seed):
        self._connection, self._rng = connection, random.Random(seed)
        self.calls = [(each.type, call) for each in SERVICES for call in service_calls(each)]

    def message(self, input_type):
        rng, kind = self._rng, self._rng.randrange(5)
        if kind == 0:
            return rng.randbytes(rng.randrange(80))
        data = bytearray(self._filled(input_type, 0).SerializeToString())
        if kind == 1 and data:
            for _ in range(rng.randrange(1, 6)):
                data[rng.randrange(len(data))] = rng.randrange(256)
            del data[rng.randrange(len(data)) if rng.random() < 0.3 else len(data) :]
        return bytes(data)

    def _filled(self, described, depth):
        """A message with random values in random fields; of fields that exclude each other it has one."""
        made, rng = GetMessageClass(described)(), self._rng
        usual = rng.random() > _STRANGE
        if described.full_name == "bosdyn.api.Lease" and usual:
            made.CopyFrom(self._connection.lease)
            return made
        if described.full_name == "google.protobuf.Timestamp" and usual:
            made.FromNanoseconds(round((self._connection.robot_time_s() + rng.uniform(-0.5, 5.0)) * 1e9))
            return made
        if described.full_name == "google.protobuf.Any" and usual:
            made.Pack(self._filled(MobilityParams.DESCRIPTOR, depth))
            return made
        chosen = {rng.choice(each.fields).name for each in described.oneofs}
        for field in described.fields:
            alone = field.containing_oneof is None
            is_map = field.message_type is not None and field.message_type.GetOptions().map_entry
            lacks = rng.random() < (0.15 if depth < 2 else 0.4) if alone else field.name not in chosen
            if depth > _DEEPEST or is_map or lacks:
                continue
            values = [self._value(field, depth) for _ in range(rng.randrange(1, 4) if field.is_repeated else 1)]
            if field.is_repeated:
                getattr(made, field.name).extend(values)
            elif field.message_type is not None:
                getattr(made, field.name).CopyFrom(values[0])
            else:
                setattr(made, field.name, values[0])
        return made

    def _value(self, field, depth):
        rng, usual = self._rng, self._rng.random() > _STRANGE
        if field.message_type is not None:
            return self._filled(field.message_type, depth + 1)
        if field.name == "clock_identifier" and usual:
            return self._connection.clock_identifier
        if field.enum_type is not None:
            return rng.choice(field.enum_type.values).number if usual else 99
        if field.type == field.TYPE_BYTES:
            return rng.randbytes(8)
        if field.cpp_type == field.CPPTYPE_STRING:
            return rng.choice(FRAMES if usual and "frame" in field.name else TEXTS)
        if field.cpp_type in (field.CPPTYPE_FLOAT, field.CPPTYPE_DOUBLE):
            return rng.uniform(-1.0, 1.0) if usual else rng.choice(FLOATS)
        return rng.random() < 0.5 if field.cpp_type == field.CPPTYPE_BOOL else rng.choice(INTEGERS)


def revive(computer, connection):
    """Releases the E-stop, takes the lease, clears the fault of a fall and switches the motors on."""
    computer.estop.level = lambda: int(estop_pb2.ESTOP_LEVEL_NONE)
    connection.acquire(take=True)
    computer.do(lambda: setattr(computer, "fault", None)).result()
    computer.do(lambda: setattr(computer, "motors", Motors.ON)).result()
    computer.do(computer.step).result()


def fuzz(computer, connection, channel, count, seed):
    """Sends messages, half of them commands; returns the kinds of the answers, and the calls that failed inside."""
    made, codes, inside = Fuzz(connection, seed), Counter(), []
    for number in range(count):
        if number % _REVIVED_EVERY == 0:
            revive(computer, connection)
        service, call = made.calls[number // 2 % len(made.calls)] if number % 2 else _COMMAND
        method = descriptor_pool.Default().FindMethodByName(f"{service}.{call}")
        data = made.message(method.input_type)
        try:
            answers = channel.unary_stream(f"/{service}/{call}")(data, timeout=10.0)
            answer = GetMessageClass(method.output_type).FromString(next(answers))
            answers.cancel()  # a stream goes on
            headed = "header" in answer.DESCRIPTOR.fields_by_name  # a chunk of data has none
            error = answer.header.error if headed else header_pb2.CommonError(code=header_pb2.CommonError.CODE_OK)
            codes[header_pb2.CommonError.Code.Name(error.code)] += 1
            if error.code == header_pb2.CommonError.CODE_INTERNAL_SERVER_ERROR:
                inside.append(f"{service}/{call}: {error.message}")
        except grpc.RpcError as error:
            codes[error.code().name] += 1
            if error.code() is not grpc.StatusCode.INVALID_ARGUMENT:
                inside.append(f"{service}/{call}: {error.code().name} {error.details()}")
    return codes, inside


def large_request(channel):
    try:
        channel.unary_unary("/bosdyn.api.DataBufferService/RecordDataBlobs")(bytes(LARGE), timeout=30.0)
    except grpc.RpcError as error:
        return str(error.code().name)
    return "OK"


def idle_clients(port, certificate, count):
    """Opens connections, each of a client of its own, that stay idle."""
    trusted = grpc.ssl_channel_credentials(certificate.read_bytes())
    options = (("grpc.ssl_target_name_override", "api.spot.robot"), ("grpc.use_local_subchannel_pool", 1))
    channels = [grpc.secure_channel(f"127.0.0.1:{port}", trusted, options) for _ in range(count)]
    for channel in channels:
        grpc.channel_ready_future(channel).result(timeout=60.0)
    return channels


@contextmanager
def standing():
    """A server with a robot that stands, stepped in a thread; a connection with its lease, and a channel."""
    with tempfile.TemporaryDirectory() as folder:
        held, stopping = credentials(Path(folder)), threading.Event()
        server = server_of(True, held)
        stepping = threading.Thread(target=server.computer.run, args=(stopping,))
        with server.running():
            stepping.start()
            try:
                connection = Connection(Address("127.0.0.1", server.port, held.certificate), USER, PASSWORD)
                connection.synchronise()
                connection.acquire()
                connection.power(True)
                yield server, connection, connection._robot.ensure_secure_channel("api.spot.robot")
                assert stepping.is_alive()
                assert connection.state().robot_state.kinematic_state.joint_states
            finally:
                stopping.set()
                stepping.join()


def measure(messages: int = 10_000, clients: int = 1000, seed: int = 1):
    logging.getLogger().addHandler(errors := Errors())
    with standing() as (server, connection, channel):
        begun_s = time.monotonic()
        codes, inside = fuzz(server.computer, connection, channel, messages, seed)
        took_s = time.monotonic() - begun_s
        large = large_request(channel)
        idle = idle_clients(server.port, server.certificate, clients)
        begun_s = time.monotonic()
        Connection(Address("127.0.0.1", server.port, server.certificate), USER, PASSWORD).state()
        served_s = time.monotonic() - begun_s
        for each in idle:
            each.close()
    return {
        "messages": sum(codes.values()),
        "took_s": round(took_s, 1),
        "codes": codes,
        "inside": inside[:20],
        "large": large,
        "idle_clients": len(idle),
        "new_client_served_s": round(served_s, 2),
        "logged": [text.splitlines()[-1] for text in errors.texts[:20]],
    }


if __name__ == "__main__":
    command(measure)
