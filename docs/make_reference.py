"""Makes the pages of the reference from schemas, skills, faults and the public API; the site adds them.

python docs/make_reference.py [FOLDER]          # writes them as Markdown, into out/reference
"""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bosdyn.api import (
    arm_command_pb2,
    full_body_command_pb2,
    manipulation_api_pb2,
    mobility_command_pb2,
    robot_command_pb2,
)
from bosdyn.api.docking import docking_pb2
from bosdyn.api.graph_nav import graph_nav_pb2
from bosdyn.api.spot import robot_command_pb2 as spot_command_pb2
from pydantic import BaseModel

import errand_spot.server
from errand_spot.server.calls import service_calls
from errand_spot.server.server import LISTED, MOTIONS, SERVICES
from executive.app.prepare.scenarios import ScenarioFile
from executive.testing.skill_test import SkillTestFile
from executive.tree.port_values import describe_type, field_types
from executive.words.knowledge import Knowledge
from executive.words.mission import Mission
from plant.worlds.world import SeedRules
from skills.api import Skill
from skills.faults.fault_kinds import STANDARD_FAULTS
from skills.quantities import DURATION_PATTERN
from skills.stack import SLOTS, components, option_fields, skill_options

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent))
from file_schemas import project_skills
from make_api import api_page
from mission_constructs import constructs_text

from tests.benchmarks.sdk_promises import NOT_RUN, PROGRAMS, REFUSED, SERVED, Program

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "reference"


@dataclasses.dataclass(frozen=True)
class SchemaPage:
    """A page on one kind of YAML file: its schema, a few words, more sections, and a file of ours as the example."""

    name: str
    title: str
    words: str
    model: type[BaseModel]
    example: str
    more: str = ""


SCHEMA_PAGES = (
    SchemaPage(
        "mission-file",
        "Mission files",
        "A mission: a short list of steps. `errand check FILE` refuses a wrong one with file and line; "
        "`missions/mission.schema.json` is the same schema for editors.",
        Mission,
        "missions/guarded_delivery.yaml",
        constructs_text(),
    ),
    SchemaPage(
        "knowledge",
        "Knowledge files",
        "`knowledge.yaml` of a world: the robot's knowledge of it. Metres and radians, in the world frame. "
        "`plant/worlds/knowledge.schema.json` is the schema for editors.",
        Knowledge,
        "plant/worlds/flat/knowledge.yaml",
    ),
    SchemaPage(
        "world-objects",
        "World files",
        "`objects.yaml` of a world: what the seed places. Rooms and furniture are in `world.dmd.yaml` (Drake's model "
        "directives), names and places in `knowledge.yaml`. [Make your own world](../how-to/own-world.md) begins here. "
        "`plant/worlds/objects.schema.json` is the schema for editors.",
        SeedRules,
        "plant/worlds/flat/objects.yaml",
    ),
    SchemaPage(
        "scenario",
        "Scenario files",
        "A scenario: `errand run --scenario FILE`, also `evaluate`. Times are those "
        "of the robot's clock, in seconds from the beginning of the run. A door waits for who is in the doorway; a "
        "person waits before a closed one, or takes another path. What a gripper holds is not moved. The robot learns "
        "of none of it but by its sensors. [Faults by name](faults.md) lists the faults. "
        "`missions/scenarios/scenario.schema.json` is the schema for editors.",
        ScenarioFile,
        "missions/scenarios/busy_flat.yaml",
    ),
    SchemaPage(
        "skill-test",
        "Skill tests",
        "`*.skilltest.yaml`: tests of one skill as data, collected by pytest. "
        "`executive/testing/skilltest.schema.json` is the schema for editors.",
        SkillTestFile,
        "tests/skills/manipulation/stow.skilltest.yaml",
    ),
)


