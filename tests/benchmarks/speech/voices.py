"""Synthetic voices found on this machine, each of which speaks a sentence into a wav file.

Test tools only: Debian's `espeak-ng`, `flite` and `festival`, and `piper` with a voice named by the environment
variable PIPER_VOICE (an .onnx file). Voices that are not installed are left out.
"""

import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

DEVELOPMENT = ("flite-kal16", "flite-rms", "espeak-us", "espeak-gb", "festival-kal")
"""Voices that served in development; figures are taken with the others."""
ESPEAK = {"us": "en-us", "gb": "en-gb", "scotland": "en-gb-scotland", "rp-f": "en-gb-x-rp+f3"}
FLITE = ("kal16", "rms", "awb", "slt")
FESTIVAL = {"kal": "kal_diphone", "ked": "ked_diphone", "slt-hts": "cmu_us_slt_arctic_hts"}


@dataclass(frozen=True)
class Voice:
    """A voice: `command` speaks the text given on its standard input into the file that stands for {wav}."""

    name: str
    command: Sequence[str]

    def speak(self, text, wav):
        made = [part.format(wav=wav) for part in self.command]
        subprocess.run(made, input=text.encode(), check=True, capture_output=True)


def installed():
    found = {}
    if shutil.which("espeak-ng"):
        for name, accent in ESPEAK.items():
            found[f"espeak-{name}"] = ("espeak-ng", "-v", accent, "-s", "150", "-w", "{wav}", "--stdin")
    if shutil.which("flite"):
        for name in FLITE:
            found[f"flite-{name}"] = ("flite", "-voice", name, "-f", "/dev/stdin", "-o", "{wav}")
    if shutil.which("text2wave"):
        listed = subprocess.run(["festival", "-b", "(print (voice.list))"], capture_output=True, text=True, check=True)
        for name, voice in FESTIVAL.items():
            if voice in listed.stdout:
                found[f"festival-{name}"] = ("text2wave", "-o", "{wav}", "-eval", f"(voice_{voice})")
    model, piper = os.environ.get("PIPER_VOICE"), shutil.which("piper")
    if model and piper:
        found["piper"] = (piper, "--model", model, "--output-file", "{wav}")
    return {name: Voice(name, command) for name, command in found.items()}
