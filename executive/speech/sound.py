"""Reads sound as samples from recordings of any kind, rate, width and channels, and measures its loudness."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import gcd
from mmap import ACCESS_COPY, mmap
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from skills.inputs.errors import InputError
from skills.inputs.outside import native_stderr_dropped, plain_file
from skills.robot import FloatArray

if TYPE_CHECKING:
    from soundfile import SoundFile

Samples = npt.NDArray[np.float32]
"""Sound of one channel at RATE_HZ; full scale is -1 to 1."""

RATE_HZ: Final = 16_000
_CLIP_LEVEL: Final = 0.999
_CLIP_RUN: Final = 3
_MUCH_CLIPPED: Final = 0.002
_SILENT_LEVEL: Final = 1e-3


@dataclass(frozen=True)
class Loudness:
    """Loudness of a sound: number of samples, greatest sample (1 is full scale), and number of clipped samples.

    A sample counts as clipped if it belongs to a run of at least `_CLIP_RUN` samples at full scale.
    """

    count: int = 0
    peak: float = 0.0
    clipped: int = 0

    def with_block(self, block: Samples) -> Loudness:
        """Loudness of the sound so far and one more block, of any rate."""
        if not block.size:
            return self
        height = np.abs(block)
        return Loudness(
            self.count + block.size, max(self.peak, float(height.max())), self.clipped + _runs(height >= _CLIP_LEVEL)
        )

    @property
    def silent(self) -> bool:
        """Returns whether no sample is louder than 60 dB below full scale."""
        return self.peak < _SILENT_LEVEL

    @property
    def much_clipped(self) -> bool:
        """Returns whether so many samples (one in 500) are clipped that words may be lost."""
        return self.clipped > _MUCH_CLIPPED * self.count


def level_db(block: Samples) -> float:
    """Mean power of a block in decibels below full scale (0 is a square wave at full scale), at least -100."""
    power = float(np.mean(np.square(block))) if block.size else 0.0
    return max(10.0 * float(np.log10(max(power, 1e-10))), -100.0)


def concatenate(blocks: Iterable[Samples]) -> Samples:
    """Concatenates blocks."""
    return np.concatenate([np.zeros(0, np.float32), *blocks])


def _runs(flags: npt.NDArray[np.bool_]) -> int:
    """Number of flags in runs of at least _CLIP_RUN."""
    from scipy.ndimage import binary_opening

    return int(binary_opening(flags, np.ones(_CLIP_RUN)).sum())


_OPEN_END: Final = 0x7FFF_F000
"""Size from which on the head's writer did not know it (recorders that write into a pipe)."""
_HEAD_BYTES: Final = 44
_PHONES: Final = re.compile(rb".{4}ftyp|\x1aE\xdf\xa3|\xff[\xf1\xf9]|#!AMR", re.DOTALL)
"""Heads of MP4 (m4a), WebM, AAC and AMR, which libsndfile does not read."""
MOST_BYTES: Final = 8_000_000_000
_RATES_HZ: Final = range(4_000, 384_001)
_CONTEXT: Final = 16
"""Samples of the neighbouring blocks, at the lower rate, that resampling of a block needs."""


def read_sound(file: Path) -> Iterator[Samples]:
    """Reads a recording in blocks of one second at RATE_HZ, as one channel; the last block may be shorter.

    Only a few blocks are in memory at a time: the file is read twice, first to measure its channels.

    Raises:
        InputError: when the first or a later block is asked for: it cannot be read, is no recording, ends before its
            head says, holds no sound, or holds samples that are no numbers.
    """
    from soundfile import LibsndfileError

    plain_file(file, most_bytes=MOST_BYTES, hint="name a recording")
    try:
        with file.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
        if _PHONES.match(head):
            hint = f"convert it: ffmpeg -i {file.name} {file.stem}.wav"
            raise InputError("it is a recording of a phone or browser", hint=hint, file=file)
        with _opened(file) as sound:
            rate_hz, gains = sound.samplerate, mixing(_blocks(file, head, sound), sound.samplerate)
        with _opened(file) as sound:
            mixed = (np.asarray(np.clip(block @ gains, -1, 1), np.float32) for block in _blocks(file, head, sound))
            yield from _resampled(mixed, rate_hz)
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", hint="name a recording", file=file) from error
    except LibsndfileError as error:
        raise _unreadable(file, head, error.error_string) from error


@contextmanager
def _opened(file: Path) -> Iterator[SoundFile]:
    """Opens a recording; sets the size of its sound in a copy when its recorder ended before it wrote the size."""
    from soundfile import SoundFile

    if not file.stat().st_size:
        raise _unreadable(file, b"", "")
    with file.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_COPY) as memory:
        with native_stderr_dropped():
            sound = SoundFile(memory if _finish_head(memory) else file)
        with sound:
            yield sound


