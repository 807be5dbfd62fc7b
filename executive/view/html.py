"""Renders the reports from the templates in `templates`: HTML files that need no script and no other file."""

from __future__ import annotations

import base64
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from executive.view.text import printable

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup

__all__ = ["render"]

_TEMPLATES: Final = Path(__file__).parent / "templates"


def render(template: str, **values: Any) -> str:
    """The HTML that a template makes of values. Every text is escaped; a missing value raises jinja2.UndefinedError."""
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_finalized,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(clock=clock_text, data_address=_data_address, percent="{:.1%}".format)
    return environment


def _finalized(value: Any) -> Any:
    """A text without control characters; what is HTML already stays as it is."""
    return printable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value


def clock_text(t_s: float) -> str:
    """A time of a run as minutes and seconds."""
    minutes, seconds = divmod(max(0.0, t_s), 60.0)
    return f"{int(minutes)}:{seconds:04.1f}"


def _data_address(jpeg: bytes) -> Markup:
    from markupsafe import Markup

    return Markup(f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}")
