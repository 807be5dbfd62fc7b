"""Key expressions, tokens and attachments in the form of the examples on rmw_zenoh's design page."""

import pytest

from errand_ros2.wire.types import SUBSCRIPTION, Attachment, NodeKey, Qos, gid_of, ros_name, ros_types, topic_name
from skills.inputs.errors import InputError

CHATTER = "std_msgs::msg::dds_::String_/RIHS01_df66"
NODE = NodeKey(2, "aac3178e146ba6f1fc6e6a4085e77f21", 0, "/", "listener")


def test_a_node_has_the_token_of_the_design_page():
    assert NODE.token() == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"


def test_a_subscription_has_the_token_of_the_design_page():
    token = NODE.token("/chatter", CHATTER, Qos().text(), kind=SUBSCRIPTION, number=10)
    head = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener"
    assert token == f"{head}/%chatter/{CHATTER}/::,10:,:,:,,"


def test_a_namespace_is_one_chunk_of_the_token_and_a_path_of_the_key():
    node = NodeKey(0, "s", 1, "/robot1", "talker")
    assert "/NN/%/%robot1/talker" in node.token()
    assert node.data_key("/robot1/chatter", CHATTER) == f"0/robot1/chatter/{CHATTER}"


@pytest.mark.parametrize(
    ("qos", "text"),
    [
        (Qos(), "::,10:,:,:,,"),
        (Qos(depth=7), "::,7:,:,:,,"),
        (Qos(depth=1, transient_local=True), ":1:,1:,:,:,,"),
        (Qos(depth=5, reliable=False), "2::,5:,:,:,,"),
    ],
)
def test_defaults_of_the_quality_of_service_are_left_out(qos, text):
    assert qos.text() == text


def test_an_attachment_is_33_bytes_in_little_endian_order():
    data = Attachment(1, 2, bytes(range(16))).encoded()
    assert data == b"\1" + bytes(7) + b"\2" + bytes(7) + b"\x10" + bytes(range(16))
    assert Attachment.decoded(data) == Attachment(1, 2, bytes(range(16)))


@pytest.mark.parametrize("data", [b"", b"x" * 16, bytes(33), bytes(34), b"\xff" * 33])
def test_a_malformed_attachment_is_refused(data):
    with pytest.raises(ValueError, match="bytes"):
        Attachment.decoded(data)


def test_entities_have_different_identities():
    assert len(gid_of("a")) == 16
    assert gid_of("a") != gid_of("b")


def test_a_type_has_its_name_in_dds():
    key = ros_types().message("geometry_msgs/msg/Twist").key
    assert key.startswith("geometry_msgs::msg::dds_::Twist_/RIHS01_") and ros_name(key) == "geometry_msgs/msg/Twist"


@pytest.mark.parametrize("name", ["", "/", "1a", "a//b", "a b", "a/*", "a%", "ä"])
def test_a_name_that_ros_does_not_allow_is_refused(name):
    with pytest.raises(InputError, match="no name"):
        topic_name(name)