COMMANDS = (
    robot_command_pb2.RobotCommand,
    spot_command_pb2.MobilityParams,
    manipulation_api_pb2.ManipulationApiRequest,
    docking_pb2.DockingCommandRequest,
    graph_nav_pb2.NavigateToRequest,
    graph_nav_pb2.NavigateRouteRequest,
    graph_nav_pb2.NavigateToAnchorRequest,
)
"""Messages of the commands that move the robot."""
ONE_OF = {
    field.name
    for message in (
        full_body_command_pb2.FullBodyCommand.Request,
        arm_command_pb2.ArmCommand.Request,
        mobility_command_pb2.MobilityCommand.Request,
    )
    for field in message.DESCRIPTOR.oneofs_by_name["command"].fields
}
"""Motions, which are refused when they are not served."""


def pages() -> dict[str, str]:
    """The text of every page by file name."""
    written = {f"{page.name}.md": schema_page(page) for page in SCHEMA_PAGES}
    more = {"skills.md": skills_page(), "stack.md": stack_page(), "faults.md": faults_page(), "api.md": api_page()}
    return {**written, **more, "spot-api.md": spot_api_page()}


def spot_api_page() -> str:
    """The page on the calls of Spot's API."""
    rows = [
        f"| `{service.name}` | {', '.join(f'`{call}`' for call in service_calls(service))} |" for service in SERVICES
    ]
    listed = ", ".join(f"`{name}`" for name in sorted(LISTED))
    return (
        "# Calls of Spot's API\n\nCalls that [`errand serve`](../../plugins/errand-spot/docs/spot-sdk.md) answers, by "
        "service of the directory.\n\n| service | calls |\n|---|---|\n"
        + "\n".join(rows)
        + "\n\nThe directory also lists services whose "
        f"calls answer `UNIMPLEMENTED`: {listed}.\n\nMotions: {MOTIONS}\n\n"
        "## Fields that change nothing\n\nThese fields of commands are accepted and not read: limits of "
        "acceleration, the choice of gait, stairs, terrain, and the like. Nor are the velocities and accelerations of "
        "a trajectory's points. A value that an enumeration of the API lacks is refused as an invalid request.\n\n"
        "| message | fields |\n|---|---|\n"
        + "\n".join(f"| `{name}` | {', '.join(f'`{field}`' for field in fields)} |" for name, fields in unread_fields())
        + f"\n\n{examples_section()}"
    )


def examples_section() -> str:
    """The section on the examples of Spot's SDK, in three tables."""
    moves = [f"| `{each.line}` | {_compared(each)} |" for each in PROGRAMS]
    still = [f"| `{folder}/{each.line.replace(' HOST', '')}` | output |" for folder, each in sorted(SERVED.items())]
    refused = [
        f"| `{folder}/{each.program.line.replace(' HOST', '')}` | {each.name} |"
        for folder, each in sorted(REFUSED.items())
    ]
    reasons = dict[str, list[str]]()
    for folder, reason in sorted(NOT_RUN.items()):
        reasons.setdefault(reason, []).append(f"`{folder}`")
    left_out = [f"| {', '.join(folders)} | {reason} |" for reason, folders in reasons.items()]
    return (
        "## Examples of the SDK\n\nEach folder of examples of Spot's SDK 5.1.4 stands in one of three tables. The "
        "programs run unchanged.\n\n### Does what it says\n\n`python -m tests.benchmarks.sdk_motion --examples FOLDER` "
        "compares programs that move the robot with the plant's truth, and "
        "`python -m tests.benchmarks.sdk_examples --examples FOLDER` the output of the others.\n\n"
        "| program | compared |\n|---|---|\n"
        + "\n".join([*moves, *still])
        + "\n\n### Refused by name\n\nChecked by `sdk_examples`, too.\n\n| program | what is refused |\n|---|---|\n"
        + "\n".join(refused)
        + "\n\n### Not run\n\n| folders | reason |\n|---|---|\n"
        + "\n".join(left_out)
        + "\n"
    )


