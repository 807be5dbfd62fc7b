"""Ament packages of the interfaces that the plug-in uses and ROS 2 may lack, which colcon or CMake builds."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from rosbags.typesys import Stores, get_typestore

from errand_ros2.wire.types import INTERFACES
from skills.inputs.errors import InputError, suggestion

PACKAGES: Final = ["tf2_msgs", "control_msgs", "nav2_msgs", "vision_msgs", "py_trees_ros_interfaces", "errand_msgs"]
_REFERENCE: Final = re.compile(r"^\s*([a-z][a-z0-9_]*)/", re.MULTILINE)  # the package of a field's type
_TEMPLATES: Final = INTERFACES.with_name("interface_package")


def definitions(package: str) -> dict[str, str]:
    """Returns the definitions of a package by file, such as `msg/Particle.msg`. Raises InputError."""
    if package not in PACKAGES:
        raise InputError(f"there is no package '{package[:60]}' to write", hint=suggestion(package, PACKAGES))
    if files := sorted((INTERFACES / package).glob("*/*")):
        return {f"{each.parent.name}/{each.name}": each.read_text(encoding="utf-8") for each in files}
    store, head = get_typestore(Stores.ROS2_JAZZY), f"{package}/msg/"
    names = [name.removeprefix(head) for name in store.types if name.startswith(head)]
    return {f"msg/{name}.msg": store.generate_msgdef(head + name)[0].partition("=" * 80)[0] for name in names}


def write_packages(folder: Path, packages: Iterable[str]) -> None:
    """Writes packages into a folder, each with its definitions, `package.xml` and `CMakeLists.txt`."""
    for name in packages:
        texts = definitions(name)
        needs = {each for text in texts.values() for each in _REFERENCE.findall(text)} - {name}
        needs |= {"action_msgs"} if any(file.endswith(".action") for file in texts) else set()
        depend = "".join(f"  <depend>{each}</depend>\n" for each in sorted(needs))
        values = {"name": name, "depend": depend, "files": " ".join(texts), "needs": " ".join(sorted(needs))}
        texts |= {each.name: each.read_text(encoding="utf-8").format(**values) for each in _TEMPLATES.iterdir()}
        for file, text in texts.items():
            (path := folder / name / file).parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
