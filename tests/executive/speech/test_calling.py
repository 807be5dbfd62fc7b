"""Whether it was the robot that was called."""

import pytest
from made_speech import ScriptedRecognition

from executive.speech.calling import opening_as_heard

OLIVER, ALICE = "Hey Oliver, get me a cube.", "Hey Alice, get me a cube."


def _opening(text, plain, likely):
    recognition = ScriptedRecognition(plain=plain, likely=likely)
    return opening_as_heard(recognition, text, ("Alice",), lambda heard: "alice" in heard.lower())


#   heard with the name expected    heard without   likelier by e to the    taken
#   Hey Alice, get me a cube.       Hey Oliver,..   12                      Hey Oliver, ...
#   Hey Alice, get me a cube.       Hey Ellis,..    3                       Hey Alice, ...
#   Hey Alice, get me a cube.       Hey Alice,..    -                       Hey Alice, ...
@pytest.mark.parametrize(("ahead", "taken"), [(12.0, OLIVER), (3.0, ALICE)])
def test_another_name_must_be_much_likelier(ahead, taken):
    assert _opening(ALICE, OLIVER, {OLIVER: ahead, ALICE: 0.0}) == taken


def test_a_name_that_is_heard_without_being_expected_is_meant():
    assert _opening(ALICE, "Hey Alice, get me acute.", {}) == ALICE


def test_only_the_opening_is_taken_from_what_was_heard_without_expecting_names():
    other = "Hey Oliver, get me a cube."
    assert _opening(ALICE, "Hey Oliver, get meat cue.", {other: 12.0}) == other


def test_a_sentence_that_is_much_likelier_as_a_whole_was_not_to_the_robot():
    meant, heard = "Okay, let us meet at five.", "OK Alice, meet at five."
    likely = {meant: 12.0, "Okay, let meet at five.": 3.0}
    assert _opening(heard, meant, likely) == meant


def test_a_call_at_the_end_stays():
    assert _opening("Get me a cube from the table, Alice.", "Get me.", {}) == "Get me a cube from the table, Alice."


def test_where_nothing_is_heard_without_expecting_names_the_call_stays():
    assert opening_as_heard(ScriptedRecognition(), ALICE, ("Alice",), lambda heard: False) == ALICE
