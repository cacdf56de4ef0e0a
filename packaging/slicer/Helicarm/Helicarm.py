# SPDX-License-Identifier: Apache-2.0
"""Scripted module of 3D Slicer: measures a case of helicarm and shows it in the scene."""
import os
import pathlib

import ctk
import numpy as np
import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (ScriptedLoadableModule, ScriptedLoadableModuleLogic,
                                           ScriptedLoadableModuleTest, ScriptedLoadableModuleWidget)
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from HelicarmLib import scene as scenes
from HelicarmLib import work

COLOURS = {"accept": (0.9, 0.85, 0.7), "warn": (1.0, 0.75, 0.2)}


class Helicarm(ScriptedLoadableModule):
    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = "Helicarm"
        parent.categories = ["Helicarm"]
        parent.dependencies = []
        parent.contributors = ["The helicarm maintainers"]
        parent.helpText = ("Measures a case of C-arm X-ray images and shows its points with 95 % regions, tunnels, registered "
                           "models, cameras and images. Research instrument, not a medical device.")
        parent.acknowledgementText = "Licence: Apache-2.0."


class HelicarmWidget(ScriptedLoadableModuleWidget):
    POLL_MS = 100

    def setup(self):
        ScriptedLoadableModuleWidget.setup(self)
        self.logic = HelicarmLogic()
        self.work = None
        self.case = self._path("Case", ctk.ctkPathLineEdit.Dirs, "helicarm/case", "Folder that holds case.json")
        self.result = self._path("Result", ctk.ctkPathLineEdit.Dirs, "helicarm/result",
                                 "Folder for result.json and the overlays; empty: helicarm-result in the case's folder")
        self.program = self._path("Program", ctk.ctkPathLineEdit.Files, "helicarm/program",
                                  "helicarm; empty: the Python package, else the program in the path")
        self.frame = qt.QComboBox()
        self.frame.toolTip = "Slicer's world: the calibrator's frame, or a registered model's own (its CT's patient frame)"
        self.form.addRow("Frame", self.frame)
        self.enlarged = qt.QSpinBox()
        self.enlarged.setRange(1, 1000)
        self.enlarged.toolTip = "Draw the 95 % regions this many times as large: most are smaller than a point's glyph"
        self.form.addRow("Enlarge regions", self.enlarged)
        self.run_button = self._button("Measure", "Measure the case, then show the result", self.on_run)
        self.show_button = self._button("Show", "Show the result of an earlier measurement", self.on_show)
        self.cancel_button = self._button("Cancel", "Stop the measurement", self.on_cancel)
        self.bar = qt.QProgressBar()
        self.bar.setRange(0, 1)
        self.log = qt.QPlainTextEdit()
        self.log.readOnly = True
        for widget in (self.bar, self.log):
            self.layout.addWidget(widget)
        self.frame.connect("activated(int)", self.on_frame)
        self.enlarged.connect("valueChanged(int)", self.on_enlarge)
        self.timer = qt.QTimer()
        self.timer.setInterval(self.POLL_MS)
        self.timer.connect("timeout()", self.on_timer)
        self._set_running(False)

    def _path(self, label, kind, key, tip):
        if not hasattr(self, "form"):
            self.form = qt.QFormLayout()
            self.layout.addLayout(self.form)
        edit = ctk.ctkPathLineEdit()
        edit.filters, edit.settingKey, edit.toolTip = kind, key, tip
        self.form.addRow(label, edit)
        return edit

    def _button(self, text, tip, pressed):
        button = qt.QPushButton(text)
        button.toolTip = tip
        button.connect("clicked(bool)", lambda _checked=False: pressed())
        self.layout.addWidget(button)
        return button

    def cleanup(self):
        self.timer.stop()
        if self.work:
            self.work.cancel()

    def _folders(self):
        if not self.case.currentPath:
            raise scenes.SceneError("choose the case's folder")
        case = pathlib.Path(self.case.currentPath)
        return case, pathlib.Path(self.result.currentPath) if self.result.currentPath else case / "helicarm-result"

    def _say(self, text):
        self.log.appendPlainText(text)

    def _set_running(self, is_running):
        self.run_button.enabled = self.show_button.enabled = not is_running
        self.cancel_button.enabled = is_running
        self.bar.setRange(0, 0 if is_running else 1)

    def on_run(self):
        try:
            self.work = self.logic.measure(*self._folders(), self.program.currentPath)
        except scenes.SceneError as error:
            slicer.util.errorDisplay(str(error))
            return
        for edit in (self.case, self.result, self.program):
            edit.addCurrentPathToHistory()
        self.log.clear()
        self._set_running(True)
        self.timer.start()

    def on_timer(self):
        for line in self.work.poll():
            self._say(line)
        if not self.work.done:
            return
        self.timer.stop()
        self._set_running(False)
        failure, self.work = self.work.failure, None
        if failure:
            self._say(failure)
        # A refusal leaves a result with all that was computed.
        if failure != "cancelled" and any((self._folders()[1] / name).is_file() for name in scenes.RESULTS):
            self.on_show()

    def on_cancel(self):
        if self.work:
            self.work.cancel()

    def on_show(self):
        try:
            scene = scenes.read_scene(*self._folders())
            self.logic.show(scene)
            self.logic.enlarge(self.enlarged.value)
        except scenes.SceneError as error:
            slicer.util.errorDisplay(str(error))
            return
        self.frame.clear()
        self.frame.addItems([scene.frame, *(model.name for model in scene.models)])
        for message in scene.messages:
            self._say(message)
        self._say(f"shown: {len(scene.points)} points, {len(scene.tunnels)} tunnels, {len(scene.models)} models, "
                  f"{len(scene.views)} cameras")

    def on_frame(self, index):
        self.logic.set_frame(self.frame.currentText if index > 0 else None)

    def on_enlarge(self, times):
        self.logic.enlarge(times)


