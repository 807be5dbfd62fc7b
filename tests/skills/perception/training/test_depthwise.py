"""Convolutions of single channels with gradients of their own; skipped without torch."""

import pytest

torch = pytest.importorskip("torch")

from skills.perception.training.depthwise import filtered, padded  # noqa: E402
from skills.perception.training.lite_backbone import PaddedDepthwise  # noqa: E402


# kernel   stride   rows of zeros above, below
# 3        1        1, 1
# 5        1        2, 2
# 3        2        0, 1
# 5        2        1, 2
@pytest.mark.parametrize(("kernel", "stride"), [(3, 1), (5, 1), (3, 2), (5, 2)])
def test_gradients_are_those_of_the_library(kernel: int, stride: int) -> None:
    given = torch.randn(2, 3, 8, 6, dtype=torch.double, requires_grad=True)
    weight = torch.randn(3, 1, kernel, kernel, dtype=torch.double, requires_grad=True)
    plain = torch.nn.functional.conv2d(padded(given, kernel, stride), weight, None, stride, 0, 1, 3)
    made = filtered(given, weight, stride)
    assert made.shape == (2, 3, 8 // stride, 6 // stride)
    assert torch.allclose(made, plain)
    towards = torch.randn_like(made)
    expected = torch.autograd.grad((plain * towards).sum(), (given, weight))
    found = torch.autograd.grad((made * towards).sum(), (given, weight))
    assert all(torch.allclose(one, other) for one, other in zip(found, expected, strict=True))


def test_weights_get_gradients_of_32_bits_from_numbers_of_16() -> None:
    weight = torch.randn(4, 1, 3, 3, requires_grad=True)
    given = torch.randn(2, 4, 8, 8, dtype=torch.bfloat16)
    filtered(given, weight, 1).float().sum().backward()
    assert weight.grad is not None
    assert weight.grad.dtype == torch.float32
    assert weight.grad[:, 0, 1, 1] == pytest.approx(given.float().sum((0, 2, 3)), abs=1e-3)


@pytest.mark.parametrize("stride", [1, 2])
def test_a_layer_says_the_same_while_it_learns_and_later(stride: int) -> None:
    layer, given = PaddedDepthwise(4, 5, stride), torch.randn(2, 4, 8, 8)
    assert torch.allclose(layer.train()(given), layer.eval()(given), atol=1e-5)
