"""Status checks: yes, an honest no, and no answer when something was not looked at."""

import py_trees
import pytest
from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.nodes.composites import MemoryRound, MemorySelector
from executive.tree.nodes.search import Answer
from skills.api import Cause, ObjectKind, ObjectObservation


class Look(Explained, py_trees.behaviour.Behaviour):
    def __init__(self, path_id: str, cause: Cause | None) -> None:
        super().__init__(path_id)
        self.path_id, self.fails_with = path_id, cause
        self.clear_explanation()

    def update(self) -> Status:
        self.cause, self.message = self.fails_with, f"{self.fails_with}"
        return Status.SUCCESS if self.fails_with is None else Status.FAILURE


def answer_of(context, *causes: Cause | None, tells: bool = False, yes_or_no: bool = True) -> Answer:
    looks = [Look(f"alice/q/{n}", cause) for n, cause in enumerate(causes)]
    root = Answer(
        path_id="alice/q",
        name="q",
        child=MemorySelector(path_id="alice/q/search", name="search", children=looks),
        question="hammer in the workshop",
        denied="hammer in the workshop",
        looks={"bench": ["alice/q/0", "alice/q/1"], "trolley": [f"alice/q/{n}" for n in range(2, len(causes))]},
        key="alice/q/answer",
        board=context.board,
        publish=context.publish,
        tells=tells,
        yes_or_no=yes_or_no,
    )
    root.tick_once()
    return root


def test_a_detection_is_a_yes(context):
    root = answer_of(context, Cause.POSTCONDITION, None, Cause.POSTCONDITION)
    assert (root.status, root.answer, root.message) == (Status.SUCCESS, True, "yes: hammer in the workshop")
    assert context.board.get("alice/q/answer") is True


def test_an_answer_may_name_the_found_object(context):
    root = answer_of(context, Cause.POSTCONDITION, None, tells=True)
    assert root.message == "yes: hammer in the workshop; None"
    unseen = answer_of(context, *[Cause.POSTCONDITION] * 3, tells=True)
    assert unseen.message == "no: hammer in the workshop"


def test_an_answer_may_do_without_yes_and_no(context):
    assert answer_of(context, None, yes_or_no=False).message == "hammer in the workshop"
    assert answer_of(context, *[Cause.POSTCONDITION] * 3, yes_or_no=False).message == "hammer in the workshop"


def test_an_answer_is_published_and_a_missed_view_is_none(context, published):
    answer_of(context, Cause.PLANNING)
    assert published == []
    answer_of(context, None)
    assert published == [
        (
            "answer",
            {
                "node": "alice/q",
                "question": "hammer in the workshop",
                "answer": True,
                "message": "yes: hammer in the workshop",
            },
        )
    ]


def test_no_after_every_view_was_looked_from_is_a_success(context):
    root = answer_of(context, *[Cause.POSTCONDITION] * 3)
    assert (root.status, root.answer, root.cause) == (Status.SUCCESS, False, None)


@pytest.mark.parametrize("obstacle", [Cause.PLANNING, Cause.EXECUTION, Cause.TIMEOUT])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_no_is_not_said_when_a_view_was_missed(context, obstacle, at):
    causes = [Cause.POSTCONDITION] * 3
    causes[at] = obstacle
    root = answer_of(context, *causes)
    assert (root.status, root.answer, root.cause) == (Status.FAILURE, None, obstacle)
    assert ("trolley" if at == 2 else "bench") in root.message
    assert "alice/q/answer" not in context.board


def beer(x_m: float, surface: str) -> ObjectObservation:
    return ObjectObservation(0.0, ObjectKind("beer"), (x_m, 0.0, 0.8), (0.1, 0.1, 0.1), 0.0, 0.9, surface)


def count_of(context, bench: Cause | tuple[float, ...], trolley: Cause | tuple[float, ...], needed: int = 1) -> Answer:
    """Asked for beers after a look at each surface, which failed with a cause or saw beers at these places (m)."""
    looks = []
    for name, seen in {"bench": bench, "trolley": trolley}.items():
        looks.append(Look(f"alice/q/{name}", seen if isinstance(seen, Cause) else None))
        if not isinstance(seen, Cause):
            context.board.put(f"alice/q/{name}/all", tuple(beer(x_m, name) for x_m in seen))
    root = Answer(
        path_id="alice/q",
        name="q",
        child=MemoryRound(path_id="alice/q/search", name="search", children=looks),
        question="beers in the workshop",
        denied="beers in the workshop",
        looks={name: [f"alice/q/{name}"] for name in ("bench", "trolley")},
        key="alice/q/answer",
        board=context.board,
        publish=context.publish,
        tallies={f"alice/q/{name}": f"alice/q/{name}/all" for name in ("bench", "trolley")},
        needed=needed,
    )
    root.tick_once()
    return root


@pytest.mark.parametrize(
    ("bench", "trolley", "needed", "answer", "told"),
    [
        ((0.0, 1.0), (2.0,), 1, True, "; there are three beers on the bench and the trolley"),
        ((0.0,), Cause.POSTCONDITION, 1, True, "; there is one beer on the bench"),
        ((0.0,), (2.0,), 2, True, "; there are two beers on the bench and the trolley"),
        ((0.0,), Cause.POSTCONDITION, 2, False, "; there is one beer on the bench"),
        (Cause.POSTCONDITION, Cause.POSTCONDITION, 1, False, ""),
        ((0.0,), Cause.PLANNING, 1, True, "; there is one beer on the bench, as far as was seen: not trolley"),
    ],
)
def test_objects_are_counted_over_all_surfaces(context, bench, trolley, needed, answer, told):
    root = count_of(context, bench, trolley, needed)
    assert (root.status, root.answer) == (Status.SUCCESS, answer)
    assert root.message == f"{'yes' if answer else 'no'}: beers in the workshop{told}"


@pytest.mark.parametrize(("bench", "needed"), [(Cause.POSTCONDITION, 1), ((0.0,), 2)])
def test_too_few_is_not_said_when_a_surface_was_missed(context, bench, needed):
    root = count_of(context, bench, Cause.PLANNING, needed)
    assert (root.status, root.answer, root.cause) == (Status.FAILURE, None, Cause.PLANNING)
    assert "could not look at trolley" in root.message
