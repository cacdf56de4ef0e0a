# SPDX-License-Identifier: Apache-2.0
"""Closed surface of a mask or a volume by marching tetrahedra (Payne and Toga 1990), as STL. Needs NumPy."""
import numpy as np

CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])  # along S, P, L
TETRAHEDRA = [(0, 7, a, b) for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1))]  # about the diagonal


def triangles_of(array, level, voxel_mm, low_mm):
    """Triangles (n, 3, 3) of corners along L, P, S in mm, outside out where the array is larger inside. `array`: (S, P, L); outside the
    grid is taken as outside. `low_mm`: of the first voxel's centre."""
    grid = np.pad(array.astype(np.float32), 1, constant_values=float(array.min()))
    inside = grid > level
    cell = np.zeros(np.array(grid.shape) - 1, np.int8)
    for corner in CORNERS:
        cell += inside[tuple(slice(c, c + n) for c, n in zip(corner, cell.shape))]
    cells = np.argwhere((cell > 0) & (cell < 8))
    at = cells[:, None, :] + CORNERS[None]
    values = grid[at[..., 0], at[..., 1], at[..., 2]]
    found = []
    for tetrahedron in TETRAHEDRA:
        places, value = at[:, tetrahedron].astype(float), values[:, tetrahedron] - level
        code = (value > 0) @ np.array([1, 2, 4, 8])
        for number in range(1, 15):
            rows = code == number
            if rows.any():
                found += cut(places[rows], value[rows], [k for k in range(4) if number >> k & 1])
    corners = np.concatenate(found)[..., ::-1]  # along L, P, S
    return (corners - 1) * np.broadcast_to(voxel_mm, 3) + np.asarray(low_mm)


def cut(places, value, inside):
    """One or two triangles of each tetrahedron, normals away from the corners inside."""
    outside = [k for k in range(4) if k not in inside]

    def between(i, j):
        share = value[:, i] / (value[:, i] - value[:, j])
        return places[:, i] + share[:, None] * (places[:, j] - places[:, i])

    if len(inside) == 2:
        (a, b), (c, d) = inside, outside
        quad = [between(a, c), between(a, d), between(b, d), between(b, c)]
        parts = [np.stack([quad[0], quad[1], quad[2]], 1), np.stack([quad[0], quad[2], quad[3]], 1)]
    else:
        lone, others = (inside[0], outside) if len(inside) == 1 else (outside[0], inside)
        parts = [np.stack([between(lone, k) for k in others], 1)]
    away = places[:, outside].mean(axis=1) - places[:, inside].mean(axis=1)
    for part in parts:
        normal = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0])
        # Axes are reversed to L, P, S, which turns the triangles over.
        wrong = np.einsum("ij,ij->i", normal, away) > 0
        part[wrong, 1], part[wrong, 2] = part[wrong, 2].copy(), part[wrong, 1].copy()
    return parts


def write_stl(path, triangles):
    record = np.zeros(len(triangles), np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("unused", "<u2")]))
    record["corners"] = triangles.reshape(-1, 9)
    path.write_bytes(b"mm".ljust(80) + np.uint32(len(triangles)).tobytes() + record.tobytes())
