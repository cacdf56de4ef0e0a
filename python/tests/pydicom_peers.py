# SPDX-License-Identifier: Apache-2.0
"""pydicom, with Pillow and DCMTK's programs for compressed frames. Judges of peers.py."""
import importlib
import importlib.util
import io
import shutil
import subprocess
import zlib

import numpy as np

import helicarm
from peer_values import COUNT, apart, random_affine


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


def compared(path, labels, place):
    """Of a file of labels (i, j, k) that lie at `place`: largest distance in mm, voxels that differ. Slices may be read in either order."""
    volume = helicarm.read_volume(path)
    flipped = volume.affine[:3, 2] @ place[:3, 2] < 0
    expected = place.copy()
    if flipped:
        expected[:3, 3] += place[:3, 2] * (labels.shape[2] - 1)
        expected[:3, 2] *= -1
    differ = volume.array != (labels[:, :, ::-1] if flipped else labels)
    return apart(labels.shape, volume.affine, expected), int(differ.sum())


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
        here, differing = compared(path, labels, place)
        far, off = max(far, here), max(off, differing)
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
        here, differing = compared(path, labels, place)
        far, off = max(far, here), max(off, differing)
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
