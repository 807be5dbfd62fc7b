import pytest


def tags(parser, text):
    return {token.text: token.pos for token in parser.parse(text)}


@pytest.mark.parametrize(
    ("text", "word", "pos"),
    [
        ("put the soap on the bathroom sink", "sink", "NOUN"),
        ("put the garbage in the trash can", "can", "NOUN"),
        ("there are clean towels in the closet", "clean", "ADJ"),
        ("go to the counter look for the bowl", "look", "VERB"),
        ("head over to the bench pick up the pliers", "pick", "VERB"),
        ("navigate to the sink and bring it to skyler at the desk", "skyler", "PROPN"),
        ("go to the kitchen no to the bathroom", "no", "INTJ"),
    ],
)
def test_what_the_tagger_misreads_is_repaired(parser, text, word, pos):
    assert tags(parser, text)[word] == pos


@pytest.mark.parametrize(
    ("text", "word", "pos"),
    [
        ("go to the kitchen and wait", "wait", "VERB"),
        ("the can is on the table", "can", "NOUN"),
        ("which hammer can you bring", "can", "AUX"),
        ("clean the towels", "clean", "VERB"),
        ("i want to know it", "know", "VERB"),
    ],
)
def test_what_the_tagger_reads_rightly_stays(parser, text, word, pos):
    assert tags(parser, text)[word] == pos


@pytest.mark.parametrize("text", ["go to the counter look for the bowl", "put the soap on the bathroom sink"])
def test_every_word_still_hangs_on_a_root(parser, text):
    tokens = parser.parse(text)
    for token in tokens:
        for _ in tokens:
            token = tokens[token.head]
        assert token.head == token.index
