"""The flat, the parser, a synthetic voice where one is installed, and the path of `made_speech`."""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from executive.language.parser import load_parser
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world

sys.path.insert(0, str(Path(__file__).parent))

PROGRAMS = {
    "flite": ("flite", "-voice", "slt", "-t", "{text}", "-o", "{wav}"),
    "espeak-ng": ("espeak-ng", "-w", "{wav}", "{text}"),
}


@pytest.fixture(scope="session")
def flat():
    """Knowledge of the flat."""
    return load_knowledge(load_world("flat").knowledge_path)


@pytest.fixture(scope="session")
def parser():
    return load_parser()


@pytest.fixture
def say(tmp_path):
    """Speaks a text into a wav file with a synthetic voice of this machine."""
    command = next((PROGRAMS[name] for name in PROGRAMS if shutil.which(name)), None)
    if command is None:
        pytest.skip("no synthetic voice: install flite or espeak-ng to test with speech")

    def spoken(text):
        wav = tmp_path / "spoken.wav"
        subprocess.run([part.format(text=text, wav=wav) for part in command], check=True)
        return wav

    return spoken


TYPES = {np.dtype("<f4"): 0, np.dtype("<i1"): 1, np.dtype("<i2"): 2, np.dtype("<i4"): 3, np.dtype("<f2"): 4}


@pytest.fixture(scope="session")
def model_bin():
    """Makes a `model.bin` of variables by name, as CTranslate2's converter does."""

    def text(words):
        return struct.pack("<H", len(words) + 1) + words.encode() + b"\0"

    def variable(name, value):
        sizes = b"".join(struct.pack("<I", size) for size in value.shape)
        kind = struct.pack("<BI", TYPES[value.dtype], value.nbytes)
        return text(name) + struct.pack("<B", value.ndim) + sizes + kind + value.tobytes()

    def made(variables, version=6):
        head = struct.pack("<I", version) + text("WhisperSpec") + struct.pack("<II", 3, len(variables))
        return head + b"".join(variable(*one) for one in variables.items()) + struct.pack("<I", 0)

    return made
