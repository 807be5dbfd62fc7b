from pathlib import Path

import pytest

from executive.language.parser import load_parser
from executive.words.knowledge import load_knowledge


@pytest.fixture(scope="session")
def parser():
    return load_parser()


@pytest.fixture(scope="session")
def knowledge():
    return load_knowledge(Path(__file__).with_name("world.yaml"))
