"""EfficientNet-Lite0 and its weights of ImageNet; skipped without torch."""

import pytest

torch = pytest.importorskip("torch")

from errand_train.detector import lite_backbone  # noqa: E402
from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.lite_backbone import LiteBackbone, PaddedConv  # noqa: E402


@pytest.fixture(scope="module")
def backbone():
    made = LiteBackbone().eval()
    made.begin_with_imagenet()
    return made


# stride     8    16   32
# channels   40   112  320
# of 64x96   8x12 4x6  2x3
def test_features_are_of_strides_8_16_and_32(backbone):
    at8 = backbone.early(torch.rand(2, 3, 64, 96))
    at16, at32 = backbone.late(at8)
    assert [tuple(one.shape) for one in (at8, at16, at32)] == [(2, 40, 8, 12), (2, 112, 4, 6), (2, 320, 2, 3)]


def test_it_has_as_many_weights_as_efficientnet_lite0_before_its_head(backbone):
    """4 652 008 less those of the head: a convolution, its normalisation, and the classes."""
    assert sum(weight.numel() for weight in backbone.parameters()) == 4_652_008 - 320 * 1280 - 2 * 1280 - 1281 * 1000


def test_imagenets_statistics_fit_what_the_layers_make_of_a_picture(backbone):
    """With weights at the wrong places, what is normalised would be far from mean 0 and spread 1."""
    smooth = torch.nn.functional.interpolate(torch.rand(8, 3, 16, 16), 224, mode="bicubic").clamp(0, 1)
    spreads: list[float] = []
    units = [block.filter for block in backbone.blocks()]
    handles = [
        unit[0].register_forward_hook(
            lambda _layer, _given, made, norm=unit[1]: spreads.append(
                float(((made - norm.running_mean[:, None, None]).square().mean((0, 2, 3)) / norm.running_var).median())
            )
        )
        for unit in units
    ]
    with torch.no_grad():
        backbone.late(backbone.early(smooth))
    for handle in handles:
        handle.remove()
    assert len(spreads) == 16
    assert all(0.05 < spread < 10.0 for spread in spreads)


def test_bytes_make_the_same_features(backbone):
    picture = torch.randint(0, 256, (1, 3, 64, 64)).float()
    expected = backbone.early(picture / 255)
    other = LiteBackbone().eval()
    other.load_state_dict(backbone.state_dict())
    other.take_bytes()
    assert torch.allclose(other.early(picture), expected, atol=1e-4)


# kernel   padding before and after, so that 8 rows become 4
# 3        0, 1: the last output's middle is the last row but one
# 5        1, 2
@pytest.mark.parametrize(("kernel", "before"), [(3, 0), (5, 1)])
def test_with_stride_2_there_is_more_padding_behind(kernel, before):
    layer, one = PaddedConv(1, 1, kernel, 2), torch.zeros(1, 1, 8, 8)
    with torch.no_grad():
        layer.weight.zero_()
        layer.weight[0, 0, before, before] = 1.0
    one[0, 0, 2, 4] = 5.0
    found = layer(one)
    assert found.shape == (1, 1, 4, 4)
    assert found[0, 0, 1, 2] == 5.0


@pytest.mark.parametrize(
    ("content", "told"),
    [
        # the package's file      what is said of it
        (None, "cannot be read"),
        (b"weights", "is damaged, or of another version"),
    ],
)
def test_other_weights_than_those_are_refused(tmp_path, monkeypatch, content, told):
    folder = tmp_path / "some_weights"
    (folder / "models").mkdir(parents=True)
    (folder / "__init__.py").touch()
    if content is not None:
        (folder / lite_backbone._FILE).write_bytes(content)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(lite_backbone, "_PACKAGE", "some_weights")
    with pytest.raises(TrainingDataError, match=told):
        LiteBackbone().begin_with_imagenet()


def test_weights_that_are_not_installed_are_named(monkeypatch):
    monkeypatch.setattr(lite_backbone, "_PACKAGE", "weights_that_nobody_has")
    with pytest.raises(TrainingDataError, match=r"weights_that_nobody_has: there is no such package.*make train"):
        LiteBackbone().begin_with_imagenet()
