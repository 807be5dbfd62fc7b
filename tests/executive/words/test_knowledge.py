import pytest

from executive.words.command import Task
from executive.words.knowledge import load_knowledge
from skills.files.errors import InputError

WORLD = """\
robot: {name: Alice}
start: {x: 0.0, y: 0.0, yaw: 0.0}
dock: {x: -1.0, y: 0.0, yaw: 0.0}
places:
  kitchen:
    aliases: [cook room]
    pose: {x: 3.0, y: 1.0, yaw: 1.57}
    polygon: [[2, 0], [4, 0], [4, 2], [2, 2]]
  workshop:
    pose: {x: -3.0, y: 1.0, yaw: 0.0}
    polygon: [[-4, 0], [-2, 0], [-2, 2], [-4, 2]]
surfaces:
  kitchen counter:
    place: kitchen
    aliases: [counter]
    height: 0.9
    polygon: [[3, 1.4], [4, 1.4], [4, 2], [3, 2]]
    viewpoints: [{x: 3.5, y: 0.8, yaw: 1.57}]
  workbench:
    place: workshop
    height: 0.85
    polygon: [[-4, 1.4], [-3, 1.4], [-3, 2], [-4, 2]]
    viewpoints: [{x: -3.5, y: 0.8, yaw: 1.57}]
things:
  coke: {aliases: [coca cola], categories: [drink], usual: [kitchen counter]}
  beer: {categories: [drink], usual: [kitchen counter]}
  hammer: {categories: [tool], usual: [workbench]}
  cube: {usual: [workbench]}
people:
  Robin: {aliases: [Rob], at: kitchen}
defaults:
  grasp: {drink: kitchen, tool: workshop}
"""


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


@pytest.mark.parametrize(
    ("name", "own"),
    [
        ("kitchen", "kitchen"),
        ("Cook Room", "kitchen"),
        ("counter", "kitchen counter"),
        ("workbench", "workbench"),
        ("cellar", None),
        ("coke", None),
    ],
)
def test_a_place_is_found_by_name_and_alias(knowledge, name, own):
    assert knowledge.place(name) == own


@pytest.mark.parametrize(
    ("name", "classes"),
    [("coke", ("coke",)), ("coca cola", ("coke",)), ("drink", ("coke", "beer")), ("Tool", ("hammer",)), ("robot", ())],
)
def test_category_includes_its_classes(knowledge, name, classes):
    assert knowledge.classes(name) == classes


def test_a_category_keeps_its_name(knowledge):
    assert knowledge.object_name("Drink") == "drink"
    assert knowledge.object_name("coca cola") == "coke"
    assert knowledge.object_name("banana") is None


def test_a_person_is_found_by_alias(knowledge):
    assert knowledge.person("rob") == "Robin"
    assert knowledge.person("Bob") is None


@pytest.mark.parametrize(
    ("task", "name", "place"),
    [
        (Task.GRASP, "drink", "kitchen"),
        (Task.GRASP, "coke", "kitchen"),
        (Task.FIND, "hammer", "workshop"),
        (Task.GRASP, "cube", "workshop"),
        (Task.GRASP, "banana", None),
    ],
)
def test_default_place_goes_by_object_then_category_then_habit(knowledge, task, name, place):
    assert knowledge.default_place(task, name) == place


def test_a_room_has_its_surfaces_and_a_surface_has_itself(knowledge):
    assert knowledge.surfaces_in("kitchen") == ("kitchen counter",)
    assert knowledge.surfaces_in("workbench") == ("workbench",)
    assert knowledge.room("workbench") == "workshop"


def test_poses_are_those_of_the_file(knowledge):
    assert knowledge.place_pose("workshop").x == -3.0
    assert knowledge.place_pose("workbench").yaw == 1.57


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("dock:", "dok:", 3, "unknown key 'dok'; did you mean 'dock'?"),
        ("    height: 0.9\n", "    hight: 0.9\n", 16, "unknown key 'hight'; did you mean 'height'?"),
        ("    height: 0.9\n", "", 13, "key 'height' is missing in surfaces.kitchen counter"),
        ("    height: 0.9\n", "    height: -1\n", 16, "above 0"),
        ("    height: 0.9\n", "    height: high\n", 16, "surfaces.kitchen counter.height"),
        ("place: kitchen\n", "place: kitchin\n", 14, "'kitchin' is not known; did you mean 'kitchen'?"),
        ("usual: [workbench]}\n  cube", "usual: [work bench]}\n  cube", 27, "did you mean 'workbench'?"),
        ("  cube:", "  banana:", 28, "'banana' is not known"),
        ("tool: workshop}", "tool: garage}", 32, "'garage' is not known"),
        ("aliases: [counter]", "aliases: [cook room]", 13, "means both 'kitchen' and 'kitchen counter'"),
        ("  workshop:\n", "  kitchen:\n", 9, "stands twice (first in line 5)"),
        ("at: kitchen}", "at: [kitchen}", 30, "broken YAML"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line_and_the_mend(write, old, new, line, says):
    path = write(WORLD.replace(old, new, 1))
    with pytest.raises(InputError) as error:
        load_knowledge(path)
    assert error.value.line == line
    assert str(error.value).startswith(f"{path}:{line}: ")
    assert says in str(error.value)
    assert "\n" not in str(error.value)


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
    assert (dock.on, dock.p_W) == ("dock", (-1.5, 0.0, 0.4))
    assert (wall.on, wall.yaw_rad) == (None, 3.14)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("{id: 7, size: 0.06, on: mug}", "'mug' is not known"),
        ("{id: 7, size: 0.06}", "give 'at' for a tag at the dock or on a wall"),
        ("{id: 7, size: 0.06, on: coke, at: [1, 1, 1]}", "'on' alone for one on an object"),
        ("{id: 587, size: 0.06, on: coke}", "id"),
        ("{id: 7, size: 0.06, on: coke, face: up}", "face"),
        ("{id: 7, size: 0.06, on: coke}\n  - {id: 7, size: 0.1, on: beer}", "tag 7 is listed twice"),
    ],
)
def test_a_wrong_tag_is_refused_with_its_line(write, line, says):
    with pytest.raises(InputError, match=says) as refused:
        load_knowledge(write(f"{WORLD}tags:\n  - {line}\n"))
    assert refused.value.line >= len(WORLD.splitlines()) + 1


def test_a_tag_of_a_dock_needs_the_dock(write):
    with pytest.raises(InputError, match="this world has no dock"):
        load_knowledge(
            write(
                WORLD.replace("dock: {x: -1.0, y: 0.0, yaw: 0.0}\n", "")
                + TAGS.splitlines()[0]
                + "\n  - {id: 5, size: 0.1, on: dock, at: [0, 0, 0.4]}\n"
            )
        )
