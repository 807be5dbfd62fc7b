"""The YAML reader: scalars, anchors, lines, and refusals that show no content of foreign files."""

import os
import time
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ConfigDict

from executive.mission.load import load_mission, load_stack
from executive.words.knowledge import load_knowledge
from executive.words.mission import Mission
from skills.inputs.errors import InputError
from skills.inputs.outside import TEXT_BYTES
from skills.inputs.schema import Name, validate
from skills.inputs.yaml_source import parse_yaml, read_yaml, scalar_of, yaml_of
from skills.quantities import Count, Share
from tests.hostile_values import FILES
from tests.tables import table


@pytest.mark.parametrize(*table(__file__, "scalars"))
def test_a_scalar_has_the_type_that_people_mean(text, value):
    assert scalar_of(text) == value
    assert type(scalar_of(text)) is type(value)


@pytest.mark.parametrize("text", ["[" * 5000, "{a: " * 5000, "- " * 5000])
def test_a_text_that_is_nested_deeply_is_no_scalar(text):
    with pytest.raises((ValueError, yaml.YAMLError)):
        scalar_of(text)


class Thing(BaseModel):
    """A file."""

    model_config = ConfigDict(extra="forbid")

    name: Name
    times: Count = 1
    battery: Share = 1.0


def source_of(tmp_path, text):
    (tmp_path / "f.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_yaml(tmp_path / "f.yaml")


@pytest.mark.parametrize(*table(__file__, "misread"))
def test_values_that_yaml_misreads_are_refused_with_a_correction(tmp_path, text, says):
    with pytest.raises(InputError) as error:
        validate(Thing, source_of(tmp_path, text))
    assert says in str(error.value)


@pytest.mark.parametrize("name", ["007", "14:30", "2026-12-01"])
def test_octals_times_and_dates_are_texts(tmp_path, name):
    assert validate(Thing, source_of(tmp_path, f"name: {name}")).name == name


# PyYAML alone writes 0E0 and 1e3 without quotes, which read back as numbers
@pytest.mark.parametrize("text", ["0E0", "1e3", "-.5e-7", "12", "no", "14:30", "010", "beer", "a: b", "ä"])
def test_a_text_that_looks_like_a_number_reads_back_as_text(text):
    assert parse_yaml(yaml_of({"answer": text}), Path("m.yaml")).data == {"answer": text}


LOADERS = (load_mission, load_stack, load_knowledge)


def refused(load, path):
    with pytest.raises(InputError) as error:
        load(path)
    assert error.value.file == Path(path)
    assert error.value.hint
    return error.value


@pytest.mark.parametrize("load", LOADERS)
@pytest.mark.parametrize("name", ["pipe.yaml", "/dev/zero", "/dev/null", "/dev/urandom", "."])
def test_a_pipe_a_device_and_a_folder_are_refused_at_once(tmp_path, load, name):
    os.mkfifo(tmp_path / "pipe.yaml")
    begun = time.perf_counter()
    refused(load, tmp_path / name)
    assert time.perf_counter() - begun < 1.0


def test_no_more_than_the_limit_is_read(tmp_path):
    (tmp_path / "long.yaml").write_text(f"name: m\n# {'x' * TEXT_BYTES}\nsteps: [{{to: hall}}]\n")
    refused(read_yaml, tmp_path / "long.yaml")


@pytest.mark.parametrize("digits", ["0x" + "f" * 10_000, "9" * 5_000, "1" + "_0" * 60, "1." + "0" * 500])
@pytest.mark.parametrize("where", ["timeout: {}", "{}: 3"])
def test_a_number_of_many_digits_is_refused_at_its_line(tmp_path, digits, where):
    (tmp_path / "m.yaml").write_text(f"name: m\n{where.format(digits)}\nsteps: [{{to: hall}}]\n")
    error = refused(read_yaml, tmp_path / "m.yaml")
    assert (error.line, digits in str(error)) == (2, False)


SECRET = "s3cret-salt"
SYSTEM_FILES = {
    "passwd": f"root:x:0:0:{SECRET}:/root:/bin/bash\ndaemon:x:1:1::/usr/sbin:/usr/sbin/nologin\n",
    "shadow": f"'root:*:{SECRET}:0:99999:7::':\n",
    "key": f"PRIVATE {SECRET}: abc\n",
    "values": f"password: {SECRET}\nuser: root\n",
    "twice": f"'x:{SECRET}': 1\n'x:{SECRET}': 2\n",
    "list": f"- {SECRET}\n- b\n",
    "broken": f"a: b: {SECRET}\n",
}


@pytest.mark.parametrize("load", LOADERS)
@pytest.mark.parametrize("text", SYSTEM_FILES.values(), ids=SYSTEM_FILES)
def test_errors_show_no_content_of_foreign_files(tmp_path, load, text):
    (tmp_path / "file").write_text(text)
    error = refused(load, tmp_path / "file")
    assert not [one for one in (error, *error.others) if SECRET in str(one)]


@pytest.mark.parametrize("name", [r'"a\0b"', '"   "', r'"\t"', r'"\u200b"', r'"a\x1bb"', r'"a\nb"', '""'])
def test_an_invisible_name_is_refused_at_its_line(tmp_path, name):
    for key in ("name", "robot", "world"):
        values = {"name": "m", key: name}
        keys = "".join(f"{one}: {value}\n" for one, value in values.items())
        (tmp_path / "m.yaml").write_text(f"steps: [{{to: hall}}]\n{keys}")
        error = refused(load_mission, tmp_path / "m.yaml")
        assert error.line == 2 + list(values).index(key)


@pytest.mark.parametrize("name", ["kitchen", "Küche 2", "厨房", "a-b_c.d"])
def test_a_name_in_any_script_is_accepted(tmp_path, name):
    (tmp_path / "m.yaml").write_text(f"name: {name}\nsteps: [{{say: 'go to\n  the hall'}}]\n", encoding="utf-8")
    assert isinstance(load_mission(tmp_path / "m.yaml"), Mission)


def refusal_of(tmp_path, text):
    with pytest.raises(InputError) as error:
        source_of(tmp_path, text)
    assert error.value.line is not None
    return error.value


@pytest.mark.parametrize("raw", FILES, ids=lambda raw: repr(raw[:20]))
def test_any_bytes_are_read_or_refused_at_a_line(tmp_path, raw):
    try:
        source_of(tmp_path, raw)
    except InputError as error:
        assert 1 <= (error.line or 0) <= raw.count(b"\n") + 1
        assert len(str(error)) < 500


MERGED = {"a": {"x": 1, "y": 2}, "b": {"y": 3}, "c": {"x": 5, "y": 2}, "d": {"y": 3}}


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("a: &a {x: 1, y: 2}\nb: &b\n  y: 3\nc:\n  <<: [*a, *b]\n  x: 5\nd: {<<: *b}\n", MERGED),
        ("choices: {yes: 1, no: 2, on: 3}", {"choices": {"yes": 1, "no": 2, "on": 3}}),
        (b"\xef\xbb\xbfa: 1\r\nb: 2\r\n", {"a": 1, "b": 2}),
    ],
    ids=["merge keys add missing keys", "yes and no are texts as keys", "byte order mark and windows line ends"],
)
def test_a_yaml_file_is_read(tmp_path, text, data):
    assert source_of(tmp_path, text).data == data


