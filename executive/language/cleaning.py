"""Cleans a sentence of odd characters, and finds the wake phrase.

The wake phrase is "Hey Alice", or only the name, set off by a comma. A greeting right before the name calls the robot
at the beginning and at the end of a sentence, and after a pause; the name alone calls at the beginning or the end. A
name in a story ("Hey, Alice told me ...", "my sister, Alice") calls nobody.
"""

import re
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from executive.language.lexicon import ONE_WORD, read_table, word_list
from executive.language.spelling import sound_distance
from executive.language.templates import page
from executive.words.task import installed_tasks

_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")
_QUOTED: Final = re.compile(r"(?<=\w)(:? )([\"'])(?=\w)(.+?)(?<=\S)\2(?!\w)")
_AND: Final = re.compile(r"(?<=\s)[&+](?=\s)")
_PERCENT: Final = re.compile(r"(?<=\d)\s?%")
_SIGNS: Final = r"$€£%#@&+=|\\/^~_{}<>\[\]"
_PLACEHOLDER: Final = re.compile(
    rf"\$?(?:(?<!\{{)\{{++[^{{}}]*+\}}+|<[^<>]*+>|\[[^\[\]]*+\])|(?<!\S)[^\s{_SIGNS}]*+[{_SIGNS}]\S*"
    r"|(?<!\S)-\d\S*(?= times)"
)  # possessive, so that the time grows with the length of a sentence and not with its square
_SHARE: Final = 0.4
_FEWEST: Final = 2
_MOST_LETTERS: Final = 2000
_HEARD_WORDS: Final = 6
_LATEST_GREETING: Final = 3
_PAGE: Final = page("wake")
SAME_NAME: Final = 0.13
"""Largest distance in sound (see `sound_distance`) of a misheard name after a greeting."""
SAME_NAME_ALONE: Final = 0.05
"""Largest distance in sound of a misheard name without a greeting."""


def clean(text: str) -> str:
    """Removes control characters, brackets, emoji, repeated blanks; makes quotes plain, and joins "i 'm" to "i'm".

    A quotation behind a word that would be split into clauses becomes one word, which `unquoted` reads.
    """
    plain = unicodedata.normalize("NFKC", _PERCENT.sub(" percent", _AND.sub("and", text)))
    plain = plain.replace("\u2019", "'").replace("\u2018", "'").replace("...", ",")
    plain = _QUOTED.sub(_as_one_word, re.sub("[\u201c\u201d]", '"', plain))
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def _as_one_word(quotation: re.Match[str]) -> str:
    """Joins the words of a quotation with clauses by letters that English has not."""
    before, _, said = quotation.groups()
    if word_list("splits").isdisjoint(re.findall(r"\w+|[^\w\s]", said.lower().rstrip(",.;:!?"))):
        return quotation[0]
    return before + " ".join(_ALLOWED.sub(" ", said).split()).translate(ONE_WORD)


def placeholder(text: str) -> str | None:
    """Finds a placeholder ("${room}", "[object]", "ROOM_NAME") or another piece that is no word; None without one."""
    found = _PLACEHOLDER.search(_PERCENT.sub(" percent", _AND.sub("and", text)))
    return None if found is None else found[0]


def foreign_reason(text: str) -> str | None:
    """Reason to refuse a text in another script or language; None for English."""
    letters = [c for c in text[:_MOST_LETTERS] if c.isalpha()]
    if letters and 2 * sum("LATIN" in unicodedata.name(c, "") for c in letters) < len(letters):
        return "I understand English only, in Latin letters"
    words = re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?", text[:_MOST_LETTERS].lower())
    counts = {language: sum(word in small for word in words) for language, small in read_table("foreign.yaml").items()}
    language, most = max(counts.items(), key=lambda item: item[1])
    if most < _FEWEST or most < _SHARE * len(words):
        return None
    return f"I understand English only, and this looks like {language}"


def unkept_reason(text: str, lost: str, rows: Iterable[Mapping[str, str]] | None = None) -> str | None:
    """Reason to refuse a text with words of a kind that no mission keeps, as a deadline, by some `rows` or by all.

    None if no such words are among those that are `lost`, or more others are than the row allows.
    """
    words = {*lost.lower().split()}
    tasks = installed_tasks().values()
    every = (*read_table("unkept.yaml"), *(row for task in tasks for row in task.unkept))
    for row in every if rows is None else rows:
        if row.get("lacks") in {task.owner for task in tasks}:
            continue
        found = re.search(rf"\b(?:{row['said']})", text, re.IGNORECASE)
        kept = words - {*found[0].lower().split()} if found else words
        if found and kept < words and len(kept) <= int(row.get("most", len(words))):
            return str(row["reason"]).format(found[0])
    return None


@dataclass(frozen=True)
class Address:
    """Robot that a sentence calls (None: no robot), and the text without the wake phrase."""

    name: str | None
    text: str


