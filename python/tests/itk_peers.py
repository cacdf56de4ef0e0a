# SPDX-License-Identifier: Apache-2.0
"""ITK, by the program of itk_peer/. Judges of peers.py."""
import atexit
import functools
import json
import pathlib
import shutil
import tempfile

import numpy as np

import helicarm
from peer_values import COUNT, PROGRAM, apart, random_affine, run


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
