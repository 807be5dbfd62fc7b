"""Names and legends on maps: nothing covers a name, and the legend stands below the map."""

import itertools

import numpy as np
import pytest

from skills.map_drawing import Names, drawable, text_size, with_legend


def blank(width=400, height=300):
    return np.full((height, width, 3), 200, np.uint8)


def overlap(one, other):
    return np.prod(np.maximum(np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2]), 0.0))


def test_names_at_one_place_do_not_cover_each_other_or_a_mark():
    names = Names(blank(), [])
    names.keep_clear((200, 150), 20.0)
    for name in ("kitchen", "Alice", "dock", "kitchen table"):
        names.write(name, (200, 150))
    assert len(names._taken) == 5
    assert all(overlap(one, other) == 0.0 for one, other in itertools.combinations(names._taken, 2))


def test_a_name_stands_beside_a_path_when_there_is_room():
    # a path along the row of the name; without it, the name stands on its point
    at = (200, 150)
    alone, beside = Names(blank(), []), Names(blank(), [np.array([[0.0, 150.0], [399.0, 150.0]])])
    for names in (alone, beside):
        names.write("hall", at)
    assert alone._taken[0][1] < 150 < alone._taken[0][3]
    assert not beside._taken[0][1] < 150 < beside._taken[0][3]


@pytest.mark.parametrize("corner", [(0, 0), (399, 299), (-50, 400)])
def test_a_name_stays_inside_the_picture(corner):
    names = Names(blank(), [])
    names.write("living room", corner)
    (box,) = names._taken
    assert (box[0] >= 0, box[1] >= 0, box[2] <= 400, box[3] <= 300) == (True, True, True, True)


def test_the_legend_leaves_the_map_as_it_is_and_shows_each_colour():
    picture, colours = blank(), [(255, 0, 0), (0, 0, 255)]
    drawn = with_legend(picture, 50.0, [(f"path of {n}", colour) for n, colour in enumerate(colours)])
    strip = drawn[300:]
    assert np.array_equal(drawn[:300], picture)
    assert all(np.any(np.all(strip == colour, axis=2)) for colour in colours)


def test_entries_that_find_no_room_go_to_another_row():
    few, many = (with_legend(blank(), 50.0, [("path planned", (255, 0, 0))] * n) for n in (1, 6))
    assert many.shape[0] > few.shape[0]


@pytest.mark.parametrize(("text", "drawn"), [("Küche", "Kuche"), ("Straße", "Strasse"), ("キッチン", "?")])
def test_letters_that_cannot_be_drawn_are_replaced(text, drawn):
    assert drawable(text) == drawn
    assert text_size(text, blank()) == text_size(drawn, blank())
