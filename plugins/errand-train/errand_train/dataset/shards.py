"""Folder of a data set: scenes are written one by one, each whole, so that an interrupted run can continue.

DIR/dataset.json            what the folder is: format, seed, digest of the sources
DIR/scenes/000012/3.jpg     pictures
DIR/scenes/000012/shots.json
DIR/train.json, DIR/val.json, DIR/contact_sheet.png   written at the end
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import cv2

from errand_train.dataset.coco import counts, document
from errand_train.dataset.errors import DatasetError
from errand_train.dataset.objects import sources_digest
from errand_train.dataset.objects.model import MODEL_FACTS, read_model
from errand_train.dataset.overview import contact_sheet
from errand_train.dataset.render import Shot, render_scene, views_in
from plant.models.catalogue import cached_folder

FORMAT: Final = 1
MANIFEST: Final = "dataset.json"
SPLITS: Final = ("train", "val")
LEAST_FREE_BYTES: Final = 50_000_000
_SCENES: Final = "scenes"
_SHOTS: Final = "shots.json"


GiveOut = Callable[[Callable[[int], Mapping[str, bytes]], list[int]], Iterator[tuple[int, Mapping[str, bytes] | None]]]
"""Distributes calls of a function with numbers; yields numbers with results, None for a lost one."""


@dataclass(frozen=True)
class Summary:
    """Summary of a data set: pictures and counted labels by class for each split, and pictures without labels."""

    images: Mapping[str, int]
    labels: Mapping[str, Mapping[str, int]]
    empty_images: int
    ignored: int


@cache
def digest() -> str:
    """Digest of the sources that make the pictures."""
    made = hashlib.sha256(sources_digest().encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        made.update(path.name.encode() + b"\0" + path.read_bytes())
    return made.hexdigest()[:10]


def one_by_one(
    function: Callable[[int], Mapping[str, bytes]], numbers: list[int]
) -> Iterator[tuple[int, Mapping[str, bytes]]]:
    """`GiveOut` that calls the function in this process."""
    return ((number, function(number)) for number in numbers)


def render(
    out: Path,
    *,
    images: int,
    seed: int,
    progress: Callable[[int, int], None],
    give_out: GiveOut = one_by_one,
    others: Path | None = None,
) -> Summary:
    """Renders the missing scenes of a data set and writes its COCO files. Raises DatasetError.

    `progress` gets the number of finished scenes and of all scenes. `give_out` distributes the rendering of scenes.
    `others` is a folder of models without a class, each in a folder of its own, which replace some distractors for
    training.
    """
    scenes = len(_taken(images))
    folders = _model_folders(others) if others is not None else ()
    with _told(out):
        _claim(out, seed, folders)
        missing = [index for index in range(scenes) if not _scene_folder(out, index).is_dir()]
        progress(scenes - len(missing), scenes)
        made = _rendered(out, partial(scene_files, seed, folders), missing, give_out)
        for done, _ in enumerate(made, start=scenes - len(missing) + 1):
            progress(done, scenes)
        return _assemble(out, images, seed)


class _LostSceneError(Exception):
    """A scene was not rendered."""


@contextmanager
def _told(out: Path) -> Iterator[None]:
    """Turns errors of the disk into DatasetError."""
    try:
        yield
    except _LostSceneError as error:
        hint = "perhaps for want of memory; the same command goes on where it stopped; take fewer --jobs"
        raise DatasetError(str(error), hint) from error
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise DatasetError(
                f"{out}: the disk is full", "make room; the same command goes on where it stopped"
            ) from error
        raise DatasetError(f"{out}: cannot be written ({error})", "name another folder with --out") from error


def _model_folders(others: Path) -> tuple[Path, ...]:
    """Finds the folders of models in a folder. Raises DatasetError without any, and for one of a class."""
    found = tuple(sorted(file.parent for file in others.glob(f"*/{MODEL_FACTS}")))
    if not found:
        raise DatasetError(f"{others}: holds no folder with {MODEL_FACTS}", "name a folder of object models")
    for folder in found:
        try:
            model = read_model(folder)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise DatasetError(f"{folder / MODEL_FACTS}: is damaged", "write the model again, or remove it") from error
        if model.class_id:
            raise DatasetError(f"{folder}: is a {model.category}, which the detector finds", "remove this model")
    return found


def _claim(out: Path, seed: int, others: Sequence[Path]) -> None:
    """Claims a new folder, or checks that seed, sources and others are the same."""
    wanted = {"format": FORMAT, "seed": seed, "sources": digest(), **_others_entry(others)}
    path = out / MANIFEST
    if not out.exists() or not any(out.iterdir()):
        (out / _SCENES).mkdir(parents=True, exist_ok=True)
        _write_whole(path, json.dumps(wanted, indent=1) + "\n")
        return
    if not path.is_file():
        raise DatasetError(f"{out}: holds other files and no {MANIFEST}", "name a new or empty folder with --out")
    _compare(path, wanted)
    (out / _SCENES).mkdir(exist_ok=True)
    for left in (out / _SCENES).glob(".making-*"):
        shutil.rmtree(left, ignore_errors=True)


def _others_entry(others: Sequence[Path]) -> dict[str, str]:
    """Entry of the manifest with the digest of the models of others; none without models."""
    made = hashlib.sha256()
    for folder in others:
        made.update(folder.name.encode() + b"\0" + (folder / MODEL_FACTS).read_bytes())
    return {"others": made.hexdigest()[:10]} if others else {}


def _compare(path: Path, wanted: Mapping[str, Any]) -> None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"{path}: is damaged ({error})", "remove the folder, or name another with --out") from error
    if not isinstance(found, dict):
        raise DatasetError(f"{path}: is damaged", "remove the folder, or name another with --out")
    if found.get("seed") != wanted["seed"]:
        raise DatasetError(
            f"{path}: this data set has seed {found.get('seed')}, not {wanted['seed']}",
            f"give --seed {found.get('seed')} to go on with it, or another --out",
        )
    if found != wanted:
        raise DatasetError(
            f"{path}: this data set was made by another version of the renderer or the models",
            "its pictures would not fit together with new ones; name another folder with --out",
        )


def _taken(images: int) -> list[int]:
    """Number of pictures of each scene in the data set, in order; all of them except for the last scene."""
    counts: list[int] = []
    while (left := images - sum(counts)) > 0:
        counts.append(min(left, views_in(len(counts))))
    return counts


def _scene_folder(out: Path, index: int) -> Path:
    return out / _SCENES / f"{index:06d}"


def _rendered(
    out: Path, make: Callable[[int], Mapping[str, bytes]], missing: list[int], give_out: GiveOut
) -> Iterator[int]:
    """Distributes scenes and writes each whole into its folder; yields each finished number."""
    for index, files in give_out(make, missing):
        if files is None:
            raise _LostSceneError(f"{out}: the processes that rendered scene {index} were killed")
        if shutil.disk_usage(out).free < LEAST_FREE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out))
        cached_folder(_scene_folder(out, index), partial(_write_files, files))
        yield index


def _write_files(files: Mapping[str, bytes], folder: Path) -> None:
    for name, data in files.items():
        (folder / name).write_bytes(data)


def scene_files(seed: int, others: Sequence[Path], index: int) -> Mapping[str, bytes]:
    """Renders one scene and returns its files by name. `others` are folders of further distractors."""
    cv2.setNumThreads(1)
    shown_as = _scene_folder(Path(), index)
    pictures: dict[str, bytes] = {}
    entries: list[dict[str, Any]] = []
    for number, shot in enumerate(render_scene(seed, index, [read_model(folder) for folder in others])):
        name = f"{number}.jpg"
        pictures[name] = _encoded(number, shot)
        entries.append({"image": {"file_name": (shown_as / name).as_posix(), **shot.facts}, "annotations": shot.labels})
    return {**pictures, _SHOTS: json.dumps(entries, separators=(",", ":")).encode()}


def _encoded(number: int, shot: Shot) -> bytes:
    picture = shot.picture if shot.picture.ndim == 2 else cv2.cvtColor(shot.picture, cv2.COLOR_RGB2BGR)
    ok, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, shot.quality])
    if not ok:
        raise OSError(f"picture {number} could not be encoded")
    return data.tobytes()


def _assemble(out: Path, images: int, seed: int) -> Summary:
    """Writes the COCO files of the first pictures, and the contact sheet."""
    shots = list(_shots(out, images))
    info = {"description": "Errand: rendered rooms", "version": FORMAT, "seed": seed, "sources": digest()}
    for split in SPLITS:
        made = document({**info, "split": split}, [shot for shot in shots if shot["image"]["split"] == split])
        _write_whole(out / f"{split}.json", json.dumps(made, separators=(",", ":")))
    contact_sheet(out, shots, out / "contact_sheet.png")
    return _summary(shots)


def _shots(out: Path, images: int) -> Iterator[Mapping[str, Any]]:
    for index, count in enumerate(_taken(images)):
        path = _scene_folder(out, index) / _SHOTS
        try:
            entries = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            hint = f"remove {path.parent}; the same command makes it again"
            raise DatasetError(f"{path}: is damaged or missing", hint) from error
        yield from entries[:count]


def _summary(shots: list[Mapping[str, Any]]) -> Summary:
    of = {split: [shot for shot in shots if shot["image"]["split"] == split] for split in SPLITS}
    labels = [label for shot in shots for label in shot["annotations"]]
    return Summary(
        images={split: len(found) for split, found in of.items()},
        labels={
            split: counts([label for shot in found for label in shot["annotations"]]) for split, found in of.items()
        },
        empty_images=sum(not any(not label["ignore"] for label in shot["annotations"]) for shot in shots),
        ignored=sum(label["ignore"] for label in labels),
    )


def _write_whole(path: Path, text: str) -> None:
    """Writes a file that is never seen half-written."""
    fresh = path.with_name(f".{path.name}.part")
    fresh.write_text(text, encoding="utf-8")
    fresh.replace(path)
