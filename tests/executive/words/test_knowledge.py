from pathlib import Path

import pytest

from executive.words.knowledge import load_knowledge
from executive.words.task import task_named
from skills.inputs.errors import InputError
from tests.tables import table

WORLD = Path(__file__).with_name("test_knowledge_world.yaml").read_text(encoding="utf-8")


@pytest.fixture
def write(tmp_path):
    def to_file(text):
        path = tmp_path / "knowledge.yaml"
        path.write_text(text, encoding="utf-8")
        return path

    return to_file


@pytest.fixture
def knowledge(write):
    return load_knowledge(write(WORLD))


@pytest.mark.parametrize(*table(__file__, "names"))
def test_a_name_or_alias_is_found_in_its_sense(knowledge, sense, name, found):
    assert getattr(knowledge, sense)(name) == (tuple(found) if sense == "classes" else found)


@pytest.mark.parametrize(*table(__file__, "default_places"))
def test_default_place_goes_by_object_then_category_then_habit(knowledge, task, name, place):
    assert knowledge.default_place(task_named(task), name) == place


def test_a_room_has_its_surfaces_and_a_surface_has_itself(knowledge):
    assert knowledge.surfaces_in("kitchen") == ("kitchen counter",)
    assert (knowledge.surfaces_in("workbench"), knowledge.room("workbench")) == (("workbench",), "workshop")


PUMP = "places:\n  pump: {pose: {x: 3.5, y: 0.2, yaw: 1.5}, aliases: [feed pump]}\n"


def test_a_place_without_an_outline_is_a_named_pose_and_no_room(write):
    knowledge = load_knowledge(write(WORLD.replace("places:\n", PUMP)))
    assert (knowledge.poses, set(knowledge.rooms)) == (("pump",), {"kitchen", "workshop"})
    assert (knowledge.place("Feed Pump"), knowledge.room("pump"), knowledge.surfaces_in("pump")) == (
        "pump",
        "kitchen",
        (),
    )
    assert (knowledge.place_pose("pump").y, "pump" in knowledge.place_names()) == (0.2, True)


def test_a_named_pose_outside_of_all_rooms_belongs_to_the_nearest(write):
    knowledge = load_knowledge(write(WORLD.replace("places:\n", PUMP.replace("3.5", "-1.0"))))
    assert knowledge.room("pump") == "workshop"


def test_poses_are_those_of_the_file(knowledge):
    assert (knowledge.place_pose("workshop").x, knowledge.place_pose("workbench").yaw) == (-3.0, 1.57)


@pytest.mark.parametrize(*table(__file__, "wrong_files"))
def test_a_wrong_file_is_refused_with_its_line_and_the_mend(write, old, new, line, says):
    path = write(WORLD.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_knowledge(path)
    message = str(error.value)
    assert (error.value.line, message.split(": ")[0]) == (line, f"{path}:{line}")
    assert says in message and "\n" not in message


@pytest.mark.parametrize(*table(__file__, "wrong_doors"))
def test_a_door_joins_two_rooms_that_are_near_it(write, door, says):
    with pytest.raises(InputError) as error:
        load_knowledge(write(f"{WORLD}doors:\n- {door}\n"))
    assert says in str(error.value)


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "just words"])
def test_a_file_without_keys_is_refused(write, text):
    with pytest.raises(InputError, match="holds no mapping"):
        load_knowledge(write(text))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml: there is no such file"):
        load_knowledge(tmp_path / "nowhere.yaml")


TAGS = """\
tags:
  - {id: 7, size: 0.06, on: mug}
  - {id: 520, size: 0.146, on: dock, at: [-1.5, 0.0, 0.4], yaw: 0.0}
  - {id: 30, size: 0.16, at: [4.0, 1.0, 1.1], yaw: 3.14}
"""


def test_a_class_that_carries_a_tag_needs_no_form(write):
    knowledge = load_knowledge(write(WORLD.replace("things:", "things:\n  mug: {aliases: [cup]}") + TAGS))
    assert knowledge.classes("cup") == ("mug",)
    mug, dock, wall = knowledge.known_tags()
    assert (mug.id, mug.size_m, mug.on, mug.p_W) == (7, 0.06, "mug", None)
    assert ((dock.on, dock.p_W), (wall.on, wall.yaw_rad)) == (("dock", (-1.5, 0.0, 0.4)), (None, 3.14))


@pytest.mark.parametrize(*table(__file__, "wrong_tags"))
def test_a_wrong_tag_is_refused_with_its_line(write, line, says):
    with pytest.raises(InputError, match=says) as refused:
        load_knowledge(write(f"{WORLD}tags:\n  - {line}\n"))
    assert refused.value.line >= len(WORLD.splitlines()) + 1


def test_a_tag_of_a_dock_needs_the_dock(write):
    world = WORLD.replace("dock: {x: -1.0, y: 0.0, yaw: 0.0}\n", "")
    with pytest.raises(InputError, match="this world has no dock"):
        load_knowledge(write(f"{world}tags:\n  - {{id: 5, size: 0.1, on: dock, at: [0, 0, 0.4]}}\n"))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("lab #2", "lab 2"),
        ("lab #2", "Lab Two"),
        ("pantry/left", "pantry left"),
        ("café", "cafe"),
        ("room 2", "room two"),
    ],
)
def test_a_place_is_found_by_the_form_in_which_its_name_is_said(write, name, said):
    text = WORLD.replace("places:\n", f'places:\n  "{name}": {{pose: {{x: 3.5, y: 0.2, yaw: 1.5}}}}\n')
    knowledge = load_knowledge(write(text))
    assert (knowledge.place(said), knowledge.place(name)) == (name, name)
    assert said.lower() in knowledge.spellings([name])
