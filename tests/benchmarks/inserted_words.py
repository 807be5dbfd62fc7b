"""How often a word that is added to an understood sentence gets lost in silence.

    python -m tests.benchmarks.inserted_words [--count 1000] [--seed 1] [--show]

Draws sentences that are understood today from the tables of the tests and benchmarks (see same_answers.py), and adds to
each an adverb, an adjective, a participle or a phrase of `inserted_words.yaml` at a grammatical place: an adverb before
a verb or at the end of a clause, an adjective or a participle before a noun, a phrase behind a noun or at the end. The
word is lost in silence when the sentence is accepted with the same meaning and the same notes as without it.
"""

import json
import random
import re
from collections import Counter
from functools import cache

from tests.benchmarks.harness import command
from tests.benchmarks.same_answers import OPEN, Asker, sentences
from tests.tables import yaml_beside

_VOWEL = re.compile(r"[aeiou]", re.IGNORECASE)
_ENDS = (",", ".", ";", "!", "?", "and", "then")


@cache
def words():
    """Kinds of words, each with its words."""
    return yaml_beside(__file__, "inserted_words.yaml")


def places(kind, tokens):
    """Indices of the words before which a word of a kind may stand; the number of words means the end."""
    tokens = [*tokens]
    end = len(tokens) - (bool(tokens) and tokens[-1].pos == "PUNCT")
    ends = [n for n in range(1, end) if tokens[n].word in _ENDS and tokens[n - 1].pos in ("NOUN", "PROPN", "PRON")]
    nouns = [n for n in range(1, end) if tokens[n].pos == "NOUN" and tokens[n - 1].pos in ("DET", "NUM", "ADP")]
    behind = [
        n + 1 for n in range(end - 1) if tokens[n].pos == "NOUN" and tokens[n + 1].pos in ("ADP", "CCONJ", "PUNCT")
    ]
    if kind == "adverbs":
        return [*(n for n in range(end) if tokens[n].tag == "VB"), *ends, end]
    return nouns if kind in ("adjectives", "participles") else [*behind, end]


def with_word(text, kind, word, tokens, at):
    """Sentence with a word before the word at an index, or at the end; "a" becomes "an" where the sound asks for it."""
    start = tokens[at].start if at < len(tokens) else len(text)
    before, after = text[:start].rstrip(), text[start:]
    if kind in ("adjectives", "participles") and (article := re.search(r"(?<![\w'])an?$", before, re.IGNORECASE)):
        before = before[: article.start() + 1] + ("n" if _VOWEL.match(word) else "")
    return " ".join(f"{before} {word} {after}".split()).replace(" ,", ",").replace(" .", ".")


def drawn(count, seed, ask):
    """Yields cases: a sentence, how it is asked, what is added, and the sentence with it."""
    chance, pool, found = random.Random(seed), sorted({*sentences()}), 0
    answered = cache(ask)
    while found < count:
        text, way = chance.choice(pool)
        kind = chance.choice([*words()])
        word = chance.choice(words()[kind])
        if answered(text, way).status.value != "ok":
            continue
        tokens = ask.parser.parse(text)
        if fitting := places(kind, tokens):
            found += 1
            yield text, way, kind, word, with_word(text, kind, word, tokens, chance.choice(fitting))


def said(answer):
    """What of an answer can tell of an added word: its status, its meaning and its notes."""
    parts = [(part.to_json()["robot"], part.after, said(part.meaning)) for part in answer.parts]
    values = answer.to_json()
    return json.dumps([{name: values[name] for name in ("status", "notes", "commands", "mission")}, parts])


def measured(count: int = 1000, seed: int = 1, show: bool = False):
    """Counts the words that are lost in silence, by kind and in all."""
    ask, lost, of, ends = Asker(), Counter(), Counter(), Counter()
    for text, way, kind, word, longer in drawn(count, seed, ask):
        answer = ask(longer, way)
        same = said(answer) == said(ask(text, way))
        asked = "open vocabulary" if way == OPEN else "a world"
        of.update([kind, asked])
        lost.update([kind, asked] if same else [])
        ends["lost" if same else answer.status.value] += 1
        if same and show:
            print(f"{kind}: {word!r}: {longer!r} ({way})")
    shares = {f"in {kind}": round(lost[kind] / of[kind], 4) for kind in sorted(of)}
    return {"seed": seed, "sentences": count, "lost_in_silence": ends["lost"] / count, **ends, **shares}


if __name__ == "__main__":
    command(measured)
