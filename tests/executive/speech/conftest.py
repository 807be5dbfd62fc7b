"""The flat, the parser, and a synthetic voice where one is installed."""

import shutil
import subprocess

import pytest

from executive.knowledge import load_knowledge
from executive.language import load_parser
from plant.worlds.world import load_world

PROGRAMS = {
    "flite": ("flite", "-voice", "slt", "-t", "{text}", "-o", "{wav}"),
    "espeak-ng": ("espeak-ng", "-w", "{wav}", "{text}"),
}


@pytest.fixture(scope="session")
def flat():
    """What is known of the flat."""
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
