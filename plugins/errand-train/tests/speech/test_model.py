"""The network in torch is the one that CTranslate2 runs, with and without an adapter. Needs the extras."""

import io

import numpy as np
import pytest

torch = pytest.importorskip("torch")
faster_whisper = pytest.importorskip("faster_whisper")

from errand_train.speech.model import AdaptedWhisper  # noqa: E402
from executive.speech.adapter import read_model_file  # noqa: E402
from executive.speech.whisper import base_weights  # noqa: E402
from tests.executive.speech.made_speech import tone  # noqa: E402

RANKS = {"encoder/": 4, "decoder/layer_0": 2}
START, TEXT = [50258, 50259, 50359], [50363, 2231, 264, 4414, 13]
FRAMES = 200


@pytest.fixture(scope="module")
def features():
    """A tone as features, and silence behind it."""
    heard = faster_whisper.feature_extractor.FeatureExtractor(feature_size=80)(tone(1.2))
    return np.pad(heard, ((0, 0), (0, FRAMES - heard.shape[1]))).astype(np.float32)


@pytest.fixture(scope="module")
def learned():
    """The network with adapters of random numbers, and the weights of the file with the same added."""
    torch.manual_seed(1)
    model, small = base_weights()
    net = AdaptedWhisper(read_model_file(model.getvalue()), RANKS, torch.float32)
    with torch.no_grad():
        for part in net.adapted_layers():
            part.up.normal_(0.0, 0.02)
            part.down.copy_(part.down.half())
            part.up.copy_(part.up.half())
    net.adapter().add_to(read_model_file(model.getbuffer()))
    return net, model, small


def _by_torch(net, features):
    """What is heard, and the probability of each token of the text behind what was told before."""
    prompt, given = torch.tensor([[*START, 7, 7]]), torch.tensor([TEXT[:-1]])
    with torch.no_grad():
        heard = net.encode(torch.from_numpy(features)[None])
        scores = net.logits(net.states(heard, prompt, torch.tensor([len(START)]), given))[0]
    words = scores[:, : START[0] - 1].softmax(-1)
    return heard.numpy(), [float(words[n, token]) for n, token in enumerate(TEXT[1:])]


def _by_ctranslate2(model, small, features):
    whisper = faster_whisper.WhisperModel(
        "whisper-base", compute_type="float32", device="cpu", files={"model.bin": model, **small}
    )
    heard = whisper.encode(features)
    (aligned,) = whisper.model.align(heard, START, [TEXT[1:]], FRAMES, median_filter_width=1)
    return np.asarray(heard), aligned.text_token_probs


def test_merged_adapters_give_what_the_trained_network_gives(learned, features):
    net, model, small = learned
    heard, chances = _by_torch(net, features)
    merged_heard, merged_chances = _by_ctranslate2(io.BytesIO(model.getvalue()), small, features)
    # the merged weights are rounded to 16 bits
    np.testing.assert_allclose(heard, merged_heard, atol=0.05)
    np.testing.assert_allclose(chances, merged_chances, atol=0.005)


def test_without_adapters_the_network_is_the_published_one(learned, features):
    net, _, small = learned
    with net.as_published():
        heard, chances = _by_torch(net, features)
    published_heard, published_chances = _by_ctranslate2(base_weights()[0], small, features)
    np.testing.assert_allclose(heard, published_heard, atol=0.01)
    np.testing.assert_allclose(chances, published_chances, atol=1e-4)
    assert not np.allclose(heard, _by_torch(net, features)[0], atol=0.1)


def test_only_adapters_learn(learned):
    net, _, _ = learned
    assert sum(part.numel() for part in net.parameters() if part.requires_grad) < 500_000
    assert {part.name.split("/")[0] for part in net.adapted_layers()} == {"encoder", "decoder"}
    assert {"encoder/conv1/weight", "encoder/conv2/weight"} <= set(net.adapter().changes)
