"""The second network as an ONNX file that takes chips as bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from skills.detect.detector_file import REGIONS_FORMAT
from skills.detect.regions import CHIP_PX
from skills.detect.training.export import fused, take_bytes, write_onnx
from skills.detect.training.region_network import RegionNetwork

__all__ = ["ExportableRegions", "export_regions"]


class ExportableRegions(nn.Module):
    """Chips (N, 128, 128, 3) of bytes, regions (N, 4) in them and first logits (N, K) to boxes (N, 4) and scores."""

    def __init__(self, network: RegionNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fused(network)
        take_bytes(self.network.detector.backbone)
        if score_offsets is not None:
            with torch.no_grad():
                self.network.scores.bias.add_(torch.tensor(score_offsets))

    def forward(self, chips: Tensor, regions: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes and scores."""
        found, boxes = self.network(chips.permute(0, 3, 1, 2).float(), regions, logits)
        return boxes, found.sigmoid()


def export_regions(
    network: RegionNetwork,
    file: Path,
    *,
    class_names: Sequence[str],
    facts: Mapping[str, str],
    score_offsets: Sequence[float] | None = None,
) -> None:
    """Write the ONNX file; whole or not at all. `score_offsets` are added to the logits of each class.

    `facts` must tell as `first` the digest of the first network's file.
    """
    model = ExportableRegions(network, score_offsets).eval()
    example = {
        "chips": torch.zeros((2, CHIP_PX, CHIP_PX, 3), dtype=torch.uint8),
        "regions": torch.full((2, 4), float(CHIP_PX)) * torch.tensor([0.2, 0.2, 0.8, 0.8]),
        "logits": torch.zeros((2, len(class_names))),
    }
    told = {"format": REGIONS_FORMAT, "class_names": json.dumps(list(class_names)), **facts}
    write_onnx(model, example, file, told, compact=True)
