import re
import struct

import numpy as np
import pytest
from made_speech import silence, tone, write_raw_wav, write_wav

from executive.speech.sound import RATE_HZ, Loudness, concatenate, level_db, read_wav
from skills.inputs.errors import InputError


def test_silence_differs_from_a_soft_voice():
    assert [Loudness().with_block(each).silent for each in (silence(1.0), tone(1.0, height=0.01))] == [True, False]


def test_flat_tops_at_full_scale_are_clipped_and_single_samples_are_not():
    flat, peaks = np.clip(tone(1.0) * 4, -1.0, 1.0), tone(1.0, height=0.5)
    assert [Loudness().with_block(each).much_clipped for each in (flat, tone(1.0, height=0.95))] == [True, False]
    peaks[::100] = 1.0
    assert Loudness().with_block(peaks).clipped == 0


def test_blocks_add_up():
    whole, halves = tone(1.0), np.array_split(tone(1.0), 2)
    assert Loudness().with_block(halves[0]).with_block(halves[1]) == Loudness().with_block(whole)
    assert concatenate(halves).tolist() == whole.tolist()


def test_levels_are_in_decibels_below_full_scale():
    sounds = tone(1.0, height=1.0), tone(1.0, height=0.1), silence(1.0), silence(0.0)
    levels_db = [pytest.approx(-3.01, abs=0.01), pytest.approx(-23.01, abs=0.01), -100.0, -100.0]
    assert list(map(level_db, sounds)) == levels_db


PCM, FLOAT, UNKNOWN, EXTENSIBLE = 1, 3, 0x4242, 0xFFFE
EDGE = 400  # samples at either end, where a change of the rate has no neighbours to look at


@pytest.mark.parametrize("rate_hz", [8_000, 11_025, 16_000, 22_050, 44_100, 48_000])
@pytest.mark.parametrize("channels", [1, 2])
def test_any_rate_and_stereo_become_one_channel_at_16_khz(tmp_path, rate_hz, channels):
    file = write_wav(tmp_path / "a.wav", tone(2.3, rate_hz=rate_hz), rate_hz=rate_hz, channels=channels)
    heard = concatenate(read_wav(file))
    assert len(heard) == pytest.approx(2.3 * RATE_HZ, abs=1)
    assert np.abs(heard - tone(2.3)[: len(heard)])[EDGE:-EDGE].max() < 0.002


#   tag, bits: how one sample of half height is written
WRITTEN = [
    (PCM, 8, b"\xc0"),
    (PCM, 16, struct.pack("<h", 2**14)),
    (PCM, 24, struct.pack("<i", 2**22)[:3]),
    (PCM, 32, struct.pack("<i", 2**30)),
    (FLOAT, 32, struct.pack("<f", 0.5)),
    (FLOAT, 64, struct.pack("<d", 0.5)),
]


@pytest.mark.parametrize(("tag", "bits", "half"), WRITTEN)
def test_every_width_is_read(tmp_path, tag, bits, half):
    heard = concatenate(read_wav(write_raw_wav(tmp_path / "a.wav", half * 100, tag=tag, bits=bits)))
    assert heard == pytest.approx(np.full(100, 0.5), abs=0.005)


def test_extensible_head_gives_the_type_further_on(tmp_path):
    extra = struct.pack("<HHIH", 22, 16, 0, PCM) + bytes.fromhex("0000 0000 1000 8000 00aa 0038 9b71")
    file = write_raw_wav(tmp_path / "a.wav", struct.pack("<h", 2**14) * 9, tag=EXTENSIBLE, bits=16, extra=extra)
    assert len(concatenate(read_wav(file))) == 9


def test_other_chunks_before_the_sound_are_left_out(tmp_path):
    file = write_wav(tmp_path / "a.wav", tone(0.5))
    whole = file.read_bytes()
    file.write_bytes(whole[:36] + b"LIST" + struct.pack("<I", 5) + b"INFO!\0" + whole[36:])
    assert len(concatenate(read_wav(file))) == RATE_HZ // 2


@pytest.mark.parametrize("size", [0xFFFF_FFFF, 0x7FFF_FFFF])
def test_a_recorder_that_did_not_know_the_length_is_read_to_the_end(tmp_path, size):
    file = write_raw_wav(tmp_path / "a.wav", b"\0\1" * 50, tag=PCM, bits=16, size=size)
    assert len(concatenate(read_wav(file))) == 50


def test_samples_beyond_full_scale_are_cut(tmp_path):
    file = write_raw_wav(tmp_path / "a.wav", struct.pack("<f", 7.0) * 4, tag=FLOAT, bits=32)
    assert concatenate(read_wav(file)).tolist() == [1.0] * 4


def cut_off(seconds, kept):
    return lambda file: file.write_bytes(write_wav(file, tone(seconds)).read_bytes()[:kept])


def raw(data, **form):
    return lambda file: write_raw_wav(file, data, **form)


TENTHS = struct.pack("<f", 0.1) * RATE_HZ
NO_NUMBER = r"^the sample at 1\.000 s is no number$"


#   what makes the file                                     a part of the refusal
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda file: None, "no such file"),
        (lambda file: file.mkdir(), "it is a folder"),
        (lambda file: file.touch(), "empty"),
        (lambda file: file.write_text("Hey Alice, fetch me a drink"), "no wav file"),
        (cut_off(1.0, 13), "ends before its"),
        (cut_off(1.0, 20), "ends before its"),
        (cut_off(1.0, 30), "ends before its"),
        (cut_off(1.0, 40), "ends before its"),
        (cut_off(2.0, 44 + RATE_HZ), r"^it ends after 0\.5 s, and its head says 2\.0 s$"),
        (lambda file: write_wav(file, []), "no sound"),
        (raw(b"\0" * 99, tag=UNKNOWN, bits=8), "no wav file"),
        (raw(b"\0\0", tag=PCM, bits=16, rate_hz=1), "1 samples per second"),
        (raw(TENTHS + struct.pack("<f", float("nan")), tag=FLOAT, bits=32), NO_NUMBER),
        (raw(TENTHS + struct.pack("<f", float("inf")), tag=FLOAT, bits=32), NO_NUMBER),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, make, message):
    make(file := tmp_path / "a.wav")
    with pytest.raises(InputError) as refused:
        list(read_wav(file))
    assert refused.value.file == file and refused.value.hint
    assert re.search(message, refused.value.message)