def test_aliased_values_have_the_line_of_their_anchor(tmp_path):
    source = source_of(tmp_path, "a: &a\n  x: 1\nb:\n  <<: *a\n  z: 1\nc:\n- *a\n")
    lines = [source.line(path) for path in (("b", "x"), ("b", "z"), ("c", 0, "x"))]
    assert lines == [2, 5, 2]


def test_allowed_tags_are_read(tmp_path):
    (tmp_path / "f.yaml").write_text("a: !Rpy {deg: [0, 0, 90]}\n")
    assert read_yaml(tmp_path / "f.yaml", frozenset({"!Rpy"})).data == {"a": {"deg": [0, 0, 90]}}


def test_a_small_file_that_aliases_make_huge_is_refused(tmp_path):
    text = "a0: &a0 [x, x, x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join(['*a' + str(n - 1)] * 8)}]\n" for n in range(1, 30)
    )
    begun = time.process_time()
    assert "repeat more than" in str(refusal_of(tmp_path, text))
    assert time.process_time() - begun < 1.0


def test_many_merges_of_a_large_mapping_are_refused(tmp_path):
    large = "a: &a {" + ", ".join(f"k{n}: 1" for n in range(2_000)) + "}\n"
    assert "repeat more than" in str(refusal_of(tmp_path, large + "b: {<<: [" + ", ".join(["*a"] * 5_000) + "]}\n"))


OTHER_ENCODINGS = [("a: 1\n".encode("utf-16"), "UTF-16", 1), (b"a: 1\nb: caf\xe9\n", "UTF-8", 2)]


@pytest.mark.parametrize(*table(__file__, "invalid", *OTHER_ENCODINGS))
def test_invalid_yaml_is_refused_at_its_line(tmp_path, text, said, line):
    error = refusal_of(tmp_path, text)
    assert said in str(error)
    assert error.line == line


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_a_million_brackets_are_refused(tmp_path, opening):
    refusal_of(tmp_path, opening * (900_000 // len(opening)))
