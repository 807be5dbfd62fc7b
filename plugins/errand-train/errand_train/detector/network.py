"""The proposal network: plain convolutions on three levels (strides 8, 16, 32), a box and class scores at each cell.

Cross-stage blocks after Wang et al., "CSPNet" (2020); top-down and bottom-up paths after Liu et al., "Path Aggregation
Network" (2018); pooled context after Jocher's SPPF; anchor-free boxes as distances from the cell's middle to the four
sides after Tian et al., "FCOS" (2019). ReLU and channel counts that are multiples of 16, because ONNX Runtime is fast
with those.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Final

import torch
from torch import Tensor, nn

from skills.perception.detector.model_files import PROPOSAL, NetworkKind

STRIDES: Final = (8, 16, 32)
FIRST_SCORE: Final = 0.003


STEM: Final = (16, 32)
LEVELS: Final = (48, 96, 192)
NECK: Final = (48, 64, 96)
"""Channels after the first halvings of the picture, at strides 8, 16 and 32, and of the neck's levels."""
_DEPTH: Final = 2
_HEAD_SCORES, _HEAD_BOXES = 48, 32


class ConvUnit(nn.Sequential):
    """Convolution, batch normalisation, ReLU; keeps the size, or halves it with stride 2."""

    def __init__(self, inputs: int, outputs: int, size: int = 1, stride: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False),
            nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03),
            nn.ReLU(inplace=True),
        )


class Bottleneck(nn.Module):
    """Two 3x3 convolutions, with a shortcut if `shortcut`."""

    def __init__(self, channels: int, shortcut: bool) -> None:
        super().__init__()
        self.first = ConvUnit(channels, channels, 3)
        self.second = ConvUnit(channels, channels, 3)
        self.shortcut = shortcut

    def forward(self, x: Tensor) -> Tensor:
        """Applies the block to (N, C, H, W)."""
        y: Tensor = self.second(self.first(x))
        return x + y if self.shortcut else y


class CrossStage(nn.Module):
    """Cross-stage block: half of the channels pass `depth` bottlenecks, half bypass them; all are mixed."""

    def __init__(self, inputs: int, outputs: int, depth: int, shortcut: bool = True) -> None:
        super().__init__()
        half = outputs // 2
        self.through = ConvUnit(inputs, half)
        self.past = ConvUnit(inputs, half)
        self.blocks = nn.Sequential(*(Bottleneck(half, shortcut) for _ in range(depth)))
        self.mix = ConvUnit(2 * half, outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Computes (N, outputs, H, W) from (N, inputs, H, W)."""
        joined = torch.cat([self.blocks(self.through(x)), self.past(x)], dim=1)
        mixed: Tensor = self.mix(joined)
        return mixed


class Residual(nn.Module):
    """Residual block of two 3x3 convolutions, whose untrained output is its input.

    After He et al., "Deep Residual Learning" (2015); the last normalisation starts at 0 after Goyal et al., "Accurate,
    Large Minibatch SGD" (2017).
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = ConvUnit(channels, channels, 3)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels, eps=1e-3, momentum=0.03)
        )
        nn.init.zeros_(self.second[1].weight)

    def forward(self, x: Tensor) -> Tensor:
        """Applies the block to (N, C, H, W)."""
        return nn.functional.relu(x + self.second(self.first(x)))


class PooledContext(nn.Module):
    """Spatial pyramid pooling: the maxima within 5, 9 and 13 cells beside the cell's own value."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.squeeze = ConvUnit(channels, channels // 2)
        self.pool = nn.MaxPool2d(5, stride=1, padding=2)
        self.mix = ConvUnit(channels * 2, channels)

    def forward(self, x: Tensor) -> Tensor:
        """Applies the block to (N, C, H, W)."""
        near = [self.squeeze(x)]
        for _ in range(3):
            near.append(self.pool(near[-1]))
        mixed: Tensor = self.mix(torch.cat(near, dim=1))
        return mixed


class EarlyLayers(nn.Module):
    """A backbone's layers up to stride 8."""

    stem: nn.Sequential
    stage8: nn.Sequential

    def early(self, pictures: Tensor) -> Tensor:
        """Computes features at stride 8 of pictures (N, 3, H, W)."""
        raise NotImplementedError

    def take_bytes(self) -> None:
        """Changes the first layer to inputs from 0 to 255."""
        raise NotImplementedError


