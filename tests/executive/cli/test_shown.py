"""What the robot says while it runs: on the console and by the voice."""

import io

import pytest
from rich.console import Console

from executive.cli.shown import SILENCE, HeardSpeech, voice_for
from executive.speech import voice as voices
from skills.files.errors import InputError


class Heard:
    """A voice that remembers."""

    def __init__(self):
        self.texts = []

    def say(self, text):
        self.texts.append(text)


@pytest.mark.parametrize(("quiet", "shown"), [(False, "Alice: [bold]Hello\n"), (True, "")])
def test_what_is_said_is_a_line_unless_quiet_and_is_said_by_the_voice(quiet, shown):
    told, voice = io.StringIO(), Heard()
    speech = HeardSpeech(Console(file=told, width=80), voice, quiet)
    speech.message("speech", {"robot": "Alice", "text": "[bold]Hello", "t": 1.0})
    speech.message("pose", {"robot": "Alice"})
    assert (told.getvalue(), voice.texts) == (shown, ["[bold]Hello"])


def test_without_the_option_nothing_is_said_aloud():
    with voice_for(False) as voice:
        assert voice is SILENCE


def test_aloud_without_a_synthesiser_is_refused(monkeypatch):
    monkeypatch.setattr(voices.queued_voice, "__kwdefaults__", {"which": lambda name: None})
    with pytest.raises(InputError, match="no voice"), voice_for(True):
        pass
