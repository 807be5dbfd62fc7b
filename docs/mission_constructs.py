"""What the reference says of each construct of mission files: an example, and the rule that says what it returns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Construct:
    """A construct: its heading, what it is, an example (steps, or a whole file), what it returns, and the node's kind.

    `kind` is the node in the compiled tree; empty where there is none of its own.
    """

    heading: str
    words: str
    example: str
    returns: str
    kind: str = ""


DECIDING = (
    Construct(
        "if, then, else",
        "Steps that are done when a condition holds, and others when it does not. `else` may be missing.",
        """- if: {object: beer, at: kitchen counter}
  then:
    - say: bring the beer from the kitchen counter to the coffee table
  else:
    - speak: There is no beer.
""",
        "As the steps that were chosen. SUCCESS when there are none. FAILURE with the cause of the look when the robot "
        "cannot look.",
        "choose",
    ),
    Construct(
        "repeat",
        "Rounds of `steps`: `times`, `until` a condition holds after a round, `while` one holds before a round. With "
        '`every` (seconds, or "30 min") a round does not begin earlier than that after the one before began. `times` '
        "beside a condition is the most rounds that are made.",
        """- repeat: {until: {object: hammer, at: workbench}, times: 3, every: 60}
  steps:
    - to: workbench
""",
        "FAILURE with the cause of a step as soon as one fails. SUCCESS when `until` holds, `while` does not hold, or "
        "after `times` rounds without a condition. FAILURE with POSTCONDITION when a condition is still not as wanted "
        "after `times` rounds. Rounds that nothing can end are refused before the mission starts.",
        "repeat",
    ),
    Construct(
        "repeat for_each",
        "One round for each value of a list, or of `rooms`, `people`, `people in ROOM`, `surfaces` and `surfaces in "
        "ROOM` of the world. The value stands in the steps as `${NAME}`, also in sentences.",
        """- repeat: {for_each: [kitchen, office], as: room}
  steps:
    - say: is there a hammer in the ${room}
      on_failure: skip
""",
        "SUCCESS after all rounds. FAILURE with the cause of a step as soon as one fails; later rounds are not made.",
    ),
    Construct(
        "try, else",
        "Steps, and others that are done in their place as soon as one of them fails.",
        """- try:
    - say: bring the coke from the kitchen table to the coffee table
      elsewhere: false
  else:
    - speak: I go on without the coke.
""",
        "SUCCESS when the steps of `try` succeed, else as the steps of `else`. A defect (ERROR) and a cancel are not "
        "caught.",
        "try",
    ),
    Construct(
        "together, done_when",
        "Steps that run side by side. Two that move the same part of the robot (base, arm, gripper) are refused. "
        "`done_when` is `all` (the default), `any`, or how many must succeed; the others are then stopped.",
        """- together:
    - to: kitchen
    - repeat: {every: 5, times: 20}
      steps:
        - speak: Careful, a robot is coming.
  done_when: any
""",
        "SUCCESS when as many steps succeeded as are needed. FAILURE with the cause of the first failure when so many "
        "cannot succeed any more.",
        "together",
    ),
    Construct(
        "group",
        "Steps in a row that share a policy, a `while`, a `when` or an `always`.",
        """- group:
    - to: office
    - to: bathroom
  name: round
  timeout: 120
  on_failure: skip
""",
        "As its steps in a row: FAILURE with the cause of the first that fails.",
        "sequence",
    ),
)
WATCHING = (
    Construct(
        "while",
        "A condition that must hold as long as the steps of a group, or of the file, run. It takes no look.",
        """name: watched
while: {holds: battery > 0.2 and elapsed < 600}
steps:
  - to: office
""",
        "FAILURE with PRECONDITION in the tick in which it does not hold; the steps are stopped. Else as the steps.",
        "guard",
    ),
    Construct(
        "when",
        "What interrupts the steps of a group, or of the file. When a condition begins to hold, the steps are "
        "suspended, those of `do` are done, and the steps go on where they were. The first of several goes first. It "
        "is called again only after the condition did not hold in between. It waits while the robot grasps, places "
        "or hands over.",
        """name: interrupted
when:
  - if: battery < 0.3
    do:
      - dock: {level: 0.8}
    times: 3
steps:
  - to: office
""",
        "RUNNING while the steps of `do` run. FAILURE with their cause when they fail, and with EXECUTION when they "
        "are called more than `times` times. Else as the steps.",
        "interrupt",
    ),
    Construct(
        "always",
        "Steps at the end of a group, or of the file, whatever happened: after success, failure and cancel. After a "
        "cancel they have two minutes.",
        """name: and back
always:
  - to: start
steps:
  - to: office
""",
        "As the steps before. FAILURE with its own cause when those succeeded and `always` failed.",
        "always",
    ),
)
SMALL = (
    Construct(
        "wait",
        'Waits `for` a condition, for `seconds` (a number, or "10 min"), or `until_clock` has come, a time of day '
        'such as "14:30". A condition that takes a look is looked at `every` 15 s. `timeout` limits it.',
        """- wait: {for: {all: [{button: go}, battery > 0.5]}}
  timeout: 60
  on_failure: skip
""",
        "RUNNING until then, then SUCCESS. A time of day that passed in the last twelve hours has come already. "
        "FAILURE with the cause of a look that fails, and with TIMEOUT after `timeout`.",
        "wait for",
    ),
    Construct(
        "check",
        "Answers whether a condition holds. The answer is part of the mission's result and report; with `gives: "
        "{answer: NAME}` later steps read it.",
        """- check: {not: {person: anybody, at: office}}
  gives: {answer: empty}
