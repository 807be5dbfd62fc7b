"""Sentences of tasks, which stand on the tasks' own pages as templates with samples."""

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any

from executive.language.lexicon import any_of, plain_yaml
from executive.language.templates import Match, Page
from executive.words.task import Part, Task, installed_tasks


@cache
def _page() -> Page:
    """Templates of all tasks; rules of a page have the word of its task before their names, since pages share names."""
    spoken, rules = dict[str, tuple[Mapping[str, Any], ...]](), dict[str, str]()
    for task in spoken_tasks():
        own = {f"<{name}>": f"<{task.word}_{name}>" for name in task.rules}
        named = partial(re.sub, any_of(own) or "(?!)", lambda rule, own=own: own[rule[0]])
        spoken[task.word] = tuple({**row, "template": named(row["template"])} for row in task.sentences)
        rules |= {own[f"<{name}>"][1:-1]: named(rule) for name, rule in task.rules.items()}
    return Page("tasks", more=spoken, rules=rules)


@cache
def spoken_tasks() -> tuple[Task, ...]:
    """Tasks with sentences that can all be read."""
    return tuple(task for task in installed_tasks().values() if task.sentences and not [*sentence_faults(task)])


@cache
def task_openers(about: Part | None = None, *, templates: bool = False) -> frozenset[str]:
    """Words with which requests for tasks begin, or for those whose object is of a kind, or by templates alone."""
    tasks = [task for task in installed_tasks().values() if about in (None, task.object_is)]
    firsts = {first for task in spoken_tasks() if task in tasks for first in _page().first_words(task.word)}
    return frozenset(firsts.union(*(task.verbs for task in tasks if not templates)))


@cache
def task_forms() -> Mapping[str, str]:
    """Words with which requests for tasks begin, by their forms: "mopping" and "mopped" map to "mop"."""
    return verb_forms(task_openers()) | {form: verb for task in spoken_tasks() for form, verb in task.past.items()}


def verb_forms(verbs: Iterable[str]) -> dict[str, str]:
    """Verbs by their regular forms in the past and with -ing, and by forms with and without a doubled letter."""
    stems = ((verb, {verb, verb + verb[-1], re.sub("e$", "", verb), re.sub("y$", "i", verb)}) for verb in verbs)
    return {f"{stem}{end}": verb for verb, each in stems for stem in each for end in ("ing", "ed")}


def sentence_faults(task: Task) -> Iterator[str]:
    """Yields a line for each template of a task that cannot be read, or that a sample of it does not match."""
    for row in task.sentences:
        if fault := _fault(task, row["template"], row["samples"]):
            yield f"the template '{row['template']}': {fault}"


def _fault(task: Task, template: str, samples: Iterable[str]) -> str:
    """Returns what is wrong with a template; empty when nothing is."""
    page = Page("tasks", more={task.word: ({"template": template},)}, rules=task.rules)
    parts = {"goal": task.goal_is, "object": task.object_is}
    slots = [slot.rpartition(":") for slot in re.findall(r"\{([^}]*)\}", template)]
    if any(template.count(opened) != template.count(closed) for opened, closed in ("()", "[]", "{}", "<>")):
        return "a bracket is not closed"
    for kind, _, part in slots:
        if parts.get(part, Part.NOTHING) is Part.NOTHING:
            return f"the task has no part '{part}' for a slot"
        if kind not in ("", "number", *page.table["lists"]):
            return f"there is no list '{kind}'"
        its = parts[part].value
        if kind in {each.value for each in Part} - {its, "room" if its == "place" else its}:
            return f"'{{{kind}:{part}}}' fills a part that is a {its}"
    try:
        if not page.first_words(task.word):
            return "it begins with no certain words"
        lacks = [sample for sample in samples if page[task.word].fullmatch(sample) is None]
    except KeyError as missing:
        return f"there is no rule {missing}"
    except RecursionError:
        return "its rules refer to each other in a circle"
    return f"the sample '{lacks[0]}' does not match it" if lacks else ""


def task_requests(text: str) -> Mapping[Task, Match]:
    """Returns the tasks that a clause asks for, each with its match: one, unless the sentences of two are alike."""
    around = _page()["around"].fullmatch(text)
    text = text if around is None else around["clause"]
    found = {task: _page()[task.word].fullmatch(text) for task in spoken_tasks()}
    return {task: match for task, match in found.items() if match is not None}


def task_again(text: str) -> tuple[str, ...]:
    """Splits a request from the same one for something else: "vacuum the hall and then the kitchen"; or empty."""
    found = _page()["again"].fullmatch(text)
    first, other = ("", "") if found is None else (found["first"], found["other"])
    slots = ((one.text, one["goal"] or one["object"]) for one in task_requests(first).values())
    return next(((first, said.replace(slot, other)) for said, slot in slots if slot), ())


def other_readings(word: str) -> Iterator[str]:
    """Yields a line for each sample of a task that is also a sentence of another, and the other way round.

    Samples of Errand's own sentences count as those of another task.
    """
    for file in sorted(Path(__file__).parent.glob("tables/intents/*.yaml")):
        own = {} if file.stem == "tasks" else plain_yaml(file.read_text("utf-8")).get("intents", {})
        for sample in (sample for rows in own.values() for row in rows for sample in row["samples"]):
            taking = (task for task in task_requests(sample) if task.word == word)
            yield from (f"'{sample}', a sentence of Errand itself, is also one of {task.named}" for task in taking)
    for owner in installed_tasks().values():
        for sample in owner.samples:
            for task in task_requests(sample):
                if task != owner and word in (task.word, owner.word):
                    yield f"'{sample}' of {owner.named} is also a sentence of {task.named}"
