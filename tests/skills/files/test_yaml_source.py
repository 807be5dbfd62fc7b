"""Files that nobody would write as a mission are refused with one error that shows nothing of them."""

import os
import time
from pathlib import Path

import pytest

from executive.mission.file.resolve import load_mission
from executive.mission.file.schema import MissionFile
from executive.mission.knowledge import load_knowledge
from executive.mission.stack_file import load_stack
from skills.files.errors import InputError
from skills.files.yaml_source import MAX_BYTES, read_yaml

LOADERS = (load_mission, load_stack, load_knowledge)


def refused(load, path) -> InputError:
    with pytest.raises(InputError) as error:
        load(path)
    assert error.value.file == Path(path)
    assert error.value.hint
    return error.value


@pytest.mark.parametrize("load", LOADERS)
def test_a_pipe_is_refused_at_once(tmp_path, load):
    os.mkfifo(tmp_path / "pipe.yaml")
    begun = time.perf_counter()
    refused(load, tmp_path / "pipe.yaml")
    assert time.perf_counter() - begun < 1.0


@pytest.mark.parametrize("load", LOADERS)
@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null", "/dev/urandom"])
def test_a_device_is_refused(load, device):
    refused(load, device)


@pytest.mark.parametrize("load", LOADERS)
def test_a_folder_is_refused(tmp_path, load):
    refused(load, tmp_path)


def test_no_more_than_the_limit_is_read(tmp_path):
    (tmp_path / "long.yaml").write_text(f"name: m\n# {'x' * MAX_BYTES}\nsteps: [{{to: hall}}]\n")
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
def test_nothing_of_a_file_that_is_none_of_ours_is_shown(tmp_path, load, text):
    (tmp_path / "file").write_text(text)
    error = refused(load, tmp_path / "file")
    assert not [one for one in (error, *error.others) if SECRET in str(one)]


@pytest.mark.parametrize("name", [r'"a\0b"', '"   "', r'"\t"', r'"\u200b"', r'"a\x1bb"', r'"a\nb"', '""'])
def test_a_name_that_cannot_be_seen_is_refused_at_its_line(tmp_path, name):
    for key in ("name", "robot", "world"):
        values = {"name": "m", key: name}
        keys = "".join(f"{one}: {value}\n" for one, value in values.items())
        (tmp_path / "m.yaml").write_text(f"steps: [{{to: hall}}]\n{keys}")
        error = refused(load_mission, tmp_path / "m.yaml")
        assert error.line == 2 + list(values).index(key)


@pytest.mark.parametrize("name", ["kitchen", "Küche 2", "厨房", "a-b_c.d"])
def test_a_name_in_any_writing_is_taken(tmp_path, name):
    (tmp_path / "m.yaml").write_text(f"name: {name}\nsteps: [{{say: 'go to\n  the hall'}}]\n", encoding="utf-8")
    assert isinstance(load_mission(tmp_path / "m.yaml"), MissionFile)
