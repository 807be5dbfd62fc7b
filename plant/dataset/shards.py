"""A data set's folder: scenes written one by one, whole or not at all, so that a broken-off run goes on.

DIR/dataset.json            what the folder is: format, seed, digest of the sources
DIR/scenes/000012/3.jpg     pictures
DIR/scenes/000012/shots.json
DIR/train.json, DIR/val.json, DIR/contact_sheet.png   written at the end
"""

from __future__ import annotations

import errno
import hashlib
import json
import multiprocessing
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import cv2

from plant.dataset.coco import counts, document
from plant.dataset.errors import DatasetError
from plant.dataset.objects import sources_digest
from plant.dataset.overview import contact_sheet
from plant.dataset.render import Shot, render_scene, views_in
from plant.models.cache import kept_folder

FORMAT: Final = 1
MANIFEST: Final = "dataset.json"
SPLITS: Final = ("train", "val")
LEAST_FREE_BYTES: Final = 50_000_000
_SCENES: Final = "scenes"


GiveOut = Callable[[Callable[[int], Mapping[str, bytes]], list[int]], Iterator[tuple[int, Mapping[str, bytes] | None]]]
"""Has a function called with each number somewhere: numbers with results as they come, None for what is lost."""


@dataclass(frozen=True)
class Summary:
    """What a data set holds: pictures and counted labels by class for each split, and pictures without any label."""

    images: Mapping[str, int]
    labels: Mapping[str, Mapping[str, int]]
    empty_images: int
    ignored: int


@cache
def digest() -> str:
    """Changes whenever a source does that makes the pictures."""
    made = hashlib.sha256(sources_digest().encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        made.update(path.name.encode() + b"\0" + path.read_bytes())
    return made.hexdigest()[:10]


def render(
    out: Path,
    *,
    images: int,
    seed: int,
    jobs: int,
    progress: Callable[[int, int], None],
    give_out: GiveOut | None = None,
) -> Summary:
    """Render what is still missing of a data set and write its COCO files. Raises DatasetError.

    `progress` is told how many scenes are there, and how many there will be. `give_out` has others write the scenes,
    who may be on other machines; else `jobs` processes of this one do.
    """
    scenes = len(_taken(images))
    with _told(out):
        _claim(out, seed)
        missing = [index for index in range(scenes) if not _scene_folder(out, index).is_dir()]
        progress(scenes - len(missing), scenes)
        made = _rendered(out, seed, missing, jobs) if give_out is None else _elsewhere(out, seed, missing, give_out)
        for done, _ in enumerate(made, start=scenes - len(missing) + 1):
            progress(done, scenes)
        return _assemble(out, images, seed)


@contextmanager
def _told(out: Path) -> Iterator[None]:
    """Errors of the disk, said in a sentence."""
    try:
        yield
    except BrokenProcessPool as error:
        raise DatasetError(
            f"{out}: a rendering process was killed, perhaps for want of memory",
            "the same command goes on where it stopped; take fewer --jobs",
        ) from error
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise DatasetError(
                f"{out}: the disk is full", "make room; the same command goes on where it stopped"
            ) from error
        raise DatasetError(f"{out}: cannot be written ({error})", "name another folder with --out") from error


def _claim(out: Path, seed: int) -> None:
    """Make the folder ours, or check that it is: of the same seed and sources."""
    wanted = {"format": FORMAT, "seed": seed, "sources": digest()}
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


def _compare(path: Path, wanted: Mapping[str, Any]) -> None:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
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
    """How many pictures are taken into the data set of each scene, in order; all of them but of the last one."""
    counts: list[int] = []
    while (left := images - sum(counts)) > 0:
        counts.append(min(left, views_in(len(counts))))
    return counts


def _scene_folder(out: Path, index: int) -> Path:
    return out / _SCENES / f"{index:06d}"


def _rendered(out: Path, seed: int, missing: list[int], jobs: int) -> Iterator[int]:
    """Render scenes, in this process or in several; each number as soon as its folder is there."""
    if jobs == 1 or len(missing) < 2:
        for index in missing:
            write_scene(out, seed, index)
            yield index
        return
    pool = ProcessPoolExecutor(
        min(jobs, len(missing)), mp_context=multiprocessing.get_context("spawn"), initializer=end_with_starter
    )
    try:
        tasks = {pool.submit(write_scene, out, seed, index): index for index in missing}
        for task in as_completed(tasks):
            task.result()
            yield tasks[task]
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _elsewhere(out: Path, seed: int, missing: list[int], give_out: GiveOut) -> Iterator[int]:
    """Have others make scenes, and write each whole into its folder here; each number as soon as that is there."""
    for index, files in give_out(partial(scene_files, seed), missing):
        if files is None:
            raise BrokenProcessPool(f"scene {index}")

        def fill(fresh: Path, files: Mapping[str, bytes] = files) -> None:
            for name, data in files.items():
                (fresh / name).write_bytes(data)

        kept_folder(_scene_folder(out, index), fill)
        yield index


def scene_files(seed: int, index: int) -> Mapping[str, bytes]:
    """The files of one scene by name, made in a folder that is thrown away."""
    with tempfile.TemporaryDirectory(prefix="errand-scene-") as made:
        out = Path(made)
        (out / _SCENES).mkdir()
        write_scene(out, seed, index)
        return {path.name: path.read_bytes() for path in sorted(_scene_folder(out, index).iterdir())}


def end_with_starter() -> None:
    """Let this process end when the one that started it is gone: one that is killed cannot end its own."""
    starter = multiprocessing.parent_process()
    if starter is None:
        return

    def outlive() -> None:
        starter.join()
        os._exit(1)

    threading.Thread(target=outlive, name="end-with-starter", daemon=True).start()


def write_scene(out: Path, seed: int, index: int) -> None:
    """Render one scene into its folder, which appears only when it is complete."""
    cv2.setNumThreads(1)
    folder = _scene_folder(out, index)
    if shutil.disk_usage(out).free < LEAST_FREE_BYTES:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(out))

    def fill(fresh: Path) -> None:
        shots = enumerate(render_scene(seed, index))
        entries = [_write_shot(fresh, folder.relative_to(out), number, shot) for number, shot in shots]
        (fresh / "shots.json").write_text(json.dumps(entries, separators=(",", ":")), encoding="utf-8")

    kept_folder(folder, fill)


