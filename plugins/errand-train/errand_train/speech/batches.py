"""Batches of training sentences: features, prompts, and the tokens of the text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from errand_train.speech.data import SpokenSentence
from errand_train.speech.noises import Conditions, Draw, hear
from executive.speech.whisper import start_tokens

__all__ = ["Batch", "Batches"]

_POOL: Final = 128
_GROUP: Final = 32
_TALKERS: Final = 12
_SILENCE_S: Final = (0.5, 2.5)
_FRAMES_PER_S: Final = 100
_NO_TOKEN: Final = -100

Features = np.ndarray[Any, np.dtype[np.float32]]


@dataclass(frozen=True)
class Batch:
    """Several sentences: features noisy and clean (batch, 80, frames), the prompts and their lengths, the input tokens
    and the target tokens (batch, tokens; -100 behind the end)."""

    heard: Tensor
    said: Tensor
    prompt: Tensor
    lengths: Tensor
    given: Tensor
    wanted: Tensor


@dataclass(frozen=True)
class _Sample:
    heard: Features
    said: Features
    prompt: list[int]
    text: list[int]


class Batches:
    """Source of batches of `size`; `features` is the recogniser's own extractor and `tokens` its tokenizer."""

    def __init__(
        self, sentences: Sequence[SpokenSentence], features: Callable[..., Any], tokens: Any, size: int
    ) -> None:
        self._sentences, self._features, self._tokens, self._size = sentences, features, tokens, size

    def training(self, conditions: Conditions, draw: Draw) -> Iterator[Batch]:
        """Yields batches without end, each of sentences of similar length, with new conditions for each sentence."""
        while True:
            order = list(draw.permutation(len(self._sentences)))
            while len(order) >= min(_POOL, len(self._sentences)) and order:
                pool = [self._sentences[order.pop()] for _ in range(min(_POOL, len(order)))]
                for some in self._alike(pool, draw):
                    yield self.batch(some, conditions, draw, silence_s=draw.uniform(*_SILENCE_S))

    def validation(self, conditions: Conditions, *, seed: int, silence_s: float) -> Iterator[Batch]:
        """Yields all sentences once, in equal conditions each time."""
        draw = np.random.default_rng(seed)
        ordered = sorted(self._sentences, key=lambda one: len(one.samples))
        for first in range(0, len(ordered), self._size):
            yield self.batch(ordered[first : first + self._size], conditions, draw, silence_s=silence_s)

    def batch(self, some: Sequence[SpokenSentence], conditions: Conditions, draw: Draw, *, silence_s: float) -> Batch:
        """Makes a batch of sentences, with silence after the longest."""
        chosen = draw.integers(len(self._sentences), size=_TALKERS)
        talkers = [self._sentences[number].samples for number in chosen]
        return self._batch([self._sample(one, conditions, talkers, draw) for one in some], silence_s)

    def _alike(self, pool: list[SpokenSentence], draw: Draw) -> list[list[SpokenSentence]]:
        """The sentences of a pool in batches, alike in the length of prompt and sound, in any order."""
        pool = sorted(pool, key=lambda one: len(one.prompt))
        groups = [sorted(pool[n : n + _GROUP], key=lambda one: len(one.samples)) for n in range(0, len(pool), _GROUP)]
        batches = [group[n : n + self._size] for group in groups for n in range(0, len(group), self._size)]
        return [batches[number] for number in draw.permutation(len(batches))]

    def _sample(self, one: SpokenSentence, conditions: Conditions, talkers: Sequence[Any], draw: Draw) -> _Sample:
        both = hear(conditions, one.samples, talkers, draw)
        text = [*self._tokens.encode(f" {one.text}"), self._tokens.eot]
        return _Sample(
            self._features(both.heard), self._features(both.said), start_tokens(self._tokens, one.prompt), text
        )

    def _batch(self, samples: Sequence[_Sample], silence_s: float) -> Batch:
        frames = max(one.heard.shape[1] for one in samples) + int(silence_s * _FRAMES_PER_S)
        frames += frames % 2
        given = [[one.prompt[-1], *one.text[:-1]] for one in samples]
        return Batch(
            _padded([one.heard for one in samples], frames),
            _padded([one.said for one in samples], frames),
            _filled([one.prompt[:-1] for one in samples], self._tokens.eot),
            torch.tensor([len(one.prompt) - 1 for one in samples]),
            _filled(given, self._tokens.eot),
            _filled([one.text for one in samples], _NO_TOKEN),
        )


def _padded(features: Sequence[Features], frames: int) -> Tensor:
    return torch.from_numpy(np.stack([np.pad(one, ((0, 0), (0, frames - one.shape[1]))) for one in features]))


def _filled(rows: Sequence[Sequence[int]], filler: int) -> Tensor:
    most = max(map(len, rows))
    return torch.tensor([[*row, *[filler] * (most - len(row))] for row in rows])
