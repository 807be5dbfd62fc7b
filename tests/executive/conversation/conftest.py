import pytest

from executive.conversation import Conversation, Speech
from executive.language.parser import load_parser
from executive.language.understand import understand
from executive.run.control import Control
from executive.tree.compiler import compile_mission
from executive.words.mission import Mission


@pytest.fixture(scope="session")
def parser():
    return load_parser()


@pytest.fixture
def speech(parser, knowledge, registry):
    def heard(text, memory):
        return understand(text, parser=parser, knowledge=knowledge, require_wake=False, memory=memory)

    def compiled(steps, taken):
        mission = Mission.from_steps(steps, world="test", robot="Alice")
        number = 1 + sum(name.startswith(mission.name) for name in taken)
        named = mission if number == 1 else mission.model_copy(update={"name": f"{mission.name} {number}"})
        return compile_mission(named, knowledge=knowledge, registry=registry)

    return Speech(knowledge, "Alice", heard, compiled)


@pytest.fixture
def control():
    return Control(pace=None)


@pytest.fixture
def talk(speech, control):
    """Conversation beside a run that began with a sentence."""

    def begin(sentence="fetch me a coke from the kitchen", **options):
        conversation = Conversation(speech, control, **options)
        meant = speech.understand(sentence, None)
        tree = speech.compile(meant.all_steps, frozenset())
        control.begin({"Alice": tree})
        conversation.set_mission(tree, memory=meant.memory)
        return conversation

    return begin


@pytest.fixture
def given(control):
    """Commands of the started missions: first, instead, later."""

    def texts():
        missions = {}
        for request in control.poll().missions:
            commands = [str(command) for command in request.tree.commands]
            missions.setdefault(request.turn.value, []).append(commands)
        return missions

    return texts
