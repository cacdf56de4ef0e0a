# SPDX-License-Identifier: Apache-2.0
"""Volumes, surfaces, images and cameras of other packages, recognised by what they offer: none of them is imported.

What an object declares of its frame, unit and orientation is converted or refused; what it does not declare the caller
states.
"""
import importlib
import io
import os
from collections.abc import Mapping, Sequence

import numpy as np

from . import _helicarm as _c
from .errors import InputError

_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


def _refuse(message, code="bad_value"):
    raise InputError(code, message)


def _own_frame(frame, own, what):
    if frame is not None and _c._space_signs(frame) != _c._space_signs(own):
        _refuse(f'frame: "{frame}" contradicts {what}, which is {own}', "usage")


def _stated(frame, what):
    if frame is None:
        _refuse(f'frame: {what} does not state its frame: give frame="LPS" or frame="RAS"', "usage")
    return frame


def _package(obj):
    return importlib.import_module(type(obj).__module__.split(".")[0])


# Volumes

def as_volume(obj, *, frame=None):
    """A Volume of a Volume, a path, or an object of another package.

    nibabel image (RAS by definition; NIfTI needs a coded sform or qform), SimpleITK or ITK image (LPS), pydicom datasets
    of one CT series (a list of them, any order; LPS), vtkImageData or PyVista's ImageData, which state no frame: give
    frame="LPS" or "RAS". An array needs its affine: Volume(array, affine, frame=...).
    Raises InputError where the object declares no orientation, or one that cannot be kept.
    """
    if isinstance(obj, _c.Volume):
        _own_frame(frame, "LPS", "a Volume")
        return obj
    if isinstance(obj, (str, os.PathLike)):
        _own_frame(frame, "LPS", "a file, whose frame is read from it: the Volume")
        return _c.read_volume(obj)
    if _is_dataset(obj) or _is_series(obj):
        _own_frame(frame, "LPS", "DICOM")
        return _volume_of_datasets(obj)
    if hasattr(obj, "affine") and hasattr(obj, "header") and hasattr(obj, "dataobj"):
        _own_frame(frame, "RAS", "a nibabel image")
        return _volume_of_nibabel(obj)
    if hasattr(obj, "GetPointData") and hasattr(obj, "GetDimensions"):
        return _volume_of_vtk(obj, _stated(frame, "vtkImageData"))
    if all(hasattr(obj, name) for name in ("GetOrigin", "GetSpacing", "GetDirection")):
        _own_frame(frame, "LPS", "an ITK image")
        return _volume_of_itk(obj)
    if isinstance(obj, np.ndarray):
        _refuse("volume: an array has no place: give Volume(array, affine, frame=...)", "usage")
    _refuse(f"volume: {type(obj).__name__} is neither a Volume, a path, pydicom datasets nor an image of nibabel, "
            "SimpleITK, ITK or VTK", "unsupported")


def _is_dataset(obj):
    return hasattr(obj, "save_as") and hasattr(obj, "data_element")  # its class may be missing, which is then named


def _is_series(obj):
    return isinstance(obj, Sequence) and len(obj) > 0 and all(_is_dataset(each) for each in obj)


def _bytes_of(dataset):
    file = io.BytesIO()
    try:
        dataset.save_as(file)
    except Exception as error:
        _refuse(f"dataset: pydicom cannot write it: {error}", "unsupported")
    return file.getvalue()


def _volume_of_datasets(obj):
    series = [obj] if _is_dataset(obj) else obj
    return _c._volume_of_slices([_bytes_of(each) for each in series], "series")


def _check_numbers(array, what):
    if array.dtype.kind not in "biuf":
        _refuse(f"{what}: its elements are {array.dtype}, not real numbers", "unsupported")


def _scaled(affine, mm):
    return np.diag([mm, mm, mm, 1.0]) @ affine


def _volume_of_nibabel(image):
    data = np.asanyarray(image.dataobj)
    if data.ndim > 3 and all(n == 1 for n in data.shape[3:]):
        data = data.reshape(data.shape[:3])
    if data.ndim != 3:
        _refuse(f"nibabel image: shape {data.shape} is a sequence of volumes; give one of them", "unsupported")
    _check_numbers(data, "nibabel image")
    if image.affine is None:
        _refuse("nibabel image: has no affine: its place is unknown")
    header = image.header
    if hasattr(header, "get_sform") and hasattr(header, "binaryblock"):
        return _volume_of_nifti(image, data)
    if "goodRASFlag" in getattr(header, "keys", lambda: ())() and int(header["goodRASFlag"]) == 1:  # FreeSurfer's MGH
        return _c.Volume(data, image.affine, frame="RAS")
    _refuse(f"nibabel image: {type(image).__name__} declares no orientation; convert it to NIfTI with a coded sform, or "
            "give Volume(array, affine, frame=...)")


