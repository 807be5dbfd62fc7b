"""Synthetic voices found on this machine, each of which speaks a sentence into a wav file.

Test tools only: Debian's `espeak-ng`, `flite` and `festival`, and `piper` with a voice named by the environment
variable PIPER_VOICE (an .onnx file). What is not installed is left out.
"""

import os
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Voice:
    """A voice: `command` speaks the text given on its standard input into the file that stands for {wav}."""

    name: str
    command: Sequence[str]

    def speak(self, text: str, wav: Path) -> None:
        """Write `text` as sound to `wav`."""
        made = [part.format(wav=wav) for part in self.command]
        subprocess.run(made, input=text.encode(), check=True, capture_output=True)


DEVELOPMENT = ("flite-kal16", "flite-rms", "espeak-us", "espeak-gb", "festival-kal")
"""The voices that served in development; figures are taken with the others."""


def installed() -> dict[str, Voice]:
    """All voices of this machine by name."""
    found = [*_espeak(), *_flite(), *_festival(), *_piper()]
    return {voice.name: voice for voice in found}


def of_development(voices: Mapping[str, Voice]) -> dict[str, Voice]:
    """Those that served in development."""
    return {name: voice for name, voice in voices.items() if name in DEVELOPMENT}


def held_out(voices: Mapping[str, Voice]) -> dict[str, Voice]:
    """Those that did not."""
    return {name: voice for name, voice in voices.items() if name not in DEVELOPMENT}


def _espeak() -> list[Voice]:
    if shutil.which("espeak-ng") is None:
        return []
    accents = {"us": "en-us", "gb": "en-gb", "scotland": "en-gb-scotland", "rp-f": "en-gb-x-rp+f3"}
    return [
        Voice(f"espeak-{name}", ("espeak-ng", "-v", accent, "-s", "150", "-w", "{wav}", "--stdin"))
        for name, accent in accents.items()
    ]


def _flite() -> list[Voice]:
    if shutil.which("flite") is None:
        return []
    return [
        Voice(f"flite-{name}", ("flite", "-voice", name, "-f", "/dev/stdin", "-o", "{wav}"))
        for name in ("kal16", "rms", "awb", "slt")
    ]


def _festival() -> list[Voice]:
    if shutil.which("text2wave") is None:
        return []
    listed = subprocess.run(["festival", "-b", "(print (voice.list))"], capture_output=True, text=True, check=True)
    known = {"kal": "kal_diphone", "ked": "ked_diphone", "slt-hts": "cmu_us_slt_arctic_hts"}
    return [
        Voice(f"festival-{name}", ("text2wave", "-o", "{wav}", "-eval", f"(voice_{voice})"))
        for name, voice in known.items()
        if voice in listed.stdout
    ]


def _piper() -> list[Voice]:
    model, piper = os.environ.get("PIPER_VOICE"), shutil.which("piper")
    if not model or piper is None:
        return []
    return [Voice("piper", (piper, "--model", model, "--output-file", "{wav}"))]