class CascadeNetwork(nn.Module):
    """A network of the cascade with the `kind` of its file."""

    kind: ClassVar[NetworkKind]
    classes: int

    @property
    def early_layers(self) -> EarlyLayers:
        """Layers up to the features at stride 8."""
        raise NotImplementedError

    @property
    def score_biases(self) -> list[Tensor]:
        """Last biases of the logits (K,)."""
        raise NotImplementedError

    def stop_learning(self) -> None:
        """Changes the network from training to inference; the default does nothing."""


class Backbone(EarlyLayers):
    """Backbone from pictures to features at strides 8, 16 and 32, with `residuals` blocks at strides 16 and 32."""

    def __init__(self, residuals: tuple[int, int]) -> None:
        super().__init__()
        first, second = STEM
        one, two, three = LEVELS
        self.stem = nn.Sequential(ConvUnit(3, first, 3, 2), ConvUnit(first, second, 3, 2))
        self.stage8 = nn.Sequential(ConvUnit(second, one, 3, 2), CrossStage(one, one, _DEPTH))
        more16, more32 = residuals
        self.stage16 = nn.Sequential(
            ConvUnit(one, two, 3, 2), CrossStage(two, two, _DEPTH), *(Residual(two) for _ in range(more16))
        )
        self.stage32 = nn.Sequential(
            ConvUnit(two, three, 3, 2),
            CrossStage(three, three, _DEPTH),
            PooledContext(three),
            *(Residual(three) for _ in range(more32)),
        )

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Computes three levels of features of pictures (N, 3, H, W)."""
        return self.late(self.early(pictures))

    def early(self, pictures: Tensor) -> Tensor:
        """Computes features at stride 8 of pictures (N, 3, H, W), half of the time of a training step."""
        at8: Tensor = self.stage8(self.stem(pictures))
        return at8

    @torch.no_grad()
    def take_bytes(self) -> None:
        """Changes the first layer to inputs from 0 to 255."""
        self.stem[0][0].weight.mul_(1.0 / 255.0)

    def late(self, at8: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Computes three levels from features at stride 8."""
        at16 = self.stage16(at8)
        return at8, at16, self.stage32(at16)


class Neck(nn.Module):
    """Path aggregation neck: features flow down from the coarse level, then up again."""

    def __init__(self) -> None:
        super().__init__()
        one, two, three = LEVELS
        low, middle, high = NECK
        self.enlarge = nn.Upsample(scale_factor=2, mode="nearest")
        self.narrow32 = ConvUnit(three, middle)
        self.down16 = CrossStage(two + middle, middle, 1, shortcut=False)
        self.narrow16 = ConvUnit(middle, low)
        self.down8 = CrossStage(one + low, low, 1, shortcut=False)
        self.halve8 = ConvUnit(low, low, 3, 2)
        self.up16 = CrossStage(low + low, middle, 1, shortcut=False)
        self.halve16 = ConvUnit(middle, middle, 3, 2)
        self.up32 = CrossStage(middle + middle, high, 1, shortcut=False)

    def forward(self, levels: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, Tensor, Tensor]:
        """Computes three levels of the neck's widths."""
        at8, at16, at32 = levels
        coarse = self.narrow32(at32)
        middle = self.narrow16(self.down16(torch.cat([self.enlarge(coarse), at16], dim=1)))
        fine = self.down8(torch.cat([self.enlarge(middle), at8], dim=1))
        middle = self.up16(torch.cat([self.halve8(fine), middle], dim=1))
        coarse = self.up32(torch.cat([self.halve16(middle), coarse], dim=1))
        return fine, middle, coarse


