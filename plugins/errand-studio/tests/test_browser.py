"""Studio in a real browser: one process and one tab; what users do, and what happens to them meanwhile."""

from __future__ import annotations

import http.client
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidHandshake
from websockets.sync.client import connect

pytest_plugins = ["tests.browser"]

TEXT = "name: round\n# the round\nsteps:\n  - to: hall  # first\n  - to: kitchen\n"
OFFICE, BEDROOM = TEXT + "  - to: office\n", TEXT + "  - to: bedroom\n"
EVIL = "<img src=x onerror=window.evil=1>"
_WAIT_MS = 20_000
_READY = "() => window.studio?.editor && document.querySelector('.outline li') && document.querySelector('.pill')"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made: Path = tmp_path_factory.mktemp("missions")
    return made


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address of a studio, and its process."""
    command = [sys.executable, "-u", "-m", "executive.cli", "studio", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        yield found[0], process
        was_killed = process.poll() is not None
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0 or was_killed


@pytest.fixture
def address(server: tuple[str, subprocess.Popen[str]]) -> str:
    return server[0]


@pytest.fixture
def file(folder: Path, request: pytest.FixtureRequest) -> Path:
    """Mission file of the test, the only one in the folder; pages of earlier tests may still keep drafts of theirs."""
    for each in folder.glob("*.yaml"):
        each.unlink()
    made = folder / f"{re.sub(r'[^a-z]+', '_', request.node.name)}.yaml"
    made.write_text(TEXT)
    return made


@pytest.fixture
def page(tab: Any, address: str, file: Path) -> Any:
    return opened(tab, address)


def opened(page: Any, address: str) -> Any:
    """Opens the mission in a tab, and waits for its check."""
    page.set_default_timeout(_WAIT_MS)
    page.goto(address)
    page.wait_for_function(_READY)
    return page


def text_of(page: Any) -> str:
    """Returns the text in the editor."""
    return str(page.evaluate("studio.editor.state.doc.toString()"))


def wait_for_text(page: Any, text: str) -> None:
    """Waits until the editor has a text."""
    page.wait_for_function("(text) => studio.editor.state.doc.toString() === text", arg=text)


def wait_for_chosen(page: Any, text: str, line: int) -> None:
    """Waits until a step on a line is chosen, and the outline takes keys again."""
    page.locator(f".outline li.chosen[data-line='{line}']", has_text=text).wait_for()
    page.wait_for_function("() => studio.edits === 0")


def type_text(page: Any, text: str) -> None:
    """Replaces the text in the editor, and waits until the server has it."""
    page.evaluate(
        "(text) => studio.editor.dispatch({changes: {from: 0, to: studio.editor.state.doc.length, insert: text}})", text
    )
    page.get_by_text("not saved", exact=True).wait_for()


def test_a_mission_is_made_in_an_empty_folder_by_mouse_alone(page: Any, address: str, file: Path) -> None:
    file.unlink()
    page.goto(address)
    page.get_by_text("no steps yet").wait_for()
    for key, rows in (("speak", 2), ("if", 5), ("repeat", 7), ("grasp", 8)):
        page.locator(".pick", has_text=re.compile(f"^{key}$")).click()
        page.wait_for_function(f"() => document.querySelectorAll('.outline li[data-list=\"0\"]').length === {rows}")
        page.locator(".outline li.chosen", has_text=key).wait_for()
    steps = page.locator(".outline li[data-list='0']")
    steps.nth(0).drag_to(steps.nth(7))
    page.wait_for_function("() => document.querySelectorAll('.outline li')[0].textContent.includes('speak')")
    page.get_by_role("button", name="Save").click()
    page.get_by_text("not saved", exact=True).wait_for(state="hidden")
    page.wait_for_function("() => document.querySelector('.pill')?.textContent.startsWith('checked')")
    assert (
        file.with_name("mission.yaml")
        .read_text()
        .endswith("  - to: start\n  - {to: kitchen counter, do: grasp, object: coke}\n")
    )


def test_a_new_file_keeps_the_draft_of_the_one_before(page: Any, file: Path) -> None:
    type_text(page, OFFICE)
    page.get_by_role("button", name="New").click()
    page.get_by_placeholder("name of the file").fill("other")
    page.get_by_role("button", name="Create").click()
    wait_for_text(page, "name: other\nsteps:\n  - to: start\n")
    page.locator(".files li", has_text=file.name).click()
    page.get_by_role("button", name="Take it").click()
    wait_for_text(page, OFFICE)


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
    wait_for_chosen(page, "hall", 5)
    page.locator(".outline li.chosen").click()
    page.keyboard.press("Alt+ArrowUp")
    wait_for_text(page, TEXT)
    wait_for_chosen(page, "hall", 4)
    page.wait_for_timeout(600)  # CodeMirror undoes edits within half a second together
    page.locator(".outline li.chosen").click()
    page.keyboard.press("d")
    wait_for_text(page, TEXT.replace("  - to: hall  # first\n", "  - to: hall  # first\n" * 2))
    page.locator(".cm-content").click()
    page.keyboard.press("Control+z")
    wait_for_text(page, TEXT)


def test_a_name_is_completed(page: Any) -> None:
    page.locator(".cm-content").click()
    page.keyboard.press("Control+End")
    page.keyboard.type("  - to: offi")
    page.wait_for_selector(".cm-tooltip-autocomplete")
    page.wait_for_timeout(100)  # CodeMirror takes no key before
    page.keyboard.press("Enter")
    page.wait_for_function("() => studio.editor.state.doc.toString().includes('- to: office')")


def test_a_change_outside_is_loaded_where_all_is_saved(page: Any, file: Path) -> None:
    file.write_text(OFFICE)
    wait_for_text(page, OFFICE)


@pytest.mark.parametrize(
    ("answer", "kept"), [("Load it", OFFICE), ("Overwrite it", BEDROOM)], ids=["load", "overwrite"]
)
def test_a_change_outside_asks_where_text_is_unsaved(page: Any, file: Path, answer: str, kept: str) -> None:
    type_text(page, BEDROOM)
    file.write_text(OFFICE)
    page.get_by_text("The file has changed").wait_for()
    assert (text_of(page), file.read_text()) == (BEDROOM, OFFICE)
    page.get_by_role("button", name=answer).click()
    page.get_by_text("not saved", exact=True).wait_for(state="hidden")
    assert (text_of(page), file.read_text()) == (kept, kept)


def test_a_file_that_is_gone_is_written_again(page: Any, file: Path) -> None:
    file.unlink()
    page.get_by_role("button", name="Write it again").click()
    page.get_by_text("The file is gone").wait_for(state="hidden")
    assert file.read_text() == TEXT


def test_two_browsers_see_each_others_saves_and_overwrite_none(
    page: Any,
    browser: Any,
    address: str,
    file: Path,
) -> None:
    context = browser.new_context()
    other = opened(context.new_page(), address)
    type_text(other, OFFICE)
    other.keyboard.press("Control+s")
    wait_for_text(page, OFFICE)
    type_text(other, TEXT)
    type_text(page, BEDROOM)
    other.keyboard.press("Control+s")
    page.keyboard.press("Control+s")
    page.get_by_text("since you opened it").wait_for()
    assert file.read_text() == TEXT
    context.close()


def test_broken_yaml_keeps_the_outline(page: Any) -> None:
    type_text(page, TEXT + "  - {to: office\n")
    page.locator(".messages li", has_text="YAML").wait_for()
    page.wait_for_selector(".cm-line.bad-line")
    assert page.locator(".outline li").count() == 2


def test_an_unknown_skill_is_mended_by_its_button(page: Any) -> None:
    type_text(page, TEXT + "  - skill: stwo\n")
    page.locator(".messages li[data-line='6'] .fix").click()
    wait_for_text(page, TEXT + "  - skill: stow\n")
    page.locator(".messages [data-look='success']").wait_for()


def test_no_script_of_a_mission_runs(page: Any) -> None:
    type_text(page, f"name: '{EVIL}'\nsteps:\n  - speak: '{EVIL}'\n  - to: '{EVIL}'\n")
    page.locator(".messages li[data-line='4']").wait_for()
    type_text(page, f"name: '{EVIL}'\nsteps:\n  - speak: '{EVIL}'\n")
    page.locator(".tree .row", has_text=EVIL).first.wait_for()
    assert page.evaluate("window.evil") is None


def test_a_draft_is_offered_when_the_page_is_opened_again(page: Any, file: Path) -> None:
    type_text(page, OFFICE)
    page.wait_for_selector(".outline li:nth-child(3)")
    page.locator(".outline li.step").nth(2).click()
    page.reload()
    page.wait_for_function(_READY)
    page.get_by_role("button", name="Take it").click()
    wait_for_text(page, OFFICE)
    assert file.read_text() == TEXT


def test_the_page_fits_a_phone(page: Any) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.wait_for_function("() => innerWidth === 390")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390


@pytest.mark.mission
def test_a_run_shows_its_live_page_stops_at_a_breakpoint_and_ends(page: Any, file: Path) -> None:
    type_text(page, "name: round\nsteps:\n  - speak: One.\n  - speak: Two.\n")
    page.locator(".tree .row", has_text="Two.").first.wait_for()
    page.locator(".outline .dot[data-stop='4']").click()
    page.locator(".dot[aria-pressed='true']").wait_for()
    page.keyboard.press("Control+Enter")
    live = page.frame_locator("iframe.live")
    live.get_by_text("paused").first.wait_for()
    page.keyboard.press("Control+Enter")
    page.get_by_text(f"{file.name} runs already").wait_for()
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text(f"{file.name}: cancelled").wait_for()
    page.get_by_role("button", name="Close the page").click()
    page.wait_for_function("() => !document.querySelector('iframe.live')")


def sent(address: str, method: str, path: str, **headers: str) -> http.client.HTTPResponse:
    """Sends a request with the token's cookie as bare bytes, and returns the answer."""
    host = re.findall(r"//([^/]*)", address)[0]
    link = http.client.HTTPConnection(host)
    cookie = f"errand_studio_{host.rpartition(':')[2]}={address.partition('token=')[2]}"
    link.request(
        method, path, headers={"cookie": cookie, **headers}, body=b"2\r\n{}\r\n0\r\n\r\n" if method == "POST" else None
    )
    return link.getresponse()


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("GET", "/", {"cookie": ""}, 403),
        ("GET", "/board", {"cookie": ""}, 403),
        ("GET", "/compare?a=..&b=..", {"cookie": ""}, 403),
        ("GET", "/_nicegui/x", {"cookie": ""}, 403),
        ("GET", "/", {"origin": "http://evil.example"}, 403),
        ("GET", "/", {"host": "evil.example"}, 403),
        ("GET", "/picture?run=../..&name=x.png", {}, 404),
        ("GET", "/_nicegui/../../../../../../etc/passwd", {}, 404),
        ("POST", "/complete", {"content-length": "20000000"}, 413),
        ("POST", "/complete", {"transfer-encoding": "chunked"}, 413),
    ],
)
def test_a_hostile_request_is_refused(
    address: str, method: str, path: str, headers: dict[str, str], status: int
) -> None:
    assert sent(address, method, path, **headers).status == status


