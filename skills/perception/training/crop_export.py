"""The refinement and the classifier network as ONNX files that take crops as bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from skills.perception.detector.proposals import CROP_PX
from skills.perception.training.crop_network import CropNetwork
from skills.perception.training.export import fused, write_onnx

__all__ = ["ExportableRegions", "export_crops"]


class ExportableRegions(nn.Module):
    """Crops (N, 128, 128, 3) of bytes, regions (N, 4) in them and logits (N, K) to boxes (N, 4) and scores."""

    def __init__(self, network: CropNetwork, score_offsets: Sequence[float] | None = None) -> None:
        super().__init__()
        self.network = fused(network)
        self.network.stop_learning()
        self.network.take_bytes()
        if score_offsets is not None:
            with torch.no_grad():
                self.network.scores.bias.add_(torch.tensor(score_offsets))

    def forward(self, crops: Tensor, regions: Tensor, logits: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes and scores."""
        found, boxes = self.network(crops.permute(0, 3, 1, 2).float(), regions, logits)
        return boxes, found.sigmoid()


def export_crops(
    network: CropNetwork,
    file: Path,
    *,
    form: str,
    class_names: Sequence[str],
    facts: Mapping[str, str],
    score_offsets: Sequence[float] | None = None,
) -> None:
    """Write the ONNX file of a format; whole or not at all. `score_offsets` are added to the logits of each class.

    `facts` must tell the digest of the file of the network before it: as `first` that of the first, as `second` that of
    the second.
    """
    model = ExportableRegions(network, score_offsets).eval()
    example = {
        "chips": torch.zeros((2, CROP_PX, CROP_PX, 3), dtype=torch.uint8),
        "regions": torch.full((2, 4), float(CROP_PX)) * torch.tensor([0.2, 0.2, 0.8, 0.8]),
        "logits": torch.zeros((2, len(class_names))),
    }
    told = {"format": form, "class_names": json.dumps(list(class_names)), **facts}
    write_onnx(model, example, file, told, compact=True)
