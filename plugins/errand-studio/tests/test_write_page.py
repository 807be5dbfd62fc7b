"""Write page with a simulated user."""

from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from studio_user import StudioUser, play, studio

from errand_studio.palette import examples

TEXT = "name: round\n# the round\nsteps:\n  - to: hall  # first\n  - to: kitchen\n"
Scenario = Callable[[StudioUser], Awaitable[None]]


@pytest.fixture
def with_page(tmp_path: Path) -> Callable[[Scenario], None]:
    """Plays a scenario on the page of a mission that is checked."""
    (tmp_path / "round.yaml").write_text(TEXT)

    def run(scenario: Scenario) -> None:
        async def whole() -> None:
            async with studio(tmp_path) as page:
                await page.open("/?file=round.yaml")
                await page.see("of the battery")
                await scenario(page)

        play(whole)

    return run


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "round.yaml"


def test_a_mistake_is_shown_at_its_line_and_replaced(with_page: Callable[[Scenario], None], file: Path) -> None:
    async def scenario(page: StudioUser) -> None:
        page.type(TEXT.replace("kitchen", "kitchn"))
        shown = await page.see("write kitchen")
        assert 'data-line="5"' in shown
        assert file.with_name(".round.draft.yaml").is_file()
        await page.send("fix", number=0)
        assert page.editor.value == TEXT

    with_page(scenario)


def test_steps_are_edited_by_mouse_and_keys(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        await page.send("down", path=["steps", 0])
        assert page.editor.value == "name: round\n# the round\nsteps:\n  - to: kitchen\n  - to: hall  # first\n"
        await page.send("up", path=["steps", 1])
        assert page.editor.value == TEXT
        await page.send("double", path=["steps", 1])
        assert page.editor.value == TEXT + "  - to: kitchen\n"
        await page.send("remove", path=["steps", 2])
        await page.send("wrap in", path=["steps", 1], kind="repeat")
        assert page.editor.value == TEXT[:-16] + "  - repeat: {times: 2}\n    steps:\n      - to: kitchen\n"
        await page.send("out", path=["steps", 1, "steps", 0])
        assert page.editor.value.endswith("    steps:\n      []\n  - to: kitchen\n")
        await page.send("in", path=["steps", 2])
        await page.send("drop", path=["steps", 0], to=["steps", 1, "steps"], place="into")
        assert page.editor.value.endswith("      - to: hall  # first\n      - to: kitchen\n")

    with_page(scenario)


def test_an_edit_that_no_longer_fits_is_refused(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        for values in ({"path": ["steps", 7]}, {"path": "steps"}, {"path": [["a"]]}, {"path": ["nothing", 0]}):
            await page.send("remove", **values)
        await page.send("fix", number=40)
        await page.send("open", name="../../etc/passwd.yaml")
        await page.send("nonsense", path=["steps", 0])
        assert page.editor.value == TEXT

    with_page(scenario)


def test_the_palette_puts_a_step_behind_the_chosen_one(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        keys = [each.key for each in examples(page.workshop.names(None))]
        await page.send("pick", number=keys.index("speak"), path=["steps", 0])
        await page.send("pick", number=keys.index("to"), path=None)
        assert page.editor.value == TEXT.replace("first\n", "first\n  - speak: Here I am.\n") + "  - to: hall\n"

    with_page(scenario)


def test_a_sentence_becomes_its_steps(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        page.path = ["steps", 0]
        await page.say("go to the office, and then go to the bedroom")
        await page.until(lambda: "office" in page.editor.value)
        steps = "first\n  - to: office\n  - to: bedroom\n"
        assert page.editor.value.replace("{", "").replace("}", "") == TEXT.replace("first\n", steps)
        await page.say("fly to the moon")
        await page.see("moon")

    with_page(scenario)


def test_a_change_outside_never_overwrites_unsaved_text(with_page: Callable[[Scenario], None], file: Path) -> None:
    async def scenario(page: StudioUser) -> None:
        page.type(TEXT + "  - to: bedroom\n")
        file.write_text(TEXT + "  - to: office\n")
        await page.send("save")
        await page.see("The file has changed")
        assert file.read_text().endswith("office\n")
        page.press("Overwrite it")
        await page.until(lambda: file.read_text().endswith("bedroom\n"))

    with_page(scenario)


def test_broken_yaml_keeps_the_outline(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        page.type(TEXT + "  - {to: office\n")
        shown = await page.see("broken YAML")
        assert "<b>to</b> hall" in shown

    with_page(scenario)


def test_texts_of_a_mission_are_shown_as_texts(with_page: Callable[[Scenario], None]) -> None:
    async def scenario(page: StudioUser) -> None:
        evil = "<img src=x onerror=alert(1)>"
        page.type(f"name: '{evil}'\nsteps:\n  - speak: '{evil}'\n  - to: '{evil}'\n")
        shown = await page.see("1 error")
        page.type(f"name: '{evil}'\nsteps:\n  - speak: '{evil}'\n")
        shown += await page.see("of the battery")
        assert evil not in shown
        assert "&lt;img" in shown

    with_page(scenario)
