# SPDX-License-Identifier: Apache-2.0
"""DICOM files that the program writes beside images, read by pydicom, DCMTK and dicom3tools; images over OpenIGTLink, read by
its library. Judges of peers.py."""
import atexit
import functools
import json
import pathlib
import shutil
import socket
import subprocess
import tempfile

import numpy as np

import helicarm
from peer_values import PROGRAM, run


def measured(folder, seed, **options):
    """A simulated case with tunnels, and the folder of its result with measurements.dcm."""
    case, out = folder / f"case{seed}", folder / f"out{seed}"
    helicarm.simulate_case(case, seed=seed, kind="tunnels", size=512, **options)
    helicarm.run_case(case).write(out, dicom=case)
    return case, out


def items(node, concept):
    """The content items below a node with this code as name."""
    return [item for item in node.get("ContentSequence", [])
            if "ConceptNameCodeSequence" in item and concept_of(item.ConceptNameCodeSequence[0]) == concept]


def concept_of(code):
    return code.get("CodeValue") or code.get("LongCodeValue")


def number_of(item):
    return float(item.MeasuredValueSequence[0].NumericValue)


def pydicom_reads_reports(folder, count=4):
    """(reports, largest difference of a position or length in mm, of a pixel): measurements.dcm against result.json."""
    import pydicom
    far = off = 0.0
    for seed in range(1, count + 1):
        case, out = measured(folder, seed)
        report, result = pydicom.dcmread(out / "measurements.dcm"), json.loads((out / "result.json").read_text())
        image = pydicom.dcmread(case / "AP.dcm")
        assert (report.PatientID, report.StudyInstanceUID) == (image.PatientID, image.StudyInstanceUID)
        (measurements,) = items(report, "126010")
        groups = {(concept_of(items(group, "121071")[0].ConceptCodeSequence[0]), items(group, "112039")[0].TextValue): group
                  for group in items(measurements, "125007")}
        images = {pydicom.dcmread(case / f"{view['name']}.dcm").SOPInstanceUID: view["name"] for view in result["views"]}
        for point in result["points"]:
            group = groups["target" if point["source"] == "target" else "point", point["name"]]
            (error,) = items(group, "error_95")
            if point["xyz_mm"] is None:
                assert not error.MeasuredValueSequence and error.NumericValueQualifierCodeSequence[0].CodeValue == "114006"
                continue
            for axis, value, variance in zip("xyz", point["xyz_mm"], np.diag(point["covariance_mm2"])):
                (item,) = items(group, f"position_{axis}")
                (sigma,), (within,) = items(item, "386136009"), items(item, "371884006")
                far = max(far, abs(number_of(item) - value), abs(number_of(sigma) - variance ** 0.5),
                          abs(number_of(within) - 1.959964 * variance ** 0.5))
            far = max(far, abs(number_of(error) - point["error_95_mm"]))
            for mark in error.ContentSequence:
                if mark.ValueType == "SCOORD3D":
                    far = max(far, np.abs(np.array(mark.GraphicData) - point["xyz_mm"]).max())
                if mark.ValueType == "SCOORD":
                    view = images[mark.ContentSequence[0].ReferencedSOPSequence[0].ReferencedSOPInstanceUID]
                    off = max(off, np.abs(np.array(mark.GraphicData) - 0.5 - point["seen"][view]["uv_raw"]).max())
        for tunnel in result["tunnels"]:
            if tunnel["length_mm"] is not None:
                far = max(far, abs(number_of(items(groups["tunnel", tunnel["name"]], "410668003")[0]) - tunnel["length_mm"]))
    return count, far, off


def dcmtk_reads_reports(folder, count=4):
    """(reports, lines of warnings or errors): by dsrdump and dsr2html, which check every relationship."""
    said = []
    for seed in range(1, count + 1):
        _, out = measured(folder, seed)
        for program in ("dsrdump", "dsr2html"):
            text = run(program, out / "measurements.dcm")
            assert "Imaging Measurement Report" in text
            said += [line for line in text.splitlines()
                     if line.startswith(("W:", "E:", "F:")) and "does not support this Specific Character Set" not in line]
    assert not said, said
    return count, len(said)


