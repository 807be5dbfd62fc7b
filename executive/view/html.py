"""Builds HTML files that need no other file: reports from `templates`, and the replay page of a log."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from executive.record.history import Event
from executive.view.feed import Feed
from executive.view.text import printable

if TYPE_CHECKING:
    from jinja2 import Environment

PAGE_FOLDER: Final = Path(__file__).parent / "page"
_TEMPLATES: Final = Path(__file__).parent / "templates"
_STYLE: Final = re.compile(r'<link rel="stylesheet" href="page/([\w.]+)">')
_SCRIPT: Final = re.compile(r'<script src="page/([\w.]+)" defer></script>\n?')


def render(template: str, **values: Any) -> str:
    """Renders a template with values. Escapes every text; raises jinja2.UndefinedError for a missing value."""
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    def finalized(value: Any) -> Any:
        """Removes control characters from a text; leaves HTML as it is."""
        return printable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=finalized,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(
        clock=clock_text,
        data_address=lambda jpeg: Markup(_data_address("jpeg", jpeg)),
        percent="{:.1%}".format,
        short="{:g}".format,
    )
    return environment


def clock_text(t_s: float) -> str:
    """Formats a time of a run (s) as minutes and seconds."""
    minutes, seconds = divmod(max(0.0, t_s), 60.0)
    return f"{int(minutes)}:{seconds:04.1f}"


def feed_of(events: Sequence[Event]) -> Feed:
    """Returns a feed with all messages of a log."""
    feed = Feed(most=None)
    for event in events:
        feed(event.topic, event.stamp_s, event.data)
    return feed


def log_page(events: Sequence[Event], recording: Path | None = None) -> str:
    """Returns the replay page of a log, with the 3D recording if there is one, as one HTML text."""
    feed = feed_of(events)
    _, texts = feed.since((0, 0))
    pictures = [_data_address(*feed.picture(number)) for number in range(feed.pictures)]
    scene = None if recording is None else recording.read_text(encoding="utf-8")
    page = _file("index.html")
    names = _SCRIPT.findall(page)
    page = _STYLE.sub(lambda match: f"<style>\n{_file(match[1])}</style>", page)
    page = _SCRIPT.sub("", page)
    messages = [json.loads(text) for text in texts]
    recorded = {"messages": messages, "pictures": pictures, "scene": scene}
    # "<" is escaped, so that the JSON can neither end its script element nor begin a comment
    data = json.dumps(recorded, ensure_ascii=True, separators=(",", ":")).replace("<", "\\u003c")
    scripts = "\n".join(_file(name) for name in names)
    body = f'<script id="recorded" type="application/json">{data}</script>\n<script>\n{scripts}</script>\n</body>'
    return f"{page.rsplit('</body>', 1)[0]}{body}\n</html>\n"


def _file(name: str) -> str:
    return (PAGE_FOLDER / name).read_text(encoding="utf-8")


def _data_address(form: str, data: bytes) -> str:
    return f"data:image/{form};base64,{base64.b64encode(data).decode()}"
