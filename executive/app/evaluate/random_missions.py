"""Draws random missions in English that make sense in a world, one for each seed."""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from executive.app.evaluate.evaluation_file import MOST_RUNS, seed_range
from executive.app.evaluate.results import Evaluation, RunSpec
from executive.app.prepare.feasibility import abilities_in
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.mission.request import Request
from executive.words.knowledge import Knowledge
from skills.descriptions import plural
from skills.inputs.errors import InputError, with_article
from skills.inputs.outside import is_file
from skills.inputs.yaml_source import read_yaml

_TABLE: Final[Mapping[str, Mapping[str, Any]]] = read_yaml(Path(__file__).with_suffix(".yaml")).data
KINDS: Final[Mapping[str, tuple[str, ...]]] = {kind: tuple(about["sentences"]) for kind, about in _TABLE.items()}
"""Sentences of each kind of mission, with slots for names of the world."""
TURNS: Final = tuple(kind for kind, about in _TABLE.items() for _ in range(about["turns"]))
"""Kinds of missions in the order of the seeds."""
TIME_LIMIT_S: Final = 3600.0
"""Time limit of a run; clearing a workbench into a far room takes six trips."""
_SHARE_OF_ALIASES: Final = 0.2
_NUMBERS: Final = MappingProxyType({2: "two", 3: "three"})
_ORDINARY: Final = ("a", "the")


@dataclass(frozen=True)
class KnownWorld:
    """World in which random missions take place; `carried` are the object classes that the robot can carry."""

    name: str
    knowledge: Knowledge
    carried: frozenset[str]


def random_missions(count: int, worlds: str, seeds: str) -> Evaluation:
    """Draws the runs of the first `count` seeds, in worlds by name or folder ("flat,shop").

    Raises:
        InputError: a world cannot be used or is named twice, or there are too few seeds or too many missions.
    """
    names = [name.strip() for name in worlds.split(",")]
    if len(set(names)) < len(names):
        raise InputError(f"--worlds {worlds} names a world twice", hint="name each once")
    if count > MOST_RUNS:
        what = f"--random-missions {count} is more than {MOST_RUNS} runs"
        raise InputError(what, hint="give several ranges of seeds in turn")
    chosen = seed_range(seeds, count)
    if len(set(chosen)) < count:
        raise InputError(f"--seeds {seeds} names a seed twice", hint="name each once")
    named = f"--random-missions {count} --worlds {worlds} --seeds {seeds}"
    return random_evaluation([_known_world(name) for name in names], chosen, name=named)


def _known_world(name: str) -> KnownWorld:
    """Opens a world with the classes that the default robot can carry there. Raises InputError."""
    world = open_world(name)
    knowledge, abilities = knowledge_of(world), abilities_in(world)
    carried = frozenset(
        name
        for name in knowledge.things
        if name in abilities.masses_kg
        and abilities.masses_kg[name] <= abilities.lift_kg
        and abilities.widths_m.get(name, 0.0) <= abilities.opens_m
    )
    own = str(Path(name).resolve()) if is_file(Path(name) / "world.dmd.yaml") else name
    return KnownWorld(own, knowledge, carried)


def random_evaluation(worlds: Sequence[KnownWorld], seeds: Iterable[int], *, name: str) -> Evaluation:
    """Draws one run for each seed, in the worlds in turn; a run depends on its own seed alone.

    Raises:
        InputError: no sentence fits one of the worlds.
    """
    runs = list[RunSpec]()
    for seed in seeds:
        world = worlds[seed % len(worlds)]
        kind, sentence = random_sentence(world, seed)
        runs.append(RunSpec(Request(sentence, world=world.name, seed=seed, time_limit_s=TIME_LIMIT_S), kind))
    return Evaluation(name, tuple(runs))


def random_sentence(world: KnownWorld, seed: int) -> tuple[str, str]:
    """Returns the kind of mission of a seed and a sentence of that kind; skips kinds that do not fit the world.

    Raises InputError if no kind fits.
    """
    rng = random.Random(f"{seed}")
    first = seed % len(TURNS)
    for kind in dict.fromkeys((*TURNS[first:], *TURNS[:first])):
        for pattern in rng.sample(KINDS[kind], len(KINDS[kind])):
            slots = _Slots(world, random.Random(f"{seed} {pattern}"))
            try:
                return kind, pattern.format_map(slots)
            except LookupError:
                continue
    hint = "give its knowledge.yaml places, surfaces or objects"
    raise InputError(f"no sentence fits the world {world.name}", hint=hint)


