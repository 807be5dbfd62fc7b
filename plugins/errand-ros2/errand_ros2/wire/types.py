"""Keys, attachments and type hashes as the design page of rmw_zenoh defines them; types of rosbags and `interfaces`."""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from skills.inputs.errors import InputError

ADMIN: Final = "@ros2_lv"  # where tokens of the graph stand
_GID_BYTES: Final = 16
_ATTACHMENT: Final = struct.Struct("<qqB16s")
_NAME: Final = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
NODE, PUBLISHER, SUBSCRIPTION, SERVICE, CLIENT = "NN", "MP", "MS", "SS", "SC"  # kinds of entities in the graph of ROS 2
INTERFACES: Final = Path(__file__).parents[1] / "interfaces"  # what rosbags lacks, as PACKAGE/KIND/NAME.KIND
_PARTS: Final = re.compile(r"^---$", re.MULTILINE)
_EVENT: Final = "service_msgs/msg/ServiceEventInfo info\n{0}_Request[<=1] request\n{0}_Response[<=1] response"
_SERVICE: Final = "{0}_Request request_message\n{0}_Response response_message\n{0}_Event event_message"
_UUID: Final = "unique_identifier_msgs/UUID goal_id"


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

    def token(self, *of_type: str, kind: str = NODE, number: int | None = None) -> str:
        """Returns the liveliness token of the node, or of one of its entities: with its name, type and quality."""
        numbers = (self.domain, self.session, self.number, self.number if number is None else number)
        parts = (ADMIN, *map(str, numbers), kind, "%", self.namespace, self.name, *of_type[:1])
        return "/".join((*(part.replace("/", "%") for part in parts), *of_type[1:]))

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


def ros_name(type_key: str) -> str:
    """Returns the name of the type, such as `std_msgs/msg/String`, whose name in DDS a key begins with."""
    return type_key.partition("/")[0].replace("::dds_", "").replace("::", "/").rstrip("_")


def topic_name(name: str) -> str:
    """Returns a topic's absolute name. Raises InputError when ROS 2 does not allow it."""
    if _NAME.fullmatch(name) is None:
        raise InputError(f"'{name[:60]}' is no name of ROS 2", hint="use letters, digits, _ and /, as in robot/scan")
    return f"/{name.strip('/')}"


class MalformedError(ValueError):
    """Bytes that are no message of the expected type."""


@dataclass(frozen=True)
class MessageType:
    """Message type: its name, its key, and how its messages are encoded."""

    name: str
    key: str
    types: Types

    def encode(self, message: Any) -> bytes:
        """Returns a message, or a mapping of its fields, as CDR in little-endian order with its header."""
        message = self.types.make(self.name, **message) if isinstance(message, Mapping) else message
        return bytes(self.types.store.serialize_cdr(message, self.name))

    def decode(self, data: bytes, padding: int = 0) -> Any:
        """Reads a message, with so many bytes behind it. Raises MalformedError for bytes that are none of this type."""
        store = self.types.store
        try:
            message = store.deserialize_cdr(data, self.name)
            if len(data) > 4 + store.get_msgdef(self.name).getsize_cdr(0, message, store) + padding:
                raise ValueError("it is too long")
        except Exception as error:  # generated code: struct.error, IndexError, UnicodeDecodeError and others
            raise MalformedError(f"{len(data)} bytes are no {self.name} ({type(error).__name__})") from error
        return message


@dataclass(frozen=True)
class ServiceType:
    """Service type: its key, and the types of its request and response."""

    key: str
    request: MessageType
    response: MessageType