def _write_shot(folder: Path, shown_as: Path, number: int, shot: Shot) -> dict[str, Any]:
    picture = shot.picture if shot.picture.ndim == 2 else cv2.cvtColor(shot.picture, cv2.COLOR_RGB2BGR)
    ok, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, shot.quality])
    if not ok:
        raise OSError(f"picture {number} could not be encoded")
    (folder / f"{number}.jpg").write_bytes(data.tobytes())
    image = {"file_name": (shown_as / f"{number}.jpg").as_posix(), **shot.facts}
    return {"image": image, "annotations": shot.labels}


def _assemble(out: Path, images: int, seed: int) -> Summary:
    """Write the COCO files of the first pictures, and the contact sheet."""
    shots = list(_shots(out, images))
    info = {"description": "Errand: rendered rooms", "version": FORMAT, "seed": seed, "sources": digest()}
    for split in SPLITS:
        made = document({**info, "split": split}, [shot for shot in shots if shot["image"]["split"] == split])
        _write_whole(out / f"{split}.json", json.dumps(made, separators=(",", ":")))
    contact_sheet(out, shots, out / "contact_sheet.png")
    return _summary(shots)


def _shots(out: Path, images: int) -> Iterator[Mapping[str, Any]]:
    for index, count in enumerate(_taken(images)):
        path = _scene_folder(out, index) / "shots.json"
        try:
            entries = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, json.JSONDecodeError) as error:
            hint = f"remove {path.parent}; the same command makes it anew"
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
    """Write a file that is never seen half-written."""
    fresh = path.with_name(f".{path.name}.part")
    fresh.write_text(text, encoding="utf-8")
    fresh.replace(path)
