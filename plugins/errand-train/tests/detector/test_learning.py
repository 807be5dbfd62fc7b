"""The parts of training that need torch; skipped without it."""

import numpy as np
import pytest
from random_networks import random_network

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from errand_train.detector.assign import assign  # noqa: E402
from errand_train.detector.batches import batch_of, truth_of  # noqa: E402
from errand_train.detector.canvases import Canvas  # noqa: E402
from errand_train.detector.export import export, fuse  # noqa: E402
from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.learner import Learner, ProposalLearner  # noqa: E402
from errand_train.detector.losses import Losses, complete_overlap, losses  # noqa: E402
from errand_train.detector.network import cells  # noqa: E402
from errand_train.detector.overlaps import overlap  # noqa: E402
from errand_train.detector.placing import Targets  # noqa: E402
from skills.perception.detector.model_files import load_model  # noqa: E402

NAMES = ("beer", "coke", "extinguisher", "hammer", "screwdriver", "wrench", "person", "cylinder", "cube")
CPU = torch.device("cpu")


def targets(*boxes, classes=(), ignored=False):
    chosen = np.array(classes or range(len(boxes)), dtype=np.int64)
    return Targets(np.array(boxes, np.float32).reshape(-1, 4), chosen, np.full(len(boxes), ignored))


def assigned(scores, boxes, middles, one):
    return assign(scores, boxes, middles, truth_of([one]), most_cells=4)


def at_every_cell(side):
    """Middles of the cells of a 64 x 64 picture, and square boxes about them."""
    middles, _ = cells(64, 64)
    return middles, torch.cat([middles - side / 2, middles + side / 2], dim=1)[None]


def test_cells_come_in_the_networks_order():
    middles, steps = cells(64, 96)
    assert middles.shape == (8 * 12 + 4 * 6 + 2 * 3, 2)
    assert middles[0].tolist() == [4, 4]
    assert middles[1].tolist() == [12, 4]
    assert middles[96].tolist() == [8, 8]
    assert steps[[0, 95, 96, 119, 120]].tolist() == [8, 8, 16, 16, 32]
    logits, boxes = random_network(0, len(NAMES))(torch.rand(1, 3, 64, 96))
    assert logits.shape == (1, len(middles), len(NAMES))
    assert ((boxes[0, :, :2] < middles) & (middles < boxes[0, :, 2:])).all()


def test_the_best_fitting_cells_are_assigned_to_an_object():
    middles, boxes = at_every_cell(16.0)
    scores = torch.full((1, len(middles), 2), 0.5)
    found = assigned(scores, boxes, middles, targets((20, 20, 36, 36), classes=(1,)))
    answering = torch.nonzero(found.objects[0] == 0).flatten()
    assert 1 <= len(answering) <= 4
    overlaps = overlap(torch.tensor([20.0, 20, 36, 36]), boxes)[0]
    assert overlaps[answering].min() >= overlaps.topk(6).values[-1]
    assert found.quality[0].max() == pytest.approx(float(overlaps[answering].max()), abs=1e-4)
    assert (found.quality[0][found.objects[0] < 0] == 0).all()


def test_a_cell_in_two_objects_is_assigned_to_the_better_fit():
    middles, boxes = at_every_cell(16.0)
    scores = torch.full((1, len(middles), 2), 0.5)
    found = assigned(scores, boxes, middles, targets((0, 0, 64, 64), (20, 20, 36, 36)))
    assert set(found.objects[0].tolist()) == {-1, 0, 1}
    at_28 = torch.nonzero((middles == 28).all(dim=1)).flatten()
    assert found.objects[0, at_28].tolist() == [1]


def test_an_object_smaller_than_a_cell_gets_one():
    middles, boxes = at_every_cell(8.0)
    scores = torch.full((1, len(middles), 1), 0.5)
    found = assigned(scores, boxes, middles, targets((15, 15, 17, 17)))
    assert (found.objects[0] == 0).any()


def test_cells_in_what_is_ignored_are_left_out_of_the_loss():
    middles, boxes = at_every_cell(16.0)
    logits = torch.full((1, len(middles), 1), 3.0)
    found = assigned(logits.sigmoid(), boxes, middles, targets((0, 0, 64, 64), ignored=True))
    assert found.left_out.all()
    assert (found.objects < 0).all()
    lost = losses(logits, boxes, middles, truth_of([targets((0, 0, 64, 64), ignored=True)]))
    assert float(lost.total) == 0.0
    assert float(losses(logits, boxes, middles, truth_of([targets()])).total) > 1.0