@pytest.mark.parametrize("origin", [None, "http://evil.example"])
def test_a_hostile_websocket_is_refused(address: str, origin: Any) -> None:
    host = re.findall(r"//([^/]*)", address)[0]
    cookie = f"errand_studio_{host.rpartition(':')[2]}={address.partition('token=')[2]}"
    headers = {"cookie": cookie} if origin else {}
    place = f"ws://{host}/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    with pytest.raises(InvalidHandshake, match="403"), connect(place, additional_headers=headers, origin=origin):
        pass
    with connect(place, additional_headers={"cookie": cookie}, proxy=None) as own:
        assert "sid" in str(own.recv())


def test_a_file_of_20_mb_is_not_opened(page: Any, file: Path) -> None:
    big = file.with_name("big.yaml")
    big.write_bytes(b"#" * 20_000_000)
    page.reload()
    page.get_by_text("big.yaml").click()
    page.get_by_role("alert").wait_for()
    big.unlink()
    assert page.locator(".cm-content").count() == 1


def test_a_killed_server_leaves_the_draft(page: Any, server: tuple[str, subprocess.Popen[str]], file: Path) -> None:
    type_text(page, OFFICE)
    page.locator(".outline li", has_text="office").wait_for()
    server[1].kill()
    server[1].wait()
    page.get_by_text("Connection lost").wait_for()
    assert text_of(page) == OFFICE
    assert file.with_name(f".{file.stem}.draft.yaml").read_text() == OFFICE
