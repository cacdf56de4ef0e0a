# SPDX-License-Identifier: Apache-2.0
"""The module of 3D Slicer: its numbers and shapes, and the scene of a measured case."""
import json

import numpy as np
import pytest

from slicer_cases import TURNED, scenes, shown, with_cameras  # noqa: F401


def moved(matrix, points):
    return np.asarray(points) @ matrix[:3, :3].T + matrix[:3, 3]


def random_covariance(seed=1):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    return root @ root.T


def test_chi_square_quantiles_are_those_of_tables():
    for probability, expected in ((0.5, 2.366), (0.95, 7.815), (0.99, 11.345), (0.999, 16.266)):
        assert scenes.chi_square_quantile_3(probability) == pytest.approx(expected, abs=5e-4)
    with pytest.raises(ValueError, match="between 0 and 1"):
        scenes.chi_square_quantile_3(1)


def test_transform_in_ras_moves_ras_points_as_the_one_in_lps_moves_lps_points():
    points = np.random.default_rng(2).normal(size=(5, 3))
    in_ras = moved(scenes.ras_transform(TURNED), scenes.ras_from_lps(points))
    assert in_ras == pytest.approx(scenes.ras_from_lps(moved(TURNED, points)))
    assert scenes.ras_transform(scenes.ras_transform(TURNED)) == pytest.approx(TURNED)
    assert scenes.ras_from_lps([1, 2, 3]) == pytest.approx([-1, -2, 3])


def test_model_stays_in_its_patient_frame_where_that_is_the_scenes():
    scene = scenes.Scene("s", models=[scenes.Model("femur", "accept", TURNED)])
    world = scenes.shown_from_frame(scene, "femur")
    assert world @ scenes.ras_transform(TURNED) == pytest.approx(np.eye(4), abs=1e-12)
    assert scenes.shown_from_frame(scene, None) == pytest.approx(np.eye(4))
    with pytest.raises(scenes.SceneError, match='"tibia".*femur'):
        scenes.shown_from_frame(scene, "tibia")


