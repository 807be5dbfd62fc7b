"""A browser for the tests of pages: each process of a run starts one Chromium, and its tests share one tab of it."""

import shutil

import pytest

FLAGS = [
    "--disable-gpu",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


@pytest.fixture(scope="session")
def browser():
    """The browser of this process."""
    api = pytest.importorskip("playwright.sync_api", reason="not installed: pip install playwright")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("no chromium was found: apt-get install chromium")
    with api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        yield running
        running.close()


@pytest.fixture(scope="session")
def only_tab(browser):
    return browser.new_page()


@pytest.fixture
def tab(only_tab):
    """A tab as if newly opened, since a new one costs more than most tests; its pages may raise nothing."""
    defects = []

    def note(error):
        defects.append(str(error))

    only_tab.set_viewport_size({"width": 1280, "height": 800})
    only_tab.emulate_media(color_scheme="light")
    only_tab.on("pageerror", note)
    yield only_tab
    if only_tab.url.startswith("http"):
        only_tab.evaluate("localStorage.clear()")
    only_tab.goto("about:blank")
    only_tab.mouse.move(0, 0)
    only_tab.remove_listener("pageerror", note)
    for popup in only_tab.context.pages[1:]:
        popup.close()
    assert defects == []
