"""Scores speech with synthetic voices: sentences of a world's own vocabulary, clear and in noise, and chatter.

    .venv/bin/python tests/benchmarks/speech/score.py --sentences 200 --chatter 200 --seed 2

Voices are those of this machine that did not serve in development (`--voices development` takes those that did, or
names them); without any it says so and ends with status 3. Sound is made anew each time and thrown away. A sentence
counts when its commands are right, the robot's name included; chatter counts as a false alarm when the robot feels
called, whatever it makes of it.
"""

import argparse
import json
import sys
import tempfile
import time
import wave
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import noise
import numpy as np
import sentences
import voices

from executive.cli.listen_command import listener_for
from executive.speech.sound import RATE_HZ, concatenate, read_wav
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world

NO_VOICE = 3
NOISES = ("white", "pink", "babble")


@dataclass(frozen=True)
class Case:
    """A sentence in a file, in one of the groups that are counted apart."""

    group: str
    voice: str
    said: sentences.Spoken
    wav: Path


def main() -> int:
    args = _arguments()
    found = _chosen(args.voices)
    if not found:
        print("no synthetic voice is installed here: apt-get install flite festival espeak-ng", file=sys.stderr)
        return NO_VOICE
    knowledge = load_knowledge(load_world(args.world).knowledge_path)
    begun = time.perf_counter()
    listener = listener_for(knowledge)
    loading_s = time.perf_counter() - begun
    with tempfile.TemporaryDirectory() as folder:
        cases = _cases(knowledge, found, Path(folder), args)
        counts, heard_s, spent_s = _score(listener, cases, show=args.show)
    result = _result(counts) | {
        "voices": sorted(found),
        "loading_s": round(loading_s, 2),
        "time_per_second_of_sound": round(spent_s / max(heard_s, 1e-9), 3),
        "peak_memory_mb": _peak_mb(),
    }
    print(json.dumps(result, indent=None if args.json else 1))
    return 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--world", default="flat")
    parser.add_argument("--sentences", type=int, default=200)
    parser.add_argument("--chatter", type=int, default=100)
    parser.add_argument("--noise-db", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--voices", default="held-out", help="held-out, development, or names with commas")
    parser.add_argument("--show", action="store_true", help="what went wrong, on standard error")
    parser.add_argument("--json", action="store_true", help="one line")
    return parser.parse_args()


def _chosen(wanted: str) -> dict[str, voices.Voice]:
    found = voices.installed()
    if wanted == "held-out":
        return voices.held_out(found)
    if wanted == "development":
        return voices.of_development(found)
    return {name: found[name] for name in wanted.split(",") if name in found}


def _cases(knowledge, found: Mapping[str, voices.Voice], folder: Path, args: argparse.Namespace) -> list[Case]:
    asked = sentences.requests(knowledge, args.sentences, args.seed)
    chat = sentences.chatter(knowledge, args.chatter, args.seed) if args.chatter else []
    clear = _spoken("clear", asked, found, folder)
    return [*clear, *_noisy(clear, folder, args), *_spoken("chatter", chat, found, folder)]


def _spoken(group: str, said: Sequence[sentences.Spoken], found, folder: Path) -> list[Case]:
    cases = []
    for number, (spoken, voice) in enumerate(zip(said, cycle(found.values()), strict=False)):
        wav = folder / f"{group}-{number}.wav"
        voice.speak(spoken.text, wav)
        cases.append(Case(group, voice.name, spoken, wav))
    return cases


def _noisy(clear: Sequence[Case], folder: Path, args: argparse.Namespace) -> list[Case]:
    draw = np.random.default_rng(args.seed)
    cases = []
    for number, (case, kind) in enumerate(zip(clear, cycle(NOISES), strict=False)):
        speech = concatenate(read_wav(case.wav)).astype(float)
        talkers = [concatenate(read_wav(clear[n].wav)) for n in draw.integers(len(clear), size=5)]
        sounds = {
            "white": lambda count: noise.white(count, draw),
            "pink": lambda count: noise.pink(count, draw),
            "babble": lambda count, talkers=talkers: noise.babble(count, draw, talkers),
        }
        wav = folder / f"noisy-{number}.wav"
        _write(wav, noise.mixed(speech, sounds[kind](len(speech)), args.noise_db))
        cases.append(Case("noisy", f"{case.voice} in {kind} noise", case.said, wav))
    return cases


def _write(wav: Path, sound: np.ndarray) -> None:
    with wave.open(str(wav), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(RATE_HZ)
        file.writeframes((sound * 32767).astype("<i2").tobytes())


def _score(listener, cases: Sequence[Case], *, show: bool) -> tuple[Counter, float, float]:
    counts, heard_s, spent_s = Counter(), 0.0, 0.0
    for case in cases:
        begun = time.perf_counter()
        heard = listener.hear_file(case.wav)
        spent_s += time.perf_counter() - begun
        heard_s += heard.loudness.count / RATE_HZ
        right = tuple(map(str, heard.commands)) == case.said.commands
        counts[case.group, "all"] += 1
        counts[case.group, "right"] += right
        counts[case.group, "called"] += heard.addressed
        counts[case.voice, "all"] += 1
        counts[case.voice, "right"] += right
        if show and (not right or heard.addressed != case.said.addressed):
            told = (case.group, case.voice, case.said.text, "->", heard.transcript, heard.status.value)
            print(*told, sep=" | ", file=sys.stderr)
    return counts, heard_s, spent_s


def _result(counts: Counter) -> dict[str, object]:
    def share(group: str, kind: str) -> float | None:
        return round(counts[group, kind] / counts[group, "all"], 4) if counts[group, "all"] else None

    asked = counts["clear", "all"] + counts["noisy", "all"]
    called = counts["clear", "called"] + counts["noisy", "called"]
    names = sorted({name for name, _ in counts} - {"clear", "noisy", "chatter"})
    return {
        "commands_right": {group: share(group, "right") for group in ("clear", "noisy")},
        "wake_missed": round(1 - called / asked, 4) if asked else None,
        "wake_missed_clear": round(1 - counts["clear", "called"] / max(counts["clear", "all"], 1), 4),
        "wake_false": share("chatter", "called"),
        "by_voice": {name: share(name, "right") for name in names},
    }


def _peak_mb() -> int:
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmHWM"))) // 1024


if __name__ == "__main__":
    sys.exit(main())
