import re
import struct

import numpy as np
import pytest
import soundfile
from made_speech import silence, tone, write_raw_wav, write_wav

from executive.speech.sound import RATE_HZ, Loudness, concatenate, level_db, read_sound
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
    heard = concatenate(read_sound(file))
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
    heard = concatenate(read_sound(write_raw_wav(tmp_path / "a.wav", half * 100, tag=tag, bits=bits)))
    assert heard == pytest.approx(np.full(100, 0.5), abs=0.005)


def test_extensible_head_gives_the_type_further_on(tmp_path):
    extra = struct.pack("<HHIH", 22, 16, 0, PCM) + bytes.fromhex("0000 0000 1000 8000 00aa 0038 9b71")
    file = write_raw_wav(tmp_path / "a.wav", struct.pack("<h", 2**14) * 9, tag=EXTENSIBLE, bits=16, extra=extra)
    assert len(concatenate(read_sound(file))) == 9


def test_other_chunks_before_the_sound_are_left_out(tmp_path):
    file = write_wav(tmp_path / "a.wav", tone(0.5))
    whole = file.read_bytes()
    file.write_bytes(whole[:36] + b"LIST" + struct.pack("<I", 5) + b"INFO!\0" + whole[36:])
    assert len(concatenate(read_sound(file))) == RATE_HZ // 2


@pytest.mark.parametrize("size", [0xFFFF_FFFF, 0x7FFF_FFFF])
def test_a_recorder_that_did_not_know_the_length_is_read_to_the_end(tmp_path, size):
    file = write_raw_wav(tmp_path / "a.wav", b"\0\1" * 50, tag=PCM, bits=16, size=size)
    assert len(concatenate(read_sound(file))) == 50


@pytest.mark.parametrize("peak", [1.5, 150.0, 32768.0])
def test_samples_beyond_full_scale_are_scaled_by_their_peak(tmp_path, peak):
    soundfile.write(file := tmp_path / "a.wav", tone(1.5, height=peak), RATE_HZ, subtype="FLOAT")
    assert concatenate(read_sound(file)) == pytest.approx(tone(1.5, height=1.0), abs=0.001)


#   name of the file       form of soundfile
FORMS = [
    ("gsm.wav", {"subtype": "GSM610"}),
    ("g721.wav", {"subtype": "G721_32"}),
    ("nms.wav", {"subtype": "NMS_ADPCM_32"}),
    ("adpcm.wav", {"subtype": "IMA_ADPCM"}),
    ("a.flac", {}),
    ("a.au", {"subtype": "PCM_16"}),
    ("float.au", {"subtype": "FLOAT"}),
    ("a.w64", {"format": "W64"}),
    ("gsm.w64", {"format": "W64", "subtype": "GSM610"}),
    ("a.aiff", {}),
    ("a.rf64", {"format": "RF64"}),
    ("a.caf", {}),
    ("a.ogg", {}),
    ("a.mp3", {"format": "MP3"}),
]


@pytest.mark.parametrize(("name", "form"), FORMS, ids=[name for name, _ in FORMS])
def test_recordings_of_other_kinds_are_read(tmp_path, name, form):
    said = tone(2.3, rate_hz=8_000)
    soundfile.write(tmp_path / name, said, 8_000, **form)
    heard = concatenate(read_sound(tmp_path / name))
    assert len(heard) == pytest.approx(2.3 * RATE_HZ, abs=1_500)
    spectrum = np.abs(np.fft.rfft(heard[:RATE_HZ]))
    assert int(spectrum.argmax()) == 440 and level_db(heard) == pytest.approx(level_db(said), abs=0.5)


# Heads of m4a, WebM, AAC and AMR.
@pytest.mark.parametrize("head", [b"\0\0\0\x1cftypM4A ", b"\x1aE\xdf\xa3", b"\xff\xf1P", b"#!AMR\n"])
def test_a_recording_of_a_phone_or_browser_is_refused_with_a_way_to_convert_it(tmp_path, head):
    (tmp_path / "a.m4a").write_bytes(head + bytes(100))
    with pytest.raises(InputError, match=r"a.m4a: it is a recording of a phone .* ffmpeg -i a.m4a a.wav"):
        concatenate(read_sound(tmp_path / "a.m4a"))


def with_sizes(content, riff, data):
    at = content.index(b"data") + 4
    return content[:4] + struct.pack("<I", riff) + content[8:at] + struct.pack("<I", data) + content[at + 4 :]


#   sizes in the head (None: the right one)
@pytest.mark.parametrize(
    ("riff", "data"), [(36, 0), (0, 0), (8, 0), (None, 0), (0xFFFF_FFFF, 0xFFFF_FFFF), (0, 0xFFFF_FFFF), (4_132, 4_096)]
)
@pytest.mark.parametrize("subtype", ["PCM_16", "FLOAT"])
def test_a_recording_whose_head_was_never_finished_is_read_to_its_end(tmp_path, riff, data, subtype):
    soundfile.write(file := tmp_path / "a.wav", tone(1.3), RATE_HZ, subtype=subtype)
    whole = file.read_bytes()
    file.write_bytes(with_sizes(whole, len(whole) - 8 if riff is None else riff, data))
    assert concatenate(read_sound(file)) == pytest.approx(tone(1.3), abs=0.001)


