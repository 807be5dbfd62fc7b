"""Tasks behind entry points: what they say of themselves, and which ones are refused, by whose fault."""

import pickle

import pytest

from executive.words import task as tasks
from executive.words.command import parse_command
from executive.words.leaf_steps import Do
from executive.words.steps import steps_from_yaml, steps_to_yaml
from executive.words.task import Part, basic, broken_tasks, installed_tasks, task_named
from tests.executive.distribution import module_of_a_plug_in
from tests.executive.house_tasks import Call, Vacuum

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

class Undecided(Mop):
    """Has a text for a truth."""
    word = "skim"
    needs_goal = "yes"

class Spoken(Mop):
    """Has a text for its samples."""
    word = "chat"
    spoken = "chat a bit"

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
    names = [*installed_tasks()]
    assert names.index("mop") > names.index("grasp")
    assert str(parse_command("Take [Nothing] to [hall] and do [mop] to [Nothing]")).endswith("do [mop] to [Nothing]")


#   what is registered, and what is said of it
@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("sweep = moppers:Mop", "calls itself 'mop'.*register it under its own word"),
        ("hush = moppers:Silent", "has no docstring"),
        ("idle = moppers:Planless", "does not define plan"),
        ("dream = moppers:Listless", "its sentences are no rows of a template with samples"),
        ("drift = moppers:Kindless", "its goal_is is 'place'; write Part.PLACE"),
        ("wipe = moppers:Texted", "its verbs are no single words"),
        ("rinse = moppers:Unread", "its rows of unkept words have no expression 'said' with a 'reason'"),
        ("hum = moppers:Pastless", "its past is 'None'.*write {'swept': 'sweep'}"),
        ("rake = moppers:Ruled", "its rules is"),
        ("skim = moppers:Undecided", "its needs_goal is 'yes'.*write True"),
        ("chat = moppers:Spoken", "its spoken is 'chat a bit'"),
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


#   how a mission names a task
FORMS = ["mop: hall", "{mop: hall, retries: 1}", "do: {task: mop, goal: hall}", "{do: mop, to: hall}"]


@pytest.mark.parametrize("step", FORMS)
@pytest.mark.parametrize("line", ["mop = moppers:broken", "mop = moppers:nothing", "mop = no_such_module:Mop"])
def test_a_mission_with_a_task_that_cannot_be_used_names_the_distribution_and_the_cause(register, line, step):
    register(line)
    with pytest.raises(ValueError, match=r"task 'mop' of distribution moppers: .*(no subclass|cannot load)"):
        steps_from_yaml([f"- {step}"])


@pytest.mark.parametrize("step", FORMS)
def test_a_mission_with_a_task_of_a_plug_in_that_is_not_installed_names_it(house_tasks, step):
    house_tasks.pop("follow", None)
    with pytest.raises(ValueError, match=r"'follow' needs the plug-in errand-people.*; pip install errand-people"):
        steps_from_yaml([f"- {step.replace('mop', 'follow')}"])


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


@pytest.fixture
def more_kinds(house_tasks):
    """The tasks of a house, one for a time and one for a number."""
    for word, kind in {"rest": Part.TIME, "tune": Part.NUMBER}.items():
        house_tasks[word] = type(word.title(), (Call,), {"word": word, "object_is": kind, "goal_is": Part.PLACE})()


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
        ("{do: rest, object: 10}", "Take [Nothing] to [Nothing] and do [rest] to [10 second]"),
        ("do: {task: rest, object: 2 min, goal: hall}", "Take [Nothing] to [hall] and do [rest] to [120 second]"),
        ("rest: 1.5 min", "Take [Nothing] to [Nothing] and do [rest] to [90 second]"),
        ("rest: 10 seconds", "Take [Nothing] to [Nothing] and do [rest] to [10 seconds]"),
        ("{do: wait, object: 10 s}", "Take [Nothing] to [Nothing] and do [wait] to [10 second]"),
        ("tune: 3", "Take [Nothing] to [Nothing] and do [tune] to [3]"),
        ("tune: '-2.5'", "Take [Nothing] to [Nothing] and do [tune] to [-2.5]"),
        ("do: {task: tune, object: 3}", "Take [Nothing] to [Nothing] and do [tune] to [3]"),
        ("call: 3", "Take [Nothing] to [Nothing] and do [call] to [3]"),
        ("call: 3 beers, please", 'Take [Nothing] to [Nothing] and do [call] to ["3 beers, please"]'),
        (
            "call: it is in front of the house",
            'Take [Nothing] to [Nothing] and do [call] to ["it is in front of the house"]',
        ),
    ],
)
def test_a_step_names_a_task_in_two_forms(more_kinds, step, command):
    (found,) = steps_from_yaml([f"- {step}"])
    assert isinstance(found, Do)
    assert str(found.command) == command
    assert steps_from_yaml(steps_to_yaml([found])) == (found,)


#   object of a task in a command, what it amounts to
@pytest.mark.parametrize(
    ("task", "said", "amount"),
    [
        ("rest", "90 second", 90.0),
        ("rest", "hour", 3600.0),
        ("rest", "beer", None),
        ("tune", "3", 3.0),
        ("tune", "three", 3.0),
        ("tune", "2 beers", None),
        ("water", "3 beers", None),
        ("vacuum", "Nothing", None),
    ],
)
def test_a_command_states_its_time_in_seconds_and_its_number(more_kinds, task, said, amount):
    assert parse_command(f"Take [Nothing] to [Nothing] and do [{task}] to [{said}]").amount == amount


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("vacuum: {gaol: hall}", "gaol"),
        ("{vacuum: hall, water: beer}", "a step has either 'vacuum' or water, not both"),
        ("{vacuum: hall, do: grasp}", "a step has either 'vacuum' or do, not both"),
        ("{vacuum: hall, to: kitchen}", "'to' of 'vacuum' is said twice"),
        ("tune: three", "should be a number; write 3"),
        ("tune: true", "'tune' takes a number"),
        ("nap: a while", 'should be a number, seconds, or as in "2 min"'),
        ("nap: 0.5 s", "should be whole seconds"),
        ("call: the [red] one", "cannot be in a command; leave brackets and double quotes out"),
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
    house_tasks["nap"] = type("Nap", (Call,), {"word": "nap", "object_is": Part.TIME})()
    house_tasks["tune"] = type("Tune", (Call,), {"word": "tune", "object_is": Part.NUMBER})()
    with pytest.raises(ValueError, match=message):
        steps_from_yaml([f"- {step}"])


def test_parts_tell_what_a_task_is_about():
    assert [task_named(word).object_is for word in ("grasp", "wait", "charge")] == [Part.THING, Part.TIME, Part.NOTHING]
