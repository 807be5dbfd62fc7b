"""Table of a network's proposals in the training pictures, with the true objects."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as coco_mask

from errand_train.detector.labels import Labels
from skills.perception.detector.boxes import Scales
from skills.perception.detector.model_files import DetectorModel
from skills.perception.detector.onnx_detector import ProposalOptions, Proposals, refine, select_proposals

NEAR: Final = 0.3
_WITHIN_IGNORED: Final = 0.6
_LOOKED_AT: Final = ProposalOptions(least_score=0.01, most=20)
_SEEN: Final = ProposalOptions(least_score=0.015, same=0.9, most=20)

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class ProposalTable:
    """Table of R proposals: picture number (R,), box (R, 4) in the letterbox, logits (R, K), and the true object.

    `classes` (R,) are those of the objects that proposals overlap by NEAR or more, or -1; `wanted` (R, 4) are their
    boxes, and the proposal's own box without an object.
    """

    pictures: NDArray[np.int64]
    boxes: Floats
    logits: Floats
    wanted: Floats
    classes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.pictures)

    def save(self, file: Path) -> None:
        """Writes the table, whole or not at all."""
        fresh = file.with_name(f".{file.name}.new.npz")
        np.savez(fresh, **vars(self))
        fresh.replace(file)

    @staticmethod
    def read(file: Path) -> ProposalTable:
        """Reads a table that `save` has written."""
        with np.load(file) as kept:
            return ProposalTable(**{name: kept[name] for name in ProposalTable.__dataclass_fields__})


def propose(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Runs the proposal network on a letterbox: boxes (A, 4) and scores (A, K)."""
    boxes, scores = model.proposal.session.run(["boxes", "scores"], {"images": scales.full[None]})
    return boxes[0], scores[0]


def refine_proposals(model: DetectorModel, scales: Scales) -> tuple[Floats, Floats]:
    """Runs the refinement network as the detector does: boxes (R, 4), scores (R, K). Raises ValueError without one."""
    if model.refinement is None:
        raise ValueError("there is no refinement network")
    return refine(model.refinement.session, scales, *propose(model, scales), ProposalOptions())


def first_proposals(model: DetectorModel, scales: Scales) -> Proposals:
    """Proposals of the proposal network."""
    return select_proposals(*propose(model, scales), _LOOKED_AT)


def refined_proposals(model: DetectorModel, scales: Scales) -> Proposals:
    """Proposals of the refinement network. Raises ValueError without one."""
    return select_proposals(*refine_proposals(model, scales), _SEEN)


def build_table(look: Callable[[Scales], Proposals], pictures: Iterable[tuple[Scales, Labels]]) -> ProposalTable:
    """Builds the table of proposals in all pictures. Leaves out those on ignored labels."""
    tables = [_rows(look(scales), number, labels) for number, (scales, labels) in enumerate(pictures)]
    names = ProposalTable.__dataclass_fields__
    return ProposalTable(**{name: np.concatenate([vars(table)[name] for table in tables]) for name in names})


def _rows(regions: Proposals, number: int, labels: Labels) -> ProposalTable:
    """The regions of one picture."""
    objects = label_boxes(labels)
    shared, inside = (_overlaps(regions.boxes, objects, crowd=crowd) for crowd in (False, True))
    left_out = ((shared >= NEAR) | (inside >= _WITHIN_IGNORED)) & labels.ignored[None, :]
    counting = np.where(labels.ignored[None, :], 0.0, shared)
    best = counting.max(axis=1, initial=0.0)
    near = best >= NEAR
    kept = near | ~left_out.any(axis=1)
    wanted, classes = regions.boxes.copy(), np.full(len(regions), -1)
    if near.any():
        chosen = counting.argmax(axis=1)[near]
        wanted[near], classes[near] = objects[chosen], labels.classes[chosen]
    return ProposalTable(
        np.full(int(kept.sum()), number), regions.boxes[kept], regions.logits[kept], wanted[kept], classes[kept]
    )


def _overlaps(boxes: Floats, objects: Floats, *, crowd: bool) -> NDArray[np.float64]:
    """Shared area / area of both (N, M), or of the box alone for a `crowd`."""
    if not len(boxes) or not len(objects):
        return np.zeros((len(boxes), len(objects)))
    first, second = (np.hstack([one[:, :2], one[:, 2:] - one[:, :2]]).astype(np.float64) for one in (boxes, objects))
    return np.asarray(coco_mask.iou(first, second, [int(crowd)] * len(objects)))


def label_boxes(labels: Labels) -> Floats:
    """Boxes (N, 4) about the outlines of labels."""
    boxes = [np.concatenate([outline.min(axis=0), outline.max(axis=0)]) for outline in labels.outlines]
    return np.array(boxes, dtype=np.float32).reshape(-1, 4)