class _Slots(dict[str, str]):
    """Words for the slots of one sentence; a repeated slot gets the same words. Raises LookupError if none fit."""

    def __init__(self, world: KnownWorld, rng: random.Random) -> None:
        super().__init__()
        self._known, self._carried, self._rng = world.knowledge, world.carried, rng
        self._meant: dict[str, str] = {}

    def __missing__(self, slot: str) -> str:
        self[slot] = words = _SLOTS[slot](self)
        return words

    def choice(self, what: str, names: Iterable[str]) -> str:
        """Returns one of the names, the same at each call. Raises LookupError if there are none."""
        if what not in self._meant:
            self._meant[what] = self._rng.choice(list(names))
        return self._meant[what]

    def called(self, name: str, aliases: Sequence[str]) -> str:
        """Returns a name or one of its aliases."""
        return self._rng.choice(aliases) if aliases and self._rng.random() < _SHARE_OF_ALIASES else name

    def placed(self, name: str) -> str:
        """Returns a room or surface with its article; a numbered one has none."""
        known = self._known
        facts = known.places[name] if name in known.places else known.surfaces[name]
        called = self.called(name, facts.aliases)
        numbered = called.split()[-1] in ("one", "two", "three", "four") or called[-1].isdigit()
        return called if numbered else f"the {called}"

    def object(self, article: str | None = None, *, what: str = "object", carried: bool = True) -> str:
        """Returns an object with its article."""
        known = self._known
        names = [name for name in known.things if name in self._carried or not carried]
        other = [name for name in names if name != self._meant.get("object")] if what != "object" else names
        name = self.choice(what, other)
        return _with_article(article or self._rng.choice(_ORDINARY), self.called(name, known.things[name].aliases))

    def usual_surfaces(self, names: Iterable[str]) -> list[str]:
        """Returns the surfaces where objects of these classes usually stand."""
        usual = (spot for name in names for spot in self._known.things[name].usual)
        return list(dict.fromkeys(surface for spot in usual for surface in self._known.surfaces_in(spot)))

    def home(self, names: Iterable[str]) -> str:
        """Returns the one room of these classes. Raises LookupError if there is none, or several."""
        rooms = {self._known.room(surface) for surface in self.usual_surfaces(names)}
        if len(rooms) != 1:
            raise LookupError
        return self.placed(rooms.pop())

    def chosen(self) -> list[str]:
        """Returns a list with the class of the object in the sentence."""
        if "object" not in self._meant:
            self.object()
        return [self._meant["object"]]

    def members(self) -> list[str]:
        """Returns the object classes in the sentence's category that the robot can carry."""
        known, found = self._known, dict[str, list[str]]()
        for category in known.categories():
            found[category] = [name for name in known.classes(category) if name in self._carried]
        return found[self.choice("category", [name for name, members in found.items() if len(members) > 1])]

    def category(self) -> str:
        """Returns the sentence's category."""
        self.members()
        return self._meant["category"]

    def some(self) -> str:
        """Returns a number and the plural of the category, such as "two drinks"."""
        most = len(self.members())
        return f"{_NUMBERS[self._rng.choice([count for count in _NUMBERS if count <= most])]} {plural(self.category())}"

    def room(self, what: str = "room") -> str:
        """Returns a room that differs from the rooms of other slots."""
        taken = [self._meant.get(other) for other in ("room", "second room")]
        return self.placed(self.choice(what, [name for name in self._known.rooms if name not in taken]))

    def surface(self, names: Iterable[str] = ()) -> str:
        """Returns a surface where objects of these classes do not usually stand."""
        usual = self.usual_surfaces(names)
        return self.placed(self.choice("surface", [name for name in self._known.tops if name not in usual]))

    def furnished(self, names: Iterable[str] = ()) -> str:
        """Returns a room that has surfaces, and where objects of these classes are not usually found."""
        known = self._known
        homes = {known.room(surface) for surface in self.usual_surfaces(names)}
        rooms = (name for name in known.rooms if known.surfaces_in(name) and name not in homes)
        return self.placed(self.choice("furnished room", rooms))

    def person(self, *, only: bool = False) -> str:
        """Returns a person's name; with `only`, raises LookupError unless the world has exactly one person."""
        people = self._known.people
        if only and len(people) != 1:
            raise LookupError
        return self.choice("person", people)

    def room_of_person(self) -> str:
        """Returns the room where the person in the sentence usually is."""
        return self.placed(self._known.room(self._known.people[self.person()].at))

    def to_clear(self) -> str:
        """Returns a surface such that the robot can carry every object that usually stands there."""
        usual = {
            surface: [name for name in self._known.things if surface in self.usual_surfaces([name])]
            for surface in self._known.tops
        }
        clearable = (surface for surface, names in usual.items() if names and self._carried.issuperset(names))
        return self.choice("cleared", clearable)

    def cleared_onto(self) -> str:
        """Returns a surface to which the objects go, other than the surface to clear."""
        return self.placed(self.choice("onto", [name for name in self._known.tops if name != self.to_clear()]))


def _with_article(article: str, name: str) -> str:
    return with_article(name) if article == "a" else f"{article} {name}"


_SLOTS: Final[Mapping[str, Callable[[_Slots], str]]] = MappingProxyType(
    {
        "object": lambda slots: slots.object(),
        "any carried object": lambda slots: slots.object("a"),
        "the carried object": lambda slots: slots.object("the"),
        "any object": lambda slots: slots.object("a", carried=False),
        "the object": lambda slots: slots.object("the", carried=False),
        "other object": lambda slots: slots.object(what="other object"),
        "objects": lambda slots: plural(slots.object("the", carried=False).removeprefix("the ")),
        "home": lambda slots: slots.home(slots.chosen()),
        "one of its surfaces": lambda slots: slots.placed(
            slots.choice("its surface", slots.usual_surfaces(slots.chosen()))
        ),
        "room for it": lambda slots: slots.furnished(slots.chosen()),
        "surface for it": lambda slots: slots.surface(slots.chosen()),
        "a drink": lambda slots: _with_article("a", slots.category()),
        "drinks": lambda slots: plural(slots.category()),
        "two drinks": lambda slots: slots.some(),
        "home of drinks": lambda slots: slots.home(slots.members()),
        "room for drinks": lambda slots: slots.furnished(slots.members()),
        "surface for drinks": lambda slots: slots.surface(slots.members()),
        "surface to clear": lambda slots: slots.placed(slots.to_clear()),
        "cleared onto": lambda slots: slots.cleared_onto(),
        "room": lambda slots: slots.room(),
        "furnished room": lambda slots: slots.furnished(),
        "second room": lambda slots: slots.room("second room"),
        "surface": lambda slots: slots.surface(),
        "person": lambda slots: slots.person(),
        "only person": lambda slots: slots.person(only=True),
        "room of a person": lambda slots: slots.room_of_person(),
    }
)
"""Words for each slot. `drink` stands for any category with several members."""
