# SPDX-License-Identifier: Apache-2.0
"""What the judges of peers.py share: random geometries and voxels, distances, programs."""
import os
import subprocess

import numpy as np

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


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, errors="replace")
    assert done.returncode == 0, (command, done.stdout, done.stderr)
    return done.stdout + done.stderr
