"""The token of calls: made once, kept where only its owner reads it."""

import stat

import pytest

from executive.app.call_token import CallToken, call_token
from skills.files.errors import InputError


@pytest.fixture
def store(tmp_path):
    return tmp_path / "missions.sqlite"


def test_a_token_is_made_once_and_kept_for_its_owner_only(store):
    made = call_token(None, store)
    assert (made.new, len(made.text) >= 32, stat.S_IMODE(made.file.stat().st_mode)) == (True, True, 0o600)
    assert call_token(None, store) == CallToken(made.text, made.file)


def test_each_store_has_a_token_of_its_own(store):
    assert call_token(None, store).text != call_token(None, store.with_name("other.sqlite")).text


def test_a_token_that_is_given_is_kept_nowhere(store):
    assert call_token("given-by-hand", store) == CallToken("given-by-hand")
    assert list(store.parent.iterdir()) == []


@pytest.mark.parametrize("given", ["", "short", "two words here", "line\nbreak-in-it", "ümlauts-in-it"])
def test_a_token_that_no_header_bears_is_refused(store, given):
    with pytest.raises(InputError, match="cannot be used; give at least 8 letters"):
        call_token(given, store)


def test_a_token_that_others_can_read_is_refused(store):
    made = call_token(None, store)
    made.file.chmod(0o640)
    with pytest.raises(InputError, match="others can read the token; chmod 600"):
        call_token(None, store)


def test_an_empty_file_is_refused(store):
    call_token(None, store).file.write_text("")
    with pytest.raises(InputError, match="cannot be used"):
        call_token(None, store)
