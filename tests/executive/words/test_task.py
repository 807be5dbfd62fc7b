"""Tasks behind entry points: what they say of themselves, and which ones are refused, by whose fault."""

import pickle

import pytest

from executive.words import task as tasks
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.steps import steps_from_yaml
from executive.words.task import Part, basic, broken_tasks, installed_tasks, task_named
from tests.executive.distribution import module_of_a_plug_in
from tests.executive.house_tasks import Vacuum

PAGE = '''
from executive.tree.task_page import TaskPage

class Mop(TaskPage):
    """Mops a floor."""
    word = "mop"
    def plan(self, builder):
        """Plans nothing."""

class Wordless(Mop):
    """Has the word of another."""
    word = "scrub"

class Silent(Mop):
    word = "hush"

class Listless(Mop):
    """Has a text for its sentences."""
    word = "dream"
    sentences = "dream on"

class Kindless(Mop):
    """Has a text for the kind of its goal."""
    word = "drift"
    goal_is = "place"

class Texted(Mop):
    """Has a text for its verbs."""
    word = "wipe"
    verbs = "wipe"

class Unread(Mop):
    """Has an expression that cannot be read."""
    word = "rinse"
    unkept = ({"said": "(", "reason": "I never {}"},)

class Pastless(Mop):
    """Has no past forms at all."""
    word = "hum"
    past = None

class Ruled(Mop):
    """Has a list for its rules."""
    word = "rake"
    rules = ["a"]

class Planless(TaskPage):
    """Has no plan."""
    word = "idle"

def broken():
    raise OSError("no bucket")
'''


@pytest.fixture
def register(tmp_path, monkeypatch):
    """Registers tasks of a module."""
    tasks._found.cache_clear()
    with module_of_a_plug_in(tmp_path, monkeypatch, "moppers", "errand.tasks", PAGE) as registered:
        yield registered
    monkeypatch.undo()
    tasks._found.cache_clear()


def test_tasks_stand_in_the_order_of_their_numbers():
    assert [*installed_tasks()][:5] == ["grasp", "find", "place", "wait", "charge"]


def test_basic_tasks_are_those_that_say_so_of_themselves():
    found = basic()
    assert [found.take, found.look, found.put, found.wait, found.charge] == [*installed_tasks().values()][:5]


def test_a_task_is_the_same_after_a_journey_to_another_process():
    grasp = task_named("grasp")
    again = pickle.loads(pickle.dumps(grasp))
    assert (again, hash(again)) == (grasp, hash(grasp))


def test_a_task_of_another_distribution_stands_behind_the_shipped_ones(register):
    register("mop = moppers:Mop")
    assert [*installed_tasks()][-1] == "mop"
    assert str(parse_command("Take [Nothing] to [hall] and do [mop] to [Nothing]")).endswith("do [mop] to [Nothing]")


#   what is registered, and what is said of it
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("sweep = moppers:Mop", "calls itself 'mop'.*register it under its own word"),
        ("hush = moppers:Silent", "has no docstring"),
        ("idle = moppers:Planless", "does not define plan"),
        ("dream = moppers:Listless", "its sentences are no rows of a template with samples"),
        ("drift = moppers:Kindless", "object_is, goal_is and item_is are kinds of parts"),
        ("wipe = moppers:Texted", "its verbs are no single words"),
        ("rinse = moppers:Unread", "its rows of unkept words have no expression 'said' with a 'reason'"),
        ("hum = moppers:Pastless", "its past is 'None'.*write {'swept': 'sweep'}"),
        ("rake = moppers:Ruled", "its rules is"),
        ("mop = moppers:broken", "no subclass of executive.tree.task_page.TaskPage"),
        ("mop = moppers:nothing", "cannot load moppers:nothing.*repair or uninstall"),
        ("Mop = moppers:Mop", "calls itself 'mop'"),
    ],
)
def test_a_task_that_breaks_a_rule_is_named_with_its_distribution(register, line, message):
    register(line)
    word = line.partition(" ")[0]
    assert word not in installed_tasks()
    with pytest.raises(ValueError, match=f"task '{word}' of distribution moppers: .*{message}"):
        task_named(word)


def test_two_distributions_with_one_word_are_both_named(register, tmp_path):
    register("mop = moppers:Mop")
    other = tmp_path / "sweepers-1.0.dist-info"
    other.mkdir()
    (other / "METADATA").write_text("Metadata-Version: 2.1\nName: sweepers\nVersion: 1.0\n")
    (other / "entry_points.txt").write_text("[errand.tasks]\nmop = moppers:Mop\n")
    assert "moppers and sweepers register a task 'mop'" in str(broken_tasks()["mop"])


def test_a_shipped_task_keeps_its_word(register):
    register("grasp = moppers:Mop")
    assert type(task_named("grasp")).__module__.startswith("executive.")


#   a step as it is written, the command that it is
@pytest.mark.parametrize(
    ("step", "command"),
    [
        ("do: {task: vacuum, goal: kitchen}", "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"),
        ("vacuum: kitchen", "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"),
        ("vacuum: {goal: kitchen}", "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"),
        ("{to: kitchen, do: vacuum}", "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"),
        ("water: beer", "Take [Nothing] to [Nothing] and do [water] to [beer]"),
        ("water: {object: 2 beers, goal: desk}", "Take [Nothing] to [desk] and do [water] to [2 beers]"),
        ("call: dinner is ready", "Take [Nothing] to [Nothing] and do [call] to [dinner is ready]"),
        ("do: {task: grasp, object: beer, goal: desk}", "Take [Nothing] to [desk] and do [grasp] to [beer]"),
        ("{vacuum: kitchen, retries: 2}", "Take [Nothing] to [kitchen] and do [vacuum] to [Nothing]"),
    ],
)
def test_a_step_names_a_task_in_two_forms(house_tasks, step, command):
    (found,) = steps_from_yaml([f"- {step}"])
    assert isinstance(found, Do)
    assert str(found.command) == command


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("vacuum: {gaol: hall}", "gaol"),
        ("{vacuum: hall, water: beer}", "vacuum"),
        ("{vacuum: hall, to: kitchen}", "vacuum"),
        ("do: {goal: hall}", "grasp"),
        ("water:", "'do' and 'object' go together; 'water' needs its object, a thing"),
        ("call: {goal: hall}", "'call' needs its object, a text"),
        ("vacuum: 5", "'vacuum' takes a place; write it as a text, in quotes"),
        ("vacuum: [kitchen, hall]", "'vacuum' takes a place"),
        ("water: true", "'water' takes a thing"),
        ("rest: hall", "'rest' takes no value; leave its value out"),
    ],
)
def test_a_faulty_form_is_refused(house_tasks, step, message):
    house_tasks["rest"] = type("Rest", (Vacuum,), {"word": "rest", "goal_is": Part.NOTHING})()
    with pytest.raises(ValueError, match=message):
        steps_from_yaml([f"- {step}"])


def test_parts_tell_what_a_task_is_about():
    assert [task_named(word).object_is for word in ("grasp", "wait", "charge")] == [Part.THING, Part.TIME, Part.NOTHING]
