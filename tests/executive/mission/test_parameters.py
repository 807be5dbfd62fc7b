"""Parameters of mission files: their types, choices and names of the world."""

import pytest

from executive.mission.load import load_mission
from executive.mission.parameters import parse_values
from executive.mission.resolve import mission_from_file
from skills.inputs.errors import InputError

FILE = """name: trial
parameters:
  room: {type: place, default: kitchen, description: Where to go.}
  who: {type: person, default: Robin}
  limit: 30
  loud: false
  mood: {type: text, default: calm, choices: [calm, hasty]}
steps:
  - to: ${room}
    timeout: ${limit}
"""


@pytest.fixture
def resolved(parser, flat, write):
    """Resolves the mission of FILE, with a change, with values given as on the command line."""

    def of(*settings, old="", new=""):
        assert old in FILE
        loaded = load_mission(write(FILE.replace(old, new, 1)), parse_values(settings))
        return mission_from_file(loaded, parser=parser, knowledge=flat)

    return of


def test_values_take_the_places_of_the_defaults(resolved):
    step = resolved("room=office", "limit=12.5").steps[0]
    assert (step.commands[0].goal, step.timeout_s) == ("office", 12.5)


# value given, what stands in the file and what instead -> line and words of the refusal
@pytest.mark.parametrize(
    ("setting", "old", "new", "line", "says"),
    [
        ("room=kitchn", "", "", 3, "parameter 'room': unknown place 'kitchn'; did you mean 'kitchen'?"),
        ("who=Rbin", "", "", 4, "parameter 'who': unknown person 'Rbin'; did you mean 'Robin'?"),
        ("limit=soon", "", "", 1, "parameter 'limit' must be a number, not 'soon'; give it a number"),
        ("limit=true", "", "", 1, "parameter 'limit' must be a number, not 'True'"),
        ("loud=1", "", "", 1, "parameter 'loud' must be true or false, not '1'"),
        ("mood=sad", "", "", 1, "parameter 'mood' cannot be 'sad'; it is one of calm or hasty"),
        ("limit=30", "default: Robin", "default: true", 4, "parameter 'who' must be a person, not 'True'"),
        ("limit=30", "type: person", "type: animal", 4, "parameter 'who' has no type; its type is one of text, number"),
    ],
)
def test_a_value_or_type_that_does_not_fit_is_refused(resolved, setting, old, new, line, says):
    with pytest.raises(InputError) as error:
        resolved(setting, old=old, new=new)
    assert (error.value.line, says in str(error.value)) == (line, True), str(error.value)


def test_a_number_may_be_given_for_a_text(resolved):
    resolved(
        "mood=5", old="choices: [calm, hasty]}\nsteps:\n  - to: ${room}", new="}\nsteps:\n  - say: go to the kitchen"
    )


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("n=" + "9" * 5000, "--set n has 5002 letters"),
        ("n=" + "9" * 1500, "too large"),
        ("n=.inf", "too large"),
        ("n=[1]", "NAME=VALUE"),
    ],
    ids=lambda text: text[:8],
)
def test_a_setting_that_is_no_plain_value_is_refused(setting, says):
    with pytest.raises(InputError, match=says):
        parse_values([setting])


def test_a_setting_that_comes_twice_is_refused():
    with pytest.raises(InputError, match="--set room is given twice"):
        parse_values(["room=office", "room=kitchen"])


@pytest.mark.parametrize(("setting", "value"), [("t=14:30", "14:30"), ("n=010", "010"), ("n=1e3", 1000.0), ("n=3", 3)])
def test_a_setting_has_the_type_that_people_mean(setting, value):
    assert list(parse_values([setting]).values()) == [value]