def _compared(program: Program) -> str:
    """What is compared of a program that moves the robot."""
    promises = [
        f"{promise.columns.replace(' ', ', ')}{' along the path' if promise.along else ''} to {promise.most:g}"
        for promise in program.promises
    ]
    return "; ".join([*promises, "goals of its commands to 0.1 m"])


def unread_fields() -> Iterator[tuple[str, list[str]]]:
    """Yields each message of the served commands with the fields whose names stand nowhere in the server's code."""
    folder = Path(errand_spot.server.__file__).parent
    sources = [*folder.glob("*.py"), folder.parent / "messages.py"]
    words = set(re.findall(r"\w+", "\n".join(path.read_text(encoding="utf-8") for path in sources)))
    known, waiting = {"bosdyn.api.RequestHeader", "bosdyn.api.Quaternion"}, [message.DESCRIPTOR for message in COMMANDS]
    while waiting:
        described = waiting.pop(0)
        if described.full_name in known or described.full_name.startswith("google."):
            continue
        known.add(described.full_name)
        waiting += [field.message_type for field in described.fields if field.message_type and field.name in words]
        unread = [field.name for field in described.fields if field.name not in words and field.name not in ONE_OF]
        if unread:
            yield described.full_name.removeprefix("bosdyn.api."), unread


def schema_page(page: SchemaPage) -> str:
    """The page on one schema: a table for each part, then the example."""
    plain = page.model.model_json_schema(by_alias=True)
    schema = _words_inlined(plain, plain.get("$defs", {}))
    parts = {page.model.__name__: schema, **schema.get("$defs", {})}
    found = _reachable(schema, schema.get("$defs", {}))
    order = [name for name in found if parts[name].keys() & {"properties", "anyOf"}]
    sections = [_section(_heading(name), _without_policy(name, parts)) for name in order]
    main = _section("The file", schema)
    example = (ROOT / page.example).read_text(encoding="utf-8")
    shown = f"## Example\n\n`{page.example}`:\n\n```yaml\n{example}```\n"
    return f"# {page.title}\n\n{page.words} Unknown keys are refused.\n\n{page.more}{main}{''.join(sections)}{shown}"


def _reachable(schema: Mapping[str, Any], parts: Mapping[str, Any]) -> list[str]:
    """The parts in the order in which the schema first speaks of them."""
    found: list[str] = []

    def look(value: Any) -> None:
        if isinstance(value, dict):
            name = str(value.get("$ref", "")).rpartition("/")[2]
            if name and name not in found:
                found.append(name)
                look(parts[name])
            for key, item in value.items():
                if key != "$defs":
                    look(item)
        elif isinstance(value, list):
            for item in value:
                look(item)

    look(schema)
    return found


def _words_inlined(value: Any, parts: Mapping[str, Any]) -> Any:
    """The schema with lists of words put where they are spoken of."""
    if isinstance(value, list):
        return [_words_inlined(item, parts) for item in value]
    if not isinstance(value, dict):
        return value
    part = parts.get(str(value.get("$ref", "")).rpartition("/")[2], {})
    words = {"enum": part["enum"]} if "enum" in part else {}
    rest = {key: _words_inlined(item, parts) for key, item in value.items() if not (words and key == "$ref")}
    return {**rest, **words}


def _without_policy(name: str, parts: Mapping[str, Any]) -> Mapping[str, Any]:
    """A part of a schema without the keys of a policy, of which it tells."""
    part, keys = parts[name], parts.get("Policy", {}).get("properties", {}).keys()
    own = part.get("properties", {})
    if name == "Policy" or not keys or not keys <= own.keys():
        return part
    words = f"{part.get('description', '')}\n\nIt also takes the keys of a [policy](#policy)."
    return {**part, "description": words, "properties": {key: own[key] for key in own if key not in keys}}


def _heading(name: str) -> str:
    """A model's name as a heading: "StepFile" is "Step"."""
    word = name.removesuffix("File").removesuffix("Setup").removesuffix("Facts").removesuffix("Rule")
    return "".join(f" {c.lower()}" if c.isupper() and n else c for n, c in enumerate(word))


