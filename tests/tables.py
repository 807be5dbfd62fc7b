"""Data and tables of tests in YAML files beside them."""

from pathlib import Path

from skills.inputs.yaml_source import read_yaml


def yaml_beside(test_file, name):
    """Data of the YAML file of this name beside a test."""
    return read_yaml(Path(test_file).with_name(name)).data


def table(test_file, name, *more):
    """Names and rows for `parametrize`: a list of mappings in the test's YAML file, and `more` rows of other types."""
    rows = yaml_beside(test_file, Path(test_file).with_suffix(".yaml").name)[name]
    return tuple(rows[0]), [*(tuple(row.values()) for row in rows), *more]
