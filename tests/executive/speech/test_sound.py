import struct

import numpy as np
import pytest
from made_speech import silence, tone, write_raw_wav, write_wav

from executive.speech.sound import RATE_HZ, Loudness, concatenate, level_db, read_wav
from skills.files.errors import InputError


def test_silence_differs_from_a_soft_voice():
    assert Loudness().with_block(silence(1.0)).silent
    assert not Loudness().with_block(tone(1.0, height=0.01)).silent


def test_flat_tops_at_full_scale_are_clipped():
    loud = np.clip(tone(1.0) * 4, -1.0, 1.0)
    assert Loudness().with_block(loud).much_clipped
    assert not Loudness().with_block(tone(1.0, height=0.95)).much_clipped


def test_single_samples_at_full_scale_are_not_clipped():
    peaks = tone(1.0, height=0.5)
    peaks[::100] = 1.0
    assert Loudness().with_block(peaks).clipped == 0


def test_blocks_add_up():
    whole, halves = tone(1.0), np.array_split(tone(1.0), 2)
    assert Loudness().with_block(halves[0]).with_block(halves[1]) == Loudness().with_block(whole)
    assert concatenate(halves).tolist() == whole.tolist()


def test_levels_are_in_decibels_below_full_scale():
    assert level_db(tone(1.0, height=1.0)) == pytest.approx(-3.01, abs=0.01)
    assert level_db(tone(1.0, height=0.1)) == pytest.approx(-23.01, abs=0.01)
    assert level_db(silence(1.0)) == -100.0
    assert level_db(silence(0.0)) == -100.0


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


def _refusal(file):
    with pytest.raises(InputError) as refused:
        list(read_wav(file))
    assert refused.value.file == file and refused.value.hint
    return refused.value.message


def test_text_is_no_wav_file(tmp_path):
    file = tmp_path / "a.wav"
    file.write_text("Hey Alice, fetch me a drink")
    assert "no wav file" in _refusal(file)


def test_empty_wav_file_is_refused(tmp_path):
    file = tmp_path / "a.wav"
    file.touch()
    assert "empty" in _refusal(file)


def test_missing_wav_file_is_refused(tmp_path):
    assert "no such file" in _refusal(tmp_path / "a.wav")


def test_folder_is_refused(tmp_path):
    assert "it is a folder" in _refusal(tmp_path)


@pytest.mark.parametrize("kept", [13, 20, 30, 40])
def test_file_cut_off_in_its_head_is_refused(tmp_path, kept):
    file = write_wav(tmp_path / "a.wav", tone(1.0))
    file.write_bytes(file.read_bytes()[:kept])
    assert "ends before its" in _refusal(file)


def test_error_says_how_much_sound_a_cut_off_file_lacks(tmp_path):
    file = write_wav(tmp_path / "a.wav", tone(2.0))
    file.write_bytes(file.read_bytes()[: 44 + RATE_HZ])
    assert _refusal(file) == "it ends after 0.5 s, and its head says 2.0 s"


def test_file_without_sound_is_refused(tmp_path):
    assert "no sound" in _refusal(write_wav(tmp_path / "a.wav", []))


def test_samples_of_an_unknown_type_are_refused(tmp_path):
    assert "no wav file" in _refusal(write_raw_wav(tmp_path / "a.wav", b"\0" * 99, tag=UNKNOWN, bits=8))


def test_unusual_sample_rate_is_refused(tmp_path):
    assert "1 samples per second" in _refusal(write_raw_wav(tmp_path / "a.wav", b"\0\0", tag=PCM, bits=16, rate_hz=1))


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_error_gives_the_time_of_a_sample_that_is_no_number(tmp_path, bad):
    data = struct.pack("<f", 0.1) * RATE_HZ + struct.pack("<f", bad)
    assert _refusal(write_raw_wav(tmp_path / "a.wav", data, tag=FLOAT, bits=32)) == "the sample at 1.000 s is no number"
