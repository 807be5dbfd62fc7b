"""Conversations during a run: one with each robot, and the choice of the robot that a sentence is for."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from executive.app.prepare.feasibility import refuse_impossible
from executive.app.prepare.prepared import Prepared
from executive.conversation import Conversation, Reply, ReplyKind, Speech
from executive.conversation.replies import Waiting
from executive.language.addressees import RobotChoice, addressees
from executive.language.cleaning import find_address
from executive.language.followups import parse_remark
from executive.language.parser import load_parser
from executive.language.questions import RefusalError
from executive.language.understand import understand
from executive.run.control import Control
from executive.run.visitor import Progress, RunVisitor
from executive.tree.compiler import CompiledTree
from executive.words.mission import Mission
from executive.words.step import Step


def load_ahead() -> None:
    """Loads the parser in a background thread."""
    threading.Thread(target=lambda: load_parser().parse("go"), name="errand-parser", daemon=True).start()


class Conversations(RunVisitor):
    """Conversations with the robots of a run. All methods may be called from any thread.

    A sentence is for the robot that it names, else for the first robot by name; "stop" without a name is for all.
    """

    def __init__(self, prepared: Prepared, control: Control) -> None:
        self._each = {each.mission.robot_name: (each, conversation_of(each, control)) for each in prepared.all}

    def listen(self, listener: Callable[[str, Waiting | None], None]) -> None:
        """Calls `listener` after each sentence with the robot's name and the question that it asks back, if any."""
        for name, (_, conversation) in self._each.items():
            conversation.listen(partial(listener, name))

    def set_missions(self) -> None:
        """Gives each conversation its robot's first mission, so that users can correct the mission and ask about it."""
        for prepared, conversation in self._each.values():
            conversation.set_mission(prepared.tree, memory=None if prepared.meant is None else prepared.meant.memory)

    def tick(self, progress: Progress) -> None:
        """Passes the progress to each conversation."""
        for _, conversation in self._each.values():
            conversation.tick(progress)

    def hear(self, text: str, robot: str | None = None) -> Reply:
        """Obeys or answers a sentence, for each robot that it addresses. Never raises, whatever the text."""
        if robot is not None and robot not in self._each:
            return Reply(ReplyKind.REFUSED, f"{robot} has nothing to do in this run")
        names, said = ((robot,), text) if robot is not None else self._addressees(text)
        replies = {name: self._each[name][1].hear(said) for name in names}
        if len(replies) == 1:
            return replies[names[0]]
        kinds = [reply.kind for reply in replies.values()]
        kind = next((each for each in kinds if each is not ReplyKind.REFUSED), ReplyKind.REFUSED)
        return Reply(kind, "; ".join(f"{name}: {reply.text}" for name, reply in replies.items()))

    def _addressees(self, text: str) -> tuple[tuple[str, ...], str]:
        """Returns the robots that a sentence addresses, and the sentence without the address."""
        names = tuple(self._each)
        if len(names) == 1:
            return names, text
        try:
            several = addressees(names).split_call(text)
        except RefusalError:
            return names, text
        if several is not None:
            return names if isinstance(several[0], RobotChoice) else several[0], several[1]
        called = find_address(text, names)
        if called.name is not None:
            return (called.name,), text
        return names if parse_remark(text) is not None else names[:1], text


def conversation_of(prepared: Prepared, control: Control) -> Conversation:
    """Builds a conversation with the robot of a request."""
    speech = Speech(
        knowledge=prepared.knowledge,
        robot_name=prepared.mission.robot_name,
        understand=lambda text, memory: understand(
            text,
            parser=load_parser(),
            knowledge=prepared.knowledge,
            require_wake=False,
            robot_name=prepared.mission.robot_name,
            memory=memory,
        ),
        compile=lambda steps, taken: _compile(steps, taken, prepared),
    )
    robot = prepared.knowledge.robot
    return Conversation(speech, control, require_wake=robot.require_wake, others=robot.others)


def _compile(steps: Sequence[Step], taken: frozenset[str], prepared: Prepared) -> CompiledTree:
    """Compiles and checks a mission under a name that is not `taken`. Raises InputError if it cannot be done."""
    mission = Mission.from_steps(steps, world=prepared.world.name, robot=prepared.mission.robot_name)
    names = (mission.name, *(f"{mission.name} {number}" for number in range(2, len(taken) + 3)))
    name = next(each for each in names if each not in taken)
    own = replace(prepared, others=()).with_mission(mission.model_copy(update={"name": name}))
    refuse_impossible(own)
    return own.tree
