"""Learns an adapter: the recogniser writes noisy speech as it was said, and hears it as it would hear it without noise.

Two losses are added: the cross entropy of the text with the prompt of the recogniser in use, and the squared distance
between the encoding of the noisy sound and the original network's encoding of the same speech without noise. The
second loss also prevents forgetting.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

import torch
import torch.nn.functional as tf
from torch import Tensor, nn

from errand_train.speech.batches import Batch
from errand_train.speech.model import AdaptedWhisper

__all__ = ["Lessons", "learn", "losses", "text_loss"]

_LOG: Final = logging.getLogger(__name__)
_NO_TOKEN: Final = -100


@dataclass(frozen=True)
class Lessons:
    """Options of the optimiser: steps in all and of the warm-up, the highest rate (it falls as a cosine to 0), the
    weight of the second loss, the greatest gradient, and the steps between reports."""

    steps: int
    warm_up: int = 40
    rate: float = 1.2e-3
    likeness: float = 2.0
    most_gradient: float = 1.0
    told_every: int = 10

    def rate_at(self, step: int) -> float:
        """Learning rate of a step, from 0."""
        return self.rate * min((step + 1) / self.warm_up, 1.0) * (0.5 + 0.5 * math.cos(math.pi * step / self.steps))


def learn(net: AdaptedWhisper, batches: Iterator[Batch], lessons: Lessons) -> Iterator[int]:
    """Trains step by step; yields the number of steps so far."""
    learned = [part for part in net.parameters() if part.requires_grad]
    optimiser = torch.optim.AdamW(learned, weight_decay=0.0, betas=(0.9, 0.98))
    for step, batch in enumerate(islice(batches, lessons.steps)):
        for group in optimiser.param_groups:
            group["lr"] = lessons.rate_at(step)
        optimiser.zero_grad()
        text, likeness = losses(net, batch)
        (text + lessons.likeness * likeness).backward()
        nn.utils.clip_grad_norm_(learned, lessons.most_gradient)
        optimiser.step()
        if step % lessons.told_every == 0:
            _LOG.info("step %d: text %.3f, likeness %.3f", step, float(text.detach()), float(likeness.detach()))
        yield step + 1


def losses(net: AdaptedWhisper, batch: Batch) -> tuple[Tensor, Tensor]:
    """Cross entropy of the texts per token, and squared distance from the clean encoding over its variance."""
    heard = net.encode(batch.heard)
    with net.as_published():
        clear = net.encode(batch.said).float()
    return _text(net, heard, batch, "mean"), torch.mean((heard.float() - clear) ** 2) / clear.var()


def text_loss(net: AdaptedWhisper, batches: Iterable[Batch]) -> float:
    """Cross entropy of all texts per token."""
    total, tokens = 0.0, 0
    with torch.no_grad():
        for batch in batches:
            total += float(_text(net, net.encode(batch.heard), batch, "sum"))
            tokens += int((batch.wanted != _NO_TOKEN).sum())
    return total / max(tokens, 1)


def _text(net: AdaptedWhisper, heard: Tensor, batch: Batch, reduction: str) -> Tensor:
    states = net.states(heard, batch.prompt, batch.lengths, batch.given)
    counts = batch.wanted != _NO_TOKEN
    return tf.cross_entropy(net.logits(states[counts]), batch.wanted[counts], reduction=reduction)