def _section(heading: str, part: Mapping[str, Any]) -> str:
    if "properties" not in part:
        return f"## {heading}\n\nOne of: {_takes(part).replace(' or ', ', ')}.\n\n"
    required = part.get("required", [])
    rows = [_row(key, facts, key in required) for key, facts in part["properties"].items()]
    table = "\n".join(["| key | type | default | meaning |", "|---|---|---|---|", *rows])
    return f"## {heading}\n\n{part.get('description', '')}\n\n{table}\n\n"


def _row(key: str, facts: Mapping[str, Any], needed: bool) -> str:
    default = "required" if needed else _default(facts.get("default"))
    cells = (f"`{key}`", _takes(facts), default, facts.get("description", ""))
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def _default(value: Any) -> str:
    return "" if value in (None, [], {}) or isinstance(value, dict) else f"`{json.dumps(value)}`"


def _takes(facts: Mapping[str, Any]) -> str:
    """What a key takes, in words."""
    if "$ref" in facts:
        name = _heading(facts["$ref"].rpartition("/")[2])
        return f"[{name}](#{name.lower().replace(' ', '-')})"
    if "enum" in facts or "const" in facts:
        return " or ".join(f"`{value}`" for value in facts.get("enum", [facts.get("const")]))
    if "anyOf" in facts or "allOf" in facts:
        options = [_takes(option) for option in facts.get("anyOf", facts.get("allOf"))]
        return " or ".join(dict.fromkeys(option for option in options if option != "nothing"))
    return _plain(facts)


def _plain(facts: Mapping[str, Any]) -> str:
    kind = facts.get("type", "anything")
    if kind == "array":
        items = facts.get("prefixItems")
        one = f"[{', '.join(map(_takes, items))}]" if items else _takes(facts.get("items", {}))
        return one if items else f"list of {one}"
    if kind == "object":
        inner = facts.get("additionalProperties")
        return f"names to {_takes(inner)}" if isinstance(inner, dict) and inner else "names to values"
    if facts.get("pattern") == DURATION_PATTERN:
        return 'text such as "2 min"'
    return {"null": "nothing", "boolean": "true or false", "string": "text", "integer": "whole number"}.get(
        kind, str(kind)
    ) + _limits(facts)


def _limits(facts: Mapping[str, Any]) -> str:
    """Bounds in words."""
    words = {"minimum": "from {}", "exclusiveMinimum": "above {}", "maximum": "to {}", "exclusiveMaximum": "below {}"}
    told = [text.format(f"{facts[key]:g}") for key, text in words.items() if key in facts]
    return f" {' '.join(told)}" if told else ""


def skills_page() -> str:
    """The page on the skills that come with the project."""
    sections = "".join(_skill(name, skill) for name, skill in project_skills().items())
    words = "Each is registered in the entry-point group `errand.skills`, as skills of other packages are."
    return f"# Skills\n\n{words}\n\n{sections}"


def _skill(name: str, skill: type[Skill[Any]]) -> str:
    ports = "".join(_ports(skill))
    causes = "\n".join(f"| {cause.value} | {why} |" for cause, why in skill.causes.items())
    ages = ", ".join(f"{source} {age_s:g} s" for source, age_s in skill.max_data_age_s.items())
    limits = f"Default time limit: {skill.default_timeout_s:g} s." + (f" Maximum age of data: {ages}." if ages else "")
    summary = " ".join((skill.__doc__ or "").split())
    failures = f"| cause of failure | when |\n|---|---|\n{causes}"
    return f"## {name}\n\n{summary}\n\n{limits}\n\n{ports}{failures}\n\n"