def dciodvfy_checks(folder, count=3):
    """(files, errors): every kind of DICOM file that the program writes, but registrations, which have a test of their own."""
    files, said = [], []
    for seed in range(1, count + 1):
        case, out = measured(folder, seed, bits=(8, 12, 16)[seed % 3])
        point = next(p["name"] for p in json.loads((out / "result.json").read_text())["points"] if p["xyz_mm"])
        run(PROGRAM, "export", case, "--out", out, "--as", "images", "--at", point, "--quiet")
        run(PROGRAM, "rectify", case / "AP.dcm", "--plate", "plate48", "--out", folder / f"rectified{seed}", "--keep-patient", "--quiet")
        run(PROGRAM, "bundle", case, "--out", folder / f"b{seed}.tar.gz", "--quiet")
        shutil.unpack_archive(folder / f"b{seed}.tar.gz", folder / f"bundle{seed}")
    files = sorted(folder.rglob("*.dcm"))
    for path in files:
        checked = subprocess.run(["dciodvfy", path], capture_output=True, text=True, errors="replace").stderr
        said += [(path.name, line) for line in checked.splitlines() if line.startswith("Error")]
    assert not said, said
    return len(files), len(said)


@functools.cache
def openigtlink_program():
    """The program of openigtlink_peer/, built once for each run of the judges."""
    built = pathlib.Path(tempfile.mkdtemp(prefix="openigtlink_peer_"))
    atexit.register(shutil.rmtree, built, ignore_errors=True)
    source = pathlib.Path(__file__).with_name("openigtlink_peer") / "openigtlink_peer.cc"
    run("g++", "-w", "-I/usr/include/openigtlink", source, "-o", built / "peer", "-lOpenIGTLink", "-lpthread")
    return built / "peer"


def openigtlink_received(case, folder, messages):
    """What the library's client receives of `tracker send`: {device: [type, numbers]}."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port = one.getsockname()[1]
    sender = subprocess.Popen([PROGRAM, "tracker", "send", case, "--port", str(port), "--seconds", "300"], stderr=subprocess.PIPE, text=True)
    try:
        for line in sender.stderr:
            if f"port {port}" in line:
                break
        lines = run(openigtlink_program(), port, messages, folder).splitlines()
    finally:
        sender.kill()
        sender.wait()
    return {line.split()[1]: (line.split()[0], np.array(line.split()[2:], float)) for line in lines}


def openigtlink_reads_images(folder, count=2):
    """(messages, largest distance in px of a pixel from its ray, largest difference of a grey value): images and cameras of
    `tracker send`; the rays are of result.json, the grey values of `export`."""
    far = off = 0.0
    signs = np.diag([-1.0, -1, 1, 1])
    messages = 0
    for seed in range(1, count + 1):
        case, out = measured(folder, seed)
        run(PROGRAM, "export", case, "--out", out, "--as", "images,matrix", "--quiet")
        views = json.loads((out / "result.json").read_text())["views"]
        got = openigtlink_received(case, folder, 2 * len(views))
        for view in views:
            projection = np.loadtxt(out / f"{view['name']}_matrix.txt")
            kind, numbers = got[view["name"]]
            size, form, spacing, matrix = numbers[:3].astype(int), list(numbers[3:6]), numbers[6:9], numbers[9:].reshape(4, 4)
            assert kind == "IMAGE" and form[:1] == [5] and form[2] == 1, (kind, form)
            corners = np.array([[u, v] for u in (0, size[0] - 1) for v in (0, size[1] - 1)], float)
            steps = (corners - (size[:2] - 1) / 2) * spacing[:2]
            ras = steps @ matrix[:3, :2].T + matrix[:3, 3]
            seen = np.column_stack([ras, np.ones(4)]) @ signs @ projection.T
            far = max(far, np.abs(seen[:, :2] / seen[:, 2:] - corners).max())
            pixels = np.fromfile(folder / f"{view['name']}.raw", ">u2" if form[1] == 1 else "<u2").reshape(size[1], size[0])
            expected = helicarm.read_image(out / f"{view['name']}_rectified.dcm").pixels
            off = max(off, np.abs(pixels - expected).max())
            kind, numbers = got[view["name"] + "_camera"]
            source = signs @ numbers.reshape(4, 4)[:, 3]
            assert kind == "TRANSFORM" and np.abs(projection @ source).max() < 1e-3 * np.abs(projection).max(), kind
            messages += 2
    return messages, far, off
