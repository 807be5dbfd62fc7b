"""Plans and nodes to find people by their appearance, and to tell people what is known or was found out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import date
from types import MappingProxyType
from typing import ClassVar, Final

from py_trees.common import Status

from errand_home.facts import Facts, QuizAnswer, facts_of
from errand_home.persons import appearance_of, description, plural_description
from errand_home.topics import OWN_TOPICS, AboutPeople, about_people, answer_to, name_in, own_sentence, unknown_fact
from errand_people.looks import Appearance, Gesture, Trait, gesture_text
from errand_people.nodes import PlaceOf
from executive.tree.behaviour import ExplainedLeaf
from executive.tree.board import FromBoard
from executive.tree.context import ANSWER_TOPIC, RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.carry import hand_over_plan
from executive.tree.nodes.command_plans import go_to_goal
from executive.tree.nodes.pick_up import go_into_plan, go_near_plan
from executive.tree.nodes.search import Answer
from executive.tree.plan import PlanBuilder
from executive.words.command import START
from executive.words.expression import Template
from executive.words.knowledge import ANYBODY
from skills.api import Cause, Failed
from skills.descriptions import distinct_objects

ANSWER_WITHIN_S: Final = 15.0
"""Time for a person to say their name or a question."""
WITHIN_M: Final = 2.15
"""Greatest distance from a person, on a bed or behind furniture, where no nearer pose is free."""
_PLAIN: Final[Mapping[str, object]] = MappingProxyType(
    {"keys": MappingProxyType({}), "names": MappingProxyType({}), "options": (), "default": None, "gives": str}
)
"""Options of a question that any text answers."""


class PeopleCount(Answer):
    """Decorator that turns the people of a search into their number, with the sentence under the key `text`.

    | child | room | status |
    |---|---|---|
    | ended | seen | SUCCESS, the number of people is the answer |
    | ended | not seen | FAILURE with the cause that prevented the look |

    `several` and `one` are the descriptions. For the rest see `Answer`.
    """

    kind = "people count"
    output_types: ClassVar = {**Answer.output_types, "text": str}
    one: str = ""
    several: str = ""
    where: str = ""
    text: str = ""

    def _counted(self, unseen: Sequence[str]) -> Status:
        if unseen:
            return self._not_looked(unseen)
        count = len(distinct_objects(self.board.get(key, ()) for key in self.tallies.values()))
        number = "no" if not count else str(count)
        said = f"There {'is' if count == 1 else 'are'} {number} {self.one if count == 1 else self.several} {self.where}"
        self.board.put(self.text, said)
        return self._answered(count, said)


class Statement(ExplainedLeaf):
    """Leaf that writes a sentence about one of the robot's own topics under `key`, and publishes it as an answer."""

    kind = "statement"
    output_types: ClassVar = {"key": str}
    topic: str
    facts: Facts
    robot: str
    key: str
    context: RunContext
    day: Callable[[], date] = date.today

    def update(self) -> Status:
        """Writes the sentence."""
        return self.tell(self.topic, own_sentence(self.topic, self.facts, self.robot, self.day(), self.time_s()))

    def time_s(self) -> float:
        """Present time after midnight of the day on which the run began, in seconds."""
        return self.context.day_began_s + self.context.clock.now()

    def tell(self, question: str, sentence: str) -> Status:
        """Writes and publishes a sentence."""
        self.context.board.put(self.key, sentence)
        note = {"node": self.path_id, "question": question, "answer": sentence, "message": sentence}
        self.context.publish(ANSWER_TOPIC, note)
        return self.say(sentence)


class Reply(Statement):
    """Leaf that writes the answer to the question under `asked`; FAILURE with POSTCONDITION for an unknown question."""

    kind = "reply"
    asked: str = ""

    def update(self) -> Status:
        """Finds the answer."""
        question = str(self.context.board.get(self.asked))
        found = answer_to(question, self.facts)
        if found is None:
            return self.fail(Failed(Cause.POSTCONDITION, f"I do not know the answer to '{question}'"))
        if isinstance(found, QuizAnswer):
            return self.tell(question, found.answer)
        if why := unknown_fact(found, self.facts):
            return self.fail(Failed(Cause.POSTCONDITION, why))
        return self.tell(question, own_sentence(found, self.facts, self.robot, self.day(), self.time_s()))


