import pytest
from made_speech import ScriptedRecognition

from executive.language.spelling import SoundAlikes
from executive.speech.interpret import Candidate, Reading, choose_opening, corrections, interpret, remove_repetitions
from executive.speech.recogniser import Transcript

ALIKES = SoundAlikes(["wrench", "bench", "coke"])


def read(text):
    last = text.split()[-1].strip(".?")
    return Reading(text, last in ("wrench", "bench", "coke"), (last,), correctable=not text.startswith("Robin"))


def heard(*texts, wider=(), likely=None, step=1.0, otherwise=0.0):
    first = tuple(Transcript(text, -step * n) for n, text in enumerate(texts))
    more = tuple(Transcript(text, -step * n) for n, text in enumerate(wider))
    return ScriptedRecognition(first, more, {texts[0]: 0.0} | (likely or {}), otherwise)


def meant(*texts, **more):
    return interpret(heard(*texts, **more), read, ALIKES).text


#   readings                                            wider             meant
#   the first fits                                                        the first
#   the second fits                                                       the second
#   none fits, one of the wider search does             yes               that
#   none fits, one that sounds like the first does                        that
#   none does                                                             the first
def test_the_first_reading_that_fits_is_meant():
    assert meant("get the wrench", "get the coke") == "get the wrench"
    assert meant("get the ranch", "get the coke") == "get the coke"


def test_a_wider_search_is_made_when_no_reading_fits():
    assert meant("get the ranch", wider=["get the crunch", "get the coke"]) == "get the coke"


def test_words_are_corrected_by_sound_when_no_reading_fits():
    result = interpret(heard("get the ranch"), read, ALIKES)
    assert (result.text, result.meaning, result.first_text) == ("get the wrench", "get the wrench", "get the ranch")


def test_the_sound_decides_between_two_corrected_sentences():
    assert meant("get the ranch", likely={"get the bench": -1.0}, otherwise=-8.0) == "get the bench"


def test_a_corrected_sentence_that_the_sound_denies_is_not_meant():
    assert meant("get the ranch", otherwise=-30.0) == "get the ranch"


def test_a_much_less_likely_reading_is_not_meant():
    assert meant("play the news", "get the coke", step=50.0, otherwise=-30.0) == "play the news"


def test_speech_to_others_keeps_its_text():
    assert meant("Robin get the ranch", "get the wrench") == "Robin get the ranch"


def test_nothing_said_means_nothing():
    assert interpret(ScriptedRecognition(), read, ALIKES) is None


@pytest.mark.parametrize(
    ("said", "left"),
    [
        ("grab this cup from the, grab this cup from the table", "grab this cup from the table"),
        ("Bring the cup. Bring the cup to Robin.", "Bring the cup to Robin."),
        ("put it on the table in the kitchen", "put it on the table in the kitchen"),
        ("bring it to Robin, which he is in the hall", "bring it to Robin who is in the hall"),
        ("bring her her tuna", "bring her her tuna"),
        ("go to the table and to the desk", "go to the table and to the desk"),
    ],
)
def test_repeated_words_are_heard_once(said, left):
    assert remove_repetitions(said) == left


NAMES = ("wrench", "bench", "desk", "kitchen", "beer", "coke")
WORDS = ("could you", "would you", "drive to", "bring", "from", "take")
KNOWN = {"bring", "take", "me", "the", "from", "to", "could", "would", "you", "drive", *NAMES}
ALIKES = SoundAlikes(NAMES, WORDS)


def read_known(text):
    unknown = tuple(word for word in text.rstrip(".?").lower().split() if word not in KNOWN)
    return Reading(text, not unknown, unknown)


def corrected(text, most=3):
    first = Candidate(text, 0.0, read_known(text))
    return [candidate.text for candidate in corrections([first], read_known, ALIKES, most=most)]


@pytest.mark.parametrize(
    ("heard", "meant"),
    [
        ("bring me the ranch", "bring me the wrench"),
        ("bring me the ranch.", "bring me the wrench."),
        ("coat you bring me the beer", "could you bring me the beer"),
        ("bring the bear from the nest", "bring the beer from the desk"),
        ("rive to the kitchen", "drive to the kitchen"),
    ],
)
def test_misheard_words_become_known_ones(heard, meant):
    assert meant in corrected(heard)


def test_a_sentence_that_fits_stays_as_it_is():
    assert corrected("bring me the coke", most=1) == ["bring me the coke"]


def test_right_words_are_left_alone():
    assert corrected("take the beer from the nest")[0].startswith("take the beer from the")


def test_unknown_sound_is_not_corrected():
    assert corrected("bring me the newspaper subscription") == []


def test_behind_an_article_stands_a_name():
    assert not any("the could" in text or "the from" in text for text in corrected("bring me the food", most=9))


def test_the_likest_sentence_comes_first():
    found = corrections([Candidate("bring me the ranch", 0.0, read_known("bring me the ranch"))], read_known, ALIKES)
    assert [candidate.cost for candidate in found] == sorted(candidate.cost for candidate in found)


def test_the_search_ends_however_long_the_sentence():
    reads = []

    def never(text):
        reads.append(text)
        return Reading(text, fits=False)

    heard = Candidate("could you bring me the ranch from the nest " * 6, 0.0, Reading("", fits=False))
    assert corrections([heard], never, ALIKES) == []
    assert len(reads) < 50


OLIVER, ALICE = "Hey Oliver, get me a cube.", "Hey Alice, get me a cube."


def _opening(text, plain, likely):
    recognition = ScriptedRecognition(plain=plain, likely=likely)
    return choose_opening(recognition, text, ("Alice",), lambda heard: "alice" in heard.lower())


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


def test_call_stays_when_nothing_is_heard_without_expected_names():
    assert choose_opening(ScriptedRecognition(), ALICE, ("Alice",), lambda heard: False) == ALICE
