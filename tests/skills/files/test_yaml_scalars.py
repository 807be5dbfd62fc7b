"""Scalars of YAML 1.1 that people mean otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ConfigDict

from skills.files.errors import InputError
from skills.files.schema import Name, validate
from skills.files.yaml_scalars import scalar_of, yaml_of
from skills.files.yaml_source import parse_yaml, read_yaml
from skills.quantities import Count, Share


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("010", "010"),
        ("08", "08"),
        ("14:30", "14:30"),
        ("190:20:30.5", "190:20:30.5"),
        ("2026-12-01", "2026-12-01"),
        ("2026-12-01 09:00:00", "2026-12-01 09:00:00"),
        ("1e3", 1000.0),
        ("-2.5E-1", -0.25),
        ("=", "="),
        ("10", 10),
        ("0", 0),
        ("0.5", 0.5),
        ("0x1F", 31),
        ("yes", True),
        ("off", False),
        ('"no"', "no"),
        ("'010'", "010"),
        ("", None),
    ],
)
def test_a_scalar_has_the_type_that_people_mean(text: str, value: Any) -> None:
    assert scalar_of(text) == value
    assert type(scalar_of(text)) is type(value)


class Thing(BaseModel):
    """A file."""

    model_config = ConfigDict(extra="forbid")

    name: Name
    times: Count = 1
    battery: Share = 1.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("name: no", 'name: should be a text; put it in quotes: "no"'),
        ("name: On", 'put it in quotes: "On"'),
        ("name: true", "put it in quotes"),
        ("name: 42", 'put it in quotes: "42"'),
        ("name: a\ntimes: 010", "times: should be a whole number; write 10, without the zero"),
        ("name: a\ntimes: 2.0", "times: should be a whole number; write 2"),
        ("name: a\ntimes: 1:30", "times: should be a whole number; it reads '1:30' now"),
        ("name: a\nbattery: 0,3", "battery: should be a number; write 0.3, with a point"),
        ("{name: a, battery: 0,3}", "write 'battery: 0.3', with a point"),
        ("{name: a, 3: b}", "put the key in quotes"),
    ],
)
def test_what_yaml_reads_otherwise_is_refused_with_what_to_write(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "thing.yaml"
    file.write_text(text)
    with pytest.raises(InputError) as error:
        validate(Thing, read_yaml(file))
    assert says in str(error.value)


@pytest.mark.parametrize(
    ("text", "name"), [("name: 007", "007"), ("name: 14:30", "14:30"), ("name: 2026-12-01", "2026-12-01")]
)
def test_what_is_a_text_for_people_is_a_text(tmp_path: Path, text: str, name: str) -> None:
    file = tmp_path / "thing.yaml"
    file.write_text(f"name: {name}")
    assert validate(Thing, read_yaml(file)).name == name


def test_words_of_yes_and_no_are_texts_where_they_are_keys(tmp_path: Path) -> None:
    file = tmp_path / "thing.yaml"
    file.write_text("choices: {yes: 1, no: 2, on: 3}")
    assert read_yaml(file).data == {"choices": {"yes": 1, "no": 2, "on": 3}}


# text    PyYAML alone writes    reads back as
# 0E0     0E0                    0.0
# 1e3     1e3                    1000.0
# 12      '12'                   "12"
@pytest.mark.parametrize("text", ["0E0", "1e3", "-.5e-7", "12", "no", "14:30", "010", "beer", "a: b", "ä"])
def test_a_text_that_looks_like_a_number_is_written_so_that_it_reads_back(text: str) -> None:
    assert parse_yaml(yaml_of({"answer": text}), Path("m.yaml")).data == {"answer": text}
