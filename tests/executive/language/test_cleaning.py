import pytest

from executive.language.cleaning import clean, rephrased


@pytest.mark.parametrize(
    ("text", "cleaned"),
    [
        ("  fetch\tme \n a drink ", "fetch me a drink"),
        ("don’t", "don't"),
        ("\x1b[31mfetch\x00 it", "31mfetch it"),
        ('fetch 🙂 [it] "now"', "fetch it now"),
        ("ﬁnd it", "find it"),
        ("i 'm here , do n't go", "i'm here , don't go"),
    ],
)
def test_text_becomes_plain(text, cleaned):
    assert clean(text) == cleaned


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("could you please get it", "get it"),
        ("Can you, please, get it?", "get it?"),
        ("there is one here can you get it", "there is one here , get it"),
        ("I would like a coke", "bring me a coke"),
        ("I would like you to get a coke", "get a coke"),
        ("I'd like something to drink", "bring me a drink"),
        ("get it please", "get it"),
        ("robot get it", "get it"),
        ("get it", "get it"),
    ],
)
def test_polite_forms_become_plain_commands(text, command):
    assert rephrased(text) == command