def find_address(text: str, names: Collection[str]) -> Address:
    """Finds the robot among `names` that a sentence calls, by the first wake phrase."""
    calls = [(start, -end, name) for name in names for start, end in _calls(text.replace("’", "'"), name)]
    start, end, name = min(calls, key=lambda call: call[:2], default=(0, 0, None))
    if name is None:
        return Address(None, text)
    behind = re.sub(r"^[\s,.!:;-]+", "", text[-end:] if end else "")
    return Address(name, " ".join(f"{text[:start].rstrip()} {behind}".split()).strip(" ,"))


def find_heard_wake(transcript: str, name: str, *, others: Collection[str] = ()) -> Address:
    """Finds the wake phrase for the robot `name` in a transcript, where the name may be misspelled ("Hey Ellis").

    `others` are names of other robots: a word that sounds more like one of these does not call this robot.
    """
    exact = find_address(transcript, (name, *others))
    if exact.name is not None:
        return exact if exact.name == name else Address(None, transcript)
    heard = (find_address(corrected, (name, *others)) for corrected in _corrected(transcript, name, others))
    return next((address for address in heard if address.name == name), Address(None, transcript))


def strip_wake(text: str, name: str, others: Collection[str] = ()) -> Address:
    """Removes the wake phrase for the robot called `name`; `others` are other robots.

    A name without a comma at the beginning is also removed, but calls nobody. If the sentence calls another robot, that
    robot's name is returned.
    """
    address = find_address(text, (name, *others))
    if address.name is not None:
        return address if address.name == name else replace(address, text=text)
    other, bare = called_stranger(text), page("wake", own=(name,))["bare"].match(text)
    plain = text if bare is None or _PAGE["told"].match(bare.rest) else bare.rest
    return Address(None if other == name else other, plain)


def called_stranger(text: str) -> str | None:
    """Name that a greeting calls at the beginning of a text, of any robot or of none."""
    match = _PAGE["stranger"].match(text)
    return match["name"] if match is not None and match["name"][0].isupper() else None


def _calls(text: str, name: str) -> Iterator[tuple[int, int]]:
    """Yields spans of text that call a robot: by a greeting, or by the name at the beginning or the end."""
    forms = page("wake", own=(name,))
    yield from ((one.start, one.end) for one in forms["greets"].finditer(text) if _greets(text[: one.start], one.rest))
    if (first := forms["begins"].match(text)) is not None:
        aside = forms["apposition"].match(first.rest)
        told = _tells_of(first.rest) or forms["relates"].match(first.rest)
        if not told and not (aside and forms["told"].match(aside.rest)):
            yield first.end - len(first["name"]), first.end
    last = next((one for one in forms["ends"].finditer(text) if not re.search(r"\w", one.rest)), None)
    if last is not None and not _told_before(text[: last.start]):
        yield last.start, last.end


def _greets(before: str, after: str) -> bool:
    """Returns whether a greeting and a name call between these words: after a pause or polite words, or at the end."""
    paused = re.search(r"^[ ,.!?;:'\"-]*$|[,.!?;:]\s*$", before) or _PAGE["politely"].fullmatch(before)
    calls = paused is not None or not after.strip(" .!?,")
    return calls and _PAGE["says_before"].fullmatch(before) is None and not _tells_of(after)


def _told_before(before: str) -> bool:
    """Returns whether the words before a name tell of it ("this is my sister"), or list other names."""
    noun = re.sub(r"\W+$", "", before).rpartition(" ")[2].lower()
    listed = re.search(r",\s*[A-Z]\w*\s*$", before) is not None
    return listed or noun in word_list("people") or _PAGE["tells_of"].match(before) is not None


def _tells_of(after: str) -> bool:
    """Returns whether the words behind a name tell of it, or name others with it (", Bob and", "and Bob")."""
    listed = _PAGE["listed"].match(after)
    return _PAGE["told"].match(after) is not None or (listed is not None and listed["next"][0].isupper())


def _corrected(transcript: str, name: str, others: Collection[str]) -> Iterator[str]:
    """Yields corrections of a transcript whose beginning sounds like the wake phrase or the name."""

    def alike(heard: str, limit: float) -> bool:
        distance = sound_distance(heard, name)
        return distance <= limit and all(distance < sound_distance(heard, other) for other in others)

    words = list(re.finditer(r"[^\W\d_][\w'’-]*", transcript))[:_HEARD_WORDS]
    for at, word in enumerate(words[:_LATEST_GREETING]):
        greets = word.group().lower() in word_list("heard_greetings")
        for last in words[at + 1 : at + 3] if greets else ():
            if alike(transcript[words[at + 1].start() : last.end()], SAME_NAME):
                yield f"{transcript[: word.start()]}Hey {name}{transcript[last.end() :]}"
        if sound_distance(word.group(), f"hey{name}") <= SAME_NAME and len(word.group()) > len(name):
            yield f"{transcript[: word.start()]}Hey {name}{transcript[word.end() :]}"
    if words and alike(words[0].group(), SAME_NAME_ALONE):
        yield f"{name}{transcript[words[0].end() :]}"
