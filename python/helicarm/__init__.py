# SPDX-License-Identifier: Apache-2.0
"""A C-arm as a measuring instrument: X-ray images to points in space with confidence regions.

Points are (u, v) in pixels, (0, 0) the centre of the top-left pixel; images are indexed [v, u]. Lengths are mm, angles
degrees. A matrix named a_from_b maps points of b into a. Volumes are indexed [i, j, k]; patients' frames are L, P, S.
Failures are InputError and RefusedError.
"""
import os as _os

# Where the package brings DCMTK's data dictionary along (wheel, archive), DCMTK does not find it by itself.
if _os.path.exists(_dictionary := _os.path.join(_os.path.dirname(__file__), "dicom.dic")):
    _os.environ.setdefault("DCMDICTPATH", _dictionary)

from ._helicarm import (  # noqa: F401
    CArmPrior, Calibration, Calibrator, Camera, DistortionMap, IntrinsicsPrior, LocatedPoint, MeasuredPhantom, Plate,
    Rectification, Result, ResultPoint, Surface, Sweep, Track, ViewPoints, Volume, XrayImage, __commit__, __version__, bundle,
    add_to_c_arm, c_arm_report, calibrate, check_c_arm, detect, import_camera, import_transform, label, measure, measure_landmarks, measure_phantom, new_case,
    read_image, read_surface, read_volume, rectify, run_case, schema, simulate_case, verify_phantom)
from .arrays import as_camera, as_image, as_surface, as_volume  # noqa: F401
from .cameras import solve  # noqa: F401
from .data import check_tunnels, drr, migration, register, register_sequence, segment, sweep, track  # noqa: F401
from .errors import HelicarmError, InputError, RefusedError  # noqa: F401
from .results import install as _install
from .session import Record, Session  # noqa: F401

_install()

__all__ = [
    "CArmPrior", "Calibration", "Calibrator", "Camera", "DistortionMap", "HelicarmError", "InputError", "IntrinsicsPrior",
    "LocatedPoint", "MeasuredPhantom", "Plate", "Record", "Rectification", "RefusedError", "Result", "ResultPoint", "Session",
    "Surface", "Sweep", "Track", "ViewPoints", "Volume", "XrayImage", "as_camera", "as_image", "as_surface", "as_volume",
    "add_to_c_arm", "bundle", "c_arm_report", "calibrate", "check_c_arm", "check_tunnels", "detect", "drr", "figures", "import_camera", "import_transform",
    "label", "measure", "measure_landmarks", "measure_phantom", "migration", "new_case", "read_image", "read_surface", "read_volume", "rectify",
    "register", "register_sequence", "run_case", "schema", "segment", "simulate_case", "solve", "sweep", "track", "verify_phantom"]


def __getattr__(name):
    if name == "figures":  # matplotlib is loaded only where figures are drawn
        import importlib
        return importlib.import_module(".figures", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
