"""Ports are checked before any tick."""

from dataclasses import dataclass
from typing import Any, ClassVar

import pytest

from executive.tree.board import Constant, FromBoard
from executive.tree.compiler import check_wiring
from executive.tree.node import NodeSpec
from executive.tree.plan import PlanBuilder
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from skills.api import Skill, Succeeded
from skills.inputs.errors import InputError
from tests.executive.conftest import KNOWLEDGE


@dataclass(frozen=True)
class Inputs:
    speed: float
    names: tuple[str, ...] = ()
    note: str | None = None


class Wired(Skill[Inputs]):
    name = "wired"
    Inputs: ClassVar[type] = Inputs
    outputs: ClassVar[dict[str, type]] = {"count": int, "word": str}

    def begin(self, inputs: Inputs) -> None:
        pass

    def step(self) -> Succeeded:
        return Succeeded("done")


def plan(inputs: dict[str, Any], outputs: dict[str, str] | None = None, path_id: str = "a/wired") -> NodeSpec:
    bound = {k: v if isinstance(v, FromBoard) else Constant(v) for k, v in inputs.items()}
    builder = PlanBuilder(Knowledge.model_validate(KNOWLEDGE), {"wired": Wired}, path_id, "a/start", Command(), None)
    return builder.skill("wired", bound, outputs, here=True)


def check(*nodes: NodeSpec) -> None:
    check_wiring(NodeSpec("sequence", "a", "a", children=nodes))


def test_good_wiring_passes():
    writer = plan({"speed": 1}, {"count": "a/count"}, "a/1")
    check(writer, plan({"speed": FromBoard("a/count"), "names": ("x",), "note": None}, path_id="a/2"))


@pytest.mark.parametrize(
    ("inputs", "words"),
    [
        ({}, "input port 'speed' has no value; give it a number"),
        ({"speed": "fast"}, "input port 'speed' got 'fast'"),
        ({"speed": True}, "input port 'speed' got True"),
        ({"speed": 1.0, "names": ("x", 3)}, "input port 'names'"),
        ({"speed": 1.0, "name": "x"}, "no input port 'name'; did you mean 'names'?"),
        ({"speed": FromBoard("a/later")}, "reads 'a/later', which nothing before it writes"),
        ({"speed": FromBoard("a/word")}, "reads 'a/word', a text"),
    ],
)
def test_bad_inputs_are_refused_with_the_node(inputs, words):
    writer = plan({"speed": 1.0}, {"word": "a/word"}, "a/0")
    with pytest.raises(InputError) as refusal:
        check(writer, plan(inputs), plan({"speed": 1.0}, {"count": "a/later"}, "a/9"))
    assert words in str(refusal.value)
    assert "a/wired" in str(refusal.value)


def test_unknown_outputs_and_doubled_path_ids_are_refused():
    with pytest.raises(InputError, match="no output port 'sum'; known: count, word"):
        check(plan({"speed": 1.0}, {"sum": "a/sum"}))
    with pytest.raises(InputError, match="two nodes have this path id"):
        check(plan({"speed": 1.0}), plan({"speed": 1.0}))
