# SPDX-License-Identifier: Apache-2.0
"""The module of 3D Slicer: its numbers and shapes, and its Slicer part with a stand-in of Slicer."""
import json
import os
import pathlib
import sys
import time

import numpy as np
import pytest

import helicarm

MODULE = pathlib.Path(__file__).resolve().parents[2] / "packaging" / "slicer" / "Helicarm"
if not MODULE.is_dir():
    pytest.skip("the Slicer module lies in the source tree only", allow_module_level=True)
sys.path.insert(0, str(MODULE))

from HelicarmLib import scene as scenes  # noqa: E402
from HelicarmLib import work  # noqa: E402

TURNED = np.array([[0, -1, 0, 10.0], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]])


def moved(matrix, points):
    return np.asarray(points) @ matrix[:3, :3].T + matrix[:3, 3]


def random_covariance(seed=1):
    root = np.random.default_rng(seed).normal(size=(3, 3))
    return root @ root.T


# ---- numbers ----

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


# ---- a measured case ----

def with_model(case_folder, folder):
    """The measured case's folder and a result beside it with a model, whose registration is written by hand."""
    case = json.loads((case_folder / "case.json").read_text())
    case["tunnels"] = [{"name": "a", "start": "T1", "end": "T2"}]
    case["models"] = [{"name": "bone", "volume": "ct.nrrd", "plan": "plan.mrk.json"},
                      {"name": "stack", "volume": "stack.tif", "voxel_mm": [0.4, 0.4, 0.6]},
                      {"name": "cup", "surface": "cup.stl"}, {"name": "lost", "surface": "lost.stl"}]
    (folder / "case.json").write_text(json.dumps(case))
    for name in ("ct.nrrd", "stack.tif", "cup.stl", "plan.mrk.json"):
        (folder / name).write_bytes(b"")
    models = [{"name": name, "decision": decision, "world_from_model": TURNED.tolist(), "points": points,
               "warnings": [{"code": "near", "message": "close"}, {"code": "far", "message": name + ": far"}] if decision == "warn" else [],
               "failure": None if decision != "refuse" else {"code": "wrong_model", "message": name + ": no fit"}}
              for name, decision, points in (("bone", "accept", [{"name": "entry", "xyz_mm": [1, 2, 3], "covariance_mm2": None}]),
                                             ("stack", "accept", []), ("cup", "warn", []), ("lost", "refuse", []))]
    return {"models": models}


