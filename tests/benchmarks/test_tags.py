"""The measure of AprilTags runs its smallest case to its end."""

from tests.benchmarks.tags import Setting, sights, summary


def test_a_near_tag_is_found_in_every_view():
    figures = summary(list(sights(Setting("hand", 0.1, 1.2, 30.0), views=2, seed=4801)))
    assert figures["found"] == 1.0
    assert figures["off_m_95"] < 0.02
    assert figures["off_deg_95"] < 2.0
