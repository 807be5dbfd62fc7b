"""The second network: what is in a chip about a place that the first network found, and where exactly.

It has the first one's backbone and begins with its weights. It is told the first one's logits and adds to them, so
that it begins with the first one's opinion.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from skills.detect.regions import CHIP_PX
from skills.detect.training.network import Backbone, ConvUnit, CrossStage, Widths

__all__ = ["RegionNetwork", "RegionWidths"]

_CELLS_8, _CELLS_32 = CHIP_PX // 8, CHIP_PX // 32
_MOST_LOGIT = 8.0
_MOST_GROWTH = 1.5


@dataclass(frozen=True)
class RegionWidths:
    """Channels of the backbone, of the two levels behind it, and of the layers that join all cells."""

    backbone: Widths = field(default_factory=Widths)
    at16: int = 128
    at32: int = 192
    squeezed: int = 32
    joined: int = 160


class RegionNetwork(nn.Module):
    """Chips (N, 3, 128, 128) from 0 to 1, boxes (N, 4) in them and first logits (N, K) to logits and better boxes."""

    def __init__(self, classes: int, widths: RegionWidths | None = None) -> None:
        super().__init__()
        widths = widths or RegionWidths()
        one, two, three = widths.backbone.levels
        self.classes = classes
        self.backbone = Backbone(widths.backbone)
        self.place8 = nn.Conv2d(1, one, 1, bias=False)
        self.place16 = nn.Conv2d(1, widths.at16, 1, bias=False)
        self.narrow32 = ConvUnit(three, two)
        self.enlarge = nn.Upsample(scale_factor=2, mode="nearest")
        self.mix16 = CrossStage(two + two, widths.at16, 2)
        self.halve16 = ConvUnit(widths.at16, widths.at16, 3, 2)
        self.mix32 = CrossStage(widths.at16 + three, widths.at32, 2)
        self.squeeze = ConvUnit(widths.at32, widths.squeezed)
        self.join = nn.Linear(widths.squeezed * _CELLS_32 * _CELLS_32 + classes + 4, widths.joined)
        self.drop = nn.Dropout(0.1)
        self.scores = nn.Linear(widths.joined, classes)
        self.sides = nn.Linear(widths.joined, 4)
        self.trust = nn.Parameter(torch.ones(classes))
        for last in (self.scores, self.sides):
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)
        nn.init.zeros_(self.place8.weight)
        nn.init.zeros_(self.place16.weight)

    def forward(self, chips: Tensor, boxes: Tensor, first_logits: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (N, K) and boxes (N, 4) as x0 y0 x1 y1 in pixels of the chip."""
        first_logits = first_logits.clamp(-_MOST_LOGIT, _MOST_LOGIT)
        place = covered(boxes)
        at8 = self.backbone.early(chips) + self.place8(place)
        _, at16, at32 = self.backbone.late(at8)
        joined = torch.cat([self.enlarge(self.narrow32(at32)), at16], dim=1)
        at16 = self.mix16(joined) + self.place16(nn.functional.avg_pool2d(place, 2))
        at32 = self.mix32(torch.cat([self.halve16(at16), at32], dim=1))
        told = torch.cat([self.squeeze(at32).flatten(1), first_logits, boxes / CHIP_PX], dim=1)
        known = self.drop(nn.functional.relu(self.join(told)))
        return self.trust * first_logits + self.scores(known), moved(boxes, self.sides(known))


def covered(boxes: Tensor) -> Tensor:
    """The share of each cell of stride 8 that boxes (N, 4) cover, (N, 1, 16, 16)."""
    edges = torch.arange(_CELLS_8, device=boxes.device, dtype=boxes.dtype)[None] * 8.0
    x0, y0, x1, y1 = (boxes[:, k : k + 1] for k in range(4))
    across = ((x1 - edges) / 8.0).clamp(0.0, 1.0) - ((x0 - edges) / 8.0).clamp(0.0, 1.0)
    down = ((y1 - edges) / 8.0).clamp(0.0, 1.0) - ((y0 - edges) / 8.0).clamp(0.0, 1.0)
    return (down[:, :, None] * across[:, None, :])[:, None]


def moved(boxes: Tensor, sides: Tensor) -> Tensor:
    """Boxes (N, 4) with middles moved by shares of their sizes, and sizes changed by factors of which `sides` tells."""
    sides = sides.float()
    middle, size = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    middle = middle + sides[:, :2] * size
    half = size * sides[:, 2:].clamp(-_MOST_GROWTH, _MOST_GROWTH).exp() / 2
    return torch.cat([middle - half, middle + half], dim=1)