def _volume_of_nifti(image, data):
    header = type(image)(data, image.affine, image.header).header  # with the codes of the affine that the image has
    sform, qform = int(header["sform_code"]), int(header["qform_code"])
    if sform <= 0 and qform <= 0:
        _refuse("nibabel image: neither sform nor qform has a code: the orientation is not declared; set_sform(affine, code) "
                "states it, or give Volume(array, affine, frame=...)")
    unit = header.get_xyzt_units()[0]
    factors = {"mm": 1.0, "meter": 1000.0, "micron": 1e-3, "unknown": 1.0}
    if unit not in factors:
        _refuse(f'nibabel image: the unit of length is "{unit}"')
    header.set_data_dtype(np.float32)
    header.set_data_shape(data.shape)
    header.set_slope_inter(1, 0)
    size = int(header["sizeof_hdr"])
    header["vox_offset"], header["magic"] = size + 4, b"n+1" if size == 348 else b"n+2"  # one file, also of a pair
    voxels = np.asarray(data, header.endianness + "f4")
    volume = _c._volume_of_nifti(header.binaryblock + bytes(4) + voxels.tobytes("F"), "nibabel image")
    own = _scaled(image.affine, factors[unit])
    if not np.allclose(volume.affine, _TO_LPS @ own, rtol=1e-5, atol=1e-3):
        _refuse("nibabel image: its affine differs from the sform and qform of its header; set_sform(image.affine, code) "
                "makes them one")
    # nibabel's affine has more digits than the header.
    return _with_warnings(_c.Volume(data, own, frame="RAS"), volume.warnings)


def _with_warnings(volume, warnings):
    if not warnings:
        return volume
    rebuild, state = volume.__reduce_ex__(2), volume.__getstate__()
    made = rebuild[0](*rebuild[1])
    made.__setstate__((*state[:2], warnings))
    return made


def _volume_of_itk(image):
    dimension = getattr(image, "GetDimension", lambda: 3)()
    if dimension == 3 and hasattr(image, "GetImageDimension"):
        dimension = image.GetImageDimension()
    if dimension != 3:
        _refuse(f"image: has {dimension} dimensions, must be 3", "unsupported")
    if int(image.GetNumberOfComponentsPerPixel()) != 1:
        _refuse("image: several values in a voxel", "unsupported")
    direction = image.GetDirection()
    if hasattr(direction, "GetVnlMatrix"):
        vnl = direction.GetVnlMatrix()
        direction = [[vnl.get(i, j) for j in range(3)] for i in range(3)]
    direction = np.asarray(direction, float).reshape(3, 3)
    package = _package(image)
    read = getattr(package, "GetArrayViewFromImage", None) or getattr(package, "array_view_from_image", None) or np.asarray
    affine = np.eye(4)
    affine[:3, :3] = direction * np.asarray(image.GetSpacing(), float)
    affine[:3, 3] = np.asarray(image.GetOrigin(), float)
    if hasattr(image, "GetBufferedRegion"):  # the origin is that of index 0, which need not be the first voxel
        index = image.GetBufferedRegion().GetIndex()
        affine[:3, 3] += affine[:3, :3] @ np.array([index[i] for i in range(3)], float)
    return _c.Volume(np.asarray(read(image)).transpose(2, 1, 0), affine, frame="LPS")


def _numpy(vtk_array):
    if isinstance(vtk_array, np.ndarray):
        return vtk_array
    return importlib.import_module("vtkmodules.util.numpy_support").vtk_to_numpy(vtk_array)


def _volume_of_vtk(image, frame):
    if not (hasattr(image, "GetOrigin") and hasattr(image, "GetSpacing")):
        _refuse(f"volume: {type(image).__name__} has no regular grid", "unsupported")
    scalars = image.GetPointData().GetScalars()
    if scalars is None or scalars.GetNumberOfComponents() != 1:
        _refuse("vtkImageData: has no scalars with one value in a point", "unsupported")
    if scalars.GetDataTypeAsString() == "bit":
        _refuse("vtkImageData: its scalars are bits, which NumPy has not: apply vtkImageCast", "unsupported")
    shape = image.GetDimensions()
    affine = np.eye(4)
    if hasattr(image, "GetDirectionMatrix"):
        matrix = image.GetDirectionMatrix()
        affine[:3, :3] = [[matrix.GetElement(i, j) for j in range(3)] for i in range(3)]
    affine[:3, :3] *= np.asarray(image.GetSpacing(), float)
    # The origin is that of index 0, which need not be the first voxel.
    affine[:3, 3] = image.GetOrigin() + affine[:3, :3] @ np.asarray(image.GetExtent()[::2], float)
    return _c.Volume(_numpy(scalars).reshape(shape, order="F"), affine, frame=frame)