""",
        "SUCCESS with yes or no: an honest no is no failure. FAILURE with the cause of a look that fails.",
        "check",
    ),
    Construct(
        "dock",
        "Goes to the dock and charges to `level` (0 to 1); by default as the knowledge file says.",
        """- dock: {level: 0.9}
""",
        "SUCCESS when the battery is charged so far. FAILURE with the cause of the drive, or when the charge does "
        "not rise.",
    ),
    Construct(
        "speak",
        "Says a text to the people around. Expressions stand in braces; `{{` is a brace.",
        """- speak: The battery is at {round(battery * 100)} percent.
""",
        "RUNNING as long as saying it takes, then SUCCESS. FAILURE with PRECONDITION when a value is missing.",
    ),
    Construct(
        "ask",
        "Puts a question, aloud, on the page and at the terminal. The answer is one of `choices`, whose steps are then "
        "done, or what `match` says: a place, person or object of the world, a number or any text.",
        """- ask: Tea or coffee?
  choices:
    tea: null
    coffee:
      - speak: Coffee takes a minute.
  limit: 30
  default: tea
  gives: {answer: drink}
""",
        "RUNNING until it is answered; an answer that means nothing is asked for again. SUCCESS with the answer, "
        "then as its steps. When nobody answers within `limit`: SUCCESS with `default`, or FAILURE with TIMEOUT "
        "without one.",
        "question",
    ),
    Construct(
        "set",
        "Gives names a value, in order. A text is an expression; a text value has quotes of its own.",
        """- set: {count: 2, where: '"in the hall"', more: count > 1}
""",
        "SUCCESS when all have a value; FAILURE with PRECONDITION at the first that has none.",
        "set",
    ),
)
CONDITIONS = (
    ("an expression", "`battery > 0.3 and not holding`", "at once"),
    ("`object`, perhaps `at`", "`{object: beer, at: kitchen}`", "goes there and looks; no only after all views"),
    ("`person`, perhaps `at`", "`{person: anybody, at: office}`", "goes there and looks around"),
    ("`look`", "`{look: is there a hammer in the workshop}`", "what a question in English asks for"),
    ("`door`", "`{door: [hall, kitchen]}`", "goes there and looks whether it is open"),
    ("`button`", "`{button: go}`", "at once: pressed since a `wait` or `repeat` began, else since the mission began"),
    ("`max_age_s`", "`{object: beer, at: kitchen, max_age_s: 60}`", "beside what looks: an answer so old counts still"),
    ("`all`, `any`, `not`", "`{all: [count > 0, {button: go}]}`", "decided by as few looks as are needed"),
)
VALUES = """\
Each time that a condition is asked (in each round, at each `every` of a `wait`, in each attempt) the robot looks
again, unless `max_age_s` (seconds, or a text such as `2 min`) lets an earlier answer count.

A value has a name and a type: a number, a text, or true and false. It comes from `variables` (the file's values at
the beginning), from `set`, and from `gives`: `{answer: NAME}` beside a question, a `check` or an `ask`, `{count:
NAME}` beside a sentence that counts, and `{PORT: NAME}` beside a skill. A value of `variables` keeps its type. A
value that not every way up to a step gives is unknown there, and using it is refused before the mission starts.

An expression has numbers, texts in quotes, `true`, `false` and names; `+ - * / // %`; `== != < <= > >=`; `and`, `or`,
`not`; `A if C else B`; brackets; and the functions `abs`, `min`, `max`, `round`, `length` and `lower`. Besides the
mission's values it reads `battery` (0 to 1), `localised`, `holding`, `elapsed` (seconds since the mission began) and
`clock` (the time of day, as `"08:30"`). Where a value is a text with braces, `{count + 1}` puts the expression's
value in.

`${NAME}` is something else: a parameter, or the value of a `for_each`. It is put in when the file is read, so it may
stand in sentences, places and conditions.
"""


def constructs_text() -> str:
    """The sections of the page on mission files."""
    return "".join(_sections())


def _sections() -> Iterator[str]:
    yield "## Steps that decide\n\n"
    yield "A step may hold steps. All take the keys of a [policy](#policy), such as `timeout` and `on_failure`.\n\n"
    yield from map(_section, DECIDING)
    yield "## What is watched\n\n"
    yield from map(_section, WATCHING)
    yield "## Small steps\n\n"
    yield from map(_section, SMALL)
    yield "## Conditions and values\n\n"
    yield "| condition | example | how it is decided |\n|---|---|---|\n"
    yield from (f"| {what} | {example} | {how} |\n" for what, example, how in CONDITIONS)
    yield f"\n{VALUES}\n"


def _section(one: Construct) -> str:
    node = f" In the tree it is a `{one.kind}`." if one.kind else ""
    return f"### {one.heading}\n\n{one.words}\n\n```yaml\n{one.example}```\n\n{one.returns}{node}\n\n"


def file_of(one: Construct) -> str:
    """The example as a whole mission file."""
    if one.example.startswith("name:"):
        return one.example
    steps = "".join(f"  {line}\n" for line in one.example.splitlines())
    return f"name: example\nvariables: {{count: 1}}\nsteps:\n{steps}"