def test_corners_of_the_ellipsoid_lie_on_the_95_percent_region():
    covariance, centre = random_covariance(), np.array([1.0, -2, 30])
    corners, triangles = scenes.ellipsoid_mesh(centre, covariance)
    distance = np.einsum("ij,jk,ik->i", corners - centre, np.linalg.inv(covariance), corners - centre)
    assert distance == pytest.approx(np.full(len(corners), 7.8147), abs=1e-3)
    a, b, c = (corners[triangles[:, i]] - centre for i in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    assert (volumes > 0).all()  # outward
    whole = 4 / 3 * np.pi * np.prod(scenes.ellipsoid_axes(covariance)[0])
    assert volumes.sum() == pytest.approx(whole, rel=0.05) and volumes.sum() < whole


def test_mesh_of_the_ellipsoid_is_closed():
    _, triangles = scenes.ellipsoid_mesh(np.zeros(3), np.eye(3), rings=5, sectors=7)
    edges = [(t[i], t[(i + 1) % 3]) for t in triangles.tolist() for i in range(3)]
    assert len(set(edges)) == len(edges) and all((b, a) in set(edges) for a, b in edges)


def test_region_holds_95_percent_of_draws():
    covariance = random_covariance(3)
    draws = np.random.default_rng(4).multivariate_normal(np.zeros(3), covariance, 20000)
    semi_axes, directions = scenes.ellipsoid_axes(covariance)
    inside = (((draws @ directions) / semi_axes) ** 2).sum(axis=1) < 1
    assert inside.mean() == pytest.approx(0.95, abs=0.006)
    assert np.linalg.det(directions) == pytest.approx(1)


def test_enlarged_region_has_its_centre_and_its_shape():
    covariance, centre = random_covariance(5), np.array([1.0, 2, 3])
    once, triangles = scenes.ellipsoid_mesh(centre, covariance)
    points = [scenes.Point("P", centre, covariance), scenes.Point("Q", centre, None), scenes.Point("R", -centre, covariance)]
    corners, joined = scenes.regions_mesh(points, enlarged=20)
    assert corners[:len(once)] - centre == pytest.approx(20 * (once - centre))
    assert (joined[len(triangles):] == triangles + len(once)).all() and joined.max() == len(corners) - 1
    assert scenes.regions_mesh(points[1:2]) is None


def test_flat_covariance_gives_a_flat_region_and_a_negative_one_is_refused():
    assert scenes.ellipsoid_axes(np.diag([0, 1, 1]))[0][0] == 0
    with pytest.raises(scenes.SceneError, match="not positive"):
        scenes.ellipsoid_axes(np.diag([-1, 1, 1]))


@pytest.mark.parametrize("mirrored", [False, True])
def test_pixels_lie_on_their_rays(mirrored):
    k = np.array([[-2000.0 if mirrored else 2000, 0, 310], [0, 2100, 250], [0, 0, 1]])
    view = scenes.View("AP", k, TURNED, 640, 480, 1000.0)
    place = scenes.on_detector(view, 17, 401)
    projected = k @ moved(TURNED, place)
    assert projected[:2] / projected[2] == pytest.approx([17, 401]) and projected[2] == pytest.approx(1000)
    assert moved(TURNED, scenes.source_of(view)) == pytest.approx(np.zeros(3))
    corners, lines = scenes.frustum(view)
    assert corners.shape == (5, 3) and lines.max() == 4
    middle = scenes.image_corners(view).mean(axis=0)
    assert middle == pytest.approx(scenes.on_detector(view, 319.5, 239.5))


def test_scene_has_what_the_result_has(shown, result):
    folder, scene = shown
    located = [point.name for point in result.points if point.xyz_mm is not None]
    assert [point.name for point in scene.points] == [*located, "bone: entry"]
    assert scene.points[0].xyz_mm == pytest.approx(result.points[0].xyz_mm)
    assert scene.points[0].covariance_mm2 == pytest.approx(result.points[0].covariance_mm2)
    assert [(t.name, t.start.name, t.end.name) for t in scene.tunnels] == [("a", "T1", "T2")]
    assert [(m.name, m.decision) for m in scene.models] == [("bone", "accept"), ("stack", "accept"), ("cup", "warn")]
    assert scene.model("cup").surface == folder / "cup.stl"
    assert scene.model("stack").ijk_to_ras == pytest.approx(np.diag([-0.4, -0.4, 0.6, 1]))
    said = [message for message in scene.messages if message.startswith(("cup", "lost"))]
    assert said == ["cup: close", "cup: far", "lost: registration refused, not shown: no fit"]


def test_cameras_of_the_scene_project_as_the_calibration_does(shown, result):
    for view in shown[1].views:
        camera = result.calibration.view(view.name) if hasattr(result.calibration, "view") else None
        raw = next(v for v in result.to_dict()["views"] if v["name"] == view.name)
        projection = view.intrinsics @ view.camera_from_world[:3]
        assert projection == pytest.approx(np.array(raw["projection"]), rel=1e-6, abs=1e-6), camera
        assert view.image and view.image.is_file()


def test_refused_result_and_missing_files_are_named(tmp_path):
    with pytest.raises(scenes.SceneError, match="case.json.*No such file"):
        scenes.read_scene(tmp_path, tmp_path)
    (tmp_path / "case.json").write_text("{}")
    (tmp_path / "result.json").write_text("{")
    with pytest.raises(scenes.SceneError, match="result.json: not JSON"):
        scenes.read_scene(tmp_path, tmp_path)
    refused = {"failure": {"code": "no_calibrator", "message": "none found"}, "points": [], "views": [{"name": "AP", "intrinsics": None}]}
    (tmp_path / "result.json").write_text(json.dumps(refused))
    assert scenes.read_scene(tmp_path, tmp_path).messages == ["refused: no_calibrator: none found", "AP: not calibrated"]


@pytest.mark.parametrize("image_size", [[640, 480], None])
def test_cameras_of_another_program_are_shown_beside_the_registration(tmp_path, image_size):
    with_cameras(tmp_path, image_size)
    scene = scenes.read_scene(tmp_path, tmp_path)
    view, = scene.views
    assert scene.frame == "world"
    assert (view.width, view.height, view.detector_mm) == (640, 480, 1400)
    assert scenes.source_of(view) == pytest.approx([0, 0, -700])
    (tmp_path / "cameras.json").unlink()
    assert "cameras are not shown" in scenes.read_scene(tmp_path, tmp_path).messages[0]
