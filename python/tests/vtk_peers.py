# SPDX-License-Identifier: Apache-2.0
"""VTK. Judges of peers.py."""
import importlib

import numpy as np

import helicarm
from peer_values import COUNT, random_rotation, random_voxels


def vtk_meshes(random, n):
    """A closed mesh in random place: a sphere, cube or cone of VTK."""
    vtk = importlib.import_module("vtk")
    source = (vtk.vtkSphereSource, vtk.vtkCubeSource, vtk.vtkConeSource)[n % 3]()
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputConnection(source.GetOutputPort())
    move = vtk.vtkTransform()
    move.Translate(*random.uniform(-200, 200, 3))
    move.RotateWXYZ(random.uniform(0, 360), *random.standard_normal(3))
    move.Scale(*random.uniform(20, 80, 3))
    moved = vtk.vtkTransformPolyDataFilter()
    moved.SetTransform(move)
    moved.SetInputConnection(triangles.GetOutputPort())
    moved.Update()
    return vtk, moved.GetOutput()


def corners_of(surface):
    """The triangles' corners (F, 3, 3)."""
    return np.asarray(surface[0], float)[np.asarray(surface[1], int)]


def triangles_apart(one, other):
    """Largest difference of a corner's coordinate between each triangle and the nearest of the other ones, both ways; the
    order of triangles and the first corner of each do not count, their sense does."""
    turned = np.stack([np.roll(other, -first, axis=1) for first in range(3)], axis=1)  # (G, 3, 3, 3)
    far = np.array([np.abs(turned - triangle).max(axis=(2, 3)).min(axis=1) for triangle in one])  # (F, G)
    return max(far.min(axis=1).max(), far.min(axis=0).max())


def numbers_of_vtk(mesh):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    return (vtk_to_numpy(mesh.GetPoints().GetData()),
            vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3))


def vtk_writes(folder, count=COUNT):
    """(files, largest distance of a corner in mm): STL, PLY, VTP, OBJ and legacy VTK, text and binary, with triangles or
    strips, and meshes in memory."""
    random, far = np.random.default_rng(3), 0.0
    for n in range(count):
        vtk, mesh = vtk_meshes(random, n)
        kind = ("stl", "ply", "vtp", "obj", "vtk")[n // 3 % 5]
        writer = {"stl": vtk.vtkSTLWriter, "ply": vtk.vtkPLYWriter, "vtp": vtk.vtkXMLPolyDataWriter, "obj": vtk.vtkOBJWriter,
                  "vtk": vtk.vtkPolyDataWriter}[kind]()
        path = folder / f"m{n}.{kind}"
        writer.SetFileName(str(path))
        writer.SetInputData(mesh)
        if kind == "vtp":
            (writer.SetDataModeToAscii, writer.SetDataModeToBinary, writer.SetDataModeToAppended)[n % 3]()
            if n % 2:
                writer.SetCompressorTypeToZLib()
            else:
                writer.SetCompressorTypeToNone()
            if n % 4 == 1:
                writer.SetByteOrderToBigEndian()
        elif kind == "vtk":
            (writer.SetFileTypeToASCII, writer.SetFileTypeToBinary)[n % 2]()
            writer.SetFileVersion((42, 51)[n // 2 % 2])
            writer.SetHeader("3D Slicer output. SPACE=LPS")
            if n % 3:
                stripper = vtk.vtkStripper()
                stripper.SetInputData(mesh)
                writer.SetInputConnection(stripper.GetOutputPort())
        elif n % 2 and kind != "obj":
            writer.SetFileTypeToASCII()
        writer.Write()
        expected = corners_of(numbers_of_vtk(mesh))
        kept = expected[np.linalg.norm(np.cross(expected[:, 1] - expected[:, 0], expected[:, 2] - expected[:, 0]), axis=1) > 0]
        for surface in (helicarm.read_surface(path), helicarm.as_surface(mesh, frame="LPS")):
            found = corners_of((surface.vertices, surface.faces))
            assert found.shape == kept.shape, (path, found.shape, kept.shape)
            far = max(far, triangles_apart(found, kept))
    return count, far


def vtk_image(folder, count=COUNT):
    """(images, largest distance in mm, largest difference of a voxel): vtkImageData in memory."""
    vtk = importlib.import_module("vtk")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    random, far, off = np.random.default_rng(4), 0.0, 0.0
    for n in range(count):
        shape = tuple(int(side) for side in random.integers(2, 9, 3))
        data = random_voxels(random, shape, ("u1", "i2", "u2", "f4")[n % 4])
        image = vtk.vtkImageData()
        first = [int(i) for i in random.integers(-5, 5, 3)]
        image.SetExtent(*[int(value) for i in range(3) for value in (first[i], first[i] + shape[i] - 1)])
        image.SetOrigin(*random.uniform(-100, 100, 3))
        image.SetSpacing(*random.uniform(0.2, 3, 3))
        turn = random_rotation(random)
        image.SetDirectionMatrix(*turn.ravel())
        image.GetPointData().SetScalars(numpy_to_vtk(data.ravel(order="F"), deep=True))
        frame = ("LPS", "RAS")[n % 2]
        volume = helicarm.as_volume(image, frame=frame)
        for _ in range(4):
            index = [int(random.integers(side)) for side in shape]
            place = np.array(image.GetPoint(image.ComputePointId([first[i] + index[i] for i in range(3)])))
            expected = place if frame == "LPS" else place * [-1, -1, 1]
            far = max(far, np.linalg.norm(volume.affine[:3] @ [*index, 1] - expected))
        off = max(off, np.abs(volume.array - data).max())
    return count, far, off
