"""Makes requests from the vocabulary of a world, each with the commands that it asks for, the same for a seed."""

import random
from dataclasses import dataclass

from executive.words.task import task_named
from tests.tables import yaml_beside

PATTERNS = yaml_beside(__file__, "patterns.yaml")


@dataclass(frozen=True)
class Spoken:
    """A sentence, and the commands it asks for in their text form; none when it is said to nobody."""

    text: str
    commands: tuple[str, ...] = ()
    addressed: bool = True


def make_requests(knowledge, count, seed):
    return _different(_Maker(knowledge, random.Random(seed)).request, count)


def make_chatter(knowledge, count, seed):
    """Makes different sentences that are not said to the robot, many of them with its words."""
    return _different(_Maker(knowledge, random.Random(seed)).chatter, count)


def _different(make, count):
    found = {}
    while len(found) < count:
        spoken = make()
        found.setdefault(spoken.text, spoken)
    return list(found.values())


class _Maker:
    """Draws names of the world and puts them into the patterns."""

    def __init__(self, knowledge, draw):
        self.knowledge, self.draw = knowledge, draw
        self.kinds = (self._fetch, self._two, self._deliver, self._move, self._put, self._find, self._pick, self._go)
        self.kinds += (self._give, self._told)

    def request(self):
        text, commands = self.draw.choice(self.kinds)()
        greeting = self.draw.choice(PATTERNS["greetings"]).format(robot=self.knowledge.robot.name)
        polite = "" if text.startswith("there") else self.draw.choice(PATTERNS["polite"])
        return Spoken(f"{greeting}{polite}{text}", tuple(commands))

    def chatter(self):
        thing, _ = self._thing()
        text = self.draw.choice(PATTERNS["not_addressed"]).format(
            thing=thing,
            thing_a=f"a {thing}".capitalize(),
            place=self._room()[0],
            surface=self._surface()[0],
            person=self._person()[0],
            other=self.draw.choice(PATTERNS["others"]),
        )
        return Spoken(text[0].upper() + text[1:], addressed=False)

    def _fetch(self):
        (thing, name), (words, source) = self._thing(), self._maybe(" from the {}")
        text = self._text("fetch", thing, source=words)
        return text, [_take(source or self._usual(name), name), _carry(name, "start")]

    def _two(self):
        thing, name = self.draw.choice([("cokes", "coke"), ("beers", "beer"), ("hammers", "hammer"), ("cubes", "cube")])
        words, source = self._maybe(" from the {}")
        text = self.draw.choice(PATTERNS["fetch_two"]).format(things=thing, source=words)
        return text, [_take(source or self._usual(name), f"2 {name}"), _carry(f"2 {name}", "start")]

    def _deliver(self):
        (thing, name), (goal, place) = self._thing(), self._goal()
        return self._text("deliver", thing, goal=goal), [_take(self._usual(name), name), _carry(name, place)]

    def _move(self):
        (thing, name), (source, taken), (goal, place) = self._thing(), self._surface(), self._surface()
        return self._text("move", thing, source=source, goal=goal), [_take(taken, name), _carry(name, place)]

    def _put(self):
        (thing, name), (source, taken), (goal, place) = self._thing(), self._surface(), self._surface()
        text = self._text("put", thing, source=source, goal=goal)
        return text, [_take(taken, name), f"Take [{name}] to [{place}] and do [place] to [{name}]"]

    def _find(self):
        (thing, name), (words, place) = self._thing(), self._maybe(" in the {}", rooms=True)
        found = place or self._usual(name, "find")
        return self._text("find", thing, place=words), [f"Take [Nothing] to [{found}] and do [find] to [{name}]"]

    def _pick(self):
        (thing, name), (words, source) = self._thing(), self._maybe(" from the {}")
        return self._text("pick", thing, source=words), [_take(source or self._usual(name), name)]

    def _go(self):
        (goal, place), pattern = self._room(), self.draw.choice(PATTERNS["go"])
        return pattern.format(goal=goal), [_carry("Nothing", place)]

    def _give(self):
        (thing, name), (person, who), (source, taken) = self._thing(), self._person(), self._surface()
        text = self._text("give", thing, source=source, person=person)
        return text, [_take(taken if text.startswith("go") else self._usual(name), name), _carry(name, who)]

    def _told(self):
        (thing, name), (source, taken) = self._thing(), self._surface()
        return self._text("told", thing, source=source), [_take(taken, name), _carry(name, "start")]

    def _text(self, kind, thing, **words):
        article = self.draw.choice(("the", "an" if thing[0] in "aeiou" else "a"))
        return self.draw.choice(PATTERNS[kind]).format(article=article, thing=thing, **words)

    def _thing(self):
        return self.draw.choice([*_named(self.knowledge.things), *((c, c) for c in self.knowledge.categories())])

    def _room(self):
        return self.draw.choice(_named(self.knowledge.places))

    def _surface(self):
        return self.draw.choice(_named(self.knowledge.surfaces))

    def _person(self):
        return self.draw.choice(_named(self.knowledge.people))

    def _goal(self):
        name, known = self.draw.choice((self._room, self._surface, self._person))()
        return (name, known) if known in self.knowledge.people else (f"the {name}", known)

    def _maybe(self, pattern, *, rooms=False):
        """The words for a place and its name, or none of both."""
        if self.draw.random() < 0.4:
            return "", None
        name, known = self._room() if rooms or self.draw.random() < 0.3 else self._surface()
        return pattern.format(name), known

    def _usual(self, name, task="grasp"):
        return self.knowledge.default_place(task_named(task), name)


def _named(group):
    """Each name and alias with the name that it stands for; of aliases that hold another name, the whole."""
    return [(spoken, name) for name, facts in group.items() for spoken in (name, *facts.aliases)]


def _take(place, name):
    return f"Take [Nothing] to [{place}] and do [grasp] to [{name}]"


def _carry(name, goal):
    return f"Take [{name}] to [{goal}] and do [Nothing] to [Nothing]"
