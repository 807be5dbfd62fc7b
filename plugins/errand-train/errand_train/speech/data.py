"""Sentences spoken by synthetic voices, cached in a folder."""

from __future__ import annotations

import json
import random
import zipfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from errand_train.speech.grammar import Grammar, load_grammar
from errand_train.speech.voices import Speaker, draw_speaker, speak, speakers
from executive.speech.sound import RATE_HZ, Samples
from skills.inputs.errors import InputError

__all__ = ["SpokenSentence", "spoken_sentences", "without_long"]

_SHARD: Final = 500
_MOST_LETTERS: Final = 110
_SHORTEST_S, _LONGEST_S = 0.3, 9.0
_USUAL_S, _USUAL_PROMPT, _UNUSUAL_ONE_IN = 4.6, 480, 8
_FULL_SCALE: Final = 32767.0


@dataclass(frozen=True)
class SpokenSentence:
    """A sentence, its prompt, the kind of voice, and its sound at RATE_HZ."""

    text: str
    prompt: str
    speaker: str
    samples: Samples


def spoken_sentences(folder: Path, count: int, seed: int, *, validation: bool = False) -> list[SpokenSentence]:
    """Loads `count` sentences from the folder; synthesises and stores the missing ones.

    Raises:
        InputError: no synthetic voice is installed, or a file in the folder is damaged.
    """
    grammar, found = load_grammar(validation=validation), speakers()
    sentences = list[SpokenSentence]()
    for shard in range(-(-count // _SHARD)):
        kind = "validation" if validation else "training"
        file = folder / f"{kind}-{seed}-{shard}.npz"
        if not file.exists():
            many = min(_SHARD, count - len(sentences))
            _keep(file, list(_spoken(grammar, found, many, f"{kind} {seed} {shard}")))
        sentences += _kept(file)
    return sentences


def without_long(sentences: list[SpokenSentence]) -> list[SpokenSentence]:
    """Drops most of the sentences that are long or have a long prompt: they cost much and teach little more."""
    return [
        one
        for number, one in enumerate(sentences)
        if number % _UNUSUAL_ONE_IN == 0 or (len(one.samples) < _USUAL_S * RATE_HZ and len(one.prompt) < _USUAL_PROMPT)
    ]


def _spoken(grammar: Grammar, found: tuple[Speaker, ...], count: int, seed: str) -> Iterator[SpokenSentence]:
    draws = [random.Random(f"{seed} {number}") for number in range(count)]
    with ThreadPoolExecutor() as several:
        yield from several.map(lambda draw: _one_spoken(grammar, found, draw), draws)


def _one_spoken(grammar: Grammar, found: tuple[Speaker, ...], draw: random.Random) -> SpokenSentence:
    """The first that is neither too long nor too short."""
    while True:
        sentence, speaker = grammar.sentence(draw), draw_speaker(found, draw)
        if len(sentence.text) > _MOST_LETTERS:
            continue
        samples = speak(speaker, sentence.text, draw)
        if _SHORTEST_S < len(samples) / RATE_HZ < _LONGEST_S:
            return SpokenSentence(sentence.text, sentence.vocabulary.prompt, speaker.name, samples)


def _keep(file: Path, sentences: list[SpokenSentence]) -> None:
    told = json.dumps([(one.text, one.prompt, one.speaker, len(one.samples)) for one in sentences])
    sound = np.concatenate([np.clip(one.samples, -1.0, 1.0) * _FULL_SCALE for one in sentences])
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez(file, sound=sound.astype(np.int16), told=np.array(told))


def _kept(file: Path) -> list[SpokenSentence]:
    try:
        with np.load(file, allow_pickle=False) as kept:
            sound, told = kept["sound"], json.loads(str(kept["told"]))
        ends = np.cumsum([length for *_, length in told])
        sounds = np.split(sound, ends[:-1])
        return [
            SpokenSentence(text, prompt, speaker, (part / _FULL_SCALE).astype(np.float32))
            for (text, prompt, speaker, _), part in zip(told, sounds, strict=True)
        ]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"it is damaged ({error})", hint="delete it, and train again", file=file) from error
