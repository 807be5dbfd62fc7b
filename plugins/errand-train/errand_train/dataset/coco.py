"""Labels in COCO's format: categories with the project's class ids, boxes, run lengths, and labels to ignore."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from errand_train.dataset.silhouette import Silhouette
from plant.models.catalogue import load_catalogue

Mask = NDArray[np.bool_]

LEAST_SHARE = 0.25
LEAST_LONG_PX = 10
LEAST_SHORT_PX = 4
LEAST_NOTED_PX = 6
MOST_OF_PICTURE = 0.95
DARKEST_MEAN, DARKEST_SPREAD = 14.0, 7.0


def run_lengths(mask: Mask) -> dict[str, Any]:
    """Encodes a mask (H, W) as COCO's uncompressed run lengths: down the columns, zeros first."""
    flat = np.asarray(mask, dtype=bool).reshape(-1, order="F")
    changes = np.flatnonzero(np.diff(flat)) + 1
    edges = np.concatenate([[0], changes, [flat.size]])
    counts = np.diff(edges).tolist()
    if flat.size and flat[0]:
        counts = [0, *counts]
    return {"size": list(mask.shape), "counts": counts}


def box_of(mask: Mask) -> tuple[int, int, int, int]:
    """Box (x, y, width, height) of a mask in pixels. Raises ValueError for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        raise ValueError("an empty mask has no box")
    x, y = int(columns[0]), int(rows[0])
    return (x, y, int(columns[-1]) - x + 1, int(rows[-1]) - y + 1)


def annotation(
    *, mask: Mask, alone: Silhouette, class_id: int, instance: str, distance_m: float, unseeable: bool = False
) -> dict[str, Any] | None:
    """Makes one label without ids; None when almost nothing is visible.

    `visibility` is the visible share of the pixels that the object alone would cover in the picture, `truncation` the
    share of the object beyond the picture's edge. `ignore` is 1, and so is `iscrowd`, by which COCO's tools ignore a
    label, for an object that is hardly visible, too small, all over the picture, without an outline, or `unseeable` for
    other reasons.
    """
    area = int(mask.sum())
    if area < LEAST_NOTED_PX:
        return None
    x, y, w, h = box_of(mask)
    visibility = min(1.0, area / max(alone.inside_px, 1))
    truncation = 1.0 - alone.inside_px / max(alone.whole_px, alone.inside_px, 1)
    seen = visibility * (1.0 - truncation)
    too_small = max(w, h) < LEAST_LONG_PX or min(w, h) < LEAST_SHORT_PX
    ignored = unseeable or seen < LEAST_SHARE or too_small or area > MOST_OF_PICTURE * mask.size
    return {
        "category_id": class_id,
        "bbox": [x, y, w, h],
        "area": area,
        "segmentation": run_lengths(mask),
        "iscrowd": int(ignored),
        "ignore": int(ignored),
        "visibility": round(visibility, 4),
        "truncation": round(truncation, 4),
        "distance_m": round(distance_m, 3),
        "instance": instance,
    }


def is_black(picture: NDArray[np.uint8], mask: Mask) -> bool:
    """Returns whether the object of a mask is all black in the picture (H, W) or (H, W, 3)."""
    seen = picture[mask].astype(np.float32)
    return bool(seen.mean() < DARKEST_MEAN and seen.std() < DARKEST_SPREAD)


def categories() -> list[dict[str, Any]]:
    """Categories of the nine classes with the project's ids."""
    return [{"id": entry.id, "name": name, "supercategory": "thing"} for name, entry in load_catalogue().items()]


def document(info: Mapping[str, Any], shots: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Joins pictures {`image`, `annotations`} of scenes to a COCO file; ids count from 1 in that order."""
    images, labels = list[dict[str, Any]](), list[dict[str, Any]]()
    for shot in shots:
        number = len(images) + 1
        images.append({"id": number, **shot["image"]})
        for label in shot["annotations"]:
            labels.append({"id": len(labels) + 1, "image_id": number, **label})
    return {"info": dict(info), "images": images, "annotations": labels, "categories": categories()}


def counts(labels: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Counts the labels of each class that are not ignored, by name."""
    names = {entry["id"]: entry["name"] for entry in categories()}
    found = dict.fromkeys(names.values(), 0)
    for label in labels:
        if not label["ignore"]:
            found[names[label["category_id"]]] += 1
    return found