class AboutPerson(Statement):
    """Leaf that writes a sentence about a person from what was heard or seen under `value`; the `topic` is its kind."""

    kind = "about person"
    value: str = ""
    where: str = ""
    names: tuple[str, ...] = ()

    def update(self) -> Status:
        """Writes the sentence."""
        value = str(self.context.board.get(self.value))
        said = f"called {name_in(value, self.names)}" if self.topic == "name" else value
        said = gesture_text(Gesture(value)) if self.topic == "gesture" else said
        return self.tell(f"the {self.topic} of the person {self.where}", f"The person {self.where} is {said}")


def seek_plan(builder: PlanBuilder) -> NodeSpec:
    """Finds a described person in the room of the goal, and goes to them."""
    goal, appearance = builder.place(str(builder.command.goal)), _appearance(builder)
    title = f"find the {description(appearance)} {where_text(builder, goal)}"
    return builder.sequence(title, *_find(builder, appearance, goal))


def deliver_plan(builder: PlanBuilder) -> NodeSpec:
    """Finds a described person with the object in the gripper, and hands it to them."""
    command = builder.command
    goal, item = builder.place(str(command.goal)), builder.required_object(command.item)
    appearance = _appearance(builder)
    whom = f"the {description(appearance)}"
    meet = builder.at("find").sequence(f"find {whom}", *_find(builder.at("find"), appearance, goal))
    return hand_over_plan(builder, item.plain, builder.knowledge.place_pose(goal).pose_2d(), whom, meet)


def _appearance(builder: PlanBuilder) -> Appearance:
    """Appearance that a command names. Raises InputError when it describes nobody."""
    words = "" if builder.command.object is None else str(builder.command.object.plain)
    found = appearance_of(words)
    if found is None:
        hint = "write 'waving person', 'person raising their left arm', 'sitting person' or 'person wearing red'"
        raise builder.error(f"'{words}' describes no person", hint)
    return found


def where_text(builder: PlanBuilder, place: str) -> str:
    """Text of the place of a person: "in the kitchen", "at the desk"."""
    return f"{'in' if place in builder.knowledge.rooms else 'at'} the {place}"


def _find(builder: PlanBuilder, appearance: Appearance, place: str) -> tuple[NodeSpec, ...]:
    """Goes to a place, looks for a person in its room, and goes to them.

    At a surface, the robot begins where it sees the surface, and looks at the nearest people first.
    """
    room, met = builder.knowledge.room(place), builder.met_key(ANYBODY)
    look = _look(builder, appearance, place, {"person": met}, count=1)
    if place == room and not appearance.traits():  # who stands there is seen without a closer look
        ports = {"area_W": builder.knowledge.rooms[room], "place": room, "person": ANYBODY, "count": 1}
        ports |= builder.optional_ports("find_people", {"moves": True})
        stands = builder.skill("find_people", ports, {"observation": met})
        look = builder.first_of(f"find a person in the {room}", stands, look, part="anybody")
    within = builder.optional_ports("meet_person", {"within_m": WITHIN_M})
    ports = {"person": ANYBODY, "place_W": PlaceOf(met), "place": room, **within}
    return _go(builder, place), look, builder.skill("meet_person", ports, {"person": met})


def _go(builder: PlanBuilder, place: str) -> NodeSpec:
    """Drives into a room, or to where the robot sees a surface; it looks from where it gets."""
    pose = builder.knowledge.place_pose(place).pose_2d()
    is_room = place in builder.knowledge.rooms
    go = go_into_plan(builder, place) if is_room else go_near_plan(builder, pose, f"the {place}")
    return builder.or_stay(f"go to the {place}, if possible", go, "it looks from here", part="go")


def _look(
    builder: PlanBuilder, appearance: Appearance, place: str, outputs: Mapping[str, str], *, count: int
) -> NodeSpec:
    """Searches the room of a place for people of an appearance; a `count` of 0 finds everybody."""
    room = builder.knowledge.room(place)
    ports = {"area_W": builder.knowledge.rooms[room], "place": room, "person": f"the {description(appearance)}"}
    traits: dict[str, object] = {str(trait): value for trait, value in appearance.traits().items()}
    return builder.skill("find_person", {**ports, "count": count, **traits}, outputs)