def _ports(skill: type[Skill[Any]]) -> Iterator[str]:
    hints = field_types(skill.Inputs)
    rows = []
    for field in dataclasses.fields(skill.Inputs):
        default = "required" if field.default is dataclasses.MISSING else f"`{field.default}`"
        rows.append(f"| `{field.name}` | {_type(hints[field.name])} | {default} |")
    if rows:
        yield " ".join((skill.Inputs.__doc__ or "").split()) + "\n\n"
        yield "| input | type | default |\n|---|---|---|\n" + "\n".join(rows) + "\n\n"
    if skill.outputs:
        given = "\n".join(f"| `{port}` | {_type(kind)} |" for port, kind in skill.outputs.items())
        yield f"| output | type |\n|---|---|\n{given}\n\n"


def _type(hint: Any) -> str:
    text = re.sub(r"Literal\[(.*?)\]", lambda found: found[1].replace(", ", " or "), describe_type(hint))
    text = re.sub(r"\bPath\b", "path", text.replace("collections.abc.Mapping[", "table["))
    return text.replace("skills.api.", "").replace("skills.robot.", "").replace("|", "&#124;")


def stack_page() -> str:
    """The page on stack files: every slot with its components, every skill that has options."""
    words = (
        "The components that a robot uses, and their options: `errand run --stack FILE`, also `check`, `evaluate` and "
        "`queue add`. What the file leaves out keeps its default; `errand stack show` prints all. Unknown keys are "
        "refused with file and line. `skills/stack.schema.json` is the schema for editors. Each component is a frozen "
        "dataclass that an installed distribution registers in the slot's entry-point group."
    )
    slots = "".join(_slot(slot, group) for slot, group in SLOTS.items())
    skills = "".join(_options(f"### {name}", kind) for name, kind in skill_options().items())
    example = "planner: {use: lattice, margin_m: 0.1}\nskills:\n  navigate:\n    replans: 3\n"
    shown = f"## Example\n\n```yaml\n{example}```\n"
    return f"# Stack files\n\n{words}\n\n{slots}## skills\n\n{skills}{shown}"


def _slot(slot: str, group: str) -> str:
    known = "".join(_options(f"### {name}", kind) for name, kind in components(slot).items())
    return f"## {slot}\n\nEntry points: `{group}`.\n\n{known}"


def _options(heading: str, kind: type[Any]) -> str:
    """Returns one component or skill: its docstring, then its options; those within an option have its name first."""
    rows = [f"| `{name}` | {_type(hint)} | `{value}` |" for name, hint, value in option_fields(kind)]
    table = "| option | type | default |\n|---|---|---|\n" + "\n".join(rows) + "\n\n" if rows else ""
    return f"{heading}\n\n{_paragraph(kind)}\n\n{table}"


def _paragraph(kind: type[Any]) -> str:
    return " ".join((kind.__doc__ or "").split())


def faults_page() -> str:
    """The page on the faults that can be injected by name."""
    rows = "\n".join(
        f"| `{kind.example}` | {kind.meaning} | {'yes' if kind.random else ''} |" for kind in STANDARD_FAULTS
    )
    words = (
        "A fault is the words of its kind and, if it is not always on, a time: `at 3 s` or `from 3 s` (from then on), "
        "`from 3 s to 5 s`, `2 s at 3 s` (for so long), or `after 4 calls`. Verbs have their names in "
        "`skills/robot.py`, or camera, lidar, arm, gripper, base and body. A colon may follow the verb, and one of "
        "several cameras is named after a dot: `camera.hand: is black 2 s at 3 s`.\n\n"
        "The same words inject faults in [skill tests](skill-test.md), by `skill_bench.inject` in pytest, and in whole "
        "missions by `errand run --fault` and [scenario files](scenario.md), where times are those of the robot's "
        "clock. `--random-faults N` draws among the kinds marked as random, by the run's seed."
    )
    return f"# Faults by name\n\n{words}\n\n| example | effect | random |\n|---|---|---|\n{rows}\n"


def main() -> None:
    """Writes all pages."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in pages().items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
