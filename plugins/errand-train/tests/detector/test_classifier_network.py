"""The parts of the classifier network's training; skipped without torch."""

from copy import deepcopy
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests.skills.tiny_detector import CLASSES, picture_of, write_pair

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from errand_train.detector.classifier_network import USED, ClassifierNetwork  # noqa: E402
from errand_train.detector.crop_batches import CropBatch  # noqa: E402
from errand_train.detector.export import export, fuse  # noqa: E402
from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.learner import CropLearner  # noqa: E402
from errand_train.detector.proposal_table import refined_proposals  # noqa: E402
from errand_train.detector.quantisation import quantise  # noqa: E402
from skills.perception.detector.boxes import Scales, halve  # noqa: E402
from skills.perception.detector.model_files import (  # noqa: E402
    CLASSIFIER,
    CROP_PX,
    load_model,
    load_network,
)

onnx = pytest.importorskip("onnx")
CPU, NAMES = torch.device("cpu"), ("beer", "coke", "cube")
SHIFT = (0.5, 0.0, -0.5)
Given = tuple["torch.Tensor", "torch.Tensor", "torch.Tensor"]


def new_learner(seed):
    return CropLearner.new(len(NAMES), seed, CPU, classifier=True)


def given(count):
    """Crops, boxes in them and logits."""
    torch.manual_seed(1)
    boxes = torch.tensor([[22.0, 40.0, 106.0, 88.0]]).repeat(count, 1)
    return torch.rand(count, 3, CROP_PX, CROP_PX), boxes, torch.randn(count, len(NAMES))


def batch_of(count):
    crops, boxes, logits = given(count)
    return CropBatch(crops, boxes, logits, boxes + 4.0, torch.arange(count) % (len(NAMES) + 1) - 1)


@pytest.fixture(scope="module")
def trained():
    """A network that says something of its own."""
    torch.manual_seed(1)
    network = ClassifierNetwork(len(NAMES))
    network.backbone.begin_with_imagenet()
    with torch.no_grad():
        for layer in (network.scores, network.sides):
            layer.weight.normal_(0.0, 0.1)
        network.place.weight.normal_(0.0, 0.1)
        network.train()
        for _ in range(15):
            network(*given(4))
    return network.eval()


@pytest.fixture(scope="module")
def exported(trained, tmp_path_factory):
    """Its file, with scores shifted."""
    file = tmp_path_factory.mktemp("exported") / "t.onnx"
    export(trained, file, class_names=NAMES, facts={"score_offsets": str(list(SHIFT))}, score_offsets=SHIFT)
    return file


def test_a_fresh_network_says_what_the_refinement_network_said():
    network, (crops, boxes, logits) = ClassifierNetwork(len(NAMES)).eval(), given(2)
    with torch.no_grad():
        found, found_boxes = network(crops, boxes, logits)
    assert torch.allclose(found, logits)
    assert torch.allclose(found_boxes, boxes)


def test_classifier_starts_from_imagenets_weights_and_trains_all_but_the_early_layers():
    learner = new_learner(1)
    learner.begin(Path("none"), [])
    learner.keep_early()
    before = {name: value.clone() for name, value in learner.network.state_dict().items()}
    assert float(before["backbone.stem.0.0.weight"].abs().max()) > 0.5
    for _ in range(2):  # what it adds is nothing at first, and so are the first gradients of what is before
        learner.step(batch_of(4), 1e-3)
    after = learner.network.state_dict()
    still = {name for name in before if name.startswith(("backbone.stem.", "backbone.stage8."))}
    assert all(torch.equal(before[name], after[name]) for name in still)
    trained = {name for name in before if name.startswith(("backbone.stage16.", "backbone.stage32."))}
    trained = {name for name in trained if name.endswith(".0.weight")}
    assert len(trained) == 3 * 11
    assert not any(torch.equal(before[name], after[name]) for name in trained)


def test_crops_are_learnt_by_heart():
    learner, batch = new_learner(1), batch_of(3)
    learner.begin(Path("none"), [])
    learner.keep_early()
    found = [learner.step(batch, 4e-3)[0] for _ in range(10)]
    assert np.mean(found[-5:]) < 0.6 * np.mean(found[:3])


