"""Key expressions, liveliness tokens and attachments, as the design page of rmw_zenoh defines them."""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass
from typing import Final, NamedTuple

from skills.inputs.errors import InputError

_ADMIN: Final = "@ros2_lv"
_GID_BYTES: Final = 16
_ATTACHMENT: Final = struct.Struct("<qqB16s")
_NAME: Final = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_TYPE: Final = re.compile(r"(?P<package>\w+)/(?P<kind>msg|srv|action)/(?P<name>\w+)")
NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT = "NN", "MP", "MS", "SS", "SC"  # kinds of entities in the graph of ROS 2


@dataclass(frozen=True)
class Qos:
    """Quality of service: how many messages are kept, whether late subscribers get them, and reliability."""

    depth: int = 10
    transient_local: bool = False
    reliable: bool = True

    def text(self) -> str:
        """Returns the compact form of liveliness tokens, in which defaults are left out."""
        reliability, durability = "" if self.reliable else "2", "1" if self.transient_local else ""
        return f"{reliability}:{durability}:,{self.depth}:,:,:,,"


USUAL: Final = Qos()
LATCHED: Final = Qos(depth=1, transient_local=True)  # late subscribers get the last message, as of `/map`
SENSOR: Final = Qos(depth=5, reliable=False)  # messages may be lost


@dataclass(frozen=True)
class NodeKey:
    """Node: its domain, session, number within the session, namespace and name."""

    domain: int
    session: str
    number: int
    namespace: str
    name: str

    def token(self, number: int | None = None, kind: str = NODE, *of_type: str) -> str:
        """Returns the liveliness token of the node, or of one of its entities."""
        number = self.number if number is None else number
        head = (_ADMIN, str(self.domain), self.session, str(self.number), str(number), kind)
        return "/".join((*head, "%", _mangled(self.namespace) or "%", self.name, *of_type))

    def entity_token(self, kind: str, number: int, name: str, type_key: str, qos: Qos) -> str:
        """Returns the liveliness token of one of the node's publishers, subscriptions, services or clients."""
        return self.token(number, kind, _mangled(name), type_key, qos.text())

    def data_key(self, name: str, type_key: str) -> str:
        """Returns the key expression of a topic or service; `type_key` is DDS_NAME/HASH of its type."""
        return f"{self.domain}/{name.strip('/')}/{type_key}"


class Attachment(NamedTuple):
    """Attachment of a message: its number, the time (ns since 1970) when it was sent, and the sender's identity."""

    number: int
    stamp_ns: int
    gid: bytes

    def encoded(self) -> bytes:
        """Returns the attachment as bytes."""
        return _ATTACHMENT.pack(self.number, self.stamp_ns, _GID_BYTES, self.gid)

    @classmethod
    def decoded(cls, data: bytes) -> Attachment:
        """Reads an attachment. Raises ValueError when it is malformed."""
        if len(data) != _ATTACHMENT.size or (found := _ATTACHMENT.unpack(data))[2] != _GID_BYTES:
            raise ValueError(f"an attachment of {len(data)} bytes")
        return cls(found[0], found[1], found[3])


def gid_of(token: str) -> bytes:
    """Returns the identity of an entity, which no other has: a hash of its liveliness token."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_BYTES).digest()


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def dds_name(ros_name: str) -> str:
    """Returns the name in DDS of a type such as `std_msgs/msg/String`. Raises ValueError when it is no type."""
    if (found := _TYPE.fullmatch(ros_name)) is None:
        raise ValueError(f"'{ros_name}' is no type of ROS 2")
    return f"{found['package']}::{found['kind']}::dds_::{found['name']}_"


def topic_name(name: str) -> str:
    """Returns a topic's absolute name. Raises InputError when ROS 2 does not allow it."""
    if _NAME.fullmatch(name) is None:
        raise InputError(f"'{name[:60]}' is no name of ROS 2", hint="use letters, digits, _ and /, as in robot/scan")
    return f"/{name.strip('/')}"
