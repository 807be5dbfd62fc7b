"""Simulated user of a studio: opens pages, types, and sends what a browser's script sends."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

from nicegui import ui
from nicegui.testing.user import User
from nicegui.testing.user_interaction import UserInteraction
from nicegui.testing.user_simulation import user_simulation

from errand_studio.app import register
from errand_studio.workshop import Workshop

WAIT_S: Final = 30.0


class StudioUser:
    """User with one page of a studio."""

    def __init__(self, user: User, workshop: Workshop) -> None:
        self.user, self.workshop = user, workshop
        self.path: list[str | int] | None = None
        user.javascript_rules[re.compile(r".*studio\.path\b(?!.*setTimeout).*", re.DOTALL)] = lambda _: self.path

    async def open(self, address: str) -> None:
        """Opens a page."""
        await self.user.open(address)

    async def send(self, what: str, **values: Any) -> None:
        """Sends an event of the page's script."""
        with self.user:
            layout = self.user.client.layout  # type: ignore[union-attr]
            UserInteraction(self.user, {layout}, None).trigger("studio", {"what": what, **values})
        await asyncio.sleep(0.05)

    @property
    def editor(self) -> ui.codemirror:
        """The editor."""
        return next(iter(self.user.find(ui.codemirror).elements))

    def type(self, text: str) -> None:
        """Replaces the text of the editor."""
        with self.user:
            self.editor.value = text

    async def say(self, sentence: str) -> None:
        """Types a sentence, and asks for its steps."""
        self.user.find(ui.input).type(sentence)
        self.user.find("Add its steps").click()

    def press(self, name: str) -> None:
        """Presses a button."""
        self.user.find(name).click()

    async def until(self, holds: Callable[[], bool]) -> None:
        """Waits until a condition holds."""
        end = asyncio.get_running_loop().time() + WAIT_S
        while not holds():
            assert asyncio.get_running_loop().time() < end, "it never holds"
            await asyncio.sleep(0.05)

    def html(self) -> str:
        """All HTML that panels show."""
        return "\n".join(element.content for element in self.user.find(ui.html).elements)

    async def see(self, text: str) -> str:
        """Waits until a panel, label or notice shows a text; returns the HTML of the panels."""
        end = asyncio.get_running_loop().time() + WAIT_S
        while text not in (shown := self.html()):
            notes = [str(each) for each in self.user.notify.messages]
            with self.user:
                labels = [each.text for each in self.user.find(ui.label).elements]
            if any(text in each for each in (*notes, *labels)):
                return shown
            if asyncio.get_running_loop().time() > end:
                raise AssertionError(f"nothing shows {text!r}: {shown[-2000:]} {notes} {labels}")
            await asyncio.sleep(0.05)
        return shown


@asynccontextmanager
async def studio(folder: Path, out: Path | None = None) -> AsyncIterator[StudioUser]:
    """Starts a studio for a simulated user."""
    async with user_simulation(root=None) as user:
        workshop = Workshop(folder, out or folder / "out")
        register(workshop)
        yield StudioUser(user, workshop)


def play(scenario: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Runs a scenario in a thread of its own, since a browser's tests occupy the event loop of the main one."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(scenario())).result()
