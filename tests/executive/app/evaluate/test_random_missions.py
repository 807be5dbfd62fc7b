"""Random missions: what the seeds draw from what is known of a world."""

from collections import Counter
from functools import cache

import pytest

from executive.app.evaluate.random_missions import KINDS, TURNS, KnownWorld, random_evaluation, random_sentence
from executive.language.parser import load_parser
from executive.language.understand import Status, understand
from executive.words.knowledge import Knowledge, load_knowledge
from plant.worlds.world import load_world
from tests.project import shipped_worlds


def known(name):
    knowledge = load_knowledge(load_world(name).knowledge_path)
    return KnownWorld(name, knowledge, frozenset(knowledge.things))


WORLDS = tuple(known(name) for name in shipped_worlds())
BARE = {"start": {"x": 0, "y": 0}, "places": {"hall": {"pose": {"x": 1, "y": 0}, "polygon": [(0, 0), (2, 0), (2, 2)]}}}


@cache
def drawn(seeds):
    return random_evaluation(WORLDS, seeds, name="random").runs


def asked(seeds):
    """The worlds and the sentences that are drawn."""
    return [(run.request.world, run.request.sentence) for run in drawn(seeds)]


def test_the_same_seed_gives_the_same_sentence_whatever_other_seeds_there_are():
    assert drawn(range(40, 50)) == drawn(range(100))[40:50]


def test_each_kind_comes_in_each_world_as_often_as_it_has_turns():
    runs = drawn(range(len(TURNS) * len(WORLDS)))
    assert Counter((run.mission, run.request.world) for run in runs) == {
        (kind, world.name): TURNS.count(kind) for kind in KINDS for world in WORLDS
    }


def test_every_sentence_is_drawn_and_all_slots_are_filled():
    texts = [run.request.sentence for run in drawn(range(3000))]
    assert not [text for text in texts if "{" in text]
    starts = {pattern.partition("{")[0] for patterns in KINDS.values() for pattern in patterns}
    assert not [start for start in starts if not any(text.startswith(start) for text in texts)]


@pytest.mark.parametrize(("count", "most"), [(60, 3), pytest.param(500, 15, marks=pytest.mark.nightly)])
def test_the_parser_understands_97_percent_of_the_sentences(count, most):
    parser = load_parser()
    knowledge = {world.name: world.knowledge for world in WORLDS}
    refused = [
        run.request.sentence
        for run in drawn(range(count))
        if understand(
            run.request.sentence, parser=parser, knowledge=knowledge[run.request.world], require_wake=False
        ).status
        is not Status.OK
    ]
    assert len(refused) <= most, refused


def test_only_what_the_robot_can_carry_is_to_be_moved():
    world = KnownWorld("flat", WORLDS[0].knowledge, frozenset({"coke", "beer"}))
    runs = [random_sentence(world, seed) for seed in range(300)]
    asked = [text for kind, text in runs if kind in ("fetch", "put on a surface", "several objects")]
    assert asked
    assert not [text for text in asked if any(name in text for name in ("hammer", "cube", "wrench", "a tool "))]


def test_a_question_about_somebody_by_name_is_asked_only_where_there_is_one_person():
    asked = {
        (run.request.world, run.request.sentence)
        for run in drawn(range(3000))
        if run.mission == "question about people"
    }
    names = {"Robin", "Noor", "Maya"}
    assert {world for world, text in asked if names & set(text.split())} == {"flat"}


def test_in_a_world_without_objects_and_people_only_places_are_asked_for():
    world = KnownWorld("bare", Knowledge.model_validate(BARE), frozenset())
    kinds = {random_sentence(world, seed)[0] for seed in range(100)}
    assert "go to a place" in kinds
    assert not kinds & {"fetch", "bring to a person", "go to a person", "put on a surface", "instead"}


def test_an_empty_world_still_has_missions_on_the_battery():
    world = KnownWorld("empty", Knowledge.model_validate({**BARE, "places": {}}), frozenset())
    assert random_sentence(world, 3) == ("wait or charge", "go and recharge")


@pytest.mark.parametrize("seed", [0, 7])
def test_the_worlds_take_turns(seed):
    assert [world for world, _ in asked(range(seed, seed + 3))] == [WORLDS[(seed + n) % 3].name for n in range(3)]
