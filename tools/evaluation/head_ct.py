# SPDX-License-Identifier: Apache-2.0
"""A head CT of a patient: Cranium.inv3 of Debian's package invesalius-examples, which is read where the package installs it.

The file is a gzipped tar with a property list and a matrix of int16, 256 x 256 x 108 voxels of 0.957 x 0.957 x 1.5 mm,
axial slices from the chin up, rows from posterior to anterior, columns from the patient's right to the left. The list has no
direction cosines: rows and slices follow from the anatomy, columns from the convention of DICOM and InVesalius (a head is
nearly symmetric). Patient frame L, P, S (mm), the origin in the volume's centre. Needs NumPy."""
import pathlib
import plistlib
import subprocess
import sys
import tarfile

import numpy as np

import bone_ct

PACKAGE, FILE = "invesalius-examples", "Cranium.inv3"
WINDOW_HU = (300, 3000)
AIR_HU, SKIN_HU = -1000, -300
GRID_SHIFT_MM = np.array([0.31, -0.24, 0.55])  # of the registered grid against the rendered one


def installed_file():
    try:
        done = subprocess.run(["dpkg", "-L", PACKAGE], capture_output=True, text=True, check=False)
    except OSError as error:
        sys.exit(f"dpkg: {error}; give the path of {FILE} with --head=PATH")
    for line in done.stdout.splitlines():
        if line.endswith(f"/{FILE}"):
            if not pathlib.Path(line).exists():
                sys.exit(f"{line} is missing: dpkg leaves out /usr/share/doc here (path-exclude in /etc/dpkg/dpkg.cfg.d); unpack the "
                         f"package with dpkg-deb -x and give the path of {FILE} with --head=PATH")
            return pathlib.Path(line)
    sys.exit(f"{FILE} is not installed: apt-get install {PACKAGE} (Debian), or give its path with --head=PATH")


def read_inv3(path):
    """Hounsfield units (S, P, L), and the voxel's size along L, P, S."""
    if not tarfile.is_tarfile(path):
        sys.exit(f"{path}: not a project of InVesalius (a gzipped tar)")
    with tarfile.open(path, "r:gz") as archive:
        members = {pathlib.PurePath(member.name).name: member for member in archive.getmembers() if member.isfile()}
        plan = plistlib.loads(archive.extractfile(members["main.plist"]).read())
        matrix = plan["matrix"]
        values = archive.extractfile(members[matrix["filename"]]).read()
    axial = 1
    if matrix["dtype"] != "int16" or plan["orientation"] != axial:
        sys.exit(f"{path}: axial slices of int16 expected, not orientation {plan['orientation']} of {matrix['dtype']}")
    hu = np.frombuffer(values, "<i2").reshape(matrix["shape"])
    return hu[:, ::-1, :], np.array(plan["spacing"])


def connected(inside, seed):
    """The part of `inside` that is connected with the voxel `seed` by faces."""
    part = np.zeros_like(inside)
    part[seed] = True
    count = 0
    while (now := int(part.sum())) != count:
        count = now
        for axis in range(3):
            for ahead in (True, False):
                to = [slice(None)] * 3
                of = [slice(None)] * 3
                to[axis], of[axis] = (slice(1, None), slice(None, -1)) if ahead else (slice(None, -1), slice(1, None))
                part[tuple(to)] |= part[tuple(of)] & inside[tuple(to)]
    return part


class Head:
    """`hu`: the patient, without the CT's headrest, which is not in the operating room. `scanned`: what is registered."""

    def __init__(self, path=None):
        if path and not pathlib.Path(path).is_file():
            sys.exit(f"{path}: no such file")
        self.whole, self.voxel_mm = read_inv3(path or installed_file())
        middle = tuple(n // 2 for n in self.whole.shape)
        self.inside = connected(self.whole > SKIN_HU, middle)
        self.hu = np.where(self.inside, self.whole, AIR_HU).astype(np.int16)

    def scanned(self):
        """Of the patient and the headrest: blurred, with noise, on a grid that is shifted by GRID_SHIFT_MM."""
        margin = 8  # the slices end within the neck: without a margin the last ones would blend with the first
        padded = np.pad(self.whole.astype(np.float32), margin, mode="edge")
        spectrum = np.fft.rfftn(padded)
        for axis, count in enumerate(padded.shape):
            frequency = (np.fft.rfftfreq if axis == 2 else np.fft.fftfreq)(count, self.voxel_mm[2 - axis])
            shape = [1, 1, 1]
            shape[axis] = -1
            spectrum = spectrum * np.exp(2j * np.pi * GRID_SHIFT_MM[2 - axis] * frequency.reshape(shape))
        size = padded.shape[::-1]
        scan = bone_ct.blurred_spectrum(spectrum, 0.45, size, self.voxel_mm)[margin:-margin, margin:-margin, margin:-margin]
        return scan + 25 * np.random.default_rng(23).standard_normal(scan.shape)

    def targets(self, count=14, within_mm=60):
        """Points of the bone within a distance of the volume's centre, each the farthest from those before it."""
        bone = np.argwhere(self.inside & (self.hu > 500))[:, ::-1]
        points = (bone - 0.5 * (np.array(self.hu.shape[::-1]) - 1)) * self.voxel_mm
        points = points[np.linalg.norm(points, axis=1) < within_mm]
        chosen = [points[np.argmin(np.linalg.norm(points, axis=1))]]
        distance = np.full(len(points), np.inf)
        while len(chosen) < count:
            distance = np.minimum(distance, np.linalg.norm(points - chosen[-1], axis=1))
            chosen.append(points[np.argmax(distance)])
        return np.array(chosen)
