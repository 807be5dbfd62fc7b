"""The plan of a world shows its parts where they are, with coordinates."""

import numpy as np
import pytest

from errand_make.worlds import plan_picture
from errand_make.worlds.plan_picture import draw_world
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.zone import ZoneFacts
from skills.map_drawing import ZONE_COLOURS


@pytest.fixture(scope="module")
def flat():
    """The flat with a silent hall."""
    world = open_world("flat")
    silent = {"quiet": ZoneFacts(kind="silent", place="hall")}
    return world, knowledge_of(world).with_zones(silent)


def places_of(picture, colour, view):
    """Middle (x, y) in metres of the pixels of a colour above the legend."""
    rows, columns = np.nonzero((picture[: view.picture.shape[0]] == colour).all(axis=2))
    zero, scale = view.pixels(np.zeros((1, 2)))[0], view.pixels_per_m
    return (np.median(columns) - zero[0]) / scale, (zero[1] - np.median(rows)) / scale


def test_people_dock_and_surfaces_are_drawn_where_they_are(flat):
    world, knowledge = flat
    picture, view = draw_world(world, knowledge), plan_picture.plan_view(world)
    assert picture.shape[1] == plan_picture.WIDTH_PX
    assert places_of(picture, plan_picture._DOCK, view) == pytest.approx((10.9, 4.95), abs=0.15)
    assert places_of(picture, plan_picture._PERSON, view) == pytest.approx((10.4, 4.0), abs=0.15)
    for x, y in ((1.0, 8.4), (9.2, 1.6), (11.2, 6.9)):  # corners of workbench, coffee table and kitchen table
        column, row = view.pixels(np.array([[x, y]]))[0].round().astype(int)
        assert tuple(picture[row, column]) == plan_picture._TOP


def test_zones_are_outlined_and_explained_in_the_legend(flat):
    world, knowledge = flat
    picture, view = draw_world(world, knowledge), plan_picture.plan_view(world)
    left, top = view.pixels(np.array([[0.12, 5.3]]))[0].round().astype(int)
    edge = picture[top - 6 : top + 6, left + 20 : left + 200]
    assert (edge == ZONE_COLOURS["silent"]).all(axis=2).any()
    legend = picture[view.picture.shape[0] :]
    assert (legend == ZONE_COLOURS["silent"]).all(axis=2).any()


def test_the_grid_has_a_line_at_each_metre(flat):
    world, knowledge = flat
    plain, lines = (draw_world(world, knowledge, grid=grid) for grid in (False, True))
    view = plan_picture.plan_view(world)
    for x, y in ((3.0, 4.7), (2.5, 5.0), (9.0, 3.3)):
        column, row = view.pixels(np.array([[x, y]]))[0].round().astype(int)
        assert tuple(lines[row, column]) == plan_picture._LINE != tuple(plain[row, column])


def test_each_metre_has_its_tick_at_the_rim(flat):
    picture, view = draw_world(*flat), plan_picture.plan_view(flat[0])
    bottom, zero = view.picture.shape[0] - plan_picture._RIM_PX, view.pixels(np.zeros((1, 2)))[0]
    ticks = (picture[bottom + 4] == plan_picture._INK).all(axis=1)
    starts = np.flatnonzero(np.diff(ticks.astype(int)) == 1)
    assert ((starts - zero[0]) / view.pixels_per_m).round(1).tolist() == pytest.approx(range(13), abs=0.05)
