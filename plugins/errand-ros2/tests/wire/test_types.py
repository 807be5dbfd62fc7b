"""Types: their hashes are those of public distributions; messages survive encoding; other bytes are refused."""

import random
from pathlib import Path

import pytest

from errand_ros2.wire.types import INTERFACES, MalformedError, Types, older_types, ros_types
from tests.tables import yaml_beside

HASHES = yaml_beside(__file__, "test_types.yaml")
EXAMPLES = {
    "srv/AddTwoInts.srv": "int64 a\nint64 b\n---\nint64 sum\n",
    "action/Fibonacci.action": "int32 order\n---\nint32[] sequence\n---\nint32[] sequence\n",
}


@pytest.fixture(scope="module")
def types(tmp_path_factory):
    """The shipped types, and example_interfaces, which has the hashes that are known best."""
    folder = tmp_path_factory.mktemp("interfaces")
    for file in INTERFACES.rglob("*.*"):
        (copy := folder / file.relative_to(INTERFACES)).parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(file.read_text())
    for name, text in EXAMPLES.items():
        (file := folder / "example_interfaces" / name).parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return Types(Path(folder))


@pytest.mark.parametrize("name", HASHES["message"])
def test_a_message_has_the_public_hash(types, name):
    assert types.message(name).key.rpartition("/")[2] == f"RIHS01_{HASHES['message'][name]}"


@pytest.mark.parametrize("name", HASHES["service"])
def test_a_service_has_the_public_hash(types, name):
    assert types.service(name).key.rpartition("/")[2] == f"RIHS01_{HASHES['service'][name]}"


@pytest.mark.parametrize("name", HASHES["older service"])
def test_a_service_of_an_older_distribution_has_the_public_hash(name):
    assert older_types().service(name).key.rpartition("/")[2] == f"RIHS01_{HASHES['older service'][name]}"


@pytest.mark.parametrize("name", HASHES["feedback"])
def test_feedback_of_an_action_has_the_public_hash(types, name):
    found = types.message(f"{name}_FeedbackMessage").key.rpartition("/")[2]
    assert found == f"RIHS01_{HASHES['feedback'][name]}"


def test_a_message_survives_encoding():
    kind = ros_types().message("geometry_msgs/msg/PoseStamped")
    message = ros_types().make(kind.name)
    message.pose.position.x, message.header.frame_id = 2.5, "map"
    assert kind.decode(kind.encode(message)) == message


@pytest.mark.parametrize(
    "name", ["nav_msgs/msg/OccupancyGrid", "sensor_msgs/msg/CameraInfo", "action_msgs/msg/GoalInfo"]
)
def test_a_blank_message_can_be_encoded(name):
    kind = ros_types().message(name)
    assert kind.encode(ros_types().make(name))[:4] == b"\0\1\0\0"


@pytest.mark.parametrize(
    "name", ["geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped", "action_msgs/msg/GoalStatusArray"]
)
def test_random_bytes_are_a_message_or_refused(name):
    kind, chance = ros_types().message(name), random.Random(1)
    for _ in range(300):
        data = chance.randbytes(chance.randrange(80))
        try:
            kind.decode(data)
        except MalformedError as error:
            assert name in str(error)
