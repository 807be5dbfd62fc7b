"""Base of the refinement and the classifier network, which judge boxes in RoI crops."""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

from errand_train.detector.network import CascadeNetwork
from skills.perception.detector.model_files import CROP_PX

MOST_LOGIT: Final = 8.0
_MOST_GROWTH: Final = 1.5
_CELLS_8: Final = CROP_PX // 8


class CropNetwork(CascadeNetwork):
    """Network from crops (N, 3, 128, 128) from 0 to 1, boxes (N, 4) in them and logits (N, K) to logits and boxes."""

    def __init__(self, classes: int, known: int, joined: int, at8: int) -> None:
        """So many numbers `known` are joined to `joined`; `at8` are the channels at stride 8."""
        super().__init__()
        self.classes = classes
        self.place = nn.Conv2d(1, at8, 1, bias=False)
        self.join = nn.Sequential(
            nn.Linear(known, joined, bias=False),
            nn.BatchNorm1d(joined, eps=1e-3, momentum=0.03),
            nn.ReLU(),
            nn.Dropout(0.1),
        )
        self.scores = nn.Linear(joined, classes)
        self.sides = nn.Linear(joined, 4)
        for last in (self.scores, self.sides):
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)
        nn.init.zeros_(self.place.weight)

    @property
    def score_biases(self) -> list[Tensor]:
        """Last biases of the logits (K,)."""
        return [self.scores.bias]

    def from_early(self, at8: Tensor, boxes: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K) and boxes (N, 4) from the features of the early layers."""
        raise NotImplementedError

    def forward(self, crops: Tensor, boxes: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K) and boxes (N, 4) as x0 y0 x1 y1 in pixels of the crop."""
        return self.from_early(self.early_layers.early(crops), boxes, logits)


def coverage(boxes: Tensor) -> Tensor:
    """Share of each cell of stride 8 that boxes (N, 4) cover, (N, 1, 16, 16)."""
    edges = torch.arange(_CELLS_8, device=boxes.device, dtype=boxes.dtype)[None] * 8.0
    x0, y0, x1, y1 = (boxes[:, k : k + 1] for k in range(4))
    across = ((x1 - edges) / 8.0).clamp(0.0, 1.0) - ((x0 - edges) / 8.0).clamp(0.0, 1.0)
    down = ((y1 - edges) / 8.0).clamp(0.0, 1.0) - ((y0 - edges) / 8.0).clamp(0.0, 1.0)
    return (down[:, :, None] * across[:, None, :])[:, None]


def shift_boxes(boxes: Tensor, sides: Tensor) -> Tensor:
    """Shifts boxes (N, 4) by shares of their sizes, and scales them by exponentials, as `sides` says."""
    middle, size = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    middle = middle + sides[:, :2] * size
    half = size * sides[:, 2:].clamp(-_MOST_GROWTH, _MOST_GROWTH).exp() / 2
    return torch.cat([middle - half, middle + half], dim=1)
