"""People who walk, in a mission file."""

import pytest

from executive.mission.load import load_mission, routes_of_people
from skills.inputs.errors import InputError

WALKS = """\
name: busy
people:
  Robin:
    waypoints: [kitchen, [4.0, 4.5], {at: worktop, pause: 2}]
    speed: 0.9
    loop: true
    start: 5
    yields: false
  Kim: {waypoints: [office]}
steps:
  - to: kitchen
"""


@pytest.fixture
def routes(write, flat):
    return lambda text: routes_of_people(load_mission(write(text)), flat)


def test_places_become_points_by_any_of_their_names(routes, flat):
    found = routes(WALKS)
    counter = flat.place_pose("kitchen counter")
    assert found["Robin"].model_dump(exclude_defaults=True) == {
        "waypoints": ({"at": (8.4, 6.9)}, {"at": (4.0, 4.5)}, {"at": (counter.x, counter.y), "pause": 2.0}),
        "speed": 0.9,
        "loop": True,
        "start": 5.0,
        "yields": False,
    }
    assert (found["Kim"].speed, found["Kim"].loop, found["Kim"].yields) == (1.2, False, True)


def test_a_mission_without_people_has_no_routes(routes):
    assert routes("name: alone\nsteps: [{to: kitchen}]\n") == {}


def test_a_place_that_nobody_knows_is_refused_at_its_line(routes):
    with pytest.raises(InputError, match="unknown place 'kitchn'") as error:
        routes(WALKS.replace("[kitchen,", "[kitchn,"))
    assert (error.value.line, error.value.hint) == (4, "did you mean 'kitchen'?")


def test_a_file_that_is_used_brings_no_people_of_its_own(compile_text):
    with pytest.raises(InputError, match="'people' of a file that is used"):
        compile_text("name: all\nsteps:\n  - use: busy.yaml\n", busy=WALKS)
