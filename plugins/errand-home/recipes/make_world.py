"""Makes rooms, furniture and maps of the world `home` from `home.yaml`: `python make_world.py`. Needs errand-train."""

from pathlib import Path

from errand_train.worlds.__main__ import build
from errand_train.worlds.plan import Plan
from plant.worlds.geometry_files import OWN_PACKAGE
from skills.inputs.yaml_source import read_yaml

HERE = Path(__file__).resolve().parent
WORLD = HERE.parent / "errand_home" / "worlds" / "home"

if __name__ == "__main__":
    build(Plan.model_validate(read_yaml(HERE / "home.yaml").data), WORLD, OWN_PACKAGE, "map")
