"""Batches of sentences, and that something is learned from them. Needs the extras."""

from itertools import islice

import numpy as np
import pytest

torch = pytest.importorskip("torch")
faster_whisper = pytest.importorskip("faster_whisper")

from errand_train.speech.batches import Batches  # noqa: E402
from errand_train.speech.data import SpokenSentence, without_long  # noqa: E402
from errand_train.speech.learning import Lessons, learn, losses, text_loss  # noqa: E402
from errand_train.speech.model import AdaptedWhisper  # noqa: E402
from errand_train.speech.noises import Conditions  # noqa: E402
from executive.speech.adapter import read_model_file  # noqa: E402
from executive.speech.whisper import base_weights  # noqa: E402
from tests.executive.speech.made_speech import tone  # noqa: E402

NOISY = Conditions(clear=0.0, echoing=0.0, ratio_db=(10.0, 10.0))
SENTENCES = [
    SpokenSentence(text, prompt, "tone", tone(length_s, height=0.4))
    for text, prompt, length_s in [
        ("Bring the cup.", "", 1.0),
        ("Rex, find the old hammer.", "cup, hammer.", 1.6),
        ("Go.", "hall.", 0.6),
    ]
]


class Letters:
    """Each letter is a token."""

    eot, sot_prev, no_timestamps, sot_sequence = 50257, 50361, 50363, (50258, 50259, 50359)

    def encode(self, text):
        return [ord(letter) for letter in text]


@pytest.fixture(scope="module")
def batches():
    return Batches(SENTENCES, faster_whisper.feature_extractor.FeatureExtractor(feature_size=80), Letters(), 3)


@pytest.fixture
def net():
    torch.manual_seed(1)
    return AdaptedWhisper(read_model_file(base_weights()[0].getvalue()), {"encoder/": 4, "decoder/": 2})


def test_a_batch_holds_prompts_and_texts_as_the_recogniser_takes_them(batches):
    batch = batches.batch(SENTENCES, NOISY, np.random.default_rng(1), silence_s=1.5)
    assert batch.heard.shape == batch.said.shape and batch.heard.shape[:2] == (3, 80)
    tokens = Letters()
    for row, sentence in enumerate(SENTENCES):
        told = [tokens.sot_prev, *tokens.encode(f" {sentence.prompt}")] if sentence.prompt else []
        before = [*told, *tokens.sot_sequence, tokens.no_timestamps]
        text = tokens.encode(f" {sentence.text}")
        assert batch.prompt[row, : batch.lengths[row]].tolist() == before[:-1]
        assert batch.given[row, : len(text) + 1].tolist() == [tokens.no_timestamps, *text]
        assert batch.wanted[row, : len(text) + 1].tolist() == [*text, tokens.eot]
        assert (batch.wanted[row, len(text) + 1 :] == -100).all()


def test_silence_is_behind_the_longest(batches):
    batch = batches.batch(SENTENCES, NOISY, np.random.default_rng(1), silence_s=1.5)
    assert (batch.heard[:, :, -149:] == 0.0).all() and (batch.heard[1, :, :-160] != 0.0).any()


def test_each_sentence_is_drawn_once_in_a_round(batches):
    several = list(islice(batches.training(NOISY, np.random.default_rng(1)), 2))
    assert all(sorted(one.lengths.tolist()) == sorted(several[0].lengths.tolist()) for one in several)
    assert several[0].heard.shape[0] == len(SENTENCES)


def test_learning_lowers_what_is_wrong(net, batches):
    batch = batches.batch(SENTENCES[::2], NOISY, np.random.default_rng(1), silence_s=0.3)
    before = text_loss(net, [batch])
    steps = list(learn(net, iter([batch] * 2), Lessons(steps=2, warm_up=1, rate=4e-3)))
    assert steps == [1, 2]
    assert text_loss(net, [batch]) < 0.8 * before


def test_before_learning_the_clear_sound_is_heard_as_published(net, batches):
    conditions = (NOISY, Conditions(clear=1.0, echoing=0.0))
    noisy, clear = (batches.batch(SENTENCES[:1], one, np.random.default_rng(1), silence_s=0.3) for one in conditions)
    with torch.no_grad():
        assert float(losses(net, noisy)[1]) > float(losses(net, clear)[1])


def test_long_sentences_are_rare():
    short = SENTENCES[0]
    long = SpokenSentence(short.text, short.prompt, "tone", np.zeros(100_000, np.float32))
    assert len(without_long([long] * 8 + [short] * 8)) == 9


def test_the_rate_rises_and_falls():
    rates = [Lessons(steps=100, warm_up=10).rate_at(step) for step in range(100)]
    assert rates[0] < rates[9] == max(rates) or rates[8] < max(rates)
    assert rates[99] < 0.01 * max(rates)
