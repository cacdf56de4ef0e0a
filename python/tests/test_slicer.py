# SPDX-License-Identifier: Apache-2.0
"""The module of 3D Slicer: its window and its nodes, with a stand-in of Slicer."""
import sys
import time

import numpy as np
import pytest

from slicer_cases import TURNED, empty_case, scenes, script, shown  # noqa: F401


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
