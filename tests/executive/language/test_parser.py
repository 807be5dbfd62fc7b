import re

import pytest
import srsly
from spacy.tokenizer import Tokenizer

from executive.language.parser import FREQUENT_WORDS, WordRows, load_parser
from tests.tables import table


@pytest.fixture(scope="module")
def stored(parser):
    return srsly.read_msgpack(parser._folder / "tokenizer")


@pytest.fixture(scope="module")
def key_rows(parser):
    return srsly.read_msgpack(parser._folder / "vocab" / "key2row")


def test_words_of_letters_alone_have_no_affixes(stored):
    patterns = [re.compile(stored[name]) for name in ("prefix_search", "suffix_search", "infix_finditer", "url_match")]
    words = ("a", "kg", "km", "US", "USD", "McDonald", "iPhone", "KITCHEN", "kitchen", "xX", " ")
    assert not [(word, pattern.pattern[:40]) for word in words for pattern in patterns if pattern.search(word)]


@pytest.mark.parametrize(*table(__file__, "texts"))
def test_tokenizer_that_adds_its_rules_late_splits_as_one_that_has_them_all(parser, stored, text):
    whole = Tokenizer(parser._pipeline.vocab).from_disk(parser._folder / "tokenizer", exclude=["vocab"])
    assert [(t.text, t.norm_) for t in parser._pipeline.tokenizer(text)] == [(t.text, t.norm_) for t in whole(text)]


def test_rows_of_frequent_and_rare_words_are_those_of_the_table(parser, key_rows):
    rows = WordRows(parser._folder / "vocab" / "key2row")
    keys = list(key_rows)
    assert list(rows.frequent) == keys[:FREQUENT_WORDS]
    some = [*keys[:: len(keys) // 20], *(key for key in keys if key.bit_length() <= 32)]
    assert ([rows[key] for key in some], len(rows)) == ([key_rows[key] for key in some], len(key_rows))


def test_a_word_that_the_table_lacks_has_no_row(parser, key_rows):
    rows = WordRows(parser._folder / "vocab" / "key2row")
    absent = [key for key in range(2**60, 2**60 + 50) if key not in key_rows]
    assert [rows.get(key, -1) for key in absent] == [-1] * len(absent)  # more than are searched for one by one


def test_a_released_parser_loads_its_model_again():
    parser = load_parser()
    before = parser.parse("go to the kitchen")
    parser.release()
    assert parser.parse("go to the kitchen") == before
