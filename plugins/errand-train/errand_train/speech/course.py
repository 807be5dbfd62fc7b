"""A whole training: synthesis of sentences, training of the network, and the adapter file."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

from errand_train.speech.batches import Batches
from errand_train.speech.data import spoken_sentences, without_long
from errand_train.speech.learning import Lessons, learn, text_loss
from errand_train.speech.model import AdaptedWhisper
from errand_train.speech.noises import Conditions
from executive.speech.adapter import read_model_file
from executive.speech.recogniser import speech_module
from executive.speech.whisper import BASE_SHA256, base_weights

__all__ = ["Course", "train"]

_LOG: Final = logging.getLogger(__name__)
_RANKS: Final = {"encoder/": 24, "decoder/": 8}
_CLEAR: Final = Conditions(clear=1.0, echoing=0.0)
_NOISY: Final = Conditions(clear=0.0, echoing=0.0, ratio_db=(8.0, 12.0))
_VALIDATED: Final = 64
_VALIDATION_SEED: Final = 5
_SILENCE_S: Final = 1.5


@dataclass(frozen=True)
class Course:
    """Options of a training.

    Attributes:
        out: the file of the adapter.
        folder: where the spoken sentences are kept.
        sentences: how many are spoken, and `seed` what is drawn by.
        batch: sentences of each step.
        lessons: how they learn.
        kept_every: after how many steps the adapter is written and tried on the validation sentences.
    """

    out: Path
    folder: Path
    lessons: Lessons
    sentences: int = 4500
    seed: int = 1
    batch: int = 12
    kept_every: int = 60


def train(course: Course) -> None:
    """Trains the network and writes the adapter.

    Raises:
        InputError: a voice or an extra is missing, or the folder holds a damaged file.
    """
    spoken_sentences(course.folder, course.sentences, course.seed)
    spoken_sentences(course.folder, _VALIDATED, course.seed, validation=True)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    torch.manual_seed(course.seed)
    model, small = base_weights()
    net = AdaptedWhisper(read_model_file(model.getbuffer()), _RANKS)
    sentences = without_long(spoken_sentences(course.folder, course.sentences, course.seed))
    batches = _batches(sentences, small, course).training(Conditions(), np.random.default_rng(course.seed))
    kept = spoken_sentences(course.folder, _VALIDATED, course.seed, validation=True)
    validation = _batches(kept, small, course)
    for step in learn(net, batches, course.lessons):
        if step % course.kept_every == 0 or step == course.lessons.steps:
            _LOG.info("step %d: validation %s", step, _validated(net, validation))
            net.adapter().save(course.out, base=BASE_SHA256)


def _batches(sentences: Any, small: dict[str, bytes], course: Course) -> Batches:
    tokenizer = speech_module("tokenizers").Tokenizer.from_buffer(small["tokenizer.json"])
    tokens = speech_module("faster_whisper.tokenizer").Tokenizer(tokenizer, True, task="transcribe", language="en")
    features = speech_module("faster_whisper.feature_extractor").FeatureExtractor(feature_size=80)
    return Batches(sentences, features, tokens, course.batch)


def _validated(net: AdaptedWhisper, validation: Batches) -> str:
    """Cross entropy per token of sentences with untrained words, clean and in noise of 8 to 12 dB."""
    told = {
        name: text_loss(net, validation.validation(conditions, seed=_VALIDATION_SEED, silence_s=_SILENCE_S))
        for name, conditions in (("clear", _CLEAR), ("noisy", _NOISY))
    }
    return ", ".join(f"{name} {loss:.3f}" for name, loss in told.items())
