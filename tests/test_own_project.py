"""A user's project uses Errand as a library, also where it has folders of Errand's names."""

import shutil
import subprocess
import sys
import tomllib
import zipfile

import pytest

from tests.sources import ROOT

DISTRIBUTIONS = (".", *(str(path.parent.relative_to(ROOT)) for path in sorted(ROOT.glob("plugins/*/pyproject.toml"))))
USE = "import executive, skills.mine\nprint(skills.mine.NAME, executive.Request('go to the kitchen').sentence)\n"


def python(folder, *words):
    """Runs Python in the folder of a project."""
    return subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, check=False)


# the project's folder `skills` is a plain folder, or a package
@pytest.fixture(params=[False, True], ids=["folder", "package"])
def project(request, tmp_path):
    for name in ("skills", "plant", "missions", "tests"):
        (tmp_path / name).mkdir()
    (tmp_path / "skills" / "mine.py").write_text("NAME = 'mine'\n")
    if request.param:
        (tmp_path / "skills" / "__init__.py").write_text("OTHER = 1\n")
    (tmp_path / "prog.py").write_text(USE)
    (tmp_path / "tests" / "test_mine.py").write_text("def test_mine():\n    import executive, skills.mine\n")
    return tmp_path


def test_a_program_imports_errand_and_its_own_folder(project):
    ended = python(project, "prog.py")
    assert (ended.stdout, ended.stderr) == ("mine go to the kitchen\n", "")


def test_the_command_line_and_pytest_work_in_the_project(project):
    assert python(project, "-m", "executive.cli", "missions").returncode == 0
    ended = python(project, "-m", "pytest", "-q", "tests")
    assert (ended.returncode, "1 passed" in ended.stdout) == (0, True), ended.stdout


@pytest.mark.parametrize("project", [True], indirect=True)
def test_a_package_that_was_imported_before_is_named(project):
    ended = python(project, "-c", "import skills.mine, executive")
    folder = project / "skills"
    assert f"ImportError: {folder} stands for Errand's package 'skills': import executive first" in ended.stderr


@pytest.mark.parametrize("folder", DISTRIBUTIONS)
def test_each_distribution_ships_its_types(folder):
    settings = tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["tool"]["setuptools"]
    data = settings["package-data"]
    typed = {path.parent.name for path in (ROOT / folder).glob("*/py.typed")}
    packages = {name.rstrip("*") for name in settings["packages"]["find"]["include"]} - {"missions"}
    assert typed == packages
    assert [name for name in packages if "py.typed" not in data.get(name, ())] == []


BUILD = "from setuptools import build_meta; build_meta.build_editable('.')"


@pytest.mark.parametrize("folder", DISTRIBUTIONS)
def test_type_checkers_find_an_editable_installation_by_a_path(folder, tmp_path):
    for name in ("pyproject.toml", "README.md", "LICENSE", "VERSION"):
        shutil.copy(ROOT / folder / name, tmp_path)
    for marker in (ROOT / folder).glob("*/py.typed"):
        (tmp_path / marker.parent.name).mkdir()
        (tmp_path / marker.parent.name / "__init__.py").touch()
    assert python(tmp_path, "-c", BUILD).returncode == 0
    (wheel,) = map(zipfile.ZipFile, tmp_path.glob("*.whl"))
    (top,) = (name for name in wheel.namelist() if "/" not in name)
    assert top.endswith(".pth") and wheel.read(top).decode().strip() == str(tmp_path)
