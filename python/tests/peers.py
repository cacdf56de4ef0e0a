# SPDX-License-Identifier: Apache-2.0
"""Other people's libraries as judges: each function makes `count` files by one and compares what helicarm reads, or the
other way round. Run as a program it prints the rows of docs/formats.md#conventions-and-peers:

PYTHONPATH=build/python HELICARM_PROGRAM=build/bin/helicarm python3 python/tests/peers.py
"""
import atexit
import functools
import importlib
import importlib.util
import io
import json
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import zlib

import numpy as np

import dicom_peers
import helicarm

COUNT = 200
PROGRAM = os.environ.get("HELICARM_PROGRAM")
TO_LPS = np.diag([-1, -1, 1, 1.0])


def random_rotation(random):
    q = random.standard_normal(4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def random_affine(random, shear=0.0):
    place = np.eye(4)
    spacing = random.uniform(0.2, 3, 3)
    turn = random_rotation(random)
    if random.random() < 0.5:
        turn[:, random.integers(3)] *= -1
    place[:3, :3] = turn @ (np.diag(spacing) + shear * np.triu(random.uniform(-1, 1, (3, 3)), 1))
    place[:3, 3] = random.uniform(-300, 300, 3)
    return place


def random_voxels(random, shape, dtype):
    dtype = np.dtype(dtype)
    if dtype.kind == "f":
        return random.normal(0, 500, shape).astype(dtype)
    low, high = max(np.iinfo(dtype).min, -5000), min(np.iinfo(dtype).max, 5000)
    return random.integers(low, high, shape, endpoint=True).astype(dtype)


def apart(shape, one, other):
    """Largest distance, mm, of the places of a volume's corners by two affines."""
    corners = np.array([[i, j, k, 1] for i in (0, shape[0] - 1) for j in (0, shape[1] - 1) for k in (0, shape[2] - 1)])
    return np.linalg.norm((corners @ (one - other).T)[:, :3], axis=1).max()


def nibabel_writes(folder, count=COUNT):
    """(files, largest distance in mm, largest difference of a voxel): NIfTI files, pairs and images in memory."""
    nibabel = importlib.import_module("nibabel")
    random, far, off = np.random.default_rng(1), 0.0, 0.0
    types = ["u1", "i1", "i2", "u2", "i4", "f4", "f8", "i8"]
    for n in range(count):
        unit, mm = (("mm", 1.0), ("mm", 1.0), ("meter", 1e3), ("micron", 1e-3))[n % 4]
        form = ("sform", "qform", "both", "sheared")[n // 4 % 4]
        shape = tuple(random.integers(2, 9, 3))
        place = random_affine(random, 0.2 if form == "sheared" else 0)
        kind = (nibabel.Nifti1Image, nibabel.Nifti2Image, nibabel.Nifti1Pair, nibabel.Nifti2Pair)[n // 16 % 4]
        pair, second = kind in (nibabel.Nifti1Pair, nibabel.Nifti2Pair), kind in (nibabel.Nifti2Image, nibabel.Nifti2Pair)
        header = kind.header_class(endianness="<>"[n % 2])
        data = random_voxels(random, shape, types[n % len(types)])
        header.set_data_dtype(data.dtype)
        header.set_xyzt_units(unit)
        stated = np.diag([1 / mm, 1 / mm, 1 / mm, 1]) @ place
        image = kind(data, stated, header)
        if form in ("qform", "both"):
            image.set_qform(stated, 1)
        image.set_sform(None if form == "qform" else stated, {"qform": 0, "both": 1}.get(form, 1 + n % 4))
        path = folder / f"v{n}.{'hdr' if pair else 'nii'}{'.gz' if n % 2 else ''}"
        nibabel.save(image, path)
        if n % 3 == 0:  # which nibabel chooses itself
            content = bytearray(nibabel.openers.Opener(path).read())
            scale = np.array([random.uniform(0.5, 1.5), random.integers(-100, 100)], "<>"[n % 2] + ("f8" if second else "f4"))
            content[176 if second else 112:192 if second else 120] = scale.tobytes()
            with nibabel.openers.Opener(path, "wb") as file:
                file.write(content)
        peer = nibabel.load(path)
        assert apart(shape, peer.affine, stated) * mm < 0.1 and (int(peer.header["sform_code"]) == 0) == (form == "qform")
        expected = TO_LPS @ np.diag([mm, mm, mm, 1]) @ peer.affine
        values = np.asarray(peer.get_fdata(), np.float32)
        files = [path, pathlib.Path(str(path).replace(".hdr", ".img"))] if pair else [path]
        for volume in (*map(helicarm.read_volume, files), helicarm.as_volume(peer)):
            far = max(far, apart(shape, volume.affine, expected))
            off = max(off, np.abs(volume.array - values).max() / max(1, np.abs(values).max()))
    return count, far, off


def ct_datasets(pydicom, random, n):
    """The slices of one series in random order, with their affine and values."""
    shape = tuple(random.integers(3, 9, 3))
    place = random_affine(random)
    place[:3, 2] = np.cross(place[:3, 0], place[:3, 1])
    place[:3, 2] *= random.uniform(0.5, 4) / np.linalg.norm(place[:3, 2])
    if n % 4 == 3:  # the gantry is tilted: slices move along their columns
        place[:3, 2] += np.tan(np.radians(random.uniform(5, 25))) * np.linalg.norm(place[:3, 2]) * (
            place[:3, 1] / np.linalg.norm(place[:3, 1]))
    signed, slope, shift = bool(n % 2), (1.0, 0.25, 2.0)[n % 3], float((-1024, 0, -8192)[n % 3])
    stored = random.integers(-2000 if signed else 0, 3000, shape, endpoint=True)
    syntax = ("ImplicitVRLittleEndian", "ExplicitVRLittleEndian", "ExplicitVRBigEndian", "RLELossless",
              "DeflatedExplicitVRLittleEndian")[n % 5]
    uid, datasets = pydicom.uid, []
    series, study, frame = uid.generate_uid(), uid.generate_uid(), uid.generate_uid()
    spacing = np.linalg.norm(place[:3, :2], axis=0)
    for k in random.permutation(shape[2]):
        meta = pydicom.dataset.FileMetaDataset()
        meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = uid.CTImageStorage, uid.generate_uid()
        meta.TransferSyntaxUID = uid.ExplicitVRLittleEndian if syntax == "RLELossless" else getattr(uid, syntax)
        dataset = pydicom.dataset.FileDataset(None, {}, file_meta=meta, preamble=bytes(128))
        dataset.is_little_endian = syntax != "ExplicitVRBigEndian"
        dataset.is_implicit_VR = syntax == "ImplicitVRLittleEndian"
        dataset.SOPClassUID, dataset.SOPInstanceUID = uid.CTImageStorage, meta.MediaStorageSOPInstanceUID
        dataset.StudyInstanceUID, dataset.SeriesInstanceUID, dataset.FrameOfReferenceUID = study, series, frame
        dataset.Modality, dataset.PatientID, dataset.ImageType = "CT", "T", ["ORIGINAL", "PRIMARY", "AXIAL"]
        dataset.Rows, dataset.Columns, dataset.SamplesPerPixel = shape[1], shape[0], 1
        dataset.PhotometricInterpretation = "MONOCHROME2"
        dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = 16, 16, 15
        dataset.PixelRepresentation = int(signed)
        dataset.RescaleSlope, dataset.RescaleIntercept, dataset.RescaleType = slope, shift, "HU"
        digits = pydicom.valuerep.format_number_as_ds
        dataset.PixelSpacing = [digits(float(spacing[1])), digits(float(spacing[0]))]
        dataset.ImageOrientationPatient = [digits(float(x)) for x in (place[:3, :2] / spacing).T.ravel()]
        dataset.ImagePositionPatient = [digits(float(x)) for x in place[:3, 2] * k + place[:3, 3]]
        dataset.InstanceNumber = int(k) + 1
        order = "<" if dataset.is_little_endian else ">"
        dataset.PixelData = stored[:, :, k].T.astype(order + ("i2" if signed else "u2")).tobytes()
        dataset["PixelData"].VR = "OW"
        if syntax == "RLELossless":
            dataset.compress(uid.RLELossless)
        datasets.append(dataset)
    return datasets, shape, place, (slope * stored + shift).astype(np.float32)


def pydicom_writes_series(folder, count=COUNT):
    """(series, largest distance in mm, largest difference of a voxel): CT series of files, and of datasets in memory."""
    pydicom = importlib.import_module("pydicom")
    random, far, off = np.random.default_rng(2), 0.0, 0.0
    for n in range(count):
        datasets, shape, place, values = ct_datasets(pydicom, random, n)
        series = folder / f"s{n}"
        series.mkdir()
        for i, dataset in enumerate(datasets):
            dataset.save_as(series / f"{i}.dcm", write_like_original=False)
        again = [pydicom.dcmread(path) for path in series.iterdir()]
        for volume in (helicarm.read_volume(series), helicarm.as_volume(again)):
            flipped = volume.affine[:3, 2] @ place[:3, 2] < 0  # slices are ordered along the normal of their axes
            expected = place.copy()
            if flipped:
                expected[:3, 3] += place[:3, 2] * (shape[2] - 1)
                expected[:3, 2] *= -1
            far = max(far, apart(shape, volume.affine, expected))
            off = max(off, np.abs(volume.array - (values[:, :, ::-1] if flipped else values)).max())
    return count, far, off


def compressed_bits(pydicom, dataset, frames, coding):
    """Replaces the frames of Bits Allocated 1 by compressed ones: RLE, Deflated Image Frame Compression, JPEG 2000."""
    packed = [np.packbits(frame.ravel(), bitorder="little") for frame in frames]
    dataset.is_little_endian, dataset.is_implicit_VR = True, False
    if coding == 0:
        syntax, coded = pydicom.uid.RLELossless, [pydicom.pixel_data_handlers.rle_handler.rle_encode_frame(p[None]) for p in packed]
    elif coding == 1 or not importlib.util.find_spec("PIL"):
        syntax = pydicom.uid.UID("1.2.840.10008.1.2.8.1")
        pydicom._uid_dict.UID_dictionary.setdefault(syntax, ("Deflated Image Frame Compression", "Transfer Syntax", "", "", ""))
        coded = [zlib.compress(p.tobytes(), wbits=-15) for p in packed]
    else:
        syntax, coded = pydicom.uid.JPEG2000Lossless, [jpeg_2000(frame.astype(np.uint8)) for frame in frames]
    dataset.file_meta.TransferSyntaxUID = syntax
    dataset.PixelData = pydicom.encaps.encapsulate([bytes(one) for one in coded])
    dataset["PixelData"].is_undefined_length = True


def jpeg_2000(frame):
    stream = io.BytesIO()
    importlib.import_module("PIL.Image").fromarray(frame).save(stream, format="JPEG2000", no_jp2=True)
    return stream.getvalue()


def pydicom_writes_segmentations(folder, count=COUNT):
    """(files, largest distance in mm, voxels that differ): DICOM segmentations of one to four segments, without empty frames. A
    half of them compressed: packed bits in pydicom's RLE or deflated by zlib, pixels in JPEG 2000 by Pillow."""
    pydicom = importlib.import_module("pydicom")
    random, far, off = np.random.default_rng(7), 0.0, 0
    digits, Dataset, Sequence = pydicom.valuerep.format_number_as_ds, pydicom.Dataset, pydicom.Sequence

    def group(**values):
        item = Dataset()
        for name, value in values.items():
            setattr(item, name, value)
        return Sequence([item])

    for n in range(count):
        datasets, shape, place, _ = ct_datasets(pydicom, random, 4 * n)  # of a gantry that is not tilted
        labels = random.integers(0, 2 + n % 4, shape)
        labels[:, :, 0] = labels[:, :, -1] = 1  # the whole extent, which the affine tells
        dataset = datasets[0]
        meta = dataset.file_meta
        meta.MediaStorageSOPClassUID = dataset.SOPClassUID = "1.2.840.10008.5.1.4.1.1.66.4"
        meta.TransferSyntaxUID = (pydicom.uid.ExplicitVRLittleEndian, pydicom.uid.ImplicitVRLittleEndian,
                                  pydicom.uid.DeflatedExplicitVRLittleEndian)[n % 3]
        dataset.is_little_endian, dataset.is_implicit_VR = True, n % 3 == 1
        axes, spacing = dataset.ImageOrientationPatient, dataset.PixelSpacing
        for name in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "RescaleSlope", "RescaleIntercept",
                     "RescaleType", "PixelData"):
            delattr(dataset, name)
        dataset.Modality, dataset.SegmentationType = "SEG", "BINARY"
        dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = 1, 1, 0, 0
        dataset.SegmentSequence = Sequence([group(SegmentNumber=k, SegmentLabel=f"part {k}")[0] for k in range(1, labels.max() + 1)])
        measures = {"PixelSpacing": spacing}
        if n % 2:
            measures["SpacingBetweenSlices"] = digits(float(np.linalg.norm(place[:3, 2])))
        dataset.SharedFunctionalGroupsSequence = group(PlaneOrientationSequence=group(ImageOrientationPatient=axes),
                                                       PixelMeasuresSequence=group(**measures))
        frames, bits = [], []
        for k in range(1, labels.max() + 1):
            for z in random.permutation(shape[2]):
                if (labels[:, :, z] == k).any():
                    position = [digits(float(x)) for x in place[:3, 2] * z + place[:3, 3]]
                    frames.append(group(PlanePositionSequence=group(ImagePositionPatient=position),
                                        SegmentIdentificationSequence=group(ReferencedSegmentNumber=k))[0])
                    bits.append((labels[:, :, z] == k).T)
        dataset.PerFrameFunctionalGroupsSequence, dataset.NumberOfFrames = Sequence(frames), len(frames)
        packed = pydicom.pixel_data_handlers.numpy_handler.pack_bits(np.array(bits).astype(np.uint8).ravel())
        dataset.PixelData = packed + bytes(len(packed) % 2)
        dataset["PixelData"].VR = "OB"
        path = folder / f"s{n}.dcm"
        dataset.save_as(path, write_like_original=False)
        peer = pydicom.dcmread(path)
        assert np.array_equal(peer.pixel_array.reshape(np.shape(bits)), bits)
        if n % 6 >= 3:
            compressed_bits(pydicom, dataset, bits, n % 6 - 3)
            dataset.save_as(path, write_like_original=False)
        volume = helicarm.read_volume(path)
        flipped = volume.affine[:3, 2] @ place[:3, 2] < 0
        expected = place.copy()
        if flipped:
            expected[:3, 3] += place[:3, 2] * (shape[2] - 1)
            expected[:3, 2] *= -1
        far = max(far, apart(shape, volume.affine, expected))
        off = max(off, int((volume.array != (labels[:, :, ::-1] if flipped else labels)).sum()))
    return count, far, off


def pydicom_writes_label_maps(folder, count=70):
    """(files, largest distance in mm, voxels that differ): LABELMAP segmentations of 8 and 16 bits by pydicom; uncompressed,
    deflated, in RLE, compressed by DCMTK's programs (lossless JPEG, JPEG-LS) and by Pillow (JPEG 2000)."""
    pydicom = importlib.import_module("pydicom")
    random, far, off = np.random.default_rng(8), 0.0, 0
    digits, Dataset, Sequence, uid = pydicom.valuerep.format_number_as_ds, pydicom.Dataset, pydicom.Sequence, pydicom.uid

    def item(**values):
        made = Dataset()
        for name, value in values.items():
            setattr(made, name, value)
        return made

    pillow = importlib.util.find_spec("PIL")

    for n in range(count):
        datasets, shape, place, _ = ct_datasets(pydicom, random, 4 * n)  # of a gantry that is not tilted
        bits = (8, 16)[n // 7 % 2]
        numbers = np.unique(random.integers(1, 2**bits, 4))
        labels = np.append(numbers, 0)[random.integers(0, len(numbers) + 1, shape)]
        dataset = datasets[0]
        meta = dataset.file_meta
        meta.MediaStorageSOPClassUID = dataset.SOPClassUID = "1.2.840.10008.5.1.4.1.1.66.7"
        meta.TransferSyntaxUID = {1: uid.ImplicitVRLittleEndian, 2: uid.DeflatedExplicitVRLittleEndian,
                                  6: uid.JPEG2000Lossless if pillow else uid.ExplicitVRLittleEndian}.get(n % 7, uid.ExplicitVRLittleEndian)
        dataset.is_little_endian, dataset.is_implicit_VR = True, n % 7 == 1
        axes, spacing = dataset.ImageOrientationPatient, dataset.PixelSpacing
        for name in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "RescaleSlope", "RescaleIntercept",
                     "RescaleType", "PixelData"):
            delattr(dataset, name)
        dataset.Modality, dataset.SegmentationType, dataset.PixelPaddingValue = "SEG", "LABELMAP", 0
        dataset["PixelPaddingValue"].VR = "US"
        dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit, dataset.PixelRepresentation = bits, bits, bits - 1, 0
        dataset.SegmentSequence = Sequence([item(SegmentNumber=int(k), SegmentLabel=f"part {k}") for k in [0, *numbers]])
        dataset.SharedFunctionalGroupsSequence = Sequence([item(
            PlaneOrientationSequence=Sequence([item(ImageOrientationPatient=axes)]),
            PixelMeasuresSequence=Sequence([item(PixelSpacing=spacing)]))])
        order = random.permutation(shape[2])
        dataset.PerFrameFunctionalGroupsSequence = Sequence([item(PlanePositionSequence=Sequence([item(
            ImagePositionPatient=[digits(float(x)) for x in place[:3, 2] * z + place[:3, 3]])])) for z in order])
        dataset.NumberOfFrames = len(order)
        frames = np.stack([labels[:, :, z].T for z in order]).astype("<u2" if bits == 16 else "u1")
        dataset.PixelData = frames.tobytes() + bytes(frames.nbytes % 2)
        dataset["PixelData"].VR = "OW" if bits == 16 else "OB"
        if n % 7 == 3:
            dataset.compress(uid.RLELossless)
        if n % 7 == 6 and pillow:
            dataset.PixelData = pydicom.encaps.encapsulate([jpeg_2000(frame) for frame in frames])
            dataset["PixelData"].is_undefined_length = True
        path = folder / f"l{n}.dcm"
        dataset.save_as(path, write_like_original=False)
        if n % 7 in (4, 5) and shutil.which("dcmcjpeg") and shutil.which("dcmcjpls"):
            plain, path = path, folder / f"c{n}.dcm"
            subprocess.run((["dcmcjpeg"], ["dcmcjpls"])[n % 7 - 4] + [str(plain), str(path)], check=True, capture_output=True)
            assert pydicom.dcmread(path).file_meta.TransferSyntaxUID != meta.TransferSyntaxUID
        volume = helicarm.read_volume(path)
        flipped = volume.affine[:3, 2] @ place[:3, 2] < 0
        expected = place.copy()
        if flipped:
            expected[:3, 3] += place[:3, 2] * (shape[2] - 1)
            expected[:3, 2] *= -1
        far = max(far, apart(shape, volume.affine, expected))
        off = max(off, int((volume.array != (labels[:, :, ::-1] if flipped else labels)).sum()))
    return count, far, off


def pydicom_reads_images(folder, count=6):
    """(files, largest difference of a pixel, largest of spacing and distance in mm): simulated X-ray images."""
    pydicom = importlib.import_module("pydicom")
    off = far = 0.0
    files = 0
    for seed in range(1, count // 2 + 1):
        helicarm.simulate_case(folder / f"c{seed}", seed=seed, size=512, bits=(8, 12, 16)[seed % 3])
        for path in sorted((folder / f"c{seed}").glob("*.dcm")):
            peer, image = pydicom.dcmread(path), helicarm.read_image(path)
            stored = peer.pixel_array.astype(float)
            if peer.PhotometricInterpretation == "MONOCHROME1":
                stored = 2 ** peer.BitsStored - 1 - stored
            off = max(off, np.abs(stored - image.pixels).max())
            if "ImagerPixelSpacing" in peer:
                far = max(far, np.abs(np.array(peer.ImagerPixelSpacing[::-1], float) - image.pixel_mm).max())
            far = max(far, abs(float(peer.DistanceSourceToDetector) - image.source_detector_mm))
            files += 1
    return files, off, far


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


def scipy_rotations(folder, count=COUNT):
    """(files, largest distance in mm): ITK's Euler3DTransform, whose rotation SciPy makes of its angles."""
    rotation = importlib.import_module("scipy.spatial.transform").Rotation
    random, far = np.random.default_rng(5), 0.0
    for n in range(count):
        angles, shift, centre = random.uniform(-3, 3, 3), random.uniform(-100, 100, 3), random.uniform(-100, 100, 3)
        # itk::Euler3DTransform: parameters are the angles about x, y, z; R = Rz Rx Ry
        path = folder / f"t{n}.tfm"
        path.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                        f"Parameters: {' '.join(map(repr, map(float, [*angles, *shift])))}\n"
                        f"FixedParameters: {' '.join(map(repr, map(float, centre)))} 0\n")
        turn = rotation.from_euler("ZXY", [angles[2], angles[0], angles[1]])
        matrix = helicarm.import_transform(path)["moving_from_fixed"]
        points = random.uniform(-200, 200, (5, 3))
        expected = turn.apply(points - centre) + centre + shift
        far = max(far, np.abs(points @ matrix[:3, :3].T + matrix[:3, 3] - expected).max())
        camera = helicarm.Camera(np.diag([1000, 1000, 1]), turn.as_matrix(), [0, 0, 900])
        far = max(far, (camera.rotation * turn.inv()).magnitude() * 200)
    return count, far


def opencv_writes(folder, count=COUNT):
    """(files, largest distance in px): YAML, XML and JSON of cv2.FileStorage, against cv2.projectPoints."""
    cv2 = importlib.import_module("cv2")
    random, far = np.random.default_rng(6), 0.0
    for n in range(count):
        path = folder / f"k{n}.{('yaml', 'xml', 'json', 'yml')[n % 4]}"
        k = np.array([[random.uniform(500, 6000), 0, random.uniform(0, 2000)],
                      [0, random.uniform(500, 6000), random.uniform(0, 2000)], [0, 0, 1]])
        rvec, tvec = random.uniform(-1.7, 1.7, 3), np.array([*random.uniform(-100, 100, 2), random.uniform(500, 1500)])
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        file.write("image_width", 1024)
        file.write("image_height", 768)
        file.write("camera_matrix", k)
        file.write("distortion_coefficients", np.zeros((1, 5)))
        if n % 2:
            file.write("rvec", rvec.reshape(3, 1))
        else:
            file.write("R", cv2.Rodrigues(rvec)[0])
        file.write("tvec" if n % 2 else "T", tvec.reshape(3, 1))
        file.release()
        points = random.uniform(-100, 100, (8, 3))
        expected = cv2.projectPoints(points, rvec, tvec, k, None)[0][:, 0]
        far = max(far, np.abs(helicarm.import_camera(path).project(points) - expected).max())
    return count, far


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout + done.stderr


def dcmtk_writes(folder, count=16):
    """(files, largest difference of a pixel): simulated images that DCMTK wrote in every transfer syntax it has."""
    off, files = 0.0, 0
    ways = [("dcmconv", "+te"), ("dcmconv", "+ti"), ("dcmconv", "+tb"), ("dcmconv", "+td"), ("dcmcrle",), ("dcmcjpls",),
            ("dcmcjpeg", "+e1"), ("dcmcjpeg", "+el")]
    for seed in range(1, count // len(ways) // 2 + 2):
        helicarm.simulate_case(folder / f"d{seed}", seed=seed, size=512, bits=(8, 12, 16)[seed % 3])
        for path in sorted((folder / f"d{seed}").glob("*.dcm"))[:2]:
            said = run("dcmdump", "-q", path)
            assert "E:" not in said and "W:" not in said, said
            expected = helicarm.read_image(path).pixels
            for way in ways:
                other = folder / "other.dcm"
                run(*way, path, other)
                off = max(off, np.abs(helicarm.read_image(other).pixels - expected).max())
                files += 1
    return files, off


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def dcmtk_sends(folder, count=4):
    """(images, largest difference of a pixel): storescu and echoscu against `helicarm receive`."""
    port, off = free_port(), 0.0
    sent = []
    for seed in range(1, count // 2 + 1):
        helicarm.simulate_case(folder / f"e{seed}", seed=seed, size=512)
        sent += sorted((folder / f"e{seed}").glob("*.dcm"))[:2]
    inbox = folder / "inbox"
    receiver = subprocess.Popen([PROGRAM, "receive", "--out", inbox, "--port", str(port), "--seconds", "300"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        for _ in range(2000):  # until it listens
            if subprocess.run(["echoscu", "-aec", "HELICARM", "127.0.0.1", str(port)], capture_output=True).returncode == 0:
                break
        else:
            raise AssertionError("echoscu: no answer")
        for i, path in enumerate(sent):
            run("storescu", "-aec", "HELICARM", *(("-xe",), ("-xi",), ("-xb",))[i % 3], "127.0.0.1", port, path)
        receiver.send_signal(signal.SIGINT)
        receiver.communicate(timeout=60)
    finally:
        receiver.kill()
        receiver.wait()
    kept = [helicarm.read_image(path) for path in sorted(inbox.rglob("*.dcm"))]
    assert len(kept) == len(sent), (len(kept), len(sent))
    for path in sent:
        pixels = helicarm.read_image(path).pixels
        off = max(off, min(np.abs(image.pixels - pixels).max() for image in kept))
    return len(sent), off


@functools.cache
def itk_program():
    """The program of itk_peer/, built once for each run of the judges."""
    built = pathlib.Path(tempfile.mkdtemp(prefix="itk_peer_"))
    atexit.register(shutil.rmtree, built, ignore_errors=True)
    run("cmake", "-S", pathlib.Path(__file__).with_name("itk_peer"), "-B", built, "-DCMAKE_BUILD_TYPE=Release")
    run("cmake", "--build", built)
    return built / "itk_peer"


def itk_lines(*words):
    for line in run(itk_program(), *words).splitlines():
        path, *numbers = line.split()
        yield pathlib.Path(path), np.array(numbers, float)


def itk_volume(path, numbers):
    """Affine (LPS) and voxels, as ITK reads them."""
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = numbers[3:12].reshape(3, 3).T, numbers[12:]
    voxels = np.fromfile(f"{path}.raw").reshape(numbers[:3].astype(int)[::-1]).transpose()
    return affine, voxels


def itk_writes_volumes(folder, count=COUNT):
    """(files, largest distance in mm, largest difference of a voxel): MetaImage, NRRD and NIfTI of seven types."""
    far, off, files = 0.0, 0.0, 0
    for path, numbers in itk_lines("volumes", folder, count, 7):
        affine, voxels = itk_volume(path, numbers)
        volume = helicarm.read_volume(path)
        assert volume.array.shape == voxels.shape, path
        far = max(far, apart(voxels.shape, volume.affine, affine))
        off = max(off, np.abs(volume.array - voxels).max() / max(1, np.abs(voxels).max()))
        files += 1
    return files, far, off


POINTS = np.array([[0, 0, 0], [100, -50, 30], [-80, 120, 200.0]])


def itk_writes_transforms(folder, count=COUNT):
    """(files, largest distance in mm): Euler, versor and affine transforms about a centre, as text and HDF5."""
    far, files = 0.0, 0
    for path, numbers in itk_lines("transforms", folder, count, 8):
        matrix = helicarm.import_transform(path)["moving_from_fixed"]
        far = max(far, np.abs(POINTS @ matrix[:3, :3].T + matrix[:3, 3] - numbers.reshape(3, 3)).max())
        files += 1
    return files, far


def itk_reads_poses(folder, count=8):
    """(files, largest distance in mm): poses of views that `export` wrote."""
    far, files = 0.0, 0
    for seed in range(1, count // 2 + 1):
        case, out = folder / f"p{seed}", folder / f"o{seed}"
        helicarm.simulate_case(case, seed=seed, size=512)
        run(PROGRAM, "export", case, "--out", out, "--quiet")
        for path in sorted(out.glob("*_pose.tfm")):
            camera = json.loads(run(PROGRAM, "import", str(path).replace("pose.tfm", "opencv.yml"), "--json"))
            _, numbers = next(itk_lines("read-transform", path))
            expected = POINTS @ np.array(camera["R"]).T + np.array(camera["t"])
            far = max(far, np.abs(numbers.reshape(3, 3) - expected).max())
            files += 1
    return files, far


def itk_reads_masks(folder, count=8):
    """(files, largest distance in mm, voxels): masks that `segment` wrote of a ball in CTs of random geometry."""
    random, far, off = np.random.default_rng(9), 0.0, 0.0
    for n in range(count):
        shape = tuple(random.integers(28, 40, 3))
        affine = random_affine(random)
        affine[:3, :3] /= np.linalg.norm(affine[:3, :3], axis=0)
        centre = np.array(shape) // 2
        ball = np.linalg.norm(np.indices(shape).transpose(1, 2, 3, 0) - centre, axis=3) < 9
        voxels = np.where(ball, 900, 0).astype("<i2")
        turn = " ".join(map(repr, map(float, affine[:3, :3].T.ravel())))
        path, out = folder / f"ct{n}.mha", folder / f"bones{n}"
        header = (f"ObjectType = Image\nNDims = 3\nDimSize = {' '.join(map(str, shape))}\nElementType = MET_SHORT\n"
                  f"ElementSpacing = 1 1 1\nTransformMatrix = {turn}\n"
                  f"Offset = {' '.join(map(repr, map(float, affine[:3, 3])))}\nElementDataFile = LOCAL\n")
        path.write_bytes(header.encode() + voxels.tobytes(order="F"))
        seed = ",".join(map(repr, map(float, (affine @ [*centre, 1])[:3])))
        run(PROGRAM, "segment", path, "--seed", f"ball={seed}", "--out", out, "--quiet")
        file, numbers = next(itk_lines("read-volume", out / "ball.nrrd"))
        of_itk, mask = itk_volume(file, numbers)
        far = max(far, apart(mask.shape, of_itk, helicarm.read_volume(file).affine))
        off = max(off, np.abs(mask - helicarm.read_volume(file).array).max())
        corner = np.rint(np.linalg.solve(affine, of_itk[:, 3])[:3]).astype(int)
        there = voxels[tuple(slice(c, c + s) for c, s in zip(corner, mask.shape))] > 0
        assert there.sum() == ball.sum() and (there != (mask > 0)).sum() <= 0.02 * ball.sum(), n
    return count, far, off


def version_of(package):
    if package == "dcmtk":
        return subprocess.run(["dcmdump", "--version"], capture_output=True, text=True).stdout.split("v")[1].split()[0]
    if package == "itk":
        return run(itk_program(), "version").strip()
    if package in ("dicom3tools", "openigtlink"):
        return run("dpkg-query", "-W", "-f", "${Version}", {"openigtlink": "libopenigtlink-dev"}.get(package, package))
    if package == "vtk":
        return importlib.import_module("vtk").vtkVersion().GetVTKVersion()
    return importlib.import_module(package).__version__


def is_there(package):
    """Whether a judge is on this machine."""
    if package == "itk":
        return bool(PROGRAM and shutil.which("cmake")) and any(pathlib.Path("/usr").glob("lib*/cmake/ITK-*/ITKConfig.cmake"))
    if package == "dcmtk":
        return bool(PROGRAM) and all(shutil.which(name) for name in ("storescu", "echoscu", "dcmdump", "dcmconv", "dcmcrle", "dcmcjpls", "dsrdump", "dsr2html"))
    if package == "dicom3tools":
        return bool(PROGRAM and shutil.which("dciodvfy"))
    if package == "openigtlink":
        return bool(PROGRAM and shutil.which("g++")) and pathlib.Path("/usr/include/openigtlink/igtlImageMessage.h").exists()
    return importlib.util.find_spec(package) is not None


# function, package, format, direction, limits of what it returns beside the count, their units
JUDGES = [
    (nibabel_writes, "nibabel", "NIfTI-1 and NIfTI-2: `.nii`, pairs of `.hdr` and `.img`, each plain or `.gz`, and images in memory", "read", (0.05, 1e-6), ("mm", "of the largest voxel")),
    (pydicom_writes_series, "pydicom", "DICOM CT series, and datasets in memory", "read", (0.005, 0), ("mm", "HU")),
    (pydicom_writes_segmentations, "pydicom", "DICOM segmentation, BINARY", "read", (0.005, 0), ("mm", "voxels")),
    (pydicom_writes_label_maps, "pydicom", "DICOM segmentation, LABELMAP", "read", (0.005, 0), ("mm", "voxels")),
    (pydicom_reads_images, "pydicom", "DICOM X-ray image", "written", (0, 1e-6), ("grey values", "mm")),
    (vtk_writes, "vtk", "STL, PLY, VTP, OBJ, legacy VTK (4.2 and 5.1, strips), and `vtkPolyData` in memory", "read", (1e-3,), ("mm",)),
    (vtk_image, "vtk", "`vtkImageData` in memory", "read", (1e-9, 1e-12), ("mm", "of a voxel")),
    (itk_writes_volumes, "itk", "MetaImage, NRRD, NIfTI of seven types, plain and compressed", "read", (0.01, 1e-6), ("mm", "of the largest voxel")),
    (itk_writes_transforms, "itk", "ITK transforms `.tfm` and `.h5`: Euler, versor, affine", "read", (1e-6,), ("mm",)),
    (itk_reads_poses, "itk", "ITK transform `.tfm` of a view's pose", "written", (1e-6,), ("mm",)),
    (itk_reads_masks, "itk", "masks of `segment`, NRRD", "written", (1e-6, 0), ("mm", "voxels")),
    (scipy_rotations, "scipy", "ITK transform `.tfm`, Euler angles", "read", (1e-9,), ("mm",)),
    (opencv_writes, "cv2", "OpenCV YAML, XML, JSON", "read", (1e-8,), ("px",)),
    (dcmtk_writes, "dcmtk", "DICOM X-ray image in DCMTK's transfer syntaxes", "read", (0,), ("grey values",)),
    (dicom_peers.pydicom_reads_reports, "pydicom", "DICOM measurement report (SR) against result.json", "written", (1e-4, 1e-4), ("mm", "px")),
    (dicom_peers.dcmtk_reads_reports, "dcmtk", "DICOM measurement report (SR) by `dsrdump`, `dsr2html`", "written", (0,), ("warnings and errors",)),
    (dicom_peers.dciodvfy_checks, "dicom3tools", "DICOM images, derived images and measurement reports by `dciodvfy`", "written", (0,), ("errors",)),
    (dicom_peers.openigtlink_reads_images, "openigtlink", "IMAGE and TRANSFORM of `tracker send`", "sent", (0.01, 0), ("px", "grey values")),
    (dcmtk_sends, "dcmtk", "C-ECHO, C-STORE by `echoscu`, `storescu`", "received", (0,), ("grey values",)),
]


def main():
    """Rows of the judges that are named, or of all."""
    for judge, package, what, direction, _, units in JUDGES:
        if sys.argv[1:] and judge.__name__ not in sys.argv[1:]:
            continue
        if not is_there(package):
            print(f"{judge.__name__}: {package} is not installed: left out", file=sys.stderr)
            continue
        with tempfile.TemporaryDirectory() as folder:
            count, *off = judge(pathlib.Path(folder))
        result = ", ".join(f"{value:.2g} {unit}" for value, unit in zip(off, units))
        print(f"| {what} | {direction} | {package} {version_of(package)} | {count} | {result} | `peers.{judge.__name__}` |", flush=True)


if __name__ == "__main__":
    main()