# Surfaces

def as_surface(obj, *, frame=None, unit=None):
    """A Surface of a Surface, a path, a pair (vertices, faces), or an object of another package.

    trimesh mesh (its .units are converted), vtkPolyData or PyVista's PolyData (a field SPACE is honoured). frame: of the
    vertices, "LPS" or "RAS", where the object does not state it; unit: of length, mm unless stated.
    """
    if isinstance(obj, _c.Surface):
        _own_frame(frame, "LPS", "a Surface")
        return obj
    if isinstance(obj, (str, os.PathLike)):
        _own_frame(frame, "LPS", "a file, whose frame is read from it: the Surface")
        return _c.read_surface(obj)
    if hasattr(obj, "GetPolys"):
        vertices, faces, declared = _triangles_of_vtk(obj)
        frame = _agreed(frame, declared.get("space"), "frame", _c._space_signs)
        unit = _agreed(unit, declared.get("unit", declared.get("units")), "unit", _c._unit_mm)
    elif hasattr(obj, "vertices") and hasattr(obj, "faces"):
        vertices, faces = obj.vertices, obj.faces
        unit = _agreed(unit, getattr(obj, "units", None), "unit", _c._unit_mm)
    elif isinstance(obj, Sequence) and not isinstance(obj, str) and len(obj) == 2:
        vertices, faces = obj
    else:
        _refuse(f"surface: {type(obj).__name__} is neither a Surface, a path, (vertices, faces) nor a mesh of trimesh, VTK "
                "or PyVista", "unsupported")
    return _c.Surface(vertices, faces, frame=_stated(frame, type(obj).__name__), unit=unit or "mm")


def _agreed(given, declared, name, meaning):
    if given is not None and declared is not None and meaning(given) != meaning(declared):
        _refuse(f'{name}: "{given}" is given, but the object states "{declared}"', "usage")
    return declared if given is None else given


def _triangles_of_vtk(mesh):
    if hasattr(mesh, "triangulate") and not mesh.is_all_triangles:
        mesh = mesh.triangulate()
    fields = mesh.GetFieldData()
    declared = {}
    for i in range(fields.GetNumberOfArrays()):
        array = fields.GetAbstractArray(i)
        if array.GetName() and array.GetName().lower() in ("space", "unit", "units") and array.GetNumberOfValues() > 0:
            declared[array.GetName().lower()] = str(array.GetVariantValue(0).ToString())
    cells = mesh.GetPolys()
    if mesh.GetStrips().GetNumberOfCells() or cells.GetNumberOfCells() == 0:
        _refuse("vtkPolyData: holds no plain triangles: apply vtkTriangleFilter", "unsupported")
    sizes = np.diff(_numpy(cells.GetOffsetsArray()))
    if (sizes != 3).any():
        _refuse("vtkPolyData: holds polygons that are no triangles: apply vtkTriangleFilter", "unsupported")
    return _numpy(mesh.GetPoints().GetData()), _numpy(cells.GetConnectivityArray()).reshape(-1, 3), declared


def _mask_on(volume, mask):
    """A mask as as_volume takes it, or an array of the volume's shape (i, j, k) on its grid."""
    if not isinstance(mask, np.ndarray):
        return as_volume(mask)
    if mask.shape != tuple(volume.shape):
        turned = "; an array (k, j, i) needs .transpose(2, 1, 0)" if mask.shape == tuple(volume.shape)[::-1] else ""
        _refuse(f"mask: an array of shape {mask.shape} is not on the volume's grid, whose shape (i, j, k) is {tuple(volume.shape)}"
                + turned)
    _check_numbers(mask, "mask")
    if np.ma.is_masked(mask):
        _refuse("mask: a masked array: what it masks is neither body nor surroundings; give mask.filled(0)")
    if not np.isfinite(mask).all():
        _refuse("mask: holds values that are not finite: what is not 0 is the body", "not_finite")
    return _c.Volume((mask != 0).astype(np.float32), volume.affine, frame="LPS")


