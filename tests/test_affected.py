"""A change touches tests of its folder and those that import it within two steps; a data file its modules' folder."""

import pytest

from tests.affected import ROOT, changed_files, imports, touched

TRAIN = "plugins/errand-train"


@pytest.mark.parametrize(
    ("test", "changed", "expected"),
    [
        ("tests/executive/words/test_command.py", "tests/executive/words/test_command.py", True),
        ("tests/executive/words/test_command.py", "executive/words/command.py", True),
        ("tests/executive/words/test_zone.py", "executive/words/command.py", True),  # its folder mirrors the module's
        ("tests/missions/test_faults.py", "executive/app/runs/simulated.py", True),  # by tests/missions/flat_mission.py
        ("tests/plant/worlds/test_shipped_worlds.py", "plant/worlds/flat/objects.yaml", True),
        ("tests/executive/words/test_command.py", "plant/worlds/flat/objects.yaml", False),
        ("tests/executive/words/test_command.py", "skills/navigate/lattice.py", False),
        ("tests/executive/words/test_command.py", "README.md", False),
        ("tests/docs/test_readme.py", "README.md", True),
        ("tests/skills/faults/test_faults.py", "tests/skills/faults/test_faults.yaml", True),
        ("tests/skills/navigate/test_navigate.py", "tests/skills/conftest.py", True),
        ("tests/plant/test_engine.py", "tests/skills/conftest.py", False),
        ("tests/executive/words/test_command.py", "executive/language/tables/ümlaut.yaml", False),
        ("tests/executive/words/test_command.py", "tests/conftest.py", True),
        (
            "plugins/errand-train/tests/dataset/test_coco.py",
            "plugins/errand-train/errand_train/dataset/compose.py",
            True,
        ),
        ("plugins/errand-train/tests/dataset/test_coco.py", "plugins/errand-train/errand_train/nouns.py", False),
        ("plugins/errand-train/tests/detector/test_refine.py", "plugins/errand-train/tests/random_networks.py", True),
        ("plugins/errand-make/tests/worlds/test_own.py", "plugins/errand-make/errand_make/mesh.py", True),
        ("plugins/errand-make/tests/test_tags.py", "plugins/errand-make/errand_make/robots/inference.py", False),
    ],
)
def test_a_change_touches(test, changed, expected):
    assert touched(ROOT / test, frozenset([changed])) is expected


def test_a_module_that_is_gone_is_imported_still(tmp_path):
    test = tmp_path / "test_it.py"
    test.write_text("from skills.gone import it\n")
    gone = ROOT / "skills/gone.py"
    assert (imports(test), imports(test, frozenset([gone]))) == (frozenset(), {gone})


def test_an_unknown_revision_is_refused_in_one_sentence():
    with pytest.raises(pytest.UsageError, match="there is no revision 'nonsense'; name a branch"):
        changed_files("nonsense")
