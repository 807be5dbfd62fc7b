"""Wav files of any rate, width and number of channels, read in blocks of one second.

The form is that of "Multimedia Programming Interface and Data Specifications 1.0" (IBM and Microsoft, 1991), with
floating-point samples and the extensible header of 1999 and 2001.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from math import gcd
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from scipy.signal import resample_poly

from executive.mission.errors import InputError
from executive.speech.sound import RATE_HZ, Samples

__all__ = ["WavFormat", "read_wav"]

_PCM: Final = 1
_FLOAT: Final = 3
_EXTENSIBLE: Final = 0xFFFE
_OPEN_END: Final = 0x7FFF_F000
"""From this size on the head says that its writer did not know it (recorders that write into a pipe)."""
_RATES_HZ: Final = range(4_000, 384_001)
_MOST_CHANNELS: Final = 64
_CONTEXT: Final = 16
"""How many samples at the lower rate a block is told of its neighbours when its rate is changed."""
_MEND: Final = "save the recording as a plain wav file (PCM or float)"


@dataclass(frozen=True)
class WavFormat:
    """How the samples of a file are written: samples per second and channel, channels, bits of each sample."""

    rate_hz: int
    channels: int
    bits: int
    floating: bool

    @property
    def frame_bytes(self) -> int:
        """The bytes of one sample of all channels."""
        return self.channels * self.bits // 8


def read_wav(file: Path) -> Iterator[Samples]:
    """The sound of a wav file at RATE_HZ, its channels averaged, in blocks of one second; the last one is shorter.

    Only a few blocks are in memory at a time.

    Raises:
        InputError: when the first or a later block is asked for: it cannot be read, is no wav file or a compressed
            one, ends before its head says, holds no sound, or holds samples that are no numbers.
    """
    try:
        with file.open("rb") as stream:
            wav = _Wav(file, stream)
            with closing(_resampled(wav.blocks(), wav.format.rate_hz)) as blocks:
                yield from blocks
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", mend="name a wav file", file=file) from error


class _Wav:
    """An open file, at the beginning of its samples."""

    def __init__(self, file: Path, stream: BinaryIO) -> None:
        self._file, self._stream = file, stream
        self._size = file.stat().st_size
        if self._size == 0:
            raise self._error("the file is empty", "record again")
        head = stream.read(12)
        if head[:4] not in (b"RIFF", b"RF64") or head[8:] != b"WAVE":
            raise self._error("this is no wav file", _MEND)
        self.format, self._data_bytes = self._find_data()

    def blocks(self) -> Iterator[Samples]:
        """One second after another, at the file's own rate."""
        left, at_s = self._data_bytes, 0
        while left >= self.format.frame_bytes:
            raw = self._stream.read(min(left, self.format.rate_hz * self.format.frame_bytes))
            left -= len(raw)
            whole = len(raw) - len(raw) % self.format.frame_bytes
            if not whole:
                return
            yield self._checked(_decoded(raw[:whole], self.format), at_s)
            at_s += 1

    def _checked(self, block: Samples, at_s: int) -> Samples:
        bad = np.flatnonzero(~np.isfinite(block))
        if bad.size:
            where = at_s + bad[0] / self.format.rate_hz
            raise self._error(f"the sample at {where:.3f} s is no number", "record again, or export it anew")
        return np.asarray(np.clip(block, -1.0, 1.0), np.float32)

    def _find_data(self) -> tuple[WavFormat, int]:
        """The format, and how many bytes of samples there are; the stream stands at the first."""
        known: WavFormat | None = None
        while len(head := self._stream.read(8)) == 8:
            kind, size = head[:4], struct.unpack("<I", head[4:])[0]
            if kind == b"data" and known is not None:
                return known, self._held(size, known)
            if kind == b"fmt ":
                known = self._format(self._stream.read(size + size % 2))
            else:
                self._stream.seek(size + size % 2, 1)
        missing = "sound" if known else "head"
        raise self._error(f"the file ends before its {missing}", "copy the whole file, or record again")

    def _held(self, size: int, known: WavFormat) -> int:
        there = self._size - self._stream.tell()
        if size == 0 or there == 0:
            raise self._error("it holds no sound", "record again")
        if size > there and size < _OPEN_END:
            per_s = known.rate_hz * known.frame_bytes
            told = f"it ends after {there / per_s:.1f} s, and its head says {size / per_s:.1f} s"
            raise self._error(told, "copy the whole file, or record again")
        return min(size, there)

    def _format(self, chunk: bytes) -> WavFormat:
        if len(chunk) < 16:
            raise self._error("the file ends before its head", "copy the whole file, or record again")
        tag, channels, rate_hz, _, _, bits = struct.unpack("<HHIIHH", chunk[:16])
        if tag == _EXTENSIBLE and len(chunk) >= 26:
            tag = struct.unpack("<H", chunk[24:26])[0]
        fits = bits in (8, 16, 24, 32) if tag == _PCM else tag == _FLOAT and bits in (32, 64)
        if not fits:
            raise self._error(f"samples of kind {tag} with {bits} bits are not read", _MEND)
        if rate_hz not in _RATES_HZ or not 1 <= channels <= _MOST_CHANNELS:
            told = f"{rate_hz} samples per second in {channels} channels are not read"
            raise self._error(told, "record at 16 kHz in one channel")
        return WavFormat(rate_hz, channels, bits, tag == _FLOAT)

    def _error(self, message: str, mend: str) -> InputError:
        return InputError(message, mend=mend, file=self._file)


def _decoded(raw: bytes, form: WavFormat) -> Samples:
    """The samples of all channels' mean, full scale at 1."""
    if form.floating:
        values = np.frombuffer(raw, "<f4" if form.bits == 32 else "<f8").astype(np.float64)
    elif form.bits == 8:
        values = (np.frombuffer(raw, np.uint8).astype(np.float64) - 128.0) / 128.0
    elif form.bits == 24:
        wide = np.zeros((len(raw) // 3, 4), np.uint8)
        wide[:, 1:] = np.frombuffer(raw, np.uint8).reshape(-1, 3)
        values = wide.view("<i4")[:, 0].astype(np.float64) / 2.0**31
    else:
        values = np.frombuffer(raw, f"<i{form.bits // 8}").astype(np.float64) / 2.0 ** (form.bits - 1)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(values.reshape(-1, form.channels).mean(axis=1), np.float32)


def _resampled(blocks: Iterator[Samples], rate_hz: int) -> Generator[Samples, None, None]:
    """The blocks of one second at RATE_HZ; each is filtered together with the ends of its neighbours."""
    if rate_hz == RATE_HZ:
        yield from blocks
        return
    up, down = RATE_HZ // gcd(RATE_HZ, rate_hz), rate_hz // gcd(RATE_HZ, rate_hz)
    context = down * -(-_CONTEXT * max(up, down) // (up * down))
    before = np.zeros(context, np.float32)
    held: Samples | None = None
    for block in blocks:
        if held is not None:
            yield _converted(before, held, block[:context], up, down)
            before = np.concatenate([before, held])[-context:]
        held = block
    if held is not None:
        yield _converted(before, held, np.zeros(0, np.float32), up, down)


def _converted(before: Samples, block: Samples, after: Samples, up: int, down: int) -> Samples:
    wide = resample_poly(np.concatenate([before, block, after]), up, down)
    start = len(before) * up // down
    return np.asarray(wide[start : start + len(block) * up // down], np.float32)
