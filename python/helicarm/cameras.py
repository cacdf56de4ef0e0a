# SPDX-License-Identifier: Apache-2.0
"""A camera from points of known place."""
import numpy as np

from . import _helicarm as _c
from .errors import InputError

_METHODS = ("ml", "dlt", "homogeneous")
_LARGEST_RMS_PX = 5.0  # above it `calibrate` refuses


def solve(xyz_mm, uv, *, sigma_px=None, labels=None, method="ml"):
    """One view from known points and their pixels (Eq. 4-7), as `helicarm solve` computes it.

    xyz_mm: (N, 3) world; uv: (N, 2); sigma_px: per axis, a number or (N,); None: alike, and estimated from the residuals.
    method: "ml" (maximum likelihood), "dlt" (least-squares solution of Eq. 7) or "homogeneous" (normalised). No outlier is
    rejected. Returns {"camera": Camera, "dlt": (11,) or None, "covariance": (11, 11) or None, "reprojection_rms_px",
    "condition", "warnings"}. Raises InputError; RefusedError: too_few_fiducials, coplanar_fiducials, ...
    """
    if method not in _METHODS:
        raise InputError("usage", f'method: "{method}" is none of: {", ".join(_METHODS)}')
    camera, factors, condition, rms = _c._dlt(xyz_mm, uv, method != "dlt")
    covariance, exceeded = None, 1
    if method == "ml":
        view = _c.ViewPoints("", xyz_mm, uv, sigma_px=1 if sigma_px is None else sigma_px, labels=labels,
                             mirrored=bool(camera.K[0, 0] < 0))
        made = _c.calibrate([view], rejection_probability=0, largest_rms_px=1e12)
        pose = made.camera_from_calibrator(0)
        camera = _c.Camera(made.intrinsics(0), pose[:3, :3], pose[:3, 3])
        covariance = made.joint_covariance.copy()
        if sigma_px is None:
            covariance *= made.chi2 / made.dof / made.variance_scale
        else:
            exceeded = made.variance_scale ** 0.5
        rms = float(np.sqrt(np.mean(np.sum((camera.project(np.asarray(xyz_mm, float)) - uv) ** 2, axis=1))))
        factors = _dlt_of(camera.projection)
    residuals = np.linalg.norm(camera.project(np.asarray(xyz_mm, float)) - uv, axis=1)
    farthest = int(np.argmax(residuals))
    warnings = _residual_warnings(rms, exceeded, labels[farthest] if labels is not None else f"P{farthest + 1}")
    return {"camera": camera, "dlt": factors, "covariance": covariance, "reprojection_rms_px": rms,
            "condition": condition, "warnings": warnings + camera.warnings}


def _residual_warnings(rms, exceeded, farthest):
    check = f"check the point with the largest residual ({farthest}); solve rejects no outlier"
    if rms > _LARGEST_RMS_PX:
        message, figures = f"{rms:.3g} px rms, over {_LARGEST_RMS_PX:g} px: ", {"rms_px": rms, "limit": _LARGEST_RMS_PX}
    elif exceeded > 1:
        message = f"residuals are {exceeded:.3g} times the stated sigma_px, and the covariance is inflated: "
        figures = {"sigmas_exceeded": exceeded}
    else:
        return []
    return [{"code": "residual_too_large", "message": message + check, "view": None, "figures": figures}]


def _dlt_of(projection):
    """A1..A11 of Eq. 6: the third row's last element is 1; None where it is 0."""
    if projection[2, 3] == 0:
        return None
    a = projection / projection[2, 3]
    return np.concatenate([a[0], a[2, :3], a[1]])