class HelicarmLogic(ScriptedLoadableModuleLogic):
    """Shows one scene at a time; `show` removes what the last call added."""

    def __init__(self):
        ScriptedLoadableModuleLogic.__init__(self)
        self.scene, self.nodes, self.root, self.folder = None, [], None, None
        self.regions = None
        self.readers = []  # of the textures: a display node does not keep them

    def measure(self, case_folder, result_folder, program=""):
        """A `Work` that has begun."""
        found = work.find_program(program)
        if program and not found:
            raise scenes.SceneError(f"{program}: no program that can be run")
        if not program and work.package():
            return work.Work(case_folder, result_folder)
        if not found:
            raise scenes.SceneError("helicarm was not found: choose the program, or install the Python package in Slicer's Python")
        return work.Work(case_folder, result_folder, program=found, environment=slicer.util.startupEnvironment())

    def show(self, scene, frame=None):
        self.clear()
        self.scene = scene
        hierarchy = slicer.mrmlScene.GetSubjectHierarchyNode()
        self.folder = hierarchy.CreateFolderItem(hierarchy.GetSceneItemID(), scene.name)
        self.root = self._transform(f"slicer_from_{scene.frame}", scenes.shown_from_frame(scene, frame), None)
        for model in scene.models:
            self._show_model(model)
        for view in scene.views:
            self._show_camera(view)
        self._show_points(scene.points)
        for tunnel in scene.tunnels:
            node = self._node("vtkMRMLMarkupsLineNode", f"tunnel {tunnel.name}", self.root)
            for end in (tunnel.start, tunnel.end):
                node.AddControlPoint(list(scenes.ras_from_lps(end.xyz_mm)), end.name)

    def set_frame(self, frame):
        """Slicer's world: None for the scene's own frame, or the name of a model."""
        if self.root is not None and slicer.mrmlScene.IsNodePresent(self.root):
            slicer.util.updateTransformMatrixFromArray(self.root, scenes.shown_from_frame(self.scene, frame))

    def clear(self):
        """Removes what `show` added, unless the scene was closed since."""
        is_open = self.root is not None and slicer.mrmlScene.IsNodePresent(self.root)
        for node in self.nodes:
            if slicer.mrmlScene.IsNodePresent(node):
                slicer.mrmlScene.RemoveNode(node)
        if is_open:
            slicer.mrmlScene.GetSubjectHierarchyNode().RemoveItem(self.folder)
        self.scene, self.nodes, self.root, self.folder, self.regions, self.readers = None, [], None, None, None, []

    def _keep(self, node, parent):
        self.nodes.append(node)
        if parent:
            node.SetAndObserveTransformNodeID(parent.GetID())
        hierarchy = slicer.mrmlScene.GetSubjectHierarchyNode()
        hierarchy.SetItemParent(hierarchy.GetItemByDataNode(node), self.folder)
        return node

    def _node(self, kind, name, parent):
        node = slicer.mrmlScene.AddNewNodeByClass(kind, name)
        node.CreateDefaultDisplayNodes()
        return self._keep(node, parent)

    def _transform(self, name, ras_matrix, parent):
        node = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLLinearTransformNode", name)
        slicer.util.updateTransformMatrixFromArray(node, np.asarray(ras_matrix))
        return self._keep(node, parent)

    def _show_model(self, model):
        name = f"{self.scene.frame}_from_{model.name}"
        transform = self._transform(name, scenes.ras_transform(model.world_from_model), self.root)
        for path, load in ((model.volume, self._volume), (model.surface, self._surface), (model.plan, self._plan)):
            try:
                if path:
                    load(model, transform)
            except (RuntimeError, OSError) as error:  # Slicer's readers raise RuntimeError
                self.scene.messages.append(f"{path}: not shown: {error}")

    def _volume(self, model, transform):
        volume = self._keep(slicer.util.loadVolume(_file_of_volume(model.volume)), transform)
        volume.SetName(model.name)
        if model.ijk_to_ras is not None:
            volume.SetIJKToRASMatrix(_vtk_matrix(model.ijk_to_ras))

    def _surface(self, model, transform):
        surface = self._keep(slicer.util.loadModel(str(model.surface)), transform)
        surface.SetName(model.name)
        surface.GetDisplayNode().SetColor(*COLOURS.get(model.decision, COLOURS["warn"]))

    def _plan(self, model, transform):
        plans = slicer.util.loadMarkups(str(model.plan))
        for plan in plans if isinstance(plans, (list, tuple)) else [plans]:
            self._keep(plan, transform)

    def _show_points(self, points):
        if not points:
            return
        node = self._node("vtkMRMLMarkupsFiducialNode", "points", self.root)
        for point in points:
            index = node.AddControlPoint(list(scenes.ras_from_lps(point.xyz_mm)), point.name)
            if point.error_95_mm is not None:
                node.SetNthControlPointDescription(index, f"95 %: {point.error_95_mm:.2f} mm")
        mesh = scenes.regions_mesh(points)
        if mesh:
            self.regions = self._model("95 % regions", _polydata(mesh[0], triangles=mesh[1]))
            self.regions.GetDisplayNode().SetColor(0.2, 0.7, 1.0)
            self.regions.GetDisplayNode().SetOpacity(0.5)

    def enlarge(self, times):
        """Draws the regions larger about their points; the node's name says so."""
        if self.regions is not None and slicer.mrmlScene.IsNodePresent(self.regions):
            corners, triangles = scenes.regions_mesh(self.scene.points, times)
            self.regions.SetAndObservePolyData(_polydata(corners, triangles=triangles))
            self.regions.SetName("95 % regions" if times == 1 else f"95 % regions, {times} times as large")

    def _show_camera(self, view):
        self._transform(f"{self.scene.frame}_from_{view.name}", scenes.ras_transform(np.linalg.inv(view.camera_from_world)), self.root)
        corners, lines = scenes.frustum(view)
        display = self._model(f"camera {view.name}", _polydata(corners, lines=lines)).GetDisplayNode()
        display.SetColor(1.0, 1.0, 0.4)
        display.SetLighting(False)
        if view.image:
            self._show_image(view)

    def _show_image(self, view):
        """The image on its plane: VTK's texture begins at the bottom left corner, as its reader's first row."""
        top_left, _, bottom_right, bottom_left = scenes.ras_from_lps(scenes.image_corners(view))
        plane = vtk.vtkPlaneSource()
        plane.SetOrigin(*bottom_left)
        plane.SetPoint1(*bottom_right)
        plane.SetPoint2(*top_left)
        plane.Update()
        node = self._model(f"image {view.name}", plane.GetOutput())
        reader = vtk.vtkPNGReader()
        reader.SetFileName(str(view.image))
        reader.Update()
        display = node.GetDisplayNode()
        display.SetBackfaceCulling(False)
        display.SetLighting(False)
        self.readers.append(reader)
        display.SetTextureImageDataConnection(reader.GetOutputPort())

    def _model(self, name, polydata):
        node = self._node("vtkMRMLModelNode", name, self.root)
        node.SetAndObservePolyData(polydata)
        return node


