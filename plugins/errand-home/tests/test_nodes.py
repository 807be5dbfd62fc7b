"""Comparisons: what comes first among the objects seen, and no answer where that is not known."""

from functools import partial

import pytest

from errand_home.nodes import Comparison
from executive.tree.nodes.composites import MemoryRound
from skills.api import Cause, ObjectKind, ObjectObservation
from tests.executive.tree.scripted import F, Leaf, S

SIDES = {
    "apple": (0.076, 0.076, 0.078),
    "banana": (0.164, 0.060, 0.038),
    "milk": (0.075, 0.075, 0.146),
    "thing": (0.05, 0.05, 0.24),
}
WEIGHTS = {"apple": 0.16, "banana": 0.13, "milk": 0.52}


def seen(*names):
    """Observations of objects in a row."""
    return tuple(
        ObjectObservation(0.0, ObjectKind(name), (0.3 * n, 0.0, 0.8), SIDES[name], 0.0, 0.9, "desk")
        for n, name in enumerate(names)
    )


def compared(context, scripts, found, superlative, most=1, weights=WEIGHTS):
    """A comparison after looks that see the objects (S) or fail."""
    children = []
    for n, script in enumerate(scripts):
        put = partial(context.board.put, f"alice/q/{n}/all", seen(*found[n]) if n < len(found) else ())
        children.append(Leaf(script, f"q/{n}", put=put))
    root = Comparison(
        path_id="alice/q",
        name="q",
        child=MemoryRound(path_id="alice/q/search", name="search", children=children),
        affirmed=f"the {superlative} object on the desk",
        denied="there is no object on the desk",
        looks={"desk": [child.path_id for child in children]},
        key="alice/q/answer",
        board=context.board,
        publish=context.publish,
        tallies={child.path_id: f"{child.path_id}/all" for child in children},
        superlative=superlative,
        most=most,
        weights=weights,
        text="alice/q/text",
    )
    root.tick_once()
    return root


# objects by look, superlative, number, sentence
@pytest.mark.parametrize(
    ("found", "superlative", "most", "says"),
    [
        ([["apple", "banana", "milk"]], "biggest", 1, "is the banana"),
        ([["apple", "banana", "milk"]], "largest", 2, "are the banana and the milk"),
        ([["apple", "banana", "milk"]], "smallest", 1, "is the apple"),
        ([["apple", "banana", "milk"]], "thinnest", 1, "is the banana"),
        ([["apple", "banana", "milk"]], "heaviest", 1, "is the milk, by the weights in my notes"),
        ([["apple", "banana", "milk"]], "lightest", 1, "is the banana, by the weights in my notes"),
        ([["apple"], ["milk"]], "heaviest", 3, "are the milk and the apple, by the weights in my notes"),
        ([["apple", "banana", "thing"]], "smallest", 1, "is the apple"),
    ],
)
def test_a_comparison_names_what_comes_first(context, published, found, superlative, most, says):
    root = compared(context, "S" * len(found), found, superlative, most)
    said = f"the {superlative} object on the desk {says}"
    assert (root.status, root.answer, root.message) == (S, True, said)
    assert context.board.get("alice/q/text") == said
    assert [message["message"] for topic, message in published if topic == "answer"] == [said]


# looks, objects by look, superlative, weights, cause, a part of the sentence
@pytest.mark.parametrize(
    ("scripts", "found", "superlative", "weights", "cause", "says"),
    [
        ("S", [["apple", "thing"]], "biggest", {}, Cause.POSTCONDITION, "something 24 cm tall stands on the desk"),
        ("S", [["apple", "thing"]], "heaviest", WEIGHTS, Cause.POSTCONDITION, "something 24 cm tall"),
        ("S", [["apple", "thing"]], "lightest", WEIGHTS, Cause.POSTCONDITION, "something 24 cm tall"),
        (
            "S",
            [["apple", "milk"]],
            "heaviest",
            {"milk": 0.5},
            Cause.PRECONDITION,
            "the weight of the apple is not known",
        ),
        ("SP", [["apple"]], "biggest", {}, Cause.PLANNING, "no answer for the desk"),
    ],
)
def test_a_comparison_that_is_not_certain_fails(context, scripts, found, superlative, weights, cause, says):
    root = compared(context, scripts, found, superlative, 1, weights)
    assert (root.status, root.cause, says in root.message) == (F, cause, True), root.message


def test_the_answer_is_no_where_nothing_is(context):
    root = compared(context, "O", [], "biggest")
    assert (root.status, root.answer, context.board.get("alice/q/text")) == (S, False, "there is no object on the desk")
