"""What a mission promises, in the referee's words."""

import pytest

from executive.cli.promises import promises
from executive.command import parse_command
from plant.referee import PromiseKind


def promised(knowledge, *texts, answers=()):
    return promises(list(map(parse_command, texts)), knowledge=knowledge, robot="Alice", answers=answers)


def test_fetch_promises_a_grasp_in_the_kitchen_and_a_hand_over(knowledge, make):
    grasp, hand_over = promised(knowledge, *make.FETCH)
    assert (grasp.kind, grasp.classes, grasp.robot) == (PromiseKind.GRASPED, ("coke", "beer"), "Alice")
    assert {region.name for region in grasp.source} == {"counter", "shelf"}
    assert (hand_over.kind, hand_over.classes, hand_over.person) == (PromiseKind.HANDED_OVER, ("coke", "beer"), None)


def test_surface_regions_begin_at_the_top(knowledge, make):
    grasp, _ = promised(knowledge, *make.FETCH)
    counter = next(region for region in grasp.source if region.name == "counter")
    assert (round(counter.z_min_m, 3), round(counter.z_max_m, 3)) == (0.85, 1.2)
    assert counter.contains((5.8, -1.8, 0.95))


def test_a_room_as_goal_means_any_surface_in_it(knowledge):
    (placed,) = promised(knowledge, "Take [coke] to [kitchen] and do [Nothing] to [Nothing]")
    assert (placed.kind, {region.name for region in placed.goal}) == (PromiseKind.PLACED, {"counter", "shelf"})


def test_a_person_is_named(knowledge):
    (promise,) = promised(knowledge, "Take [coke] to [Sam] and do [Nothing] to [Nothing]")
    assert (promise.kind, promise.person) == (PromiseKind.HANDED_OVER, "Sam")


@pytest.mark.parametrize(
    ("goal", "point"), [("kitchen", (5.9, -1.9, 0.5)), ("counter", (4.5, -1.0, 0.5)), ("start", (0, 0, 0.5))]
)
def test_going_promises_the_body_there(knowledge, goal, point):
    (promise,) = promised(knowledge, f"Take [Nothing] to [{goal}] and do [Nothing] to [Nothing]")
    assert promise.kind is PromiseKind.WENT
    assert promise.goal[0].contains(point)
    assert not promise.goal[0].contains((-9.0, 9.0, 0.5))


@pytest.mark.parametrize("answer", [True, False, None])
def test_answers_go_to_the_checks_in_order(knowledge, answer):
    check = "Take [Nothing] to [kitchen] and do [find] to [hammer]"
    first, second = promised(knowledge, check, check, answers=[True, answer])
    assert (first.kind, first.answer, second.answer) == (PromiseKind.ANSWERED, True, answer)