def as_model(obj):
    """The arguments of a model: {"volume" or "surface", "mask", "window_hu", "scale_sigma", "points"}."""
    if isinstance(obj, Mapping):
        known = ("volume", "surface", "mask", "window_hu", "scale_sigma", "points")
        if unknown := sorted(set(obj) - set(known)):
            _refuse(f"models: {', '.join(map(str, unknown))}: a model in memory has {', '.join(known)}", "unknown_key")
        obj = {name: value for name, value in obj.items() if value is not None}
        if ("volume" in obj) == ("surface" in obj) or ("surface" in obj and {"mask", "window_hu"} & set(obj)):
            _refuse('models: give "volume" (with "mask" or "window_hu") or "surface"')
        model = dict(obj)
        for name, convert in (("volume", as_volume), ("surface", as_surface)):
            if name in model:
                model[name] = convert(model[name])
        if "mask" in model:
            model["mask"] = _mask_on(model["volume"], model["mask"])
        if not isinstance(model.get("points", {}), Mapping):
            _refuse(f"points: {type(model['points']).__name__} is not {{name: (x, y, z)}}", "usage")
        if "points" in model:
            model["points"] = [(name, np.asarray(place, float)) for name, place in model["points"].items()]
        return model
    is_surface = isinstance(obj, _c.Surface) or hasattr(obj, "GetPolys") or hasattr(obj, "faces")
    return {"surface": as_surface(obj)} if is_surface else {"volume": as_volume(obj)}


# Images and cameras

def as_image(obj, *, name="", pixel_mm=None, source_detector_mm=None, range=None, frame=None):
    """An XrayImage of an XrayImage, a path, a pydicom dataset, or an array (height, width); frame: 1-based.

    pixel_mm, source_detector_mm and range are those of an array; the others state their own. frame is of a file or a
    dataset. name: of the image; an XrayImage keeps its own.
    """
    stated = {"pixel_mm": pixel_mm, "source_detector_mm": source_detector_mm, "range": range}
    own = isinstance(obj, (_c.XrayImage, str, os.PathLike)) or _is_dataset(obj)
    if own and any(value is not None for value in stated.values()):
        _refuse("image: pixel_mm, source_detector_mm and range are for arrays, other images state their own", "usage")
    if frame is not None and (isinstance(obj, _c.XrayImage) or not own):
        _refuse("image: frame is for files and datasets, an array or XrayImage is one image", "usage")
    if isinstance(obj, _c.XrayImage):
        return obj
    if isinstance(obj, (str, os.PathLike)):
        return _c.read_image(obj, frame=frame, name=name or None)
    if _is_dataset(obj):
        return _c._image_of_dicom(_bytes_of(obj), name or "dataset", frame)
    return _c.XrayImage(obj, name=name, **stated)


def as_images(images, what, **stated):
    """XrayImages of an array (n, height, width) or a list of what as_image takes."""
    if isinstance(images, (str, os.PathLike, _c.XrayImage)) or _is_dataset(images):
        _refuse(f"{what}: one {'path' if isinstance(images, (str, os.PathLike)) else type(images).__name__}: give an array "
                "(n, height, width), such as a dataset's pixel_array, or a list with an image in each element", "usage")
    if not hasattr(images, "__iter__"):
        _refuse(f"{what}: {type(images).__name__} is neither an array (n, height, width) nor a list of images", "usage")
    return [_named(as_image, image, f"{what}: image {i}", **stated) for i, image in enumerate(images, 1)]


def _named(convert, obj, what, **stated):
    """convert(obj), whose refusal names what it was of."""
    try:
        return convert(obj, **stated)
    except InputError as error:
        raise InputError(error.code, f"{what}: {error.message}", error.view, error.figures) from None


def as_camera(obj):
    """A Camera of a Camera, a path, (K, R, t), {"K", "R", "t"}, a 3 x 4 projection, or (Calibration, view)."""
    if isinstance(obj, _c.Camera):
        return obj
    if isinstance(obj, (str, os.PathLike)):
        return _c.import_camera(obj)
    if isinstance(obj, Mapping):
        if all(name in obj for name in "KRt"):
            return _c.Camera(obj["K"], obj["R"], obj["t"])
        if "projection" in obj:
            return _c.Camera.from_projection(obj["projection"])
        _refuse(f'camera: a mapping with {", ".join(map(repr, obj)) or "no keys"}; must have "K", "R" and "t", or "projection"',
                "unsupported")
    if isinstance(obj, Sequence) and len(obj) == 2 and isinstance(obj[0], _c.Calibration):
        calibration, view = obj
        pose = calibration.camera_from_calibrator(view)
        return _c.Camera(calibration.intrinsics(view), pose[:3, :3], pose[:3, 3])
    if isinstance(obj, Sequence) and len(obj) == 3 and np.shape(obj[0]) == (3, 3):
        return _c.Camera(*obj)
    if np.shape(obj) == (3, 4):
        return _c.Camera.from_projection(obj)
    _refuse(f"camera: {type(obj).__name__} is neither a Camera, a path, (K, R, t), a 3 x 4 projection nor (Calibration, view)",
            "unsupported")
