"""Tables of tests in YAML files beside them."""

from pathlib import Path

import yaml


def table(test_file, name, *more):
    """Names and rows for `parametrize`: a list of mappings in the test's YAML file, and `more` rows of other types."""
    rows = yaml.safe_load(Path(test_file).with_suffix(".yaml").read_text(encoding="utf-8"))[name]
    return tuple(rows[0]), [*(tuple(row.values()) for row in rows), *more]
