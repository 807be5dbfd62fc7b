"""Whether all sentences of the tests and benchmarks get the same answers as before.

    python -m tests.benchmarks.same_answers store answers.json [--corpora FOLDER] [--only WORDS]
    python -m tests.benchmarks.same_answers compare before.json after.json

`store` understands the sentences in the ways that their tables are asked in: in a world ("flat", "shop", "lab", or the
tests' own "home"), with open vocabulary ("open"), or by several robots ("Alice, Bob"). `--corpora` adds the sentences
of the JSON lines in a folder, with open vocabulary. It writes the answers by way and sentence. `compare` prints the
answers that differ, and exits with 1 if there are any.
"""

import json
import re
from pathlib import Path

import yaml

from executive.language.parser import load_parser
from executive.language.several_robots import understand_for_robots
from executive.language.understand import understand
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.harness import command

TESTS = Path(__file__).parents[1]
HOME = TESTS / "executive" / "language" / "world.yaml"
WORLDS = ("flat", "shop", "lab")
OPEN, OWN = "open", "home"
_SENTENCE = re.compile(r"(?=.*[A-Za-z])[^\[\]()|{}<>\n]*\S\s+\S[^\[\]()|{}<>\n]*")
_STEP = re.compile(r"[A-Z]\w*: |Take Nothing ")


def sentences(corpora=None):
    """Yields each sentence with the way in which it is asked."""
    for table in sorted((TESTS / "executive" / "language").rglob("*.yaml")):
        if table != HOME:
            for section, entry in _read(table).items():
                ways = (section,) if section in WORLDS else (OWN, OPEN, "flat")
                yield from ((text, way) for text in _texts(entry) for way in ways)
    for table in sorted((TESTS / "benchmarks").glob("*_sentences*.yaml")):
        yield from ((text, section) for section, rows in _read(table).items() for text in rows)
    for world in WORLDS:
        rows = yaml.safe_load((TESTS / "benchmarks" / "everyday" / f"{world}.yaml").read_text(encoding="utf-8"))
        yield from ((row["say"], world) for row in rows)
    for lines in sorted(corpora.glob("*.jsonl")) if corpora else ():
        yield from ((json.loads(line)["text"], OPEN) for line in lines.read_text(encoding="utf-8").splitlines())


def _read(table):
    found = yaml.safe_load(table.read_text(encoding="utf-8"))
    return found if isinstance(found, dict) else {"": found}


def _texts(entry):
    """Yields the texts of two words or more in an entry of a table, keys included, without commands and steps."""
    if isinstance(entry, dict):
        for key, value in entry.items():
            yield from (*_texts(key), *_texts(value))
    elif isinstance(entry, list):
        for each in entry:
            yield from _texts(each)
    elif isinstance(entry, str) and _SENTENCE.fullmatch(entry) and not _STEP.match(entry):
        yield entry


class Asker:
    """Understands sentences in each way with one parser."""

    def __init__(self):
        self.parser = load_parser()
        self.knowledge = {name: load_knowledge(load_world(name).knowledge_path) for name in WORLDS}
        self.knowledge |= {OWN: load_knowledge(HOME), OPEN: None}

    def __call__(self, text, way):
        """What was understood of a sentence in a way, the trace included."""
        if way in self.knowledge:
            return understand(text, parser=self.parser, knowledge=self.knowledge[way], require_wake=False)
        robots = way.split(", ")
        return understand_for_robots(text, robots=robots, parser=self.parser, knowledge=self.knowledge["flat"])


def answers(corpora=None, only=""):
    """Answers as JSON values by way and sentence; with `only`, of the sentences that contain these words."""
    ask, found = Asker(), {}
    for text, way in sentences(corpora):
        key = f"{way}: {text}"
        if key not in found and only in text:
            meant = ask(text, way)
            parts = {"parts": [part.to_json() for part in meant.parts]} if meant.parts else {}
            found[key] = {**meant.to_json(), **parts}
    return found


def store(file: Path, corpora: Path | None = None, only: str = ""):
    """Writes the answers to a file."""
    found = answers(corpora, only)
    file.write_text(json.dumps(found, indent=0, sort_keys=True), encoding="utf-8")
    return {"sentences": len(found), "understood": sum(answer["status"] == "ok" for answer in found.values())}


def compare(before: Path, after: Path):
    """Prints what differs between two files of answers."""
    one, other = (json.loads(file.read_text(encoding="utf-8")) for file in (before, after))
    differing = [key for key in one if key in other and one[key] != other[key]]
    for key in differing:
        print(key)
        for name in one[key].keys() | other[key].keys():
            was, now = one[key].get(name), other[key].get(name)
            if was != now:
                print(f"    {name}: {_short(was)}\n    {' ' * len(name)}> {_short(now)}")
    print(f"{len(differing)} of {len(one.keys() & other.keys())} answers differ")
    for title, missing in (("only before", one.keys() - other.keys()), ("only after", other.keys() - one.keys())):
        print(f"{title}: {len(missing)}")
    return int(bool(differing))


def _short(value):
    return json.dumps(value) if value is not None else "nothing"


if __name__ == "__main__":
    command(store, compare)
