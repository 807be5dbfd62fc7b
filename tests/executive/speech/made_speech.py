"""Synthetic sound for tests, and a scripted recogniser and detector."""

import struct
import wave
from dataclasses import dataclass, field

import numpy as np

from executive.speech.recogniser import Transcript
from executive.speech.sound import RATE_HZ


@dataclass(frozen=True)
class ScriptedRecognition:
    """Recognition with given readings; `likely` has log likelihoods of other texts, `otherwise` that of all else."""

    transcripts: tuple = ()
    wider: tuple = ()
    likely: dict = field(default_factory=dict)
    otherwise: float = 0.0
    plain: str = ""

    def more(self):
        yield self.wider

    def unprompted_text(self):
        """Given text, or the first of the readings."""
        return self.plain or next((transcript.text for transcript in self.transcripts), "")

    def likelihoods(self, texts):
        return [self.likely.get(text, self.otherwise) for text in texts]


@dataclass
class ScriptedRecogniser:
    """Recogniser that returns the given texts in order, and stores the length of each sound (s)."""

    texts: list
    lengths_s: list = field(default_factory=list)

    def transcribe(self, sound, vocabulary):
        """Next text; none for an empty one, or when no text is left."""
        self.lengths_s.append(len(sound) / RATE_HZ)
        text = self.texts.pop(0) if self.texts else ""
        return ScriptedRecognition((Transcript(text, -1.0),) if text else ())

    def partial_transcript(self, sound, vocabulary):
        """First word of the next text."""
        return self.texts[0].split()[0] if self.texts else ""


class LoudIsSpeech:
    """Detector that takes loud sound for speech."""

    def probability(self, frame):
        """1 above 26 dB below full scale, else 0."""
        return float(np.abs(frame).max() > 0.05)


def tone(seconds, *, rate_hz=RATE_HZ, height=0.5):
    """A tone of 440 Hz."""
    times_s = np.arange(round(seconds * rate_hz)) / rate_hz
    return np.asarray(height * np.sin(2 * np.pi * 440.0 * times_s), np.float32)


def silence(seconds, *, rate_hz=RATE_HZ):
    return np.zeros(round(seconds * rate_hz), np.float32)


def speech_like(*lengths_s):
    """Silences and tones of the given lengths (s) in turn, a silence first."""
    return np.concatenate([tone(s) if n % 2 else silence(s) for n, s in enumerate(lengths_s)])


def write_wav(file, samples, *, rate_hz=RATE_HZ, channels=1):
    """Writes a wav file with 16 bits a sample and the same sound in each channel."""
    whole = (np.asarray(samples, np.float32) * 32767).astype("<i2")
    with wave.open(str(file), "wb") as writer:
        writer.setnchannels(channels)
        writer.setsampwidth(2)
        writer.setframerate(rate_hz)
        writer.writeframes(np.repeat(whole, channels).tobytes())
    return file


def write_raw_wav(file, data, *, tag, bits, rate_hz=RATE_HZ, size=None, extra=b""):
    """Writes a wav file of one channel with any samples: their type `tag`, and the `size` in its head."""
    form = struct.pack("<HHIIHH", tag, 1, rate_hz, rate_hz * bits // 8, bits // 8, bits) + extra
    chunks = b"fmt " + struct.pack("<I", len(form)) + form
    chunks += b"data" + struct.pack("<I", len(data) if size is None else size) + data
    file.write_bytes(b"RIFF" + struct.pack("<I", 4 + len(chunks)) + b"WAVE" + chunks)
    return file
