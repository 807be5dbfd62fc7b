"""Faulty mission files: the refusal says where, what is wrong and what to do."""

import pytest

from skills.inputs.errors import InputError
from tests.tables import yaml_beside

FORMS = yaml_beside(__file__, "refusals.yaml")
ROWS = [(form.pop("refused"), form, name) for name, form in FORMS.items()]
REFUSED = [pytest.param(form, row, id=f"{name}: {row['input'][:40]}") for rows, form, name in ROWS for row in rows]


@pytest.mark.parametrize(("form", "row"), REFUSED)
def test_faulty_file_is_refused_with_its_place_and_a_hint(compile_text, tmp_path, form, row):
    old = row.get("instead_of", "INPUT")
    assert any(old in text for text in form.values())
    files = {name: text.replace(old, row["input"], 1) for name, text in form.items()}
    with pytest.raises(InputError) as refusal:
        compile_text(files.pop("mission"), **files)
    error = refusal.value
    assert f"{error.file.relative_to(tmp_path)}:{error.line}" == row["place"]
    assert row["message"] in error.message
    assert row.get("used_by", "") in error.message
    assert row.get("hint", "") in error.hint
    assert error.hint
    assert "\n" not in str(error)