def report_plan(builder: PlanBuilder) -> NodeSpec:
    """Finds out what to report, goes to the listener, and says it; own topics are said as they are there."""
    command, text = builder.command, builder.key("text")
    topic = "" if command.object is None else str(command.object.plain)
    says, asked = builder.skill("speak", {"text": FromBoard(text)}), about_people(topic)
    to = _to_listener(builder.at("to"))
    if asked is not None:
        place = builder.place(asked.place)
        found = _found_out(builder.at("find-out"), replace(asked, place=place), text)
        return builder.sequence(f"report the {topic}", *found, *to, says)
    facts = facts_of(builder.knowledge)
    if topic not in OWN_TOPICS:
        a_room = next(iter(builder.knowledge.rooms), "kitchen")
        hint = f"say 'time', 'today', 'yourself', 'name of the team' or 'number of waving people in the {a_room}'"
        raise builder.error(f"'{topic}' is nothing that the robot can report", hint)
    if why := unknown_fact(topic, facts):
        raise builder.error(*why.split("; "))
    own = {"topic": topic, "facts": facts, "robot": builder.knowledge.robot.name, "key": text}
    return builder.sequence(f"report the {topic}", *to, builder.node("statement", topic, part="statement", **own), says)


def _to_listener(builder: PlanBuilder) -> tuple[NodeSpec, ...]:
    """Way to the listener: the speaker or a person by name, or the person at a place; none without a goal."""
    goal, knowledge = builder.command.goal, builder.knowledge
    if goal is None:
        return ()
    if goal == START or knowledge.person(goal) is not None:
        return (go_to_goal(builder),)
    return _find(builder, Appearance(), builder.place(goal))


def _found_out(builder: PlanBuilder, asked: AboutPeople, text: str) -> tuple[NodeSpec, ...]:
    """Nodes that find out something about people, and write the sentence under a key."""
    where = where_text(builder, asked.place)
    if asked.appearance is not None:
        return (_count(builder, asked.appearance, asked.place, text),)
    meet, value = _find(builder, Appearance(), asked.place), builder.key("value")
    if asked.info == "name":
        learn = _question(builder, "What is your name?", value)
    else:
        traits = {"traits": (Trait(asked.info),), "place_W": PlaceOf(builder.met_key(ANYBODY))}
        room = builder.knowledge.room(asked.place)
        ports = {"person": ANYBODY, "place": room, "area_W": builder.knowledge.rooms[room], **traits}
        learn = builder.skill("read_person", ports, {asked.info: value})
        meet = meet[:-1]  # it looks from where nothing hides the person, who may sit
    own = {"facts": Facts(), "robot": "", "key": text, "value": value, "where": where}
    names = tuple(builder.knowledge.people)
    told = builder.node("about person", f"the {asked.info}", part="told", topic=asked.info, names=names, **own)
    return *meet, learn, told


def _question(builder: PlanBuilder, text: str, key: str) -> NodeSpec:
    """Asks the person before the robot something, and writes the answer in words under a key."""
    own = {**_PLAIN, "limit_s": ANSWER_WITHIN_S, "key": key}
    return builder.node("question", text, part="ask", text=Template(text), **own)


def _count(builder: PlanBuilder, appearance: Appearance, room: str, text: str) -> NodeSpec:
    """Counts the people of an appearance in a room, and writes the sentence under a key."""
    if room not in builder.knowledge.rooms:
        raise builder.error(f"people are counted in rooms, and '{room}' is none", "name the room")
    people = builder.key("people")
    look = _look(builder, appearance, room, {"people": people}, count=0)
    several, where = plural_description(appearance), where_text(builder, room)
    return builder.node(
        "people count",
        f"how many {several} are {where}?",
        builder.sequence(f"look about the {room}", _go(builder, room), look, part="search"),
        affirmed=f"the number of {several} {where}",
        denied=f"no {several} {where}",
        looks=MappingProxyType({room: (look.path_id,)}),
        key=builder.key("answer"),
        tallies=MappingProxyType({look.path_id: people}),
        numeric=True,
        one=description(appearance),
        several=several,
        where=where,
        text=text,
    )


def answer_plan(builder: PlanBuilder) -> NodeSpec:
    """Asks the person before the robot for their question, and says the answer."""
    asked, text = builder.key("asked"), builder.key("text")
    what = "" if builder.command.object is None else str(builder.command.object.plain)
    if what not in ("question", "quiz"):
        raise builder.error(f"'{what}' is nothing that the robot can answer", "say 'question' or 'quiz'")
    ask = _question(builder, f"What is your {what}?".replace("quiz", "quiz question"), asked)
    own = {"topic": what, "facts": facts_of(builder.knowledge), "robot": builder.knowledge.robot.name, "key": text}
    reply = builder.node("reply", "the answer", part="reply", asked=asked, **own)
    return builder.sequence(f"answer a {what}", ask, reply, builder.skill("speak", {"text": FromBoard(text)}))