class Head(nn.Module):
    """Head with scores and box sides of one level."""

    def __init__(self, inputs: int, classes: int) -> None:
        super().__init__()
        self.for_scores = ConvUnit(inputs, _HEAD_SCORES, 3)
        self.for_boxes = ConvUnit(inputs, _HEAD_BOXES, 3)
        self.scores = nn.Conv2d(_HEAD_SCORES, classes, 1)
        self.sides = nn.Conv2d(_HEAD_BOXES, 4, 1)
        nn.init.constant_(self.scores.bias, -math.log((1.0 - FIRST_SCORE) / FIRST_SCORE))
        nn.init.constant_(self.sides.bias, 1.0)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Computes logits (N, classes, H, W) and raw sides (N, 4, H, W)."""
        return self.scores(self.for_scores(x)), self.sides(self.for_boxes(x))


class DetectorNetwork(CascadeNetwork):
    """Proposal network from pictures (N, 3, H, W) from 0 to 1, H and W multiples of 32, to logits and boxes."""

    kind = PROPOSAL

    def __init__(self, classes: int, residuals: tuple[int, int] = (0, 0)) -> None:
        super().__init__()
        self.classes = classes
        self.backbone = Backbone(residuals)
        self.neck = Neck()
        self.heads = nn.ModuleList(Head(width, classes) for width in NECK)

    @property
    def early_layers(self) -> Backbone:
        """Layers up to the features at stride 8."""
        return self.backbone

    @property
    def score_biases(self) -> list[Tensor]:
        """Last biases of the logits (K,) of each level."""
        return [head.scores.bias for head in self.heads]

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Computes logits (N, A, classes) and boxes (N, A, 4) as x0 y0 x1 y1 in pixels."""
        return self.from_early(self.backbone.early(pictures))

    def from_early(self, at8: Tensor) -> tuple[Tensor, Tensor]:
        """Computes logits and boxes from features at stride 8."""
        return self.from_levels(self.neck(self.backbone.late(at8)))

    def from_levels(self, levels: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, Tensor]:
        """Computes logits and boxes from the neck's three levels."""
        logits, boxes = [], []
        for head, level, stride in zip(self.heads, levels, STRIDES, strict=True):
            scores, sides = head(level)
            logits.append(scores.flatten(2))
            boxes.append(decode_boxes(sides, stride).flatten(2))
        return torch.cat(logits, dim=2).transpose(1, 2), torch.cat(boxes, dim=2).transpose(1, 2)


def decode_boxes(sides: Tensor, stride: int) -> Tensor:
    """Decodes raw sides to boxes (N, 4, H, W) in pixels: softplus gives distances from the cell's middle in strides."""
    far = nn.functional.softplus(sides.float()) * float(stride)
    middle = cell_middles(int(sides.shape[2]), int(sides.shape[3]), stride, sides.device)
    return torch.cat([middle - far[:, :2], middle + far[:, 2:]], dim=1)


def cell_middles(rows: int, columns: int, stride: int, device: torch.device) -> Tensor:
    """Middles (2, rows, columns) of a level's cells as x, y in pixels."""
    x = (torch.arange(columns, device=device, dtype=torch.float32) + 0.5) * stride
    y = (torch.arange(rows, device=device, dtype=torch.float32) + 0.5) * stride
    return torch.stack([x[None, :].expand(rows, columns), y[:, None].expand(rows, columns)])


def cells(height: int, width: int, strides: Sequence[int] = STRIDES) -> tuple[Tensor, Tensor]:
    """Middles (A, 2) and strides (A,) of all cells of a picture, in the network's order."""
    middles = [cell_middles(height // step, width // step, step, torch.device("cpu")).flatten(1).T for step in strides]
    steps = [torch.full((len(middle),), float(step)) for middle, step in zip(middles, strides, strict=True)]
    return torch.cat(middles), torch.cat(steps)
