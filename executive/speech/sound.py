"""Reads sound as samples from wav files of any rate, width and channels, and measures its loudness."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from skills.inputs.errors import InputError
from skills.inputs.outside import plain_file

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
MOST_BYTES: Final = 8_000_000_000
_RATES_HZ: Final = range(4_000, 384_001)
_SAMPLE_BYTES: Final = {"PCM_U8": 1, "PCM_16": 2, "PCM_24": 3, "PCM_32": 4, "FLOAT": 4, "DOUBLE": 8}
_CONTEXT: Final = 16
"""Samples of the neighbouring blocks, at the lower rate, that resampling of a block needs."""
_HINT: Final = "save the recording as a plain wav file (PCM or float)"


def read_wav(file: Path) -> Iterator[Samples]:
    """Reads a wav file in blocks of one second at RATE_HZ, with averaged channels; the last block may be shorter.

    Only a few blocks are in memory at a time.

    Raises:
        InputError: when the first or a later block is asked for: it cannot be read, is no wav file, ends before its
            head says, holds no sound, or holds samples that are no numbers.
    """
    from soundfile import LibsndfileError, SoundFile

    plain_file(file, most_bytes=MOST_BYTES, hint="name a wav file")
    try:
        with file.open("rb") as stream:
            head = stream.read(_HEAD_BYTES)
        with SoundFile(file) as sound, closing(_resampled(_blocks(file, head, sound), sound.samplerate)) as blocks:
            yield from blocks
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", hint="name a wav file", file=file) from error
    except LibsndfileError as error:
        raise _unreadable(file, head, error.error_string) from error


def _blocks(file: Path, head: bytes, sound: SoundFile) -> Iterator[Samples]:
    """Blocks of one second, at the file's own rate."""
    rate_hz, there_s = sound.samplerate, sound.frames / sound.samplerate
    if rate_hz not in _RATES_HZ:
        hint = "record at 16 kHz in one channel"
        raise InputError(f"{rate_hz} samples per second are not read", hint=hint, file=file)
    size = int.from_bytes(head[4:8], "little")
    missing = 0 if size >= _OPEN_END else size + 8 - file.stat().st_size
    if missing > 1:
        missing_s = missing / (rate_hz * sound.channels * _SAMPLE_BYTES.get(sound.subtype, 1))
        what = f"it ends after {there_s:.1f} s, and its head says {there_s + missing_s:.1f} s"
        raise InputError(what, hint="copy the whole file, or record again", file=file)
    if sound.frames == 0:
        raise InputError("it holds no sound", hint="record again", file=file)
    for at_s, frames in enumerate(sound.blocks(rate_hz, dtype="float64", always_2d=True)):
        block = frames.mean(axis=1)
        bad = np.flatnonzero(~np.isfinite(block))
        if bad.size:
            where = at_s + bad[0] / rate_hz
            what = f"the sample at {where:.3f} s is no number"
            raise InputError(what, hint="record again, or export it again", file=file)
        yield np.asarray(np.clip(block, -1.0, 1.0), np.float32)


def _unreadable(file: Path, head: bytes, reason: str) -> InputError:
    """Error of a file without sound."""
    if not head:
        return InputError("the file is empty", hint="record again", file=file)
    if head[:4] == b"RIFF" and len(head) < _HEAD_BYTES:
        return InputError("the file ends before its sound", hint="copy the whole file, or record again", file=file)
    return InputError(f"this is no wav file ({reason.rstrip('.')})", hint=_HINT, file=file)


def _resampled(blocks: Iterator[Samples], rate_hz: int) -> Generator[Samples, None, None]:
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
