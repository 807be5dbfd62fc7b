"""Parts that all pages of the studio have: style, bar, buttons, and how errors are shown."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from nicegui import ui

from executive.view.html import PAGE_FOLDER
from skills.inputs.errors import InputError

PAGE: Final = Path(__file__).parent / "page"
_COLOURS: Final = re.compile(r":root[^{]*\{[^}]*\}")


def style_sheet() -> str:
    """Returns the studio's style, with the colours of the live page."""
    colours = "\n".join(_COLOURS.findall((PAGE_FOLDER / "page.css").read_text(encoding="utf-8")))
    return f"{colours}\n{(PAGE / 'studio.css').read_text(encoding='utf-8')}"


def frame(title: str, here: str) -> None:
    """Builds the head of a page: style, script and the bar with links to the pages."""
    ui.add_css(style_sheet())
    ui.add_head_html(f"<script>{(PAGE / 'studio.js').read_text(encoding='utf-8')}</script>")
    ui.page_title(title)
    with ui.element("header").classes("bar"):
        ui.html("<b>errand studio</b>", sanitize=False)
        for name, address in (("Missions", "/"), ("Board", "/board")):
            ui.link(name, address).classes("here" if name == here else "")


def panel(kind: str = "grow") -> ui.element:
    """Builds a panel."""
    return ui.element("section").classes(f"panel {kind}")


def head(title: str = "") -> ui.element:
    """Builds the head of a panel; what is added stands at its right, or at its left if there is no title."""
    with ui.element("div").classes("head") as made:
        if title:
            ui.html(f"<h2>{title}</h2>", sanitize=False)
            ui.element("span").classes("spring")
    return made


class Notice:
    """Question above the text of a page, until it is answered."""

    def __init__(self) -> None:
        self._bar = ui.element("div").classes("notice")
        self.hide()

    @property
    def is_shown(self) -> bool:
        """Returns whether a question waits for its answer."""
        return bool(self._bar.visible)

    def hide(self) -> None:
        """Takes the question back."""
        self._bar.set_visibility(False)

    def ask(self, text: str, answers: Mapping[str, Callable[[], object]]) -> None:
        """Asks a question; each answer is a button."""
        self._bar.clear()
        with self._bar:
            ui.label(text)
            for name, act in answers.items():
                tool(name, self.hide).on_click(act)
        self._bar.set_visibility(True)


def tool(text: str, on_click: Callable[..., Any] | None = None, *, hint: str = "", kind: str = "") -> ui.button:
    """Builds a button in the form of the live page."""
    button = (
        ui.button(text, on_click=on_click, color=None).props("flat dense no-caps :ripple=false").classes(f"tool {kind}")
    )
    if hint:
        button.props(f'title="{hint}"')
    return button


def refused(error: InputError) -> None:
    """Shows an error to the user."""
    hint = f" - {error.hint}" if error.hint else ""
    ui.notify(f"{error.message}{hint}", type="negative", position="top", multi_line=True)
