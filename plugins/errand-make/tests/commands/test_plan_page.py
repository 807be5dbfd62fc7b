"""The page of a plan in a browser: a click tells the pose, and its command adds the part there."""

import shlex

import numpy as np
import pytest

from errand_make.worlds.plan_picture import plan_view
from executive import load_world
from executive.words.knowledge import load_knowledge
from tests.executive.cli.calls import done

pytest_plugins = ["tests.browser"]
pytestmark = pytest.mark.browser


@pytest.fixture
def page(own, tmp_path, tab, monkeypatch):
    """The opened page of a world of two rooms."""
    monkeypatch.chdir(tmp_path)
    done("world", "add", "table", "own", "rack", "--in", "room 1")
    said = done("world", "show", "own", "--view", "--out", "plan.png").stdout
    assert "plan.html: open it in a browser" in said
    tab.set_viewport_size({"width": 1280, "height": 900})
    tab.goto((tmp_path / "plan.html").as_uri())
    tab.wait_for_function("document.querySelector('img').complete")
    return tab


@pytest.fixture
def click(page):
    """Clicks a point of the world, or drags the mouse from it towards another."""
    view = plan_view(load_world("own"))

    def spot(x, y):
        box = page.locator("#plan img").bounding_box()
        pixel = view.pixels(np.array([[x, y]]))[0] * box["width"] / view.picture.shape[1]
        return box["x"] + pixel[0], box["y"] + pixel[1]

    def clicked(x, y, towards=None):
        page.mouse.move(*spot(x, y))
        page.mouse.down()
        if towards is not None:
            page.mouse.move(*spot(*towards))
        page.mouse.up()

    return clicked


def command(tab):
    return tab.locator("#command code").inner_text()


def test_a_click_gives_the_pose_and_a_drag_the_direction_of_the_front_also_on_a_telephone(page, click):
    click(5.0, 2.0, towards=(5.0, 3.0))
    numbers = [float(word.strip(",")) for word in page.locator("#place").inner_text().split() if word[0].isdigit()][:3]
    assert numbers == pytest.approx([5.0, 2.0, np.pi / 2.0], abs=0.03)
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    click(4.0, 2.0)
    assert "x 4" in page.locator("#place").inner_text()


def test_the_commands_of_the_page_add_table_object_and_zone_where_one_clicks(page, click):
    page.select_option("#kind", "table")
    page.fill("#name", "lab table")
    click(11.0, -0.4, towards=(11.0, 0.8))
    words = shlex.split(command(page))
    assert words[:5] == ["errand", "world", "add", "table", "own"]
    done(*words[1:])
    # an object lies on the surface that is clicked
    rack = np.array(load_world("own").surfaces["rack"].polygon_W).mean(axis=0)
    page.select_option("#kind", "object")
    page.fill("#name", "coke")
    click(8.0, 2.0)
    assert command(page) == "click a surface: an object lies on one"
    click(*rack)
    assert command(page) == "errand world add object own coke --on rack"
    page.select_option("#kind", "zone")
    page.fill("#name", "wet floor")
    for corner in ((8.0, 1.5), (9.0, 1.5), (9.0, 2.5)):
        click(*corner)
    done(*shlex.split(command(page))[1:])
    known = load_knowledge("own/knowledge.yaml")
    assert np.mean(known.surfaces["lab table"].polygon, axis=0) == pytest.approx([11.0, -0.4], abs=0.05)
    outline = np.array(known.zones["wet floor"].polygon)
    assert outline == pytest.approx(np.array([(8.0, 1.5), (9.0, 1.5), (9.0, 2.5)]), abs=0.03)
