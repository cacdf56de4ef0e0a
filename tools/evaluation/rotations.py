# SPDX-License-Identifier: Apache-2.0
"""Rotations of the evaluations."""
import numpy as np


def rotation(vector):
    """Matrix of a rotation vector, radians (Rodrigues)."""
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
