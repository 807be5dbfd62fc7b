"""Studio in a real browser: one process, one tab, the way from an empty folder to a checked mission."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser import browser, only_tab, tab  # noqa: F401 - fixtures

TEXT = "name: round\n# the round\nsteps:\n  - to: hall  # first\n  - to: kitchen\n"
_WAIT_MS = 60_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("missions")
    (made / "round.yaml").write_text(TEXT)
    return made


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    """Address of a studio."""
    command = [sys.executable, "-u", "-m", "executive.cli", "studio", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        yield found[0]
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0


@pytest.fixture
def page(tab: Any, address: str, folder: Path) -> Any:  # noqa: F811
    (folder / "round.yaml").write_text(TEXT)
    (folder / ".round.draft.yaml").unlink(missing_ok=True)
    tab.set_default_timeout(_WAIT_MS)
    tab.goto(address)
    tab.goto(f"{address.split('?')[0]}?file=round.yaml")
    tab.wait_for_function("() => window.studio?.editor && document.querySelector('.messages [data-look=success]')")
    return tab


def text_of(page: Any) -> str:
    """Returns the text in the editor."""
    return str(page.evaluate("studio.editor.state.doc.toString()"))


def wait_for_text(page: Any, text: str) -> None:
    """Waits until the editor has a text."""
    page.wait_for_function("(text) => studio.editor.state.doc.toString() === text", arg=text)


def test_a_mission_is_made_by_mouse_alone(page: Any, folder: Path) -> None:
    page.get_by_role("button", name="New").click()
    page.get_by_placeholder("name of the file").fill("by_mouse")
    page.get_by_role("button", name="Create").click()
    page.wait_for_function("() => studio.editor.state.doc.toString().startsWith('name: by mouse')")
    for key in ("speak", "if", "repeat", "grasp"):
        before = text_of(page)
        page.locator(".pick", has_text=re.compile(f"^{key}$")).click()
        page.wait_for_function("(before) => studio.editor.state.doc.toString() !== before", arg=before)
        page.wait_for_timeout(300)
    rows = page.locator(".outline li[data-list='0']")
    assert rows.count() == 8
    rows.nth(0).drag_to(rows.nth(7))
    page.wait_for_function("() => document.querySelectorAll('.outline li')[0].textContent.includes('speak')")
    page.get_by_role("button", name="Save").click()
    page.wait_for_function("() => document.querySelector('.pill')?.textContent.startsWith('checked')")
    assert "to: start" in (folder / "by_mouse.yaml").read_text()


def test_step_node_and_line_select_each_other(page: Any) -> None:
    page.locator(".outline li", has_text="kitchen").click()
    page.wait_for_selector(".tree .row.chosen")
    assert "kitchen" in page.locator(".tree .row.chosen").first.inner_text()
    assert page.evaluate("studio.editor.state.doc.lineAt(studio.editor.state.selection.main.head).number") == 5
    page.locator(".tree .row[data-line='4']").first.click()
    assert "hall" in page.locator(".outline li.chosen").inner_text()


def test_keys_edit_the_outline_and_undo_takes_it_back(page: Any) -> None:
    page.locator(".outline li", has_text="hall").click()
    page.keyboard.press("Alt+ArrowDown")
    wait_for_text(page, "name: round\n# the round\nsteps:\n  - to: kitchen\n  - to: hall  # first\n")
    page.wait_for_timeout(300)
    page.keyboard.press("Alt+ArrowUp")
    wait_for_text(page, TEXT)
    page.wait_for_timeout(300)
    page.keyboard.press("d")
    page.wait_for_function("() => document.querySelectorAll('.outline li').length === 3")
    page.locator(".cm-content").click()
    page.keyboard.press("Control+z")
    wait_for_text(page, TEXT)


def test_a_name_is_completed(page: Any) -> None:
    page.locator(".cm-content").click()
    page.keyboard.press("Control+End")
    page.keyboard.type("  - to: offi")
    page.wait_for_selector(".cm-tooltip-autocomplete")
    page.wait_for_timeout(200)
    page.keyboard.press("Enter")
    page.wait_for_function("() => studio.editor.state.doc.toString().includes('- to: office')")
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+z")


def test_two_browsers_see_each_others_saves(page: Any, browser: Any, address: str, folder: Path) -> None:  # noqa: F811
    context = browser.new_context()
    other = context.new_page()
    other.goto(address)
    other.goto(f"{address.split('?')[0]}?file=round.yaml")
    other.wait_for_function("() => window.studio?.editor")
    (folder / "round.yaml").write_text(TEXT)
    other.evaluate(
        "studio.editor.dispatch({changes: {from: studio.editor.state.doc.length, insert: '  - to: office\\n'}})"
    )
    other.wait_for_timeout(500)
    other.keyboard.press("Control+s")
    page.wait_for_function("() => studio.editor.state.doc.toString().endsWith('office\\n')")
    context.close()


@pytest.mark.parametrize(
    "address_of", ["/", "/board", "/compare?a=..&b=..", "/picture?run=..&name=x.png", "/_nicegui/x"]
)
def test_nothing_is_open_without_the_token(tab: Any, address: str, address_of: str) -> None:  # noqa: F811
    bare = tab.context.browser.new_context()
    assert bare.request.get(address.split("/?")[0] + address_of).status == 403
    bare.close()


def test_the_page_fits_a_phone(page: Any) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_timeout(200)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