class Types:
    """All known types by name; `ros_types()` returns the shared ones."""

    def __init__(self, folder: Path = INTERFACES) -> None:
        self.store = get_typestore(Stores.ROS2_JAZZY)
        files = [*INTERFACES.glob("*/msg/*.msg"), *folder.glob("*/*/*.*")]
        for file in sorted(files, key=lambda path: path.suffix != ".msg"):
            self._register(file)

    def message(self, name: str) -> MessageType:
        """Returns a message type. Raises KeyError when it is unknown."""
        package, kind, base = name.split("/")
        return MessageType(name, f"{package}::{kind}::dds_::{base}_/{self.store.hash_rihs01(name)}", self)

    def service(self, name: str) -> ServiceType:
        """Returns a service type. Raises KeyError when it is unknown."""
        return ServiceType(self.message(name).key, self.message(f"{name}_Request"), self.message(f"{name}_Response"))

    def make(self, name: str, /, **values: Any) -> Any:
        """Returns a message; mappings become messages, and what is left out is zero or empty.

        Raises KeyError for an unknown type, and TypeError for an unknown field.
        """
        _, fields = self.store.fielddefs[name]
        made = {field: self._value(kind, values.get(field)) for field, kind in fields}
        return self.store.types[name](**values | made)

    def _value(self, kind: Any, given: Any) -> Any:
        """Returns the value of a field of a type as rosbags describes it; None gives its zero."""
        node, what = kind
        if node == Nodetype.NAME:
            return self.make(what, **given or {}) if given is None or isinstance(given, Mapping) else given
        if node == Nodetype.BASE:
            zero = {"string": "", "wstring": "", "bool": False}.get(what[0], 0.0 if "float" in what[0] else 0)
            return zero if given is None else given
        of, length = what
        length = length if node == Nodetype.ARRAY else 0
        if of[0] == Nodetype.NAME or of[1][0] in ("string", "wstring"):
            return [self._value(of, each) for each in ([None] * length if given is None else given)]
        dtype = of[1][0].replace("byte", "uint8")
        return np.zeros(length, dtype) if given is None else np.asarray(given, dtype)

    def _register(self, file: Path) -> None:
        name = f"{file.parts[-3]}/{file.parts[-2]}/{file.stem}"
        parts = [part.strip() for part in _PARTS.split(file.read_text(encoding="utf-8"))]
        if file.suffix == ".msg":
            self.store.fielddefs.pop(name, None)
            self.store.register(get_types_from_msg(parts[0], name))
        elif file.suffix == ".srv":
            self._register_service(name, *parts)
        else:
            self._register_action(name, *parts)

    def _register_service(self, name: str, request: str, response: str) -> None:
        types: dict[str, Any] = {}
        texts = {"_Request": request, "_Response": response, "_Event": _EVENT.format(name), "": _SERVICE.format(name)}
        for suffix, text in texts.items():
            types |= get_types_from_msg(text, name + suffix)
        self.store.register(_as_service(types))

    def _register_action(self, name: str, goal: str, result: str, feedback: str) -> None:
        texts = {"_Goal": goal, "_Result": result, "_Feedback": feedback}
        texts["_FeedbackMessage"] = f"{_UUID}\n{name}_Feedback feedback"
        for suffix, text in texts.items():
            self.store.register(get_types_from_msg(text, name + suffix))
        accepted = "bool accepted\nbuiltin_interfaces/Time stamp"
        self._register_service(f"{name}_SendGoal", f"{_UUID}\n{name}_Goal goal", accepted)
        self._register_service(f"{name}_GetResult", _UUID, f"int8 status\n{name}_Result result")


def _as_service(value: Any) -> Any:
    """Corrects the names of services in parsed types, which rosbags takes for messages."""
    if isinstance(value, str):
        return value.replace("/srv/msg/", "/srv/")
    if isinstance(value, Mapping):
        return {_as_service(name): _as_service(each) for name, each in value.items()}
    return type(value)(map(_as_service, value)) if type(value) in (tuple, list) else value


@cache
def ros_types() -> Types:
    """Returns the types that all nodes of this process share."""
    return Types()


def service_forms(name: str) -> list[ServiceType]:
    """Returns the forms of a service: that of Kilted, and that of distributions before, if it is another."""
    forms = [types.service(name) for types in (ros_types(), older_types()) if f"{name}_Request" in types.store.types]
    return [*{each.key: each for each in forms}.values()]


@cache
def older_types() -> Types:
    """Returns the types that distributions before Kilted have in another form."""
    return Types(INTERFACES.with_name("interfaces_before_kilted"))
