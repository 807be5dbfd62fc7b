"""The benchmark of views of people: one view of a drawn person, and the figures of several."""

from types import SimpleNamespace

import home_people


def test_a_view_of_a_drawn_person_is_compared_with_what_was_drawn(monkeypatch, tmp_path):
    scene_of = home_people.scene_of

    def one_view(seed):
        built, truth, at, cameras, rng = scene_of(seed)
        return built, truth, at, cameras[:1], rng

    monkeypatch.setattr(home_people, "scene_of", one_view)
    result = home_people.run_case(1, tmp_path)
    assert result["views"] == [result["truth"]]


# truth: standing, waving, red; one view is right, one is wrong and one is not sure of the gesture
def test_the_figures_count_right_wrong_and_unsure_views():
    truth = SimpleNamespace(pose="standing", gesture="waving", clothes_colour="red")
    views = [SimpleNamespace(**vars(truth) | {"gesture": gesture}) for gesture in ("waving", "none", None)]
    figures = home_people.summary([SimpleNamespace(truth=truth, views=views)])
    assert (figures["pose"]["right"], figures["gesture"]["right"]) == (1.0, 0.333)
    assert figures["gesture"]["confused"] == ["waving as none"]
    assert figures["gesture"]["unsure_of"] == ["waving"]
