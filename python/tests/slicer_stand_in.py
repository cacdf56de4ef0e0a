# SPDX-License-Identifier: Apache-2.0
"""The part of 3D Slicer's Python interface that the module uses, as Slicer's documentation describes it; VTK is the real one.

Calls that Slicer does not have raise AttributeError here as there.
"""
import pathlib
import sys
import types

import numpy as np


class Node:
    def __init__(self, kind, name):
        self.kind, self.name, self.parent, self.display = kind, name, None, None

    def GetID(self):
        return id(self)

    def GetName(self):
        return self.name

    def SetName(self, name):
        self.name = name

    def SetAndObserveTransformNodeID(self, identifier):
        self.parent = next(node for node in sys.modules["slicer"].mrmlScene.nodes if node.GetID() == identifier)

    def to_world(self):
        here = self.matrix if isinstance(self, Transform) else np.eye(4)
        return self.parent.to_world() @ here if self.parent else here

    def CreateDefaultDisplayNodes(self):
        self.display = self.display or Display()

    def GetDisplayNode(self):
        return self.display


class Display:
    def __init__(self):
        self.colour, self.texture = None, None

    def SetColor(self, red, green, blue):
        self.colour = (red, green, blue)

    def SetOpacity(self, opacity):
        self.opacity = opacity

    def SetLighting(self, is_lit):
        self.is_lit = is_lit

    def SetBackfaceCulling(self, is_culled):
        self.is_culled = is_culled

    def SetTextureImageDataConnection(self, port):
        self.texture = port


class Transform(Node):
    matrix = np.eye(4)


class Markups(Node):
    def __init__(self, kind, name):
        super().__init__(kind, name)
        self.points, self.descriptions = [], {}

    def AddControlPoint(self, place, label=""):
        assert isinstance(place, list) and len(place) == 3
        self.points.append((np.array(place), label))
        return len(self.points) - 1

    def SetNthControlPointDescription(self, index, text):
        self.descriptions[index] = text

    def GetNthControlPointPositionWorld(self, index, place):
        place[:] = (self.to_world() @ [*self.points[index][0], 1])[:3]


class Model(Node):
    polydata = None

    def SetAndObservePolyData(self, polydata):
        self.polydata = polydata


class Volume(Node):
    ijk_to_ras = None

    def SetIJKToRASMatrix(self, matrix):
        self.ijk_to_ras = np.array([[matrix.GetElement(r, c) for c in range(4)] for r in range(4)])


KINDS = {"vtkMRMLLinearTransformNode": Transform, "vtkMRMLMarkupsFiducialNode": Markups, "vtkMRMLMarkupsLineNode": Markups,
         "vtkMRMLModelNode": Model}


class Hierarchy:
    def __init__(self):
        self.folders, self.parents = {}, {}

    def GetSceneItemID(self):
        return 1

    def CreateFolderItem(self, parent, name):
        assert parent == 1
        self.folders[len(self.folders) + 2] = name
        return len(self.folders) + 1

    def GetItemByDataNode(self, node):
        return 1000 + node.GetID()

    def SetItemParent(self, item, parent):
        assert parent in self.folders
        self.parents[item] = parent

    def RemoveItem(self, item):
        del self.folders[item]


class Scene:
    def __init__(self):
        self.Clear()

    def Clear(self):
        self.nodes, self.hierarchy = [], Hierarchy()

    def AddNewNodeByClass(self, kind, name):
        self.nodes.append(KINDS[kind](kind, name))
        return self.nodes[-1]

    def IsNodePresent(self, node):
        return node in self.nodes

    def RemoveNode(self, node):
        self.nodes.remove(node)

    def GetSubjectHierarchyNode(self):
        return self.hierarchy


class Widget:
    """A Qt widget: attributes are properties, methods and signals do what the module needs."""

    def __init__(self, text=""):
        self.text, self.lines, self.slots = text, [], {}
        self.currentPath, self.enabled, self.items, self.index, self.value = "", True, [], 0, 1

    def connect(self, signal, slot):
        self.slots[signal] = slot

    def press(self):
        if self.enabled:
            self.slots["clicked(bool)"](False)

    @property
    def currentText(self):
        return self.items[self.index]

    def addItems(self, items):
        self.items += items

    def clear(self):
        self.items, self.lines, self.index = [], [], 0

    def appendPlainText(self, text):
        self.lines.append(text)

    def setRange(self, low, high):
        self.range = (low, high)

    def addRow(self, *_):
        pass

    addWidget = addLayout = addRow

    def addCurrentPathToHistory(self):
        pass

    def setInterval(self, ms):
        self.ms = ms

    def start(self):
        self.is_active = True

    def stop(self):
        self.is_active = False


class PathEdit(Widget):
    Dirs, Files = 1, 2


class Base:
    def __init__(self, parent=None):
        self.parent, self.layout = parent, Widget()

    def setup(self):
        pass

    def delayDisplay(self, text):
        self.shown = text


def _from_file(kind):
    def load(path, properties=None):
        if not pathlib.Path(path).is_file():
            raise RuntimeError("Failed to load node from file: " + path)
        scene = sys.modules["slicer"].mrmlScene
        node = kind(kind.__name__, path)
        node.CreateDefaultDisplayNodes()
        scene.nodes.append(node)
        return node
    return load


def _update(node, array):
    assert isinstance(array, np.ndarray) and array.shape == (4, 4)
    node.matrix = array.copy()


def install():
    """Puts `slicer`, `qt` and `ctk` among the modules; returns `slicer`."""
    slicer, util, qt, ctk = (types.ModuleType(name) for name in ("slicer", "slicer.util", "qt", "ctk"))
    loadable = types.ModuleType("slicer.ScriptedLoadableModule")
    for name in ("", "Logic", "Test", "Widget"):
        setattr(loadable, "ScriptedLoadableModule" + name, type("ScriptedLoadableModule" + name, (Base,), {}))
    slicer.mrmlScene, slicer.util, slicer.ScriptedLoadableModule, util.errors = Scene(), util, loadable, []
    util.getNode = lambda name: next(node for node in slicer.mrmlScene.nodes if node.GetName() == name)
    util.loadVolume, util.loadModel, util.loadMarkups = map(_from_file, (Volume, Model, Markups))
    util.updateTransformMatrixFromArray = _update
    util.arrayFromTransformMatrix = lambda node, toWorld=False: node.to_world() if toWorld else node.matrix
    util.startupEnvironment = lambda: None
    util.errorDisplay = util.errors.append
    qt.QComboBox = qt.QSpinBox = qt.QPushButton = qt.QProgressBar = qt.QPlainTextEdit = qt.QTimer = qt.QFormLayout = Widget
    ctk.ctkPathLineEdit = PathEdit
    sys.modules.update({"slicer": slicer, "slicer.util": util, "slicer.ScriptedLoadableModule": loadable, "qt": qt, "ctk": ctk})
    return slicer
