"""Spoken sentences are kept, and read again."""

import numpy as np
import pytest

from errand_train.speech import data
from errand_train.speech.data import spoken_sentences
from errand_train.speech.voices import Speaker
from skills.inputs.errors import InputError
from tests.executive.speech.made_speech import tone


@pytest.fixture
def spoken(monkeypatch):
    """Sentences are spoken as tones; gives how many were."""
    texts = []

    def speak(speaker, text, draw):
        texts.append(text)
        return tone(1.0, height=0.5)

    monkeypatch.setattr(data, "speak", speak)
    monkeypatch.setattr(data, "speakers", lambda: (Speaker("tone", "sh", 1.0, lambda draw: ()),))
    return texts


def test_sentences_are_synthesised_once(spoken, tmp_path):
    first = spoken_sentences(tmp_path, 5, seed=1)
    count = len(spoken)
    again = spoken_sentences(tmp_path, 5, seed=1)
    assert count == 5 == len(spoken) == len(first)
    assert [one.text for one in first] == [one.text for one in again]
    np.testing.assert_allclose(again[4].samples, tone(1.0, height=0.5), atol=1e-4)


def test_another_seed_and_those_for_validation_are_others(spoken, tmp_path):
    several = [spoken_sentences(tmp_path, 3, 1), spoken_sentences(tmp_path, 3, 2)]
    several.append(spoken_sentences(tmp_path, 3, 1, validation=True))
    texts = [one.text for some in several for one in some]
    assert len(set(texts)) == len(texts) == 9


def test_a_damaged_file_is_refused(spoken, tmp_path):
    spoken_sentences(tmp_path, 2, 1)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:50])
    with pytest.raises(InputError, match="damaged") as refused:
        spoken_sentences(tmp_path, 2, 1)
    assert refused.value.file == file and "delete" in refused.value.hint
