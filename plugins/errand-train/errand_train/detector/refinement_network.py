"""The refinement network: class and exact box in a crop about a proposal.

It is a second proposal network with weights of its own, which start from the proposal network's, on a crop: the
result is that of the cell with the best box about the proposal. Features of its coarsest level and the proposal's
logits are added. On the coarser levels it has additional layers that start as identities: on a crop they cost little.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from errand_train.detector.crop_network import MOST_LOGIT, CropNetwork, coverage, shift_boxes
from errand_train.detector.network import LEVELS, NECK, Backbone, ConvUnit, DetectorNetwork
from errand_train.detector.overlaps import overlap
from skills.perception.detector.model_files import CROP_PX, REFINEMENT

_RESIDUALS = (3, 2)
_CELLS_32 = CROP_PX // 32
_SQUEEZED, _JOINED = 32, 128
_SIDES_SCALE = 0.1


class RefinementNetwork(CropNetwork):
    """Crop network that starts from the proposal network's weights."""

    kind = REFINEMENT

    def __init__(self, classes: int) -> None:
        known = _SQUEEZED * _CELLS_32 * _CELLS_32 + 2 * (classes + 4)
        super().__init__(classes, known, _JOINED, LEVELS[0])
        self.detector = DetectorNetwork(classes, _RESIDUALS)
        self.squeeze = ConvUnit(NECK[2], _SQUEEZED)
        self.trust_first = nn.Parameter(torch.full((classes,), 0.5))
        self.trust_seen = nn.Parameter(torch.full((classes,), 0.5 + 1e-6))  # the exporter merges equal weights
        self.nearer = nn.Parameter(torch.full((4,), 0.5))

    @property
    def early_layers(self) -> Backbone:
        """Layers up to the features at stride 8."""
        return self.detector.backbone

    def from_early(self, at8: Tensor, boxes: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K) and boxes (N, 4) from the features of the early layers."""
        first_logits = logits.clamp(-MOST_LOGIT, MOST_LOGIT)
        levels = self.detector.neck(self.detector.backbone.late(at8 + self.place(coverage(boxes))))
        seen_logits, seen_boxes = best_cell_about(boxes, *self.detector.from_levels(levels))
        seen_logits = seen_logits.clamp(-MOST_LOGIT, MOST_LOGIT)
        seen = [self.squeeze(levels[2]).flatten(1), first_logits, seen_logits, boxes / CROP_PX, seen_boxes / CROP_PX]
        known = self.join(torch.cat(seen, dim=1))
        found = self.trust_first * first_logits + self.trust_seen * seen_logits + self.scores(known)
        nearer = boxes + self.nearer * (seen_boxes - boxes)
        return found, shift_boxes(nearer, _SIDES_SCALE * self.sides(known).float())


def best_cell_about(boxes: Tensor, logits: Tensor, found: Tensor) -> tuple[Tensor, Tensor]:
    """Logits (N, K) and box (N, 4) of the cell with the highest product of score and overlap with a box (N, 4).

    Inputs are the logits (N, A, K) and boxes `found` (N, A, 4) of all cells.
    """
    with torch.no_grad():
        fit = logits.float().amax(dim=2).sigmoid() * overlap(boxes[:, None], found)
        best = fit.argmax(dim=1)[:, None, None]
    surest = logits.gather(1, best.expand(-1, 1, logits.shape[2]))[:, 0]
    return surest, found.gather(1, best.expand(-1, 1, 4))[:, 0]
