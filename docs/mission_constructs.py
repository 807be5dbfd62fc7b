"""Constructs of mission files for the reference: an example of each, and the rule of what it returns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Construct:
    """Construct: heading, description, an example (steps, or a whole file), the rule of its result, and its node.

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
        "Runs some steps when a condition holds, and others when it does not. `else` may be missing.",
        """- if: {object: beer, at: kitchen counter}
  then:
    - say: bring the beer from the kitchen counter to the coffee table
  else:
    - speak: There is no beer.
""",
        "The result of the chosen steps; SUCCESS when there are none. FAILURE with the cause of the look when the "
        "robot cannot look.",
        "choose",
    ),
    Construct(
        "repeat",
        "Repeats `steps`: `times`, `until` a condition holds after a round, `while` one holds before a round, "
        "or rounds begin until a time of day (`until_clock`, which is over for twelve hours after it). With "
        '`every` (seconds, or "30 min") successive rounds begin at least that far apart. `times` '
        "beside a condition is the largest number of rounds.",
        """- repeat: {until: {object: hammer, at: workbench}, times: 3, every: 60}
  steps:
    - to: workbench
""",
        "FAILURE with the cause of a step as soon as one fails. SUCCESS when `until` holds, `while` does not hold, at "
        "`until_clock`, or after `times` rounds without a condition. FAILURE with PRECONDITION when `until_clock` is "
        "over before the first round. FAILURE with POSTCONDITION when a condition still "
        "keeps the rounds going after `times` of them. Endless rounds are refused before the mission starts.",
        "repeat",
    ),
    Construct(
        "repeat for_each",
        "Runs one round for each value of a list, or of `rooms`, `people`, `people in ROOM`, `surfaces` and `surfaces "
        "in ROOM` of the world. The value stands in the steps as `${NAME}`, also in sentences.",
        """- repeat: {for_each: [kitchen, office], as: room}
  steps:
    - say: is there a hammer in the ${room}
      on_failure: skip
""",
        "SUCCESS after all rounds. FAILURE with the cause of a step as soon as one fails; later rounds do not run.",
    ),
    Construct(
        "try, else",
        "Runs steps, and others in their place as soon as one of them fails.",
        """- try:
    - say: bring the coke from the kitchen table to the coffee table
      elsewhere: false
  else:
    - speak: I go on without the coke.
""",
        "SUCCESS when the steps of `try` succeed, otherwise the result of `else`. A defect (ERROR) and a cancel are "
        "not caught.",
        "try",
    ),
    Construct(
        "together, done_when",
        "Runs steps in parallel. Two that move the same part of the robot (base, arm, gripper) are refused. "
        "`done_when` is `all` (the default), `any`, or how many must succeed; the others are then stopped.",
        """- together:
    - to: kitchen
    - repeat: {every: 5, times: 20}
      steps:
        - speak: Careful, a robot is coming.
  done_when: any
""",
        "SUCCESS when enough steps have succeeded. FAILURE with the cause of the first failure when too few can "
        "still succeed.",
        "together",
    ),
    Construct(
        "group",
        "Runs steps in order, with a common policy, `while`, `when` or `always`.",
        """- group:
    - to: office
    - to: bathroom
  name: round
  timeout: 120
  on_failure: skip
""",
        "SUCCESS when all steps succeed; FAILURE with the cause of the first that fails.",
        "sequence",
    ),
)
WATCHING = (
    Construct(
        "while",
        "Condition that must hold while the steps of a group, or of the file, run. It needs no look.",
        """name: watched
while: {holds: battery > 0.2 and elapsed < 600}
steps:
  - to: office
""",
        "FAILURE with PRECONDITION in the tick in which it does not hold; the steps are stopped. Otherwise the "
        "result of the steps.",
        "guard",
    ),
    Construct(
        "when",
        "Conditions that interrupt the steps of a group, or of the file. When one begins to hold, the steps are "
        "suspended, those of `do` run, and the steps go on where they were. The first of several goes first. It "
        "runs again only after the condition did not hold in between. It waits while the robot grasps, places "
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
        "run more than `times` times. Otherwise the result of the steps.",
        "interrupt",
    ),
    Construct(
        "always",
        "Steps at the end of a group, or of the file, in any case: after success, failure and cancel. After a "
        "cancel they have two minutes.",
        """name: and back
always:
  - to: start
steps:
  - to: office
""",
        "The result of the steps before. FAILURE with its own cause when those succeeded and `always` failed.",
        "always",
    ),
)
SMALL = (
    Construct(
        "wait",
        'Waits `for` a condition, for `seconds` (a number, or "10 min"), or `until_clock` has come, a time of day '
        'such as "14:30". The robot looks for a condition `every` 15 s. `timeout` limits the wait.',
        """- wait: {for: {all: [{button: go}, battery > 0.5]}}
  timeout: 60
  on_failure: skip
""",
        "RUNNING until then, then SUCCESS. A time of day within the last twelve hours has come already. "
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
        "SUCCESS with yes or no: a true no is no failure. FAILURE with the cause of a look that fails.",
        "check",
    ),
    Construct(
        "picture",
        "Takes a picture `of` an object, a surface or a named pose, or four of a room, by the `camera` that is named, "
        "from the place `at`. It stands in the answers of the report and in the folder `pictures/`.",
        """- picture: {of: kitchen table, camera: hand}
- picture: {of: desk, at: hall}
""",
        "SUCCESS when the picture is taken. FAILURE with the cause of the drive or the search, with PLANNING when no "
        "camera sees it, and with EXECUTION when the camera shows nothing.",
        "picture taken",
    ),
    Construct(
        "dock",
        "Goes to the dock and charges to `level` (0 to 1); by default as the knowledge file says.",
        """- dock: {level: 0.9}
""",
        "SUCCESS when the battery has that charge. FAILURE with the cause of the drive, or when the charge does "
        "not rise.",
    ),
    Construct(
        "open",
        "Has a door opened: the robot looks at it. A closed door is opened by its "
        "[plug-in](../how-to/doors.md), or else asked for aloud. "
        "The robot waits before it, for `within` at most (two minutes by default).",
        """- open: {door: [hall, kitchen], within: 1 min}
""",
        "SUCCESS when the door is open. FAILURE with TIMEOUT when it is not opened in time, and with the cause of "
        "its plug-in.",
        "timeout",
    ),
    Construct(
        "speak",
        "Says a text to the people around. Expressions stand in braces; `{{` is a brace.",
        """- speak: The battery is at {round(battery * 100)} percent.
""",
        "RUNNING while the robot speaks, then SUCCESS. FAILURE with PRECONDITION when a value is missing.",
    ),
    Construct(
        "ask",
        "Asks aloud, on the page and at the terminal. The answer is one of `choices`, whose steps then "
        "run, or of the type of `match`: a place, person or object of the world, a number or any text.",
        """- ask: Tea or coffee?
  choices:
    tea: null
    coffee:
      - speak: Coffee takes a minute.
  limit: 30
  default: tea
  gives: {answer: drink}
""",
        "RUNNING until somebody answers; the robot asks again after an answer that it cannot use. SUCCESS with "
        "the answer, then the result of its steps. When nobody answers within `limit`: SUCCESS with `default`, or "
        "FAILURE with TIMEOUT without one.",
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
    (
        "`object` as `name` with `next_to`, `left_of`, `right_of`, `behind`, `in_front_of`, `between`, "
        "`nearest_to`, `part`, `seen_from`, `order` (`nth`, `from`), `not_at`",
        "`{object: {name: beer, left_of: coke}, at: kitchen}`",
        "the same; [which one](../language.md#which-one-and-where-to-put-it) has all relations",
    ),
    ("`person`, perhaps `at`", "`{person: anybody, at: office}`", "goes there and looks around"),
    ("`look`", "`{look: is there a hammer in the workshop}`", "looks for the answer to a question in English"),
    (
        "`door`",
        "`{door: [hall, kitchen]}`",
        "goes there and looks whether it is open; before the door it looks at once",
    ),
    ("`button`", "`{button: go}`", "at once: pressed since a `wait` or `repeat` began, else since the mission began"),
    (
        "`max_age_s`",
        "`{object: beer, at: kitchen, max_age_s: 60}`",
        "beside a look: age up to which an answer counts",
    ),
    ("`all`, `any`, `not`", "`{all: [count > 0, {button: go}]}`", "decided by as few looks as possible"),
)
VALUES = """\
Each time that a condition is checked (in each round, at each `every` of a `wait`, in each attempt) the robot looks
again, unless `max_age_s` (seconds, or a text such as `2 min`) lets an earlier answer count. What the robot saw of a
door on its way counts as an answer, too.

A value has a name and a type: a number, a text, or true and false. It comes from `variables` (the file's values at
the beginning), from `set`, and from `gives`: `{answer: NAME}` beside a question (the number
for *how many*), a `check` or an `ask`, `{count: NAME}` beside a sentence that counts, and `{PORT: NAME}` beside a
skill. A value of `variables` keeps its type. A
value that is not set on every path to a step is unknown there, and its use is refused before the mission starts.

An expression has numbers, texts in quotes, `true`, `false` and names; `+ - * / // %`; `== != < <= > >=`; `and`, `or`,
`not`; `A if C else B`; brackets; and the functions `abs`, `min`, `max`, `round`, `length` and `lower`. Besides the
mission's values it reads `battery` (0 to 1), `localised`, `holding`, `elapsed` (seconds since the mission began) and
`clock` (the time of day, as `"08:30"`). In a text with braces, `{count + 1}` inserts the expression's value.

`${NAME}` is different: a parameter, or the value of a `for_each`. It is inserted when the file is read, so it may
stand in sentences, places and conditions.
"""


def constructs_text() -> str:
    """Sections of the page on mission files."""
    return "".join(_sections())


def _sections() -> Iterator[str]:
    yield "## Steps that decide\n\n"
    yield "A step may hold steps. All take the keys of a [policy](#policy), such as `timeout` and `on_failure`.\n\n"
    yield from map(_section, DECIDING)
    yield "## Watched conditions\n\n"
    yield from map(_section, WATCHING)
    yield "## Small steps\n\n"
    yield from map(_section, SMALL)
    yield "## Conditions and values\n\n"
    yield "| condition | example | decision |\n|---|---|---|\n"
    yield from (f"| {what} | {example} | {how} |\n" for what, example, how in CONDITIONS)
    yield f"\n{VALUES}\n"


def _section(one: Construct) -> str:
    node = f" In the tree it is a `{one.kind}`." if one.kind else ""
    return f"### {one.heading}\n\n{one.words}\n\n```yaml\n{one.example}```\n\n{one.returns}{node}\n\n"


def file_of(one: Construct) -> str:
    """Makes a whole mission file of the example."""
    if one.example.startswith("name:"):
        return one.example
    steps = "".join(f"  {line}\n" for line in one.example.splitlines())
    return f"name: example\nvariables: {{count: 1}}\nsteps:\n{steps}"
