# SPDX-License-Identifier: Apache-2.0
"""Other people's libraries as judges: each function makes `count` files by one and compares what helicarm reads, or the
other way round. Run as a program it prints the rows of docs/formats.md#conventions-and-peers:

PYTHONPATH=build/python HELICARM_PROGRAM=build/bin/helicarm python3 python/tests/peers.py
"""
import importlib
import importlib.util
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile

import numpy as np

import dicom_peers
import helicarm
import itk_peers
import pydicom_peers
import vtk_peers
from peer_values import COUNT, PROGRAM, TO_LPS, apart, random_affine, random_voxels, run


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


def version_of(package):
    if package == "dcmtk":
        return subprocess.run(["dcmdump", "--version"], capture_output=True, text=True).stdout.split("v")[1].split()[0]
    if package == "itk":
        return run(itk_peers.itk_program(), "version").strip()
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
    (pydicom_peers.pydicom_writes_series, "pydicom", "DICOM CT series, and datasets in memory", "read", (0.005, 0), ("mm", "HU")),
    (pydicom_peers.pydicom_writes_segmentations, "pydicom", "DICOM segmentation, BINARY", "read", (0.005, 0), ("mm", "voxels")),
    (pydicom_peers.pydicom_writes_label_maps, "pydicom", "DICOM segmentation, LABELMAP", "read", (0.005, 0), ("mm", "voxels")),
    (pydicom_peers.pydicom_reads_images, "pydicom", "DICOM X-ray image", "written", (0, 1e-6), ("grey values", "mm")),
    (vtk_peers.vtk_writes, "vtk", "STL, PLY, VTP, OBJ, legacy VTK (4.2 and 5.1, strips), and `vtkPolyData` in memory", "read", (1e-3,), ("mm",)),
    (vtk_peers.vtk_image, "vtk", "`vtkImageData` in memory", "read", (1e-9, 1e-12), ("mm", "of a voxel")),
    (itk_peers.itk_writes_volumes, "itk", "MetaImage, NRRD, NIfTI of seven types, plain and compressed", "read", (0.01, 1e-6), ("mm", "of the largest voxel")),
    (itk_peers.itk_writes_transforms, "itk", "ITK transforms `.tfm` and `.h5`: Euler, versor, affine", "read", (1e-6,), ("mm",)),
    (itk_peers.itk_reads_poses, "itk", "ITK transform `.tfm` of a view's pose", "written", (1e-6,), ("mm",)),
    (itk_peers.itk_reads_masks, "itk", "masks of `segment`, NRRD", "written", (1e-6, 0), ("mm", "voxels")),
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
