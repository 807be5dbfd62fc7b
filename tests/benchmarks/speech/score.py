"""Scores speech with synthetic voices: sentences of a world's own vocabulary, clear and in noise, and chatter.

    python -m tests.benchmarks.speech.score --sentences 200 --chatter 200 --seed 2

Voices are those of this machine that did not serve in development (`--voices development` takes those that did, or
names them); without any it says so and ends with status 3. Sound is made anew each time and thrown away. A sentence
counts when its commands are right, the robot's name included; chatter counts as a false alarm when the robot feels
called, whatever it makes of it. `--show` shows on standard error what went wrong.
"""

import tempfile
import time
import wave
from collections import Counter
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np

from executive.cli.listen_command import listener_for
from executive.speech.sound import RATE_HZ, concatenate, read_sound
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.harness import command, tell
from tests.benchmarks.speech.sentences import Spoken, make_chatter, make_requests
from tests.benchmarks.speech.voices import DEVELOPMENT, installed

NO_VOICE = 3
NOISES = ("white", "pink", "babble")


@dataclass(frozen=True)
class Case:
    """A sentence in a file, in one of the groups that are counted apart."""

    group: str
    voice: str
    said: Spoken
    wav: Path


def spoken(group, said, voices, folder):
    cases = []
    for number, (each, voice) in enumerate(zip(said, cycle(voices.values()), strict=False)):
        cases.append(Case(group, voice.name, each, folder / f"{group}-{number}.wav"))
        voice.speak(each.text, cases[-1].wav)
    return cases


def noise(kind, count, draw, talkers):
    """Noise as strong at all frequencies, with a power that falls as one over the frequency, or of several voices."""
    if kind == "white":
        return draw.standard_normal(count)
    if kind == "pink":
        spectrum = np.fft.rfft(draw.standard_normal(count))
        return np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1)), count)
    rolled = [np.roll(np.resize(talker, count), draw.integers(count)) for talker in talkers]
    return np.sum([sound / max(np.std(sound), 1e-9) for sound in rolled], axis=0)


def with_noise(clear, folder, ratio_db, seed):
    """The same sentences in noise, so strong that the mean power of the speech lies `ratio_db` above it."""
    draw, cases = np.random.default_rng(seed), []
    for number, (case, kind) in enumerate(zip(clear, cycle(NOISES), strict=False)):
        speech = concatenate(read_sound(case.wav)).astype(float)
        talkers = [concatenate(read_sound(clear[n].wav)) for n in draw.integers(len(clear), size=5)]
        sound = noise(kind, len(speech), draw, talkers)
        mixed = speech + sound * np.std(speech) / max(np.std(sound), 1e-12) / 10 ** (ratio_db / 20)
        mixed /= max(1.0, float(np.max(np.abs(mixed))) / 0.99)
        cases.append(Case("noisy", f"{case.voice} in {kind} noise", case.said, folder / f"noisy-{number}.wav"))
        with wave.open(str(cases[-1].wav), "wb") as file:
            file.setnchannels(1)
            file.setsampwidth(2)
            file.setframerate(RATE_HZ)
            file.writeframes((mixed * 32767).astype("<i2").tobytes())
    return cases


def score(
    world: str = "flat",
    sentences: int = 200,
    chatter: int = 100,
    noise_db: float = 10.0,
    seed: int = 2,
    voices: str = "held-out",
    show: bool = False,
):
    """Shares of sentences that are right, by group and voice, with times and memory."""
    own = {"held-out": lambda name: name not in DEVELOPMENT, "development": DEVELOPMENT.__contains__}
    takes = own.get(voices, voices.split(",").__contains__)
    found = {name: voice for name, voice in installed().items() if takes(name)}
    if not found:
        tell("no synthetic voice is installed here: apt-get install flite festival espeak-ng")
        return NO_VOICE
    knowledge = load_knowledge(load_world(world).knowledge_path)
    begun = time.perf_counter()
    listener = listener_for(knowledge)
    loading_s = time.perf_counter() - begun
    counts, heard_s, spent_s = Counter(), 0.0, 0.0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        clear = spoken("clear", make_requests(knowledge, sentences, seed), found, folder)
        noisy = with_noise(clear, folder, noise_db, seed)
        for case in [*clear, *noisy, *spoken("chatter", make_chatter(knowledge, chatter, seed), found, folder)]:
            begun = time.perf_counter()
            heard = listener.hear_file(case.wav)
            spent_s += time.perf_counter() - begun
            heard_s += heard.loudness.count / RATE_HZ
            right = tuple(map(str, heard.commands)) == case.said.commands
            for group in (case.group, case.voice):
                counts.update({(group, "all"): 1, (group, "right"): right, (group, "called"): heard.addressed})
            if show and (not right or heard.addressed != case.said.addressed):
                tell(f"{case.group} | {case.voice} | {case.said.text} -> {heard.transcript} | {heard.status.value}")
    return _figures(counts) | {
        "voices": sorted(found),
        "loading_s": round(loading_s, 2),
        "time_per_second_of_sound": round(spent_s / max(heard_s, 1e-9), 3),
        "peak_memory_mb": _peak_mb(),
    }


def _figures(counts):
    def share(kind, *groups):
        every = sum(counts[group, "all"] for group in groups)
        return round(sum(counts[group, kind] for group in groups) / every, 4) if every else None

    def missed(*groups):
        called = share("called", *groups)
        return None if called is None else round(1.0 - called, 4)

    names = sorted({name for name, _ in counts} - {"clear", "noisy", "chatter"})
    return {
        "commands_right": {group: share("right", group) for group in ("clear", "noisy")},
        "wake_missed": missed("clear", "noisy"),
        "wake_missed_clear": missed("clear"),
        "wake_false": share("called", "chatter"),
        "by_voice": {name: share("right", name) for name in names},
    }


def _peak_mb():
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM"))) // 1024


if __name__ == "__main__":
    command(score)
