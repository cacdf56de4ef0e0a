# SPDX-License-Identifier: Apache-2.0
"""Objects of other packages: what they declare is honoured or refused. Stand-ins have the attributes that the packages
document; test_peers.py has the packages themselves."""
import sys
import types

import numpy as np
import pytest

import helicarm
from pydicom_peers import ct_datasets
from vtk_peers import vtk_meshes
from test_arrays import TETRAHEDRON, refused

TO_LPS = np.diag([-1, -1, 1, 1.0])


def sitk_image(dimension=3, components=1):
    """As SimpleITK.Image; its module gives the array."""
    module = sys.modules.setdefault("SimpleITK_stand_in", types.ModuleType("SimpleITK_stand_in"))
    voxels = np.arange(24, dtype=np.int16).reshape(4, 3, 2)  # [k, j, i]
    module.GetArrayViewFromImage = lambda image: voxels

    class Image:
        __module__ = "SimpleITK_stand_in"
        GetDimension = staticmethod(lambda: dimension)
        GetNumberOfComponentsPerPixel = staticmethod(lambda: components)
        GetOrigin = staticmethod(lambda: (5.0, -6.0, 7.0))
        GetSpacing = staticmethod(lambda: (0.5, 2.0, 3.0))
        GetDirection = staticmethod(lambda: (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    return Image(), voxels


def test_simple_itk_is_lps_with_directions_in_columns():
    image, voxels = sitk_image()
    volume = helicarm.as_volume(image)
    assert np.array_equal(volume.array, voxels.transpose(2, 1, 0))
    assert np.array_equal(volume.affine, [[0, -2, 0, 5], [0.5, 0, 0, -6], [0, 0, 3, 7], [0, 0, 0, 1]])
    refused("usage", "contradicts", helicarm.as_volume, image, frame="RAS")
    refused("unsupported", "several values", helicarm.as_volume, sitk_image(components=3)[0])
    refused("unsupported", "2 dimensions", helicarm.as_volume, sitk_image(dimension=2)[0])


def test_itk_has_a_matrix_of_directions():
    image, voxels = sitk_image()

    class Vnl:
        get = staticmethod(lambda i, j: np.reshape(type(image).GetDirection(), (3, 3))[i, j])

    class Direction:
        GetVnlMatrix = staticmethod(Vnl)

    class Image:
        __module__ = "itk_stand_in"
        GetImageDimension = staticmethod(lambda: 3)
        GetNumberOfComponentsPerPixel, GetOrigin, GetSpacing = (staticmethod(getattr(image, name)) for name in (
            "GetNumberOfComponentsPerPixel", "GetOrigin", "GetSpacing"))
        GetDirection = staticmethod(Direction)
    module = sys.modules.setdefault("itk_stand_in", types.ModuleType("itk_stand_in"))
    module.array_view_from_image = lambda image: voxels
    assert np.array_equal(helicarm.as_volume(Image()).affine, helicarm.as_volume(image).affine)
    # A filter that cuts a part out keeps the origin and numbers the voxels from another index.
    Image.GetBufferedRegion = staticmethod(lambda: types.SimpleNamespace(GetIndex=lambda: (100, -10, 2)))
    part, whole = helicarm.as_volume(Image()).affine, helicarm.as_volume(image).affine
    assert np.array_equal(part[:3, :3], whole[:3, :3])
    assert np.array_equal(part[:3, 3], (whole @ [100, -10, 2, 1])[:3])


def test_trimesh_states_its_unit_but_no_frame():
    mesh = types.SimpleNamespace(vertices=TETRAHEDRON[0] / 1000, faces=TETRAHEDRON[1], units="meters")
    surface = helicarm.as_surface(mesh, frame="RAS")
    assert surface.vertices[surface.faces] == pytest.approx((TETRAHEDRON[0] * [-1, -1, 1])[TETRAHEDRON[1]])
    refused("usage", 'give frame="LPS"', helicarm.as_surface, mesh)
    refused("usage", "the object states", helicarm.as_surface, mesh, frame="LPS", unit="mm")
    assert np.array_equal(helicarm.as_surface(mesh, frame="right-anterior-superior", unit="m").vertices, surface.vertices)
    mesh.units = None
    metres = helicarm.as_surface(mesh, frame="LPS", unit="m")
    assert metres.vertices[metres.faces] == pytest.approx(TETRAHEDRON[0][TETRAHEDRON[1]])


def test_what_is_nothing_of_these_is_refused():
    refused("unsupported", "neither a Volume", helicarm.as_volume, 3)
    refused("unsupported", "neither a Surface", helicarm.as_surface, 3)


# nibabel

@pytest.fixture
def nibabel():
    return pytest.importorskip("nibabel", reason="nibabel is not installed")


def test_nifti_without_a_coded_form_is_refused(nibabel):
    image = nibabel.Nifti1Image(np.zeros((3, 4, 5), np.int16), np.diag([1, 2, 3, 1.0]))
    assert np.allclose(helicarm.as_volume(image).affine, TO_LPS @ image.affine)
    image.set_sform(None, 0)
    image.set_qform(None, 0)
    refused("bad_value", "neither sform nor qform", helicarm.as_volume, image)


def test_nifti_whose_forms_differ_is_refused_or_warned_of(nibabel):
    image = nibabel.Nifti1Image(np.zeros((3, 4, 5), np.int16), np.diag([1, 2, 3, 1.0]))
    shifted = np.diag([1, 2, 3, 1.0])
    shifted[:3, 3] = 30
    image.set_qform(shifted, 1)
    image.set_sform(image.affine, 2)
    refused("bad_value", "sform.*and qform.*differently", helicarm.as_volume, image)
    image.set_sform(image.affine, 1)
    volume = helicarm.as_volume(image)
    assert [warning["code"] for warning in volume.warnings] == ["irregular_file"] and np.allclose(volume.affine, TO_LPS @ image.affine)


@pytest.mark.parametrize("kind", ["Nifti1Pair", "Nifti2Image", "Nifti2Pair"])
def test_nifti_of_either_version_is_checked_alike(nibabel, kind, tmp_path):
    place = np.array([[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 2, 6], [0, 0, 0, 1.0]])
    image = getattr(nibabel, kind)(np.arange(60, dtype=np.int16).reshape(3, 4, 5), place)
    volume = helicarm.as_volume(image)
    assert np.allclose(volume.affine, TO_LPS @ place) and np.array_equal(volume.array, image.get_fdata())
    nibabel.save(image, tmp_path / ("a.img.gz" if kind.endswith("Pair") else "a.nii.gz"))
    for path in tmp_path.iterdir():
        assert np.array_equal(helicarm.read_volume(path).array, volume.array)
    image.set_qform(np.diag([-1, -1, 2, 1.0]), 1)
    image.set_sform(place, 2)
    refused("bad_value", "sform.*and qform.*differently", helicarm.as_volume, image)
    image.set_sform(None, 0)
    image.set_qform(None, 0)
    refused("bad_value", "neither sform nor qform", helicarm.as_volume, image)


def test_a_sheared_sform_is_kept_and_a_collapsed_one_refused(nibabel):
    sheared = np.array([[1, 0.3, 0, 4], [0, 2, 0.5, 5], [0, 0, 3, 6], [0, 0, 0, 1]])
    image = nibabel.Nifti1Image(np.zeros((3, 4, 5), np.int16), sheared)
    assert np.allclose(helicarm.as_volume(image).affine, TO_LPS @ sheared)
    sheared[0, 1] = 5
    refused("bad_value", "nearly coplanar", helicarm.as_volume, nibabel.Nifti1Image(np.zeros((3, 4, 5), np.int16), sheared))


def test_other_images_of_nibabel_need_an_orientation(nibabel):
    refused("bad_value", "declares no orientation", helicarm.as_volume, nibabel.AnalyzeImage(np.zeros((3, 4, 5), np.int16), np.eye(4)))
    place = np.array([[0, -1, 0, 4], [1, 0, 0, 5], [0, 0, 2, 6], [0, 0, 0, 1.0]])
    assert np.allclose(helicarm.as_volume(nibabel.MGHImage(np.zeros((3, 4, 5), np.int16), place)).affine, TO_LPS @ place)
    refused("unsupported", "sequence of volumes", helicarm.as_volume, nibabel.Nifti1Image(np.zeros((3, 4, 5, 2), np.int16), place))


@pytest.mark.parametrize("kind", [np.dtype([("R", "u1"), ("G", "u1"), ("B", "u1")]), np.complex64])
@pytest.mark.filterwarnings("error")
def test_colours_and_complex_values_of_nibabel_are_refused(nibabel, kind):
    refused("unsupported", "nibabel image: its elements are", helicarm.as_volume, nibabel.Nifti1Image(np.zeros((3, 4, 5), kind), np.eye(4)))


# pydicom

@pytest.fixture
def series():
    pydicom = pytest.importorskip("pydicom", reason="pydicom is not installed")
    return lambda n: ct_datasets(pydicom, np.random.default_rng(n), n)


def test_a_tilted_series_keeps_its_shear(series):
    datasets, _, place, _ = series(3)
    volume = helicarm.as_volume(datasets)
    angle = volume.affine[:3, 1] @ volume.affine[:3, 2] / np.prod(np.linalg.norm(volume.affine[:3, 1:3], axis=0))
    assert abs(angle) > 0.05 and np.abs(volume.affine[:3, :2] - place[:3, :2]).max() < 1e-3


def test_a_series_without_a_slice_is_refused(series):
    datasets = sorted(series(8)[0] + series(8)[0][:0], key=lambda dataset: dataset.InstanceNumber)
    assert len(datasets) > 3
    del datasets[1]
    refused("bad_value", "apart", helicarm.as_volume, datasets)


def test_what_a_series_lacks_is_named(series):
    datasets = series(1)[0]
    del datasets[0].ImageOrientationPatient
    refused("bad_value", r"series\[0\].*Image Orientation|0020,0037", helicarm.as_volume, datasets)
    refused("bad_size", "only one slice", helicarm.as_volume, series(1)[0][0])


def test_a_dataset_is_an_image(case):
    pydicom = pytest.importorskip("pydicom", reason="pydicom is not installed")
    image, peer = helicarm.read_image(case[0] / "AP.dcm"), helicarm.as_image(pydicom.dcmread(case[0] / "AP.dcm"), name="AP")
    assert np.array_equal(peer.pixels, image.pixels) and np.array_equal(peer.pixel_mm, image.pixel_mm) and peer.name == "AP"


def test_a_dataset_without_a_class_is_no_array():
    dataset = pytest.importorskip("pydicom", reason="pydicom is not installed").Dataset()
    dataset.PatientID = "1"
    for convert, given in ((helicarm.as_image, dataset), (helicarm.as_volume, dataset), (helicarm.as_volume, [dataset])):
        refused("unsupported", "dataset: pydicom cannot write it", convert, given)


# VTK

def test_bits_of_vtk_are_refused():
    vtk = pytest.importorskip("vtk", reason="VTK is not installed")
    image = vtk.vtkImageData()
    image.SetDimensions(3, 4, 5)
    image.AllocateScalars(vtk.VTK_BIT, 1)
    refused("unsupported", "apply vtkImageCast", helicarm.as_volume, image, frame="RAS")


def test_a_space_of_poly_data_is_honoured():
    vtk = pytest.importorskip("vtk", reason="VTK is not installed")
    _, mesh = vtk_meshes(np.random.default_rng(1), 0)
    refused("usage", "does not state its frame", helicarm.as_surface, mesh)
    space = vtk.vtkStringArray()
    space.SetName("SPACE")
    space.InsertNextValue("RAS")
    mesh.GetFieldData().AddArray(space)
    lps = helicarm.as_surface(mesh)
    bounds = mesh.GetBounds()
    assert lps.vertices[:, 0].min() == pytest.approx(-bounds[1]) and lps.vertices[:, 2].max() == pytest.approx(bounds[5])
    refused("usage", "the object states", helicarm.as_surface, mesh, frame="LPS")
