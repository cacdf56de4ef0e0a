# SPDX-License-Identifier: Apache-2.0
"""A camera from points of known place."""
from . import _helicarm as _c


def solve(xyz_mm, uv, *, sigma_px=None, labels=None, method="ml"):
    """One view from known points and their pixels (Eq. 4-7), as `helicarm solve` computes it.

    xyz_mm: (N, 3) world; uv: (N, 2); sigma_px: per axis, a number or (N,); None: alike, and estimated from the residuals.
    method: "ml" (maximum likelihood), "dlt" (least-squares solution of Eq. 7) or "homogeneous" (normalised). No outlier is
    rejected. Returns {"camera": Camera, "dlt": (11,) or None, "covariance": (11, 11) or None, "reprojection_rms_px",
    "condition", "warnings"}. Raises InputError: usage (places not in mm), name_clash, bad_value, not_finite; RefusedError:
    too_few_fiducials, coplanar_fiducials, ...
    """
    return _c._solve(xyz_mm, uv, sigma_px, labels, method)