# first, second -> overlap less penalties
@pytest.mark.parametrize(
    ("first", "second", "low", "high"),
    [
        ((0, 0, 10, 10), (0, 0, 10, 10), 0.999, 1.001),
        ((0, 0, 10, 10), (5, 0, 15, 10), 0.2, 1 / 3),
        ((0, 0, 10, 10), (20, 0, 30, 10), -1.0, -0.3),
        ((0, 0, 10, 10), (0, 0, 20, 5), 0.0, 1 / 3),
    ],
)
def test_boxes_apart_or_of_other_shape_overlap_less(first, second, low, high):
    value = float(complete_overlap(torch.tensor([first]).float(), torch.tensor([second]).float()))
    assert low <= value <= high


def test_the_average_follows_fast_at_first():
    learner = Learner(torch.nn.Linear(1, 1), CPU)

    def step_to(value):
        with torch.no_grad():
            learner.network.weight.fill_(value)
        weight = learner.network.weight
        learner.take_step(lambda: Losses((weight * 0.0).sum(), (weight * 0.0).sum()), 0.0)
        return float(learner.average.weight.detach())

    for _ in range(200):
        close = step_to(5.0)
    assert close == pytest.approx(5.0, abs=0.01)
    assert step_to(0.0) > 4.0


def test_without_normalisation_the_network_says_the_same():
    network, pictures = random_network(0, len(NAMES)), torch.rand(2, 3, 64, 64)
    with torch.no_grad():
        for mine, theirs in zip(network(pictures), fuse(network)(pictures), strict=True):
            assert torch.allclose(mine, theirs, atol=1e-3)
    assert not any(isinstance(module, torch.nn.BatchNorm2d) for module in fuse(network).modules())


def test_the_exported_file_says_what_the_network_says(tmp_path):
    network, file = random_network(0, len(NAMES)), tmp_path / "made.onnx"
    export(network, file, class_names=NAMES, facts={"seed": "1", "data": "abc"})
    model = load_model(file)
    assert model.class_names == NAMES
    images = np.random.default_rng(0).integers(0, 256, (2, 480, 640, 3), dtype=np.uint8)
    boxes, scores = model.proposal.session.run(["boxes", "scores"], {"images": images})
    with torch.no_grad():
        logits, expected = network(torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255)
    assert np.abs(boxes - expected.numpy()).max() < 0.01
    assert np.abs(scores - logits.sigmoid().numpy()).max() < 1e-4
    assert file.stat().st_size < 12_000_000


def trained(learner, steps):
    """Losses in training four pictures with a bright rectangle each."""
    canvases = []
    for k in range(4):
        picture = np.full((64, 64, 3), 40, dtype=np.uint8)
        picture[8 + 4 * k : 40, 12 : 52 - 4 * k] = (250, 60 * k, 30)
        canvases.append(Canvas(picture, targets((12, 8 + 4 * k, 52 - 4 * k, 40), classes=(k,))))
    batch = batch_of(canvases)
    return [sum(learner.step(batch, 1e-2)) for _ in range(steps)]


@pytest.mark.usefixtures("small_network")
def test_four_pictures_are_learnt_by_heart():
    learner = ProposalLearner.new(len(NAMES), 1, CPU)
    found = trained(learner, 30)
    assert np.mean(found[-5:]) < 0.25 * np.mean(found[:5])


@pytest.mark.usefixtures("small_network")
def test_a_resumed_training_goes_on_to_the_bit(tmp_path):
    torch.set_num_threads(1)
    whole = ProposalLearner.new(len(NAMES), 1, CPU)
    trained(whole, 4)
    part = ProposalLearner.new(len(NAMES), 1, CPU)
    trained(part, 2)
    part.progress.taken = 8
    part.save(tmp_path / "checkpoint.pt")
    resumed = ProposalLearner.new(len(NAMES), 2, CPU)
    resumed.restore(tmp_path / "checkpoint.pt")
    trained(resumed, 2)
    assert resumed.progress.taken == 8
    for mine, theirs in ((whole.network, resumed.network), (whole.average, resumed.average)):
        pairs = zip(mine.state_dict().values(), theirs.state_dict().values(), strict=True)
        assert all(torch.equal(one, other) for one, other in pairs)


@pytest.mark.usefixtures("small_network")
@pytest.mark.parametrize("content", [b"", b"no checkpoint"])
def test_a_damaged_checkpoint_is_named(tmp_path, content):
    file = tmp_path / "checkpoint.pt"
    file.write_bytes(content)
    with pytest.raises(TrainingDataError, match=r"checkpoint\.pt"):
        ProposalLearner.new(len(NAMES), 1, CPU).restore(file)