@pytest.fixture(scope="module")
def shown(case, result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("with-model")
    result.write(folder)
    registration = with_model(pathlib.Path(case[0]), folder)
    (folder / "registration.json").write_text(json.dumps(registration))
    return folder, scenes.read_scene(folder, folder)


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


def with_cameras(folder, image_size):
    (folder / "case.json").write_text(json.dumps({"views": [{"name": "cam1", "camera": "cam1.json"}], "models": []}))
    (folder / "registration.json").write_text(json.dumps({"models": []}))
    (folder / "cam1_overlay.png").write_bytes(b"\x89PNG\r\n\x1a\n" + (13).to_bytes(4, "big") + b"IHDR"
                                              + (640).to_bytes(4, "big") + (480).to_bytes(4, "big"))
    camera = {"name": "cam1", "K": [[2000, 0, 320], [0, 2000, 240], [0, 0, 1]], "R": np.eye(3).tolist(), "t": [0, 0, 700],
              "image_size": image_size}
    (folder / "cameras.json").write_text(json.dumps({"views": [camera]}))


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


# ---- the measurement beside the window ----

def ended(job, limit_s=60):
    lines, end = [], time.monotonic() + limit_s
    while not job.done:
        assert time.monotonic() < end, "still at work"
        lines += job.poll()
    return lines


def test_work_by_the_package_writes_the_result(case, tmp_path):
    job = work.Work(case[0], tmp_path / "result")
    lines = ended(job)
    assert job.failure is None and "calibrate" in lines
    assert (tmp_path / "result" / "result.json").is_file()


def test_work_can_be_cancelled(case, tmp_path):
    job = work.Work(case[0], tmp_path / "result")
    job.cancel()
    ended(job)
    assert job.failure == "cancelled" and not (tmp_path / "result" / "result.json").exists()


def script(tmp_path, text):
    file = tmp_path / "program"
    file.write_text("#!/bin/sh\n" + text)
    file.chmod(0o755)
    return file


@pytest.fixture
def empty_case(tmp_path):
    (tmp_path / "case.json").write_text("{}")
    return tmp_path


def test_case_without_a_file_fails_by_name(tmp_path):
    job = work.Work(tmp_path, tmp_path / "out")
    ended(job)
    assert "case.json" in job.failure


def test_case_with_cameras_is_registered_and_its_cameras_are_kept(tmp_path):
    with_cameras(tmp_path, [640, 480])
    answer = (tmp_path / "cameras.json").read_text()
    one = json.dumps(json.loads(answer)["views"][0])
    job = work.Work(tmp_path, tmp_path, program=script(tmp_path, f"echo '{one}'; echo $1 >> {tmp_path}/calls"))
    lines = ended(job)
    assert job.failure is None and (tmp_path / "calls").read_text().split() == ["register", "import"] and len(lines) == 1
    assert json.loads((tmp_path / "cameras.json").read_text())["views"][0]["t"] == [0, 0, 700]


def test_work_by_a_program_gives_its_lines_and_its_exit_code(empty_case):
    tmp_path = empty_case
    job = work.Work(tmp_path, tmp_path / "out", program=script(tmp_path, 'echo "$@"; echo no such thing >&2; exit 2'))
    assert ended(job) == [f"run {tmp_path} --out {tmp_path / 'out'}", "no such thing"]
    assert job.failure == "exit code 2: no such thing"


def test_program_can_be_cancelled(empty_case):
    tmp_path = empty_case
    job = work.Work(tmp_path, tmp_path, program=script(tmp_path, "echo begun; exec sleep 60"))
    while "begun" not in job.poll():
        pass
    job.cancel()
    ended(job)
    assert job.failure == "cancelled"


def test_program_is_the_chosen_one_or_none(tmp_path, monkeypatch):
    chosen = script(tmp_path, "")
    assert work.find_program(str(chosen)) == str(chosen)
    assert work.find_program(str(tmp_path / "none")) is None and work.find_program(str(tmp_path)) is None
    monkeypatch.setenv("HELICARM_PROGRAM", str(chosen))
    assert work.find_program() == str(chosen)


# ---- the Slicer part ----

@pytest.fixture
def slicer(monkeypatch):
    pytest.importorskip("vtk")
    import slicer_stand_in
    for name in ("slicer", "slicer.util", "slicer.ScriptedLoadableModule", "qt", "ctk", "Helicarm"):
        monkeypatch.setitem(sys.modules, name, None)
        del sys.modules[name]
    return slicer_stand_in.install()


def nodes_of(slicer):
    return {node.GetName(): node for node in slicer.mrmlScene.nodes}


def test_own_test_of_the_module_passes(slicer):
    import Helicarm
    test = Helicarm.HelicarmTest()
    test.runTest()
    assert test.shown == "Passed" and slicer.mrmlScene.nodes == []


def test_everything_is_shown_at_its_place(slicer, shown):
    import Helicarm
    folder, scene = shown
    logic = Helicarm.HelicarmLogic()
    logic.show(scene)
    nodes = nodes_of(slicer)
    assert {"slicer_from_calibrator", "calibrator_from_bone", "calibrator_from_cup", "calibrator_from_AP", "points",
            "tunnel a", "95 % regions", "camera AP", "image AP", "camera LAT", "image LAT"} <= set(nodes)
    volume = nodes["bone"]
    assert volume.to_world() == pytest.approx(scenes.ras_transform(TURNED)) and volume.ijk_to_ras is None
    assert nodes["stack"].ijk_to_ras == pytest.approx(np.diag([-0.4, -0.4, 0.6, 1]))
    assert nodes[str(folder / "plan.mrk.json")].parent is nodes["calibrator_from_bone"]
    assert nodes["cup"].display.colour == Helicarm.COLOURS["warn"]
    place, label = nodes["points"].points[0]
    assert label == scene.points[0].name and place == pytest.approx(scenes.ras_from_lps(scene.points[0].xyz_mm))
    assert nodes["points"].descriptions[0] == f"95 %: {scene.points[0].error_95_mm:.2f} mm"
    hierarchy = slicer.mrmlScene.hierarchy
    assert hierarchy.folders and set(hierarchy.parents) == {hierarchy.GetItemByDataNode(n) for n in slicer.mrmlScene.nodes}
    logic.set_frame("bone")
    assert volume.to_world() == pytest.approx(np.eye(4), abs=1e-9)
    logic.show(scene)  # replaces
    assert len(slicer.mrmlScene.nodes) == len(nodes) and len(hierarchy.folders) == 1


def test_regions_and_images_are_meshes_at_their_place(slicer, shown):
    import Helicarm
    from vtk.util.numpy_support import vtk_to_numpy
    Helicarm.HelicarmLogic().show(shown[1])
    nodes, scene = nodes_of(slicer), shown[1]
    mesh = nodes["95 % regions"].polydata
    with_region = [point for point in scene.points if point.covariance_mm2 is not None]
    corners = vtk_to_numpy(mesh.GetPoints().GetData()).reshape(len(with_region), -1, 3)
    for point, own in zip(with_region, corners):
        assert (own[0] + own[-1]) / 2 == pytest.approx(scenes.ras_from_lps(point.xyz_mm), abs=1e-6)
    assert mesh.GetNumberOfPolys() % len(with_region) == 0 and mesh.GetNumberOfPolys() > 0
    view, plane = scene.views[0], nodes[f"image {scene.views[0].name}"]
    places, texture = (vtk_to_numpy(a) for a in (plane.polydata.GetPoints().GetData(), plane.polydata.GetPointData().GetTCoords()))
    corner = scenes.ras_from_lps(scenes.image_corners(view))
    for where, expected in (((0, 0), corner[3]), ((1, 0), corner[2]), ((0, 1), corner[0]), ((1, 1), corner[1])):
        found = places[np.argmin(np.abs(texture - where).sum(axis=1))]
        assert found == pytest.approx(expected, abs=1e-3)
    assert plane.display.texture is not None


def test_model_whose_file_is_missing_is_named_and_the_rest_is_shown(slicer, tmp_path):
    import Helicarm
    (tmp_path / "empty").mkdir()
    models = [scenes.Model("gone", "accept", TURNED, surface=tmp_path / "gone.stl"),
              scenes.Model("slices", "accept", TURNED, volume=tmp_path / "empty")]
    scene = scenes.Scene("s", points=[scenes.Point("P", np.zeros(3), None)], models=models)
    Helicarm.HelicarmLogic().show(scene)
    assert ["gone.stl: not shown" in scene.messages[0], "an empty folder" in scene.messages[1]] == [True] * 2
    assert "points" in nodes_of(slicer) and "95 % regions" not in nodes_of(slicer)


def test_closed_scene_is_shown_again_without_errors(slicer, shown):
    import Helicarm
    logic = Helicarm.HelicarmLogic()
    logic.show(shown[1])
    slicer.mrmlScene.Clear()
    logic.set_frame("bone")
    logic.show(shown[1])
    assert "points" in nodes_of(slicer)


def widget_of(Helicarm, case_folder, result_folder, program=""):
    widget = Helicarm.HelicarmWidget()
    widget.setup()
    widget.case.currentPath, widget.result.currentPath, widget.program.currentPath = map(str, (case_folder, result_folder, program))
    return widget


def until_idle(widget):
    end = time.monotonic() + 60
    while widget.timer.is_active:
        assert time.monotonic() < end
        widget.on_timer()


def test_window_measures_and_shows(slicer, case, tmp_path):
    import Helicarm
    widget = widget_of(Helicarm, case[0], tmp_path / "result")
    assert not widget.cancel_button.enabled
    widget.run_button.press()
    assert widget.cancel_button.enabled and not widget.run_button.enabled and widget.bar.range == (0, 0)
    until_idle(widget)
    assert widget.run_button.enabled and "points" in nodes_of(slicer)
    assert widget.log.lines[-1].startswith("shown: ") and slicer.util.errors == []


def test_window_says_what_is_missing(slicer, tmp_path):
    import Helicarm
    widget = widget_of(Helicarm, "", "")
    widget.run_button.press()
    widget.case.currentPath = str(tmp_path)
    widget.show_button.press()
    widget.program.currentPath = str(tmp_path / "none")
    widget.run_button.press()
    assert ["choose the case's folder" in slicer.util.errors[0], "case.json" in slicer.util.errors[1],
            "no program that can be run" in slicer.util.errors[2]] == [True] * 3


def test_window_cancels(slicer, empty_case):
    import Helicarm
    tmp_path = empty_case
    widget = widget_of(Helicarm, tmp_path, tmp_path / "out", script(tmp_path, "exec sleep 60"))
    widget.run_button.press()
    widget.cancel_button.press()
    until_idle(widget)
    assert widget.log.lines[-1] == "cancelled" and widget.run_button.enabled


def test_regions_are_enlarged_in_place(slicer, shown):
    import Helicarm
    widget = widget_of(Helicarm, shown[0], shown[0])
    widget.show_button.press()
    widget.enlarged.slots["valueChanged(int)"](20)
    bounds = [np.diff(np.reshape(nodes_of(slicer)[name].polydata.GetBounds(), (3, 2))).max()
              for name in ("95 % regions, 20 times as large",)]
    widget.enlarged.slots["valueChanged(int)"](1)
    bounds.append(np.diff(np.reshape(nodes_of(slicer)["95 % regions"].polydata.GetBounds(), (3, 2))).max())
    assert bounds[0] > bounds[1]
    slicer.mrmlScene.Clear()
    widget.enlarged.slots["valueChanged(int)"](20)  # a closed scene is left alone


def test_frame_is_chosen_by_the_models_name(slicer, shown):
    import Helicarm
    widget = widget_of(Helicarm, shown[0], shown[0])
    widget.show_button.press()
    assert widget.frame.items == ["calibrator", "bone", "stack", "cup"]
    widget.frame.index = 1
    widget.frame.slots["activated(int)"](1)
    root = nodes_of(slicer)["slicer_from_calibrator"]
    assert root.matrix == pytest.approx(np.linalg.inv(scenes.ras_transform(TURNED)))


PROGRAM = os.environ.get("HELICARM_PROGRAM")


@pytest.mark.skipif(not PROGRAM, reason="HELICARM_PROGRAM does not name the program")
def test_program_and_package_give_one_scene(case, shown, tmp_path):
    job = work.Work(case[0], tmp_path / "result", program=PROGRAM)
    ended(job)
    assert job.failure is None
    by_program = scenes.read_scene(case[0], tmp_path / "result")
    for point, other in zip(by_program.points, shown[1].points):
        assert point.name == other.name and point.xyz_mm == pytest.approx(other.xyz_mm)


def test_version_of_the_package_is_the_one_under_test():
    assert work.package() is helicarm