def test_the_exported_file_says_what_the_network_says_and_learning_goes_on_from_it(trained, exported):
    crops, boxes, logits = given(3)
    as_bytes = (crops * 255).round()
    told = {
        "chips": as_bytes.permute(0, 2, 3, 1).numpy().astype(np.uint8),
        "regions": boxes.numpy(),
        "logits": logits.numpy(),
    }
    found, scores = load_network(exported, CLASSIFIER).session.run(["boxes", "scores"], told)
    in_use = fuse(trained)
    in_use.stop_learning()
    with torch.no_grad():
        expected, expected_boxes = in_use(as_bytes / 255, boxes, logits)
    assert np.abs(found - expected_boxes.numpy()).max() < 0.05
    assert np.abs(scores - (expected + torch.tensor(SHIFT)).sigmoid().numpy()).max() < 5e-3
    learner = new_learner(2)
    learner.start_from(exported, [batch_of(4)])
    with torch.no_grad():
        again, boxes_again = learner.network.eval()(as_bytes / 255, boxes, logits)
        before, boxes_before = trained(as_bytes / 255, boxes, logits)
    assert torch.allclose(again, before, atol=5e-2)
    assert torch.allclose(boxes_again, boxes_before, atol=0.2)


def test_in_use_it_adds_a_part_of_what_it_adds_while_learning(trained):
    network, (crops, boxes, logits) = deepcopy(trained), given(3)
    with torch.no_grad():
        learning, learning_boxes = network(crops, boxes, logits)
        network.stop_learning()
        used, used_boxes = network(crops, boxes, logits)
    assert not torch.allclose(learning, logits, atol=0.1)
    assert torch.allclose(used, logits.lerp(learning, USED), atol=1e-5)
    assert torch.allclose(used_boxes, boxes.lerp(learning_boxes, USED), atol=0.3)


def test_its_file_needs_no_padding_beside_convolutions_and_runs_in_8_bits(exported):
    model = onnx.load(exported)
    assert "Pad" not in {node.op_type for node in model.graph.node}
    crops, boxes, logits = given(3)
    told = {
        "chips": (crops * 255).permute(0, 2, 3, 1).numpy().astype(np.uint8),
        "regions": boxes.numpy(),
        "logits": logits.numpy(),
    }
    made = quantise(model, [told])
    kinds = {one.data_type for one in made.graph.initializer if one.name.endswith("weight_quantized")}
    assert kinds == {onnx.TensorProto.INT8}
    # 16 blocks of 3 convolutions, of which the first has 2; neither the first of all, nor this block, nor the last two
    assert sum(one.name.endswith("weight_quantized") for one in made.graph.initializer) == 45


def test_normalisation_becomes_part_of_the_layers(trained):
    crops, boxes, logits = given(2)
    with torch.no_grad():
        for mine, theirs in zip(fuse(trained)(crops, boxes, logits), trained(crops, boxes, logits), strict=True):
            assert torch.allclose(mine, theirs, atol=1e-2)


# first: a box at (100, 100, 200, 200); the second makes it a tenth smaller, and sees the red there as a beer
def test_training_crops_are_the_refinement_networks_proposals(tmp_path):
    picture = picture_of(("hammer", 0.2, (100, 100, 200, 200)))
    picture[50:250, 50:250, 0] = 255
    look = partial(refined_proposals, load_model(write_pair(tmp_path / "m.onnx")))
    found = look(Scales(picture, halve(picture)))
    assert found.boxes.round().tolist() == [[105.0, 105.0, 195.0, 195.0]]
    assert found.logits.argmax(axis=1).tolist() == [CLASSES.index("beer")]


def test_classifier_training_needs_a_refinement_network(tmp_path):
    pair = load_model(write_pair(tmp_path / "m.onnx"), networks=1)
    with pytest.raises(ValueError, match="no refinement network"):
        refined_proposals(pair, Scales(picture_of(), halve(picture_of())))


def test_learning_goes_on_from_no_refinement_networks_file(tmp_path):
    write_pair(tmp_path / "m.onnx")
    with pytest.raises(TrainingDataError, match=r"m_refinement\.onnx.*start again without it"):
        new_learner(2).start_from(tmp_path / "m_refinement.onnx", [])
