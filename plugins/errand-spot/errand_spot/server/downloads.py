"""Downloads of captures by HTTPS, as a ZIP file in the layout of the robot's."""

from __future__ import annotations

import io
import json
import re
import ssl
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit
from zipfile import ZipFile

from bosdyn.api import image_pb2
from google.protobuf.json_format import MessageToDict

from errand_spot.server.data_acquisition import Capture, Store
from errand_spot.server.identity import Credentials

PATH: Final = "/v1/data-buffer/daq-data/"
_NANOS: Final = 10**9
_UNSAFE: Final = re.compile(r'[:*?<>|/\\"]')


class Downloads:
    """Server of the files; it takes the tokens of the API."""

    def __init__(self, store: Store, credentials: Credentials, user_of: Callable[[str], str | None]) -> None:
        """Opens a free port on 127.0.0.1."""

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self._answer()

            def _answer(self) -> None:
                asked = urlsplit(self.path)
                if user_of(self.headers.get("Authorization", "").removeprefix("Bearer ")) is None:
                    self.send_error(HTTPStatus.UNAUTHORIZED)
                elif asked.path.rstrip("/") != PATH.rstrip("/"):
                    self.send_error(HTTPStatus.NOT_FOUND, f"only {PATH} is served")
                else:
                    self._send(parse_qs(asked.query))

            def _send(self, query: dict[str, list[str]]) -> None:
                try:
                    first_s, last_s = (int(query.get(name, [default])[0]) / _NANOS for name, default in _RANGE)
                except ValueError:
                    self.send_error(HTTPStatus.BAD_REQUEST, "from_nsec and to_nsec are whole numbers")
                    return
                found = store.find(lambda each: first_s <= _time_s(each) <= last_s)
                self.send_response(HTTPStatus.OK if found else HTTPStatus.NO_CONTENT)
                packed = zipped(found) if found else b""
                if found:
                    self.send_header("Content-Type", "application/zip")
                    self.send_header("Content-Disposition", 'attachment; filename="download.zip"')
                    self.send_header("Content-Length", str(len(packed)))
                self.end_headers()
                self.wfile.write(packed)

            def log_message(self, *_arguments: Any) -> None:
                """Writes no line for a download."""

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(credentials.certificate, credentials.private_key)
        self._http.socket = context.wrap_socket(self._http.socket, server_side=True)
        self.port = int(self._http.server_address[1])

    @contextmanager
    def running(self) -> Iterator[None]:
        """Answers in a thread of its own."""
        thread = Thread(target=self._http.serve_forever, name="downloads", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._http.shutdown()
            self._http.server_close()
            thread.join()


_RANGE: Final = (("from_nsec", "0"), ("to_nsec", str(10**20)))
"""Parameters of a download, with their defaults (ns)."""


def _time_s(capture: Capture) -> float:
    return float(capture.data_id.action_id.timestamp.ToNanoseconds()) / _NANOS


def zipped(captures: Sequence[Capture]) -> bytes:
    """ZIP file with a folder for each group: pictures and data, and `metadata.json` with the rest, by action."""
    packed, groups, names = io.BytesIO(), dict[str, dict[str, Any]](), set[str]()
    with ZipFile(packed, "w") as archive:
        for each in captures:
            action = each.data_id.action_id
            group = _UNSAFE.sub("-", action.group_name) or "no-group"
            key = action.SerializeToString().hex()
            kinds = groups.setdefault(group, {}).setdefault(
                key, {"action_id": _values(action), "data": {}, "metadata": {}}
            )
            entry = {"data_id": _values(each.data_id)}
            if each.kind in ("image", "data"):
                name, content = _file(each)
                name = name if f"{group}/{name}" not in names else f"{each.data_id.id} {name}"
                names.add(f"{group}/{name}")
                archive.writestr(f"{group}/{name}", content)
                kinds["data"].setdefault(each.data_id.channel, []).append({**entry, "filename": name})
            else:
                value: Any = each.content
                value = value.metadata.data if each.kind == "metadata" else value.alert_data
                kinds["metadata"].setdefault(each.data_id.channel, []).append({**entry, "data": _values(value)})
        for group, actions in groups.items():
            archive.writestr(f"{group}/metadata.json", json.dumps({"actions": [*actions.values()]}, indent=2))
    return packed.getvalue()


def _file(capture: Capture) -> tuple[str, bytes]:
    """Name and content of the file of a picture or of data."""
    content: Any = capture.content
    stem = _UNSAFE.sub("-", f"{capture.data_id.action_id.action_name} {capture.data_id.channel}")
    if capture.kind == "data":
        return stem + _UNSAFE.sub("-", content.file_extension), content.data
    suffix = ".jpg" if content.image.format == image_pb2.Image.FORMAT_JPEG else ".raw"
    return stem + suffix, content.image.data


def _values(message: Any) -> Any:
    return MessageToDict(message, preserving_proto_field_name=True)
