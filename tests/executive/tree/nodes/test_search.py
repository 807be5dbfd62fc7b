"""Status checks: yes, an honest no, and no answer when something was not looked at."""

from functools import partial

import pytest

from executive.tree.nodes.composites import MemoryRound, MemorySelector, MemorySequence
from executive.tree.nodes.search import Answer
from skills.api import Cause, ObjectKind, ObjectObservation
from tests.executive.tree.scripted import CAUSES, F, Leaf, S


def asked(context, search, looks, question, **more):
    """An answer after its search."""
    told = {"affirmed": question, "denied": question, **more}
    services = {"board": context.board, "publish": context.publish}
    root = Answer(
        path_id="alice/q",
        name=f"is there a {question}?",
        child=search,
        looks=looks,
        key="alice/q/answer",
        **services,
        **told,
    )
    root.tick_once()
    return root


def answer_of(context, scripts, **more):
    """Asked for a hammer after looks that see it (S) or fail: two at the bench, the others at the trolley."""
    children = [Leaf(script, f"q/{n}") for n, script in enumerate(scripts)]
    ids = [child.path_id for child in children]
    search = MemorySelector(path_id="alice/q/search", name="search", children=children)
    return asked(context, search, {"bench": ids[:2], "trolley": ids[2:]}, "hammer in the workshop", **more)


# looks  how it is told  answer  sentence
@pytest.mark.parametrize(
    ("scripts", "more", "answer", "message"),
    [
        ("OOO", {"tells": True}, False, "no: hammer in the workshop"),
        ("OOO", {"yes_or_no": False}, False, "hammer in the workshop"),
        ("OOO", {}, False, "no: hammer in the workshop"),
        ("OS", {"tells": True}, True, "yes: hammer in the workshop; q/1 S"),
        ("OSO", {}, True, "yes: hammer in the workshop"),
        ("S", {"yes_or_no": False}, True, "hammer in the workshop"),
    ],
)
def test_a_detection_is_a_yes_and_a_look_at_all_is_needed_for_a_no(context, published, scripts, more, answer, message):
    root = answer_of(context, scripts, **more)
    assert (root.status, root.answer, root.message, root.cause) == (S, answer, message, None)
    assert context.board.get("alice/q/answer") is answer
    told = {"node": "alice/q", "question": "is there a hammer in the workshop", "answer": answer, "message": message}
    assert published == [("answer", told)]


@pytest.mark.parametrize("obstacle", "PFT")
@pytest.mark.parametrize("at", [0, 1, 2])
def test_no_is_not_said_when_a_view_was_missed(context, published, obstacle, at):
    root = answer_of(context, "OOO"[:at] + obstacle + "OOO"[at + 1 :])
    assert (root.status, root.answer, root.cause) == (F, None, CAUSES[obstacle])
    assert ("trolley" if at == 2 else "bench") in root.message
    assert ("alice/q/answer" in context.board, published) == (False, [])


class Says(Leaf):
    """Leaf that ends with a message."""

    def __init__(self, script, name, said):
        super().__init__(script, name)
        self.said = said

    def update(self):
        status = super().update()
        self.message = self.said
        return status


# the drive to a view ("": it succeeds), the look -> cause and reason
@pytest.mark.parametrize(
    ("drive", "look", "cause", "why"),
    [
        ("The door is closed, so no path leads there.", "20% was never in view", Cause.PLANNING, "{}, and {}"),
        ("", "20% was never in view", Cause.EXECUTION, "{1}"),
    ],
)
def test_no_answer_names_the_place_and_what_kept_the_robot_from_it(context, drive, look, cause, why):
    go = Says("P" if drive else "S", "q/office/go", drive)
    near = MemorySelector(path_id="q/office/near", name="near", children=[go, Leaf("S", "q/office/stay")])
    views = MemorySequence(path_id="q/office", name="views", children=[near, Says("F", "q/office/detect", look)])
    root = asked(context, views, {"office": ["alice/q/office/detect"]}, "hammer in the office")
    said = why.format(drive.rstrip("."), look)
    assert (root.status, root.cause, root.message) == (F, cause, f"no answer for the office: {said}")


def beer(x_m, surface):
    return ObjectObservation(0.0, ObjectKind("beer"), (x_m, 0.0, 0.8), (0.1, 0.1, 0.1), 0.0, 0.9, surface)


