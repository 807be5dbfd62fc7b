"""Key expressions, liveliness tokens and attachments, as the design page of rmw_zenoh defines them."""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from skills.inputs.errors import InputError

_ADMIN: Final = "@ros2_lv"
_GID_BYTES: Final = 16
_HEAD: Final = struct.Struct("<qqB")
_NAME: Final = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_TYPE: Final = re.compile(r"(?P<package>\w+)/(?P<kind>msg|srv|action)/(?P<name>\w+)")
MOST_DOMAIN: Final = 232
"""Largest ROS domain."""


class EntityKind(StrEnum):
    """Kind of an entity in the graph of ROS 2."""

    NODE = "NN"
    PUBLISHER = "MP"
    SUBSCRIPTION = "MS"
    SERVICE = "SS"
    CLIENT = "SC"


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


LATCHED: Final = Qos(depth=1, transient_local=True)
"""Late subscribers get the last message, as of `/map`."""
SENSOR: Final = Qos(depth=5, reliable=False)
"""Messages of sensors, which may be lost."""


@dataclass(frozen=True)
class TypeKey:
    """Type as key expressions name it: its name in DDS and its RIHS01 hash."""

    dds_name: str
    type_hash: str


@dataclass(frozen=True)
class NodeKey:
    """Node: its domain, session, number within the session, namespace and name."""

    domain: int
    session: str
    number: int
    namespace: str
    name: str

    def token(self) -> str:
        """Returns the node's liveliness token."""
        return "/".join(self._parts(self.number, EntityKind.NODE))

    def entity_token(self, kind: EntityKind, number: int, name: str, type_key: TypeKey, qos: Qos) -> str:
        """Returns the liveliness token of one of the node's publishers, subscriptions, services or clients."""
        of_type = (mangled(name), type_key.dds_name, type_key.type_hash, qos.text())
        return "/".join((*self._parts(number, kind), *of_type))

    def _parts(self, number: int, kind: EntityKind) -> tuple[str, ...]:
        head = (_ADMIN, str(self.domain), self.session, str(self.number), str(number))
        return (*head, kind.value, "%", mangled(self.namespace) or "%", self.name)

    def data_key(self, name: str, type_key: TypeKey) -> str:
        """Returns the key expression of a topic or service."""
        return f"{self.domain}/{name.strip('/')}/{type_key.dds_name}/{type_key.type_hash}"


@dataclass(frozen=True)
class Attachment:
    """Attachment of a message: its number, the time (ns since 1970) when it was sent, and the sender's identity."""

    number: int
    stamp_ns: int
    gid: bytes

    def encoded(self) -> bytes:
        """Returns the attachment as bytes."""
        return _HEAD.pack(self.number, self.stamp_ns, len(self.gid)) + self.gid

    @classmethod
    def decoded(cls, data: bytes) -> Attachment:
        """Reads an attachment. Raises ValueError when it is malformed."""
        if len(data) != _HEAD.size + _GID_BYTES:
            raise ValueError(f"an attachment of {len(data)} bytes")
        number, stamp_ns, length = _HEAD.unpack_from(data)
        if length != _GID_BYTES:
            raise ValueError(f"an identity of {length} bytes")
        return cls(number, stamp_ns, data[_HEAD.size :])


def gid_of(token: str) -> bytes:
    """Returns the identity of an entity, which no other has: a hash of its liveliness token."""
    return hashlib.blake2b(token.encode(), digest_size=_GID_BYTES).digest()


def mangled(name: str) -> str:
    """Returns a name as one chunk of a key expression."""
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
