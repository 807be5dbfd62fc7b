"""A log as a page: fed to a server, or written as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from executive.record.reader import Event
from executive.view.feed import Feed
from executive.view.page_files import PAGE_FOLDER

_STYLE: Final = re.compile(r'<link rel="stylesheet" href="page/([\w.]+)">')
_SCRIPT: Final = re.compile(r'<script src="page/([\w.]+)" defer></script>\n?')


def fed(events: Sequence[Event]) -> Feed:
    """A feed that holds a whole log."""
    feed = Feed(most=None)
    for event in events:
        feed(event.topic, event.stamp_s, event.data)
    return feed


def to_html(events: Sequence[Event], recording: Path | None = None) -> str:
    """The page with the log in it, and with the 3D recording when there is one."""
    feed = fed(events)
    _, texts = feed.since((0, 0))
    pictures = [_data_address(feed, number) for number in range(feed.pictures)]
    scene = None if recording is None else recording.read_text(encoding="utf-8")
    page = (PAGE_FOLDER / "index.html").read_text(encoding="utf-8")
    names = _SCRIPT.findall(page)
    page = _STYLE.sub(lambda match: f"<style>\n{_file(match[1])}</style>", page)
    page = _SCRIPT.sub("", page)
    messages = [json.loads(text) for text in texts]
    data = _inert({"messages": messages, "pictures": pictures, "scene": scene})
    scripts = "\n".join(_file(name) for name in names)
    body = f'<script id="recorded" type="application/json">{data}</script>\n<script>\n{scripts}</script>\n</body>'
    return f"{page.rsplit('</body>', 1)[0]}{body}\n</html>\n"


def _file(name: str) -> str:
    return (PAGE_FOLDER / name).read_text(encoding="utf-8")


def _data_address(feed: Feed, number: int) -> str:
    form, data = feed.picture(number)
    return f"data:image/{form};base64,{base64.b64encode(data).decode()}"


def _inert(value: Any) -> str:
    """JSON that cannot end the script element that it stands in, nor begin a comment."""
    return json.dumps(value, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")