def _finish_head(memory: mmap) -> bool:
    """Writes the size of the sound into the head of a wav or AU file that lacks it; returns whether it did."""
    if memory[:4] == b".snd" and not any(memory[8:12]):
        memory[8:12] = b"\xff" * 4
        return True
    at, endless = 12, memory[:4] == b"RF64" and not any(memory[28:36])
    if memory[:4] != b"RIFF" and not endless:
        return False
    while memory[at : at + 4] not in (b"data", b""):
        at += 8 + -(-int.from_bytes(memory[at + 4 : at + 8], "little") // 2) * 2
    start, size = at + 8, int.from_bytes(memory[at + 4 : at + 8], "little")
    after = memory[start + size : start + size + 8]
    if (len(after) < 8 and not endless) or re.match(rb"[ -~]{4}", after):  # the file ends, or another chunk begins
        return False
    memory[:8] = b"RIFF" + b"\xff" * 4
    memory[at + 4 : start] = min(len(memory) - start, _OPEN_END).to_bytes(4, "little")
    return True


def _blocks(file: Path, head: bytes, sound: SoundFile) -> Iterator[FloatArray]:
    """Blocks of one second, at the file's own rate."""
    rate_hz, at, whole, there = sound.samplerate, 0, _size_of_head(head), file.stat().st_size
    if rate_hz not in _RATES_HZ:
        raise InputError(f"{rate_hz} samples per second are not read", hint="record at 16 kHz", file=file)
    if whole > there + 1:
        raise _cut_off(file, sound.frames / rate_hz, sound.frames / rate_hz * whole / there)
    while (block := _next_second(sound)).size:
        bad = np.flatnonzero(~np.isfinite(block).all(axis=1))
        if bad.size:
            what = f"the sample at {(at + bad[0]) / rate_hz:.3f} s is no number"
            raise InputError(what, hint="record again, or export it again", file=file)
        yield block
        at += len(block)
    if at == 0:
        raise InputError("it holds no sound", hint="record again", file=file)
    if sound.format == "FLAC" and at < sound.frames < _OPEN_END:
        raise _cut_off(file, at / rate_hz, sound.frames / rate_hz)


def _next_second(sound: SoundFile) -> FloatArray:
    """Samples of the next second, a row for each time; a decoder of FLAC fails at the end, and has given the rest."""
    from soundfile import LibsndfileError

    block = np.full((sound.samplerate, sound.channels), np.inf)
    try:
        with native_stderr_dropped():
            return np.asarray(sound.read(out=block))
    except LibsndfileError:
        if sound.format != "FLAC":
            raise
        return block[: np.count_nonzero(np.isfinite(block[:, 0]))]


def _size_of_head(head: bytes) -> int:
    """Bytes of the whole file as its head says; 0 if it does not."""
    little, big = struct.unpack_from("<4xI8xQ", head.ljust(24)), struct.unpack_from(">4xII", head.ljust(24))
    sizes = {b"RIFF": (little[0], 8), b"FORM": (big[0], 8), b".snd": big[::-1], b"riff": (little[1], 0)}
    size, more = sizes.get(head[:4], (0, 0))
    return size + more if size < _OPEN_END else 0


def _cut_off(file: Path, there_s: float, whole_s: float) -> InputError:
    what = f"it ends after {there_s:.1f} s, and its head says {whole_s:.1f} s"
    return InputError(what, hint="copy the whole file, or record again", file=file)


_FRAMES_PER_S: Final = 50
_MOST_CONTRAST_DB: Final = 40.0
_WORSE_DB: Final = 12.0
_OPPOSED: Final = -0.3  # correlation with the best channel below which a channel takes away from it


def mixing(blocks: Iterable[FloatArray], rate_hz: int) -> FloatArray:
    """Gain of each channel: the mean of those that do not harm the best one; a peak beyond 1 becomes 1.

    The best channel's level varies most, as speech does and noise does not; much steadier channels, clipped ones beside
    one that is not, and inverted ones are left out.
    """
    count, peaks, clipped, products, levels = zip(*(_measure(block, rate_hz) for block in blocks), strict=True)
    low, high = np.percentile(np.concatenate(levels), (10, 95), axis=0)
    power = sum(products).diagonal()
    contrast = np.minimum(high - low, _MOST_CONTRAST_DB) - _WORSE_DB * (sum(clipped) > _MUCH_CLIPPED * sum(count))
    best = int(np.lexsort((power, contrast))[-1])
    alike = sum(products)[best] / np.sqrt(np.maximum(power * power[best], 1e-24))
    heard = (contrast > contrast[best] - _WORSE_DB) & (alike > _OPPOSED)
    return np.asarray(heard / heard.sum() / max(1.0, np.max(peaks, axis=0)[heard].max()))


def _measure(block: FloatArray, rate_hz: int) -> tuple[int, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Length, and for each channel: peak, clipped samples; of the differences: products with others, levels in dB."""
    height, change = np.abs(block), np.diff(block, axis=0, prepend=block[:1])
    frames = np.array_split(change, -(-_FRAMES_PER_S * len(block) // rate_hz))
    levels = [10.0 * np.log10(np.square(frame).mean(axis=0) + 1e-10) for frame in frames]
    return len(block), height.max(axis=0), (height >= _CLIP_LEVEL).sum(axis=0), change.T @ change, np.array(levels)


def _unreadable(file: Path, head: bytes, reason: str) -> InputError:
    """Error of a file without sound."""
    if not head:
        return InputError("the file is empty", hint="record again", file=file)
    if head[:4] == b"RIFF" and len(head) < _HEAD_BYTES:
        return InputError("the file ends before its sound", hint="copy the whole file, or record again", file=file)
    return InputError(
        f"this is no recording that can be read ({reason.rstrip('.')})", hint="save it as wav or FLAC", file=file
    )


def _resampled(blocks: Iterator[Samples], rate_hz: int) -> Iterator[Samples]:
    """Blocks of one second at RATE_HZ; each is filtered together with the ends of its neighbours."""
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
    from scipy.signal import resample_poly

    wide = resample_poly(np.concatenate([before, block, after]), up, down)
    start = len(before) * up // down
    return np.asarray(wide[start : start + len(block) * up // down], np.float32)