def _file_of_volume(path):
    """A file: of a folder of DICOM slices one of them, whose series Slicer reads."""
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    if not files:
        raise OSError("an empty folder")
    return os.fspath(files[0])


def _vtk_matrix(matrix):
    result = vtk.vtkMatrix4x4()
    for row in range(4):
        for column in range(4):
            result.SetElement(row, column, matrix[row][column])
    return result


def _polydata(corners_lps, triangles=None, lines=None):
    """In RAS; RAS and LPS differ by half a turn, so triangles keep their sense."""
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(scenes.ras_from_lps(corners_lps)), deep=True))
    polydata = vtk.vtkPolyData()
    polydata.SetPoints(points)
    for cells, add in ((triangles, polydata.SetPolys), (lines, polydata.SetLines)):
        if cells is not None:
            counted = np.insert(np.asarray(cells, np.int64), 0, np.shape(cells)[1], axis=1).ravel()
            array = vtk.vtkCellArray()
            array.SetCells(len(cells), numpy_to_vtkIdTypeArray(counted, deep=True))
            add(array)
    return polydata


class HelicarmTest(ScriptedLoadableModuleTest):
    """In Slicer: Edit, Application Settings, Developer mode; then Reload and Test in the module."""

    def setUp(self):
        slicer.mrmlScene.Clear()

    def runTest(self):
        self.setUp()
        turned = np.array([[0, -1, 0, 10.0], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]])
        point = scenes.Point("P", np.array([1.0, 2, 3]), np.diag([0.01, 0.04, 0.09]), 0.5)
        other = scenes.Point("Q", np.array([4.0, 5, 6]), None)
        scene = scenes.Scene("test", points=[point, other], tunnels=[scenes.Tunnel("t", point, other)],
                             models=[scenes.Model("bone", "accept", turned)])
        logic = HelicarmLogic()
        logic.show(scene)
        place = [0.0, 0.0, 0.0]
        slicer.util.getNode("points").GetNthControlPointPositionWorld(0, place)
        np.testing.assert_allclose(place, (-1, -2, 3))
        logic.set_frame("bone")
        bone = slicer.util.arrayFromTransformMatrix(slicer.util.getNode("calibrator_from_bone"), toWorld=True)
        np.testing.assert_allclose(bone, np.eye(4), atol=1e-12)
        logic.clear()
        self.delayDisplay("Passed")
