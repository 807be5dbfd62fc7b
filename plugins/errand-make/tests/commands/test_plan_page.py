"""The page of a plan in a browser: a click tells the pose, and its command adds the part there."""

import shlex

import numpy as np
import pytest

from errand_make.worlds.plan_picture import plan_view
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.executive.cli.calls import done
from tests.executive.view.conftest import browser  # noqa: F401

pytestmark = pytest.mark.browser


@pytest.fixture
def page(own, tmp_path, browser, monkeypatch):  # noqa: F811
    """The opened page of a world of two rooms; clicks are in metres."""
    monkeypatch.chdir(tmp_path)
    done("world", "add", "table", "own", "rack", "--in", "room 1")
    said = done("world", "show", "own", "--view", "--out", "plan.png").stdout
    assert "plan.html: open it in a browser" in said
    tab = browser.new_page(viewport={"width": 1280, "height": 900})
    errors = []
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.goto((tmp_path / "plan.html").as_uri())
    tab.wait_for_function("document.querySelector('img').complete")
    yield tab
    assert errors == []
    tab.close()


def spot(tab, x, y):
    """Point of the window at a point of the world."""
    view = plan_view(load_world("own"))
    box = tab.locator("#plan img").bounding_box()
    pixel = view.pixels(np.array([[x, y]]))[0] * box["width"] / view.picture.shape[1]
    return box["x"] + pixel[0], box["y"] + pixel[1]


def click(tab, x, y, towards=None):
    tab.mouse.move(*spot(tab, x, y))
    tab.mouse.down()
    if towards is not None:
        tab.mouse.move(*spot(tab, *towards))
    tab.mouse.up()


def command(tab):
    return tab.locator("#command code").inner_text()


def test_a_click_gives_the_pose_and_a_drag_the_direction_of_the_front(page):
    click(page, 5.0, 2.0, towards=(5.0, 3.0))
    numbers = [float(word.strip(",")) for word in page.locator("#place").inner_text().split() if word[0].isdigit()][:3]
    assert numbers == pytest.approx([5.0, 2.0, np.pi / 2.0], abs=0.03)


def test_the_command_of_the_page_adds_the_table_there(page):
    page.select_option("#kind", "table")
    page.fill("#name", "lab table")
    click(page, 11.0, -0.4, towards=(11.0, 0.8))
    words = shlex.split(command(page))
    assert words[:5] == ["errand", "world", "add", "table", "own"]
    done(*words[1:])
    corners = np.array(load_knowledge("own/knowledge.yaml").surfaces["lab table"].polygon)
    assert corners.mean(axis=0) == pytest.approx([11.0, -0.4], abs=0.05)


def test_an_object_goes_on_the_surface_that_is_clicked_and_a_zone_has_the_clicked_corners(page):
    rack = np.array(load_world("own").surfaces["rack"].polygon_W).mean(axis=0)
    page.select_option("#kind", "object")
    page.fill("#name", "coke")
    click(page, 8.0, 2.0)
    assert command(page) == "click a surface: an object lies on one"
    click(page, *rack)
    assert command(page) == "errand world add object own coke --on rack"
    page.select_option("#kind", "zone")
    page.fill("#name", "wet floor")
    for corner in ((8.0, 1.5), (9.0, 1.5), (9.0, 2.5)):
        click(page, *corner)
    done(*shlex.split(command(page))[1:])
    outline = np.array(load_knowledge("own/knowledge.yaml").zones["wet floor"].polygon)
    assert outline == pytest.approx(np.array([(8.0, 1.5), (9.0, 1.5), (9.0, 2.5)]), abs=0.03)


def test_the_page_fits_a_telephone(page):
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    click(page, 5.0, 2.0)
    assert "x 5" in page.locator("#place").inner_text()