#   format, place and length of the size that is 0
@pytest.mark.parametrize(("form", "sizes"), [("AU", [(8, 4)]), ("RF64", [(20, 24)]), ("AIFF", [(4, 4)])])
def test_the_size_may_be_missing_in_other_heads_too(tmp_path, form, sizes):
    soundfile.write(file := tmp_path / "a", tone(1.3), RATE_HZ, format=form, subtype="PCM_16")
    content = bytearray(file.read_bytes())
    for at, length in sizes:
        content[at : at + length] = bytes(length)
    file.write_bytes(content)
    assert concatenate(read_sound(file)) == pytest.approx(tone(1.3), abs=0.001)


def test_a_flac_stream_without_a_length_is_read_to_its_end(tmp_path):
    soundfile.write(file := tmp_path / "a.flac", tone(1.3), RATE_HZ)
    content = bytearray(file.read_bytes())
    content[21] &= 0xF0
    content[22:26] = bytes(4)
    file.write_bytes(content)
    assert concatenate(read_sound(file)) == pytest.approx(tone(1.3), abs=0.001)


def voice():
    """A tone that comes and goes, as syllables do."""
    return np.concatenate([tone(0.2), silence(0.1)] * 10)


NOISE = np.random.default_rng(1).normal(0.0, 0.3, len(voice()))
HUM = 0.5 * np.sign(np.sin(2 * np.pi * 50.0 * np.arange(len(voice())) / RATE_HZ))


@pytest.mark.parametrize(
    "channels",
    [
        (voice(), -voice()),
        (-voice(), voice()),
        (voice(), -0.7 * voice()),
        (voice(), -voice(), voice(), -voice()),
        (voice(), NOISE),
        (NOISE, voice()),
        (voice(), HUM),
        (voice(), voice() + NOISE),
        (voice(), 0 * voice()),
        (voice(), np.clip(40 * voice(), -1, 1)),
        (0 * voice(), NOISE, voice(), NOISE),
        (voice(), 200 * NOISE),
    ],
)
def test_the_better_channel_is_heard(tmp_path, channels):
    soundfile.write(file := tmp_path / "a.wav", np.stack(channels, axis=1), RATE_HZ, subtype="FLOAT")
    heard = concatenate(read_sound(file))
    assert np.corrcoef(np.abs(heard), np.abs(voice()))[0, 1] > 0.99 and np.abs(heard).max() > 0.4


def test_two_speakers_with_a_channel_each_are_both_heard(tmp_path):
    first, second = np.concatenate([voice(), 0 * voice()]), np.concatenate([0 * voice(), 0.5 * voice()])
    soundfile.write(file := tmp_path / "a.wav", np.stack([first, second], axis=1), RATE_HZ)
    assert concatenate(read_sound(file)) == pytest.approx((first + second) / 2, abs=0.001)


def test_a_damaged_mp3_writes_no_lines_of_its_decoder(tmp_path, capfd):
    soundfile.write(file := tmp_path / "a.mp3", tone(2.0), RATE_HZ, format="MP3")
    file.write_bytes(file.read_bytes()[:2_000])
    assert 0 < len(concatenate(read_sound(file))) < 2 * RATE_HZ
    assert capfd.readouterr().err == ""


def cut_off(seconds, kept):
    return lambda file: file.write_bytes(write_wav(file, tone(seconds)).read_bytes()[:kept])


def cut_off_flac(file):
    soundfile.write(file, np.random.default_rng(1).normal(0, 0.1, 3 * RATE_HZ), RATE_HZ, format="FLAC")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


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
        (lambda file: file.write_text("Hey Alice, fetch me a drink"), "no recording"),
        (cut_off(1.0, 13), "ends before its"),
        (cut_off(1.0, 20), "ends before its"),
        (cut_off(1.0, 30), "ends before its"),
        (cut_off(1.0, 40), "ends before its"),
        (cut_off(2.0, 44 + RATE_HZ), r"^it ends after 0\.5 s, and its head says 2\.0 s$"),
        (lambda file: write_wav(file, []), "no sound"),
        (cut_off_flac, r"^it ends after 1\.\d s, and its head says 3\.0 s$"),
        (raw(b"\0" * 99, tag=UNKNOWN, bits=8), "no recording"),
        (raw(b"\0\0", tag=PCM, bits=16, rate_hz=1), "1 samples per second"),
        (raw(TENTHS + struct.pack("<f", float("nan")), tag=FLOAT, bits=32), NO_NUMBER),
        (raw(TENTHS + struct.pack("<f", float("inf")), tag=FLOAT, bits=32), NO_NUMBER),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, make, message):
    make(file := tmp_path / "a.wav")
    with pytest.raises(InputError) as refused:
        list(read_sound(file))
    assert refused.value.file == file and refused.value.hint
    assert re.search(message, refused.value.message)
