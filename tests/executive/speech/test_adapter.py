import numpy as np
import pytest

from executive.speech import adapter
from executive.speech.adapter import Adapter, LowRank, packaged_adapter, read_adapter, read_model_file
from executive.speech.whisper import BASE_SHA256
from skills.inputs.errors import InputError

BASE = "0123"
DRAW = np.random.default_rng(1)
WEIGHT = DRAW.normal(size=(6, 4)).astype("<f2")
CONVOLUTION = DRAW.normal(size=(5, 2, 3)).astype("<f2")


def _low_rank(outputs, inputs, rank=2):
    return LowRank(DRAW.normal(size=(outputs, rank)).astype("<f2"), DRAW.normal(size=(rank, inputs)).astype("<f2"))


@pytest.fixture
def weights(model_bin):
    return read_model_file(bytearray(model_bin({"a/weight": WEIGHT, "c/weight": CONVOLUTION, "b": WEIGHT[0]})))


# the changed matrix, its value and shape, and the one that stays
@pytest.mark.parametrize(
    ("name", "before", "shape", "other"),
    [("a/weight", WEIGHT, (6, 4), "c/weight"), ("c/weight", CONVOLUTION, (5, 6), "a/weight")],
    ids=["a matrix", "a convolution as a matrix of inputs times width"],
)
def test_the_product_is_added_to_its_matrix_only(weights, name, before, shape, other):
    low_rank, unchanged = _low_rank(*shape), weights[other].copy()
    Adapter({name: low_rank}).add_to(weights)
    wanted = before.reshape(shape) + low_rank.up.astype(float) @ low_rank.down.astype(float)
    np.testing.assert_allclose(weights[name].reshape(shape), wanted, atol=0.01)
    np.testing.assert_array_equal(weights[other], unchanged)


def test_it_is_the_same_when_it_is_read_again(tmp_path):
    written = Adapter({"a/weight": _low_rank(6, 4), "c/weight": _low_rank(5, 6)})
    written.save(tmp_path / "adapter.npz", base=BASE)
    read = read_adapter((tmp_path / "adapter.npz").read_bytes(), base=BASE)
    assert read.changes.keys() == written.changes.keys()
    for name, low_rank in written.changes.items():
        np.testing.assert_array_equal(read.changes[name].change(), low_rank.change())


@pytest.mark.parametrize(
    ("name", "low_rank"),
    [
        ("z/weight", _low_rank(6, 4)),
        ("a/weight", _low_rank(6, 5)),
        ("a/weight", LowRank(_low_rank(6, 4, rank=2).up, _low_rank(6, 4, rank=3).down)),
    ],
)
def test_one_that_does_not_fit_is_refused_and_changes_nothing(weights, name, low_rank):
    with pytest.raises(InputError, match=name) as refused:
        Adapter({"c/weight": _low_rank(5, 6), name: low_rank}).add_to(weights)
    assert "python -m errand_train.speech" in refused.value.hint
    np.testing.assert_array_equal(weights["c/weight"], CONVOLUTION)


@pytest.mark.parametrize(
    ("damage", "base", "message"),
    [
        (lambda content: content[: len(content) // 2], BASE, "damaged"),
        (lambda content: b"", BASE, "damaged"),
        (lambda content: b"no file of numpy's", BASE, "damaged"),
        (bytes, "4567", "other weights"),
    ],
    ids=["cut off", "empty", "another kind", "of other weights"],
)
def test_damaged_file_is_refused_with_a_hint(tmp_path, damage, base, message):
    Adapter({"a/weight": _low_rank(6, 4)}).save(tmp_path / "a.npz", base=BASE)
    with pytest.raises(InputError, match=message) as refused:
        read_adapter(damage((tmp_path / "a.npz").read_bytes()), base=base)
    assert "python -m errand_train.speech" in refused.value.hint


def test_missing_adapter_is_refused_with_a_hint(monkeypatch):
    monkeypatch.setattr(adapter, "_FILE", "nowhere.npz")
    with pytest.raises(InputError, match="missing") as refused:
        packaged_adapter(base=BASE_SHA256)
    assert "python -m errand_train.speech" in refused.value.hint


def test_the_packaged_one_belongs_to_the_published_weights():
    packaged = packaged_adapter(base=BASE_SHA256)
    assert len(packaged.changes) == 2 + 6 * 4 + 6 * 7
    assert all(0 not in low_rank.shape for low_rank in packaged.changes.values())
    assert all(np.isfinite(low_rank.change()).all() for low_rank in packaged.changes.values())


VARIABLES = {
    "encoder/weight": np.arange(12, dtype="<f2").reshape(3, 4),
    "encoder/bias": np.array([0.5, -0.5, 2.0], "<f4"),
    "decoder/heads": np.array(8, "<i2"),
    "decoder/codes": np.array([[[1, -1]]], "<i1"),
}


def test_variables_are_read_by_name_with_shape_and_type(model_bin):
    read = read_model_file(model_bin(VARIABLES))
    assert read.names == tuple(VARIABLES)
    for name, value in VARIABLES.items():
        assert read[name].dtype == value.dtype
        np.testing.assert_array_equal(read[name], value)


def test_weights_change_where_they_stand_and_nothing_else_does(model_bin):
    content = bytearray(model_bin(VARIABLES))
    read_model_file(memoryview(content))["encoder/bias"][...] = 7.0
    assert bytes(content) == model_bin(VARIABLES | {"encoder/bias": np.full(3, 7.0, "<f4")})


def test_read_only_weights_are_not_changed(model_bin):
    with pytest.raises(ValueError, match="read-only"):
        read_model_file(model_bin(VARIABLES))["encoder/bias"][...] = 7.0


# what is made of the file                          what the refusal says
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda model_bin: b"", "damaged"),
        (lambda model_bin: model_bin(VARIABLES)[:90], "damaged"),
        (lambda model_bin: model_bin(VARIABLES, version=5), "version 5"),
        (lambda model_bin: b"\xff" * 200, "version"),
    ],
    ids=["nothing", "a file cut off", "a file of another version", "something else"],
)
def test_another_file_is_refused(model_bin, change, told):
    with pytest.raises(InputError, match=told) as refused:
        read_model_file(change(model_bin))
    assert "spot-errand[speech]" in refused.value.hint