def count_of(context, seen, needed, **more):
    """Asked for beers after a look at each surface, which failed (its letter) or saw beers at these places (m)."""
    looks = []
    for name, found in zip(("bench", "trolley"), seen, strict=True):
        letter, beers = (found, ()) if isinstance(found, str) else ("S", tuple(beer(x_m, name) for x_m in found))
        put = partial(context.board.put, f"alice/q/{name}/all", beers)
        looks.append(Leaf(letter, f"q/{name}", put=put))
    search = MemoryRound(path_id="alice/q/search", name="search", children=looks)
    names = {look.name[2:]: [look.path_id] for look in looks}
    tallies = {look.path_id: f"{look.path_id}/all" for look in looks}
    return asked(context, search, names, "beers in the workshop", tallies=tallies, needed=needed, **more)


@pytest.mark.parametrize(
    ("bench", "trolley", "needed", "answer", "told"),
    [
        ((0.0, 1.0), (2.0,), 1, True, "; there are three beers on the bench and the trolley"),
        ((0.0,), "O", 1, True, "; there is one beer on the bench"),
        ((0.0,), (2.0,), 2, True, "; there are two beers on the bench and the trolley"),
        ((0.0,), "O", 2, False, "; there is one beer on the bench"),
        ("O", "O", 1, False, ""),
        ((0.0,), "P", 1, True, "; there is at least one beer on the bench; not all was seen in the trolley"),
    ],
)
def test_objects_are_counted_over_all_surfaces(context, bench, trolley, needed, answer, told):
    root = count_of(context, (bench, trolley), needed)
    assert (root.status, root.answer) == (S, answer)
    assert root.message == f"{'yes' if answer else 'no'}: beers in the workshop{told}"


# surfaces with the places of beers (m), or the letter of a failed look -> answer, at least so many, sentence
@pytest.mark.parametrize(
    ("seen", "answer", "at_least", "told"),
    [
        (((0.0, 1.0), (2.0,)), 3, False, "there are three beers on the bench and the trolley next to the coke"),
        (((0.0, 1.0), "P"), 2, True, "there are at least two beers on the bench next to the coke; not all was seen in"),
        (("O", "O"), 0, False, "no beers"),
    ],
)
def test_the_answer_to_how_many_is_the_number(context, published, seen, answer, at_least, told):
    numeric = {"numeric": True, "count_key": "alice/q/count", "yes_or_no": False, "related": " next to the coke"}
    root = count_of(context, seen, 1, denied="no beers", **numeric)
    ((_, note),) = published
    assert (root.status, root.answer, note["answer"], note.get("at_least", False)) == (S, answer, answer, at_least)
    assert (context.board.get("alice/q/count"), context.board.get("alice/q/answer")) == (answer, answer)
    assert root.message.startswith(told)


def test_a_count_names_what_no_look_recognised(context):
    unknown = ObjectObservation(0.0, ObjectKind("thing"), (3.0, 0.0, 0.8), (0.06, 0.06, 0.24), 0.0, 0.7, "bench")
    context.board.put("alice/q/bench/unexplained", (unknown,))
    doubts = {f"alice/q/{name}": f"alice/q/{name}/unexplained" for name in ("bench", "trolley")}
    root = count_of(context, ((0.0,), "O"), 1, doubts=doubts)
    told = "there is at least one beer on the bench; besides, something 24 cm tall stands on the bench"
    assert root.message == f"yes: beers in the workshop; {told}"


def test_too_few_is_not_said_while_something_is_unexplained(context):
    unknown = ObjectObservation(0.0, ObjectKind("thing"), (3.0, 0.0, 0.8), (0.06, 0.06, 0.24), 0.0, 0.7, "bench")
    for name in ("bench", "trolley"):
        context.board.put(f"alice/q/{name}/unexplained", (unknown,))
    doubts = {f"alice/q/{name}": f"alice/q/{name}/unexplained" for name in ("bench", "trolley")}
    root = count_of(context, ((0.0,), "O"), 2, doubts=doubts)
    assert (root.status, root.answer, root.cause) == (F, None, Cause.EXECUTION)
    assert "no answer for the bench" in root.message
    assert count_of(context, ((0.0,), (3.0,)), 2, doubts=doubts).answer is True  # another look recognised it


@pytest.mark.parametrize(("bench", "needed"), [("O", 1), ((0.0,), 2)])
def test_too_few_is_not_said_when_a_surface_was_missed(context, bench, needed):
    root = count_of(context, (bench, "P"), needed)
    assert (root.status, root.answer, root.cause) == (F, None, Cause.PLANNING)
    assert "no answer for the trolley" in root.message
