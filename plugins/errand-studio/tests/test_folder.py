"""Mission files of a folder."""

from pathlib import Path

import pytest

from errand_studio.folder import MOST_BYTES, ConflictError, MissionFolder
from skills.inputs.errors import InputError

TEXT = "name: a\nsteps:\n  - to: hall\n"


@pytest.fixture
def folder(tmp_path: Path) -> MissionFolder:
    (tmp_path / "a.yaml").write_text(TEXT)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "b.yaml").write_text(TEXT)
    (tmp_path / "outside.txt").write_text("no")
    return MissionFolder(tmp_path)


def test_the_folder_lists_its_missions(folder: MissionFolder) -> None:
    folder.keep_draft("a.yaml", "draft")
    assert folder.names() == ["a.yaml", "sub/b.yaml"]


def test_a_file_that_nobody_has_changed_is_saved(folder: MissionFolder) -> None:
    opened = folder.open("a.yaml")
    folder.keep_draft("a.yaml", "name: b")
    stamp = folder.save("a.yaml", "name: b", opened.stamp)
    assert folder.open("a.yaml").text == "name: b"
    assert folder.open("a.yaml").draft is None
    assert stamp == folder.stamp("a.yaml") != opened.stamp


def test_a_file_that_somebody_has_changed_is_not_overwritten(folder: MissionFolder) -> None:
    opened = folder.open("a.yaml")
    folder.save("a.yaml", "name: theirs", opened.stamp)
    with pytest.raises(ConflictError, match="changed since"):
        folder.save("a.yaml", "name: mine", opened.stamp)
    assert folder.open("a.yaml").text == "name: theirs"


def test_a_draft_is_offered_after_a_crash(folder: MissionFolder) -> None:
    folder.keep_draft("sub/b.yaml", "name: draft")
    assert MissionFolder(folder.path).open("sub/b.yaml").draft == "name: draft"
    folder.drop_draft("sub/b.yaml")
    assert folder.open("sub/b.yaml").draft is None


def test_a_mission_is_created_once(folder: MissionFolder) -> None:
    assert folder.create("night_round") == "night_round.yaml"
    assert folder.open("night_round.yaml").text.startswith("name: night round\n")
    with pytest.raises(InputError, match="already"):
        folder.create("a")


@pytest.mark.parametrize(
    "name",
    ["../a.yaml", "/etc/a.yaml", "sub/../../a.yaml", "outside.txt", "<script>.yaml", "a\n.yaml", ".a.yaml", "", "a/"],
)
def test_a_name_that_leads_out_of_the_folder_is_refused(folder: MissionFolder, name: str) -> None:
    with pytest.raises(InputError, match="no name of a mission file"):
        folder.file(name)


def test_a_link_out_of_the_folder_is_refused(folder: MissionFolder, tmp_path_factory: pytest.TempPathFactory) -> None:
    other = tmp_path_factory.mktemp("other") / "c.yaml"
    other.write_text(TEXT)
    (folder.path / "c.yaml").symlink_to(other)
    with pytest.raises(InputError, match="no name"):
        folder.open("c.yaml")


def test_a_file_that_is_too_large_is_refused(folder: MissionFolder) -> None:
    (folder.path / "a.yaml").write_text("x" * 20_000_000)
    with pytest.raises(InputError, match="too large"):
        folder.open("a.yaml")
    with pytest.raises(InputError, match="letters"):
        folder.keep_draft("a.yaml", "x" * (MOST_BYTES + 1))
