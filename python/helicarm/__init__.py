# SPDX-License-Identifier: Apache-2.0
"""A C-arm as a measuring instrument: X-ray images to points in space with confidence regions.

Points are (u, v) in pixels, (0, 0) the centre of the top-left pixel; images are indexed [v, u]. Lengths are mm, angles
degrees. A matrix named a_from_b maps points of b into a. Failures are InputError and RefusedError.
"""
from ._helicarm import (  # noqa: F401
    CArmPrior, Calibration, Calibrator, DistortionMap, IntrinsicsPrior, LocatedPoint, MeasuredPhantom, Plate,
    Rectification, Result, ResultPoint, Sweep, Track, ViewPoints, XrayImage, __version__, c_arm_report, calibrate,
    check_c_arm, detect, label, measure, measure_phantom, migration, read_image, rectify, register, register_sequence,
    run_case, segment, simulate_case, sweep, track, verify_phantom)
from .errors import HelicarmError, InputError, RefusedError  # noqa: F401

__all__ = [
    "CArmPrior", "Calibration", "Calibrator", "DistortionMap", "HelicarmError", "InputError", "IntrinsicsPrior",
    "LocatedPoint", "MeasuredPhantom", "Plate", "Rectification", "RefusedError", "Result", "ResultPoint", "Sweep",
    "Track", "ViewPoints", "XrayImage", "c_arm_report", "calibrate", "check_c_arm", "detect", "figures", "label",
    "measure", "measure_phantom", "migration", "read_image", "rectify", "register", "register_sequence",
    "run_case", "segment", "simulate_case", "sweep", "track", "verify_phantom"]


def __getattr__(name):
    if name == "figures":  # matplotlib is loaded only where figures are drawn
        import importlib
        return importlib.import_module(".figures", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
