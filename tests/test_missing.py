"""Skips for want of something installed fail where CI is set; those by a condition, and expected failures, stay."""

from tests.missing import NothingMissing

pytest_plugins = ["pytester"]


def test_a_test_that_skips_for_want_of_something_fails(pytester):
    pytester.makepyfile(
        test_module="import pytest; pytest.importorskip('nothing_of_this_name')",
        test_one="""
            import pytest
            @pytest.fixture
            def voice(): pytest.skip("no voice: install one")
            def test_voice(voice): pass
            def test_import(): pytest.importorskip("nothing_of_this_name")
            @pytest.mark.skipif(True, reason="of another system")
            def test_system(): pass
            @pytest.mark.xfail
            def test_known(): assert False
            def test_passes(): pass
        """,
    )
    found = pytester.inline_run("--continue-on-collection-errors", plugins=[NothingMissing()])
    passed, skipped, failed = found.listoutcomes()
    assert [len(passed), len(skipped), len(failed)] == [1, 2, 3]
    assert {each.longrepr.partition(";")[0] for each in failed} == {
        "Skipped: no voice: install one",
        "Skipped: could not import 'nothing_of_this_name': No module named 'nothing_of_this_name'",
    }
