"""People in a mission file: those who walk, and those whom the robot follows, guides and greets."""

import pytest

from executive.mission.load import load_mission, routes_of_people
from executive.mission.resolve import mission_from_file
from skills.files.errors import InputError

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


def loaded(tmp_path, text):
    path = tmp_path / "mission.yaml"
    path.write_text(text, encoding="utf-8")
    return load_mission(path)


def test_places_become_points_by_any_of_their_names(tmp_path, flat):
    routes = routes_of_people(loaded(tmp_path, WALKS), flat)
    counter = flat.place_pose("kitchen counter")
    assert routes["Robin"].model_dump(exclude_defaults=True) == {
        "waypoints": ({"at": (8.4, 6.9)}, {"at": (4.0, 4.5)}, {"at": (counter.x, counter.y), "pause": 2.0}),
        "speed": 0.9,
        "loop": True,
        "start": 5.0,
        "yields": False,
    }
    assert (routes["Kim"].speed, routes["Kim"].loop, routes["Kim"].yields) == (1.2, False, True)


def test_a_mission_without_people_has_no_routes(tmp_path, flat):
    assert routes_of_people(loaded(tmp_path, "name: alone\nsteps: [{to: kitchen}]\n"), flat) == {}


def test_a_place_that_nobody_knows_is_refused_at_its_line(tmp_path, flat):
    with pytest.raises(InputError, match="unknown place 'kitchn'") as error:
        routes_of_people(loaded(tmp_path, WALKS.replace("[kitchen,", "[kitchn,")), flat)
    assert (error.value.line, error.value.hint) == (4, "did you mean 'kitchen'?")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("speed: 0.9", "speed: 9", 5),
        ("loop: true", "loops: true", 6),
        ("start: 5", "start: -1", 7),
        ("pause: 2", "pause: soon", 4),
        ("[office]", "[]", 9),
    ],
)
def test_a_wrong_route_is_refused_at_its_line(tmp_path, old, new, line):
    with pytest.raises(InputError) as error:
        loaded(tmp_path, WALKS.replace(old, new))
    assert error.value.line == line


def test_a_file_that_is_used_brings_no_people_of_its_own(compile_text):
    with pytest.raises(InputError, match="'people' of a file that is used"):
        compile_text("name: all\nsteps:\n  - use: busy.yaml\n", busy=WALKS)


def resolved(tmp_path, parser, flat, parts):
    path = tmp_path / "mission.yaml"
    path.write_text(f"name: people\nsteps:\n  - {parts}\n", encoding="utf-8")
    return mission_from_file(path, parser=parser, knowledge=flat)


@pytest.mark.parametrize(
    ("parts", "command"),
    [
        ("{do: follow, object: speaker}", "Take [Nothing] to [Nothing] and do [follow] to [speaker]"),
        ("{to: kitchen, do: guide, object: robin}", "Take [Nothing] to [kitchen] and do [guide] to [Robin]"),
        (
            "{to: lounge, do: greet, object: some person}",
            "Take [Nothing] to [living room] and do [greet] to [some person]",
        ),
    ],
)
def test_people_are_followed_guided_and_greeted_by_name(tmp_path, parser, flat, parts, command):
    (step,) = resolved(tmp_path, parser, flat, parts).commands
    assert str(step) == command


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ("{do: follow, object: Robyn}", "unknown person 'Robyn'; did you mean 'Robin'?"),
        ("{do: follow, object: beer}", "unknown person 'beer'"),
        ("{do: follow, object: tall person}", "unknown person 'tall person'"),
        ("{to: kitchen, do: guide, object: some person}", "cannot guide several people"),
        ("{do: guide, object: Robin}", "it is not said where to guide Robin; name the place under 'to'"),
        ("{take: beer, to: kitchen, do: guide, object: Robin}", "the beer cannot be taken along by 'guide'"),
    ],
)
def test_a_command_that_does_not_fit_people_is_refused(tmp_path, parser, flat, parts, says):
    with pytest.raises(InputError) as error:
        resolved(tmp_path, parser, flat, parts)
    assert error.value.line == 3
    assert says in str(error.value)
