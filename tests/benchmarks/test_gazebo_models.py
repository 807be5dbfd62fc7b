"""Gazebo models that others made are read as their SDF files say: shapes, poses, pictures, lengths."""

import cv2
import numpy as np
import pytest

from tests.benchmarks.gazebo_models import creased_normals, gazebo, visuals, written_gazebo

SDF = """<sdf version="1.6"><model name="beer"><link name="a"><pose>0 0 1 0 0 0</pose>
<visual name="can"><geometry><cylinder><radius>0.5</radius><length>2</length></cylinder></geometry>
<material><script><uri>model://beer/materials/scripts</uri><name>Beer/Label</name></script></material></visual>
<visual name="base"><pose>0 0 -1 0 0 0</pose><geometry><box><size>1 1 0.5</size></box></geometry>
<material><diffuse>0 0.5 0 1</diffuse></material></visual></link></model></sdf>"""


@pytest.fixture
def models(tmp_path):
    textures, scripts = tmp_path / "beer" / "materials" / "textures", tmp_path / "beer" / "materials" / "scripts"
    textures.mkdir(parents=True)
    scripts.mkdir()
    cv2.imwrite(str(textures / "label.png"), np.full((8, 8, 3), (0, 0, 255), np.uint8))
    (scripts / "beer.material").write_text("material Beer/Label\n{\n texture label.png\n}\n")
    (tmp_path / "beer" / "model.sdf").write_text(SDF)
    return tmp_path


def test_visuals_have_their_poses_pictures_and_colours(models):
    can, base = visuals(models / "beer")
    points = np.concatenate([patch.triangles.reshape(-1, 3) for patch in can])
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((0.0, 2.0))
    assert can[0].picture[0, 0].tolist() == [255, 0, 0]
    assert {patch.colour for patch in base} == {(0.0, 0.5, 0.0)}


def test_a_model_is_scaled_to_its_usual_length_and_has_its_class(models, tmp_path):
    made = written_gazebo(models / "beer", "beer", 0.225, 0, tmp_path / "made")
    assert made.size_m == pytest.approx((0.1, 0.1, 0.225), rel=0.02)
    assert (made.class_id > 0, made.kind) == (True, "beer")


def test_only_models_that_are_there_are_read(models, tmp_path):
    assert {category: len(found) for category, found in gazebo(tmp_path / "out", models).items()} == {"beer": 1}
    with pytest.raises(FileNotFoundError, match="holds none of the models"):
        gazebo(tmp_path / "more", tmp_path / "nowhere")


def test_a_box_keeps_its_edges():
    corner = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 0, 1], [1, 0, 0]]], dtype=float)
    np.testing.assert_allclose(np.abs(creased_normals(corner)).max(axis=2), 1.0)
