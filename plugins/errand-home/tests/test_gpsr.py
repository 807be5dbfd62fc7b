"""The benchmark of sentences: what is understood by category, and a scene in which a sentence can be carried out."""

from types import SimpleNamespace

import home_gpsr
import pytest

from executive.app.prepare.from_request import prepare
from executive.mission.request import Request
from executive.words.outlines import inside
from plant.worlds.seeding import place_objects

SENTENCES = """\
tell me what is the biggest drink on the desk
get a soup from the kitchen table and place it on the desk

give it to the waving person in the study
"""


def test_sentences_are_counted_by_category_with_the_reasons_of_refusals(tmp_path):
    (tmp_path / "sentences.txt").write_text(SENTENCES)
    drawn = list(home_gpsr.cases(tmp_path / "sentences.txt"))
    results = [SimpleNamespace(**home_gpsr.run_case(*case, tmp_path)) for case in drawn]
    figures = home_gpsr.summary(results)
    assert figures["categories"] == [
        ["sentences", "understood"],
        ["all", "2 of 3"],
        ["compare objects", "1 of 1"],
        ["other", "0 of 1"],
        ["take, then", "1 of 1"],
    ]
    assert [reason.partition(": ")[0] for reason in figures["refused"]] == ["other"]


def test_the_scene_has_room_for_what_the_sentence_needs():
    prepared = prepare(Request("give me a toy car from the night stand", world="home", seed=7103))
    placed = place_objects(home_gpsr.feasible(prepared), 7103)
    assert [each.surface for each in placed if each.name == "toy_car"] == ["night stand"]


@pytest.mark.parametrize("seed", [3, 4])
def test_objects_and_people_are_where_the_sentence_needs_them(seed):
    request = Request("get a soup from the dresser and give it to Alex in the kitchen", world="home", seed=seed)
    prepared = prepare(request)
    world = home_gpsr.feasible(prepared)
    (soup,) = (each for each in place_objects(world, seed) if each.name == "soup")
    (alex,) = (each for each in world.seed_rules.people if each.name == "Alex")
    kitchen = prepared.knowledge.rooms["kitchen"]
    assert soup.surface == "dresser"
    assert all(inside(kitchen, (pose.x, pose.y)) for pose in alex.stands)


@pytest.mark.nightly
def test_a_sentence_runs_in_the_scene_of_a_seed(tmp_path):
    found = home_gpsr.run_case("tell me what is the biggest fruit on the coffee table", 7002, tmp_path / "run")
    assert (found["claimed"], found["fulfilled"], found["collisions"]) == (True, True, 0)
