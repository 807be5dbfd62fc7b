import pytest
from pydantic import BaseModel, ConfigDict

from skills.inputs.errors import InputError
from skills.inputs.schema import validate
from skills.inputs.yaml_source import read_yaml


class Event(BaseModel):
    model_config = ConfigDict(extra="forbid")

    at: float = 0.0


class Plan(BaseModel):
    events: tuple[Event, ...]


def test_a_key_that_is_no_text_in_a_list_item_is_refused_with_its_line(tmp_path):
    path = tmp_path / "plan.yaml"
    path.write_text("events:\n  - {at: 1}\n  - {null: null}\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        validate(Plan, read_yaml(path))
    assert (error.value.file, error.value.line) == (path, 3)
