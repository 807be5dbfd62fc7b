import re

import pytest
import srsly
from spacy.tokenizer import Tokenizer

from executive.language.parser import FREQUENT_WORDS, WordRows, load_parser


@pytest.fixture(scope="module")
def stored(parser):
    return srsly.read_msgpack(parser._folder / "tokenizer")


@pytest.fixture(scope="module")
def table(parser):
    return srsly.read_msgpack(parser._folder / "vocab" / "key2row")


def test_words_of_letters_alone_have_no_affixes(stored):
    patterns = [re.compile(stored[name]) for name in ("prefix_search", "suffix_search", "infix_finditer", "url_match")]
    words = ("a", "kg", "km", "US", "USD", "McDonald", "iPhone", "KITCHEN", "kitchen", "xX", " ")
    assert not [(word, pattern.pattern[:40]) for word in words for pattern in patterns if pattern.search(word)]


@pytest.mark.parametrize(
    "text",
    [
        "I'll be at the door at 3 p.m., don't wait :-)",
        "We're gonna take the U.S. flag (10km away) to www.errand.example/a?b=1",
        "put Dr. Lee's mug on the coffee-table… o'clock",
    ],
)
def test_tokenizer_that_adds_its_rules_late_splits_as_one_that_has_them_all(parser, stored, text):
    vocab = parser._pipeline.vocab
    whole = Tokenizer(vocab).from_disk(parser._folder / "tokenizer", exclude=["vocab"])
    assert [(t.text, t.norm_) for t in parser._pipeline.tokenizer(text)] == [(t.text, t.norm_) for t in whole(text)]


def test_rows_of_frequent_and_rare_words_are_those_of_the_table(parser, table):
    rows = WordRows(parser._folder / "vocab" / "key2row")
    keys = list(table)
    assert list(rows.frequent) == keys[:FREQUENT_WORDS]
    some = [*keys[:: len(keys) // 20], *(key for key in keys if key.bit_length() <= 32)]
    assert [rows[key] for key in some] == [table[key] for key in some]
    assert len(rows) == len(table)


def test_a_word_that_the_table_lacks_has_no_row(parser, table):
    rows = WordRows(parser._folder / "vocab" / "key2row")
    absent = [key for key in range(2**60, 2**60 + 50) if key not in table]
    assert [rows.get(key, -1) for key in absent] == [-1] * len(absent)  # more than are searched for one by one


def test_a_released_parser_loads_its_model_again():
    parser = load_parser()
    before = parser.parse("go to the kitchen")
    parser.release()
    assert parser.parse("go to the kitchen") == before
