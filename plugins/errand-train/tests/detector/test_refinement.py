"""The parts of the refinement network's training; skipped without torch."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from random_networks import random_network

from tests.skills.tiny_detector import CLASSES, picture_of, write_model

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from errand_train.detector.crop_batches import CropFeed  # noqa: E402
from errand_train.detector.crop_network import coverage, shift_boxes  # noqa: E402
from errand_train.detector.export import export  # noqa: E402
from errand_train.detector.labels import Labels, TrainingDataError, TrainingPicture  # noqa: E402
from errand_train.detector.learner import CropLearner, ProposalLearner  # noqa: E402
from errand_train.detector.losses import crop_losses  # noqa: E402
from errand_train.detector.network import Residual  # noqa: E402
from errand_train.detector.proposal_table import ProposalTable, build_table, first_proposals  # noqa: E402
from errand_train.detector.refinement_network import RefinementNetwork, best_cell_about  # noqa: E402
from errand_train.detector.store import PictureStore  # noqa: E402
from skills.perception.detector.boxes import Scales, halve  # noqa: E402
from skills.perception.detector.model_files import CROP_PX, load_model, refinement_file  # noqa: E402

CPU = torch.device("cpu")
THING, FAR = (100, 100, 200, 200), (300, 300, 400, 400)


def new_learner(seed):
    return CropLearner.new(len(CLASSES), seed, CPU, classifier=False)


def labelled(*boxes, ignored=False):
    corners = [np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1)], np.float32) for u0, v0, u1, v1 in boxes]
    count = len(corners)
    labels = Labels(tuple(corners), np.arange(count), np.ones(count, np.float32), np.full(count, ignored))
    return TrainingPicture(Path("none"), labels)


def table(file, picture, *things):
    look = partial(first_proposals, load_model(write_model(file)))
    seen = picture_of(*things)
    return build_table(look, [(Scales(seen, halve(seen)), picture.labels)])


def test_a_proposal_on_an_object_has_its_class_and_box_as_target(tmp_path):
    found = table(tmp_path / "m.onnx", labelled(THING), ("coke", 0.6, (110, 100, 200, 200)), ("coke", 0.5, FAR))
    assert found.classes.tolist() == [0, -1]
    assert found.wanted.tolist() == [list(THING), list(FAR)]
    assert found.boxes.tolist() == [[110, 100, 200, 200], list(FAR)]
    assert found.pictures.tolist() == [0, 0]


# share of the thing's box that the place takes   0.36 of 100 x 100 -> near, 0.25 -> not near
@pytest.mark.parametrize(("side", "near"), [(60, True), (50, False)])
def test_a_proposal_is_on_an_object_from_an_overlap_of_0_3_on(tmp_path, side, near):
    found = table(tmp_path / "m.onnx", labelled(THING), ("beer", 0.6, (100, 100, 100 + side, 100 + side)))
    assert (found.classes.tolist() == [0]) is near


def test_proposals_on_ignored_labels_are_left_out(tmp_path):
    part = ("beer", 0.5, (120, 120, 150, 150))
    found = table(tmp_path / "m.onnx", labelled(THING, ignored=True), ("beer", 0.6, THING), part, ("coke", 0.4, FAR))
    assert found.boxes.tolist() == [list(FAR)]


def test_a_table_is_read_as_it_was_written(tmp_path):
    found = table(tmp_path / "m.onnx", labelled(THING), ("coke", 0.6, THING))
    found.save(tmp_path / "table.npz")
    again = ProposalTable.read(tmp_path / "table.npz")
    assert all(np.array_equal(getattr(found, name), getattr(again, name)) for name in vars(found))


@pytest.fixture
def feed():
    """A bright thing in one of two dark pictures, and as many places on it as elsewhere."""
    dark = np.full((480, 640, 3), 40, np.uint8)
    bright = dark.copy()
    bright[100:200, 100:200] = 220
    rows = 8
    on = np.arange(rows) % 2 == 0
    boxes = np.where(on[:, None], THING, FAR).astype(np.float32)
    logits = np.zeros((rows, len(CLASSES)), np.float32)
    classes = np.where(on, 1, -1)
    told = ProposalTable(np.where(on, 0, 1), boxes, logits, boxes, classes)
    store = PictureStore(np.stack([bright, dark]), np.stack([halve(bright), halve(dark)]))
    return CropFeed(told, store, 5)


def test_half_of_a_batch_shows_objects(feed):
    batch = feed.batch(0, 8)
    assert (batch.classes >= 0).sum() == 4
    assert batch.crops.shape == (8, 3, CROP_PX, CROP_PX)


def test_the_boxes_of_a_rotated_crop_are_on_the_object(feed):
    for start in range(0, 64, 8):
        batch = feed.batch(start, 8)
        for crop, box in zip(batch.crops[:4], batch.wanted[:4], strict=True):
            inside = torch.zeros(CROP_PX, CROP_PX, dtype=torch.bool)
            u0, v0, u1, v1 = (round(float(value)) for value in box)
            inside[max(v0, 0) : v1, max(u0, 0) : u1] = True
            assert crop.mean(0)[inside].mean() > crop.mean(0)[~inside].mean() + 0.1


def test_the_same_seed_gives_the_same_crops(feed):
    again = CropFeed(feed.table, feed.store, 5).batch(8, 8)
    assert torch.equal(feed.batch(8, 8).crops, again.crops)
    assert not torch.equal(feed.batch(0, 8).crops, again.crops)


def test_a_fresh_network_says_the_mean_of_what_the_proposal_network_said_and_sees_in_the_crop():
    network = RefinementNetwork(3).eval()
    crops, boxes, first = (
        torch.rand(1, 3, CROP_PX, CROP_PX),
        torch.tensor([[22.0, 40.0, 106.0, 88.0]]),
        torch.ones(1, 3),
    )
    with torch.no_grad():
        logits, found = network(crops, boxes, first)
        seen, seen_boxes = best_cell_about(boxes, *network.detector(crops))
    assert torch.allclose(logits, (first + seen) / 2, atol=1e-4)
    assert torch.allclose(found, (boxes + seen_boxes) / 2, atol=1e-3)


def test_an_untrained_residual_block_is_the_identity():
    block, given = Residual(4).train(), torch.rand(2, 4, 8, 8)
    assert torch.equal(block(given), given)
    block(given).square().sum().backward()
    assert block.second[1].weight.grad.abs().min() > 0


# cell                  score  overlap  product
# on the box             0.5    1.0      0.5
# surer, half beside     0.7    1/3      0.23   surest of those that share less
# surest, elsewhere      0.9    0        0
def test_the_cell_counts_that_is_surest_of_a_box_about_the_places():
    place = torch.tensor([[0.0, 0.0, 10.0, 10.0]])
    found = torch.tensor([[[50.0, 50.0, 60.0, 60.0], [5.0, 0.0, 15.0, 10.0], [0.0, 0.0, 10.0, 10.0]]])
    logits = torch.tensor([0.9, 0.7, 0.5]).logit()[None, :, None]
    seen, box = best_cell_about(place, logits, found)
    assert seen.sigmoid().item() == pytest.approx(0.5)
    assert box.tolist() == [[0.0, 0.0, 10.0, 10.0]]


def test_cells_tell_the_share_that_a_box_covers():
    share = coverage(torch.tensor([[4.0, 8.0, 24.0, 20.0]]))[0, 0]
    assert share[1, :4].tolist() == [0.5, 1.0, 1.0, 0.0]
    assert share[2, 1] == 0.5
    assert float(share.sum()) * 64 == pytest.approx(20 * 12)


def test_sides_move_and_stretch_a_box():
    half = float(np.log(0.5))
    found = shift_boxes(torch.tensor([[10.0, 10.0, 30.0, 50.0]]), torch.tensor([[0.5, 0.0, half, 0.0]]))
    assert found[0].tolist() == pytest.approx([25.0, 10.0, 35.0, 50.0])


def test_scores_want_to_be_as_high_as_the_box_is_good():
    wanted, classes = torch.tensor([[0.0, 0.0, 10.0, 10.0]]), torch.tensor([1])
    half = torch.tensor([[0.0, 0.0, 10.0, 5.0]])
    told = {score: crop_losses(torch.tensor([[-9.0, score]]), half, wanted, classes) for score in (-2.0, 0.0, 2.0)}
    assert told[0.0].scores < min(told[-2.0].scores, told[2.0].scores)
    assert told[0.0].boxes > crop_losses(torch.tensor([[-9.0, 0.0]]), wanted, wanted, classes).boxes


def test_a_background_crop_wants_low_scores_and_no_box():
    box, none = torch.tensor([[0.0, 0.0, 10.0, 10.0]]), torch.tensor([-1])
    low, high = (crop_losses(torch.full((1, 2), score), box, box + 5, none) for score in (-5.0, 5.0))
    assert low.scores < high.scores
    assert low.boxes == high.boxes == 0.0


@pytest.mark.usefixtures("small_network")
def test_crops_are_learnt_by_heart(feed):
    learner = new_learner(1)
    batch = feed.batch(0, 8)
    found = [learner.step(batch, 4e-3)[0] for _ in range(20)]
    assert np.mean(found[-5:]) < 0.5 * np.mean(found[:5])


def unsettled(classes):
    torch.manual_seed(3)
    network = RefinementNetwork(classes)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm1d | torch.nn.BatchNorm2d):
            module.running_mean.normal_(0.0, 0.1)
            module.running_var.uniform_(0.5, 2.0)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
        if isinstance(module, torch.nn.Linear):
            torch.nn.init.normal_(module.weight, 0.0, 0.05)
    with torch.no_grad():  # a file keeps only one of weights that are equal
        for weight in network.parameters():
            weight.add_(1e-3 * torch.randn_like(weight))
    return network.eval()


def test_the_exported_file_says_what_the_network_says(tmp_path):
    first = write_model(tmp_path / "m.onnx")
    facts = {"first": load_model(first).proposal.digest}
    network = unsettled(len(CLASSES))
    for head in network.detector.heads:  # no two cells are equally sure
        torch.nn.init.normal_(head.scores.weight, 0.0, 1.0)
    export(network, refinement_file(first), class_names=CLASSES, facts=facts, score_offsets=(0.5, 0.0, -0.5))
    random = np.random.default_rng(0)
    crops = random.integers(0, 256, (3, CROP_PX, CROP_PX, 3), dtype=np.uint8)
    boxes = np.array([[22, 40, 106, 88], [30, 22, 80, 106], [40, 40, 90, 90]], np.float32)
    logits = random.normal(0, 2, (3, len(CLASSES))).astype(np.float32)
    second = load_model(first).refinement
    assert second is not None
    given = {"chips": crops, "regions": boxes, "logits": logits}
    found, scores = second.session.run(["boxes", "scores"], given)
    with torch.no_grad():
        expected, moved_to = network(
            torch.from_numpy(crops).permute(0, 3, 1, 2).float() / 255, torch.from_numpy(boxes), torch.from_numpy(logits)
        )
    shifted = (expected + torch.tensor([0.5, 0.0, -0.5])).sigmoid()
    assert np.abs(found - moved_to.numpy()).max() < 0.01
    assert np.abs(scores - shifted.numpy()).max() < 1e-3


@pytest.mark.usefixtures("small_network")
def test_learning_begins_with_the_proposal_networks_weights_and_keeps_its_early_layers(tmp_path, feed):
    first, file = random_network(1, len(CLASSES)), tmp_path / "m.onnx"
    export(first, file, class_names=CLASSES, facts={})
    batch, learner = feed.batch(0, 8), new_learner(2)
    learner.begin(file, [batch])
    with torch.no_grad():
        for mine, theirs in zip(learner.network.detector.eval()(batch.crops), first(batch.crops), strict=True):
            assert torch.allclose(mine, theirs, atol=1e-2)
    learner.keep_early()
    before = {name: value.clone() for name, value in learner.network.state_dict().items()}
    learner.step(batch, 1e-3)
    after, kept = learner.network.state_dict(), ("detector.backbone.stem.", "detector.backbone.stage8.")
    assert all(torch.equal(before[name], after[name]) for name in before if name.startswith(kept))
    assert not torch.equal(before["detector.neck.down8.mix.0.weight"], after["detector.neck.down8.mix.0.weight"])


@pytest.mark.usefixtures("small_network")
def test_learning_goes_on_from_a_refinement_networks_file(tmp_path, feed):
    file, network, batch = tmp_path / "r.onnx", unsettled(len(CLASSES)), feed.batch(0, 8)
    shift = (0.5, 0.0, -0.5)
    export(network, file, class_names=CLASSES, facts={"score_offsets": str(list(shift))}, score_offsets=shift)
    learner = new_learner(2)
    learner.start_from(file, [batch])
    for mine in (learner.network.eval(), learner.average.eval()):
        with torch.no_grad():
            given = batch.crops, batch.boxes, batch.logits
            (logits, boxes), (expected, expected_boxes) = mine(*given), network(*given)
        assert torch.allclose(logits, expected, atol=2e-2)
        assert torch.allclose(boxes, expected_boxes, atol=0.3)
    assert all(
        float(module.running_var.min()) < 0.9
        for module in learner.network.modules()
        if isinstance(module, torch.nn.BatchNorm1d | torch.nn.BatchNorm2d)
    )


@pytest.mark.usefixtures("small_network")
def test_learning_goes_on_from_no_proposal_networks_file(tmp_path, feed):
    export(random_network(1, len(CLASSES)), tmp_path / "m.onnx", class_names=CLASSES, facts={})
    with pytest.raises(TrainingDataError, match=r"m\.onnx.*start again without it"):
        new_learner(2).start_from(tmp_path / "m.onnx", [feed.batch(0, 8)])


@pytest.mark.usefixtures("small_network")
@pytest.mark.parametrize("go_on", [CropLearner.restore, CropLearner.start_from_checkpoint])
def test_a_checkpoint_of_the_other_network_is_named(tmp_path, go_on):
    ProposalLearner.new(len(CLASSES), 1, CPU).save(tmp_path / "checkpoint.pt")
    with pytest.raises(TrainingDataError, match="another network"):
        go_on(new_learner(1), tmp_path / "checkpoint.pt")
