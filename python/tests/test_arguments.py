# SPDX-License-Identifier: Apache-2.0
"""What an argument may be: each refusal names argument, value and limit."""
import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest

import helicarm

NAN = math.nan
EYE = np.eye(3)


@pytest.fixture(scope="module")
def calibration(pair):
    return pair.calibration()


def views(pair, **more):
    return [helicarm.ViewPoints(name, pair.xyz, pair.pixels(name, pair.xyz), sigma_px=0.1, **more)
            for name in pair.pose]


def refused(call, argument, code="bad_value"):
    with pytest.raises(helicarm.InputError) as error:
        call()
    assert error.value.code == code and argument in error.value.message, error.value
    return error.value


def test_stubs_name_the_arguments_of_every_function():
    stubs = ast.parse((Path(helicarm.__file__).parent / "_helicarm.pyi").read_text())
    for stub in (each for each in stubs.body if isinstance(each, ast.FunctionDef)):
        arguments = {each.arg for each in [*stub.args.posonlyargs, *stub.args.args, *stub.args.kwonlyargs]}
        signature = getattr(helicarm._helicarm, stub.name).__doc__.splitlines()[0]
        assert arguments == set(re.findall(r"(?:\(|, )(\w+): ", signature)), stub.name


def test_limit_and_value_are_in_message_and_figures(calibration):
    error = refused(lambda: calibration.predict([0, 0, 40], sigma_px=-1), "sigma_px")
    assert error.message == "sigma_px: -1 must be at least 0"
    assert error.figures == {"value": -1.0, "limit": 0.0}
    error = refused(lambda: helicarm.calibrate([], scale_sigma=5), "views")
    assert error.figures == {"value": 0.0, "limit": 1.0}


@pytest.mark.parametrize("wrong, code", [
    ({"scale_sigma": -1}, "bad_value"), ({"scale_sigma": 5}, "bad_value"), ({"scale_sigma": NAN}, "not_finite"),
    ({"rejection_probability": 2}, "bad_value"), ({"largest_rms_px": -1}, "bad_value"),
    ({"ball_covariance_mm2": [-EYE] * 12}, "bad_value"), ({"least_angle_deg": 100}, "bad_value"),
    ({"ball_covariance_mm2": [[[1, 2, 0], [0, 1, 0], [0, 0, 1]]] * 12}, "bad_value"),
    ({"ball_covariance_mm2": -np.eye(36)}, "bad_value")])
def test_calibrate_refuses(pair, wrong, code):
    refused(lambda: helicarm.calibrate(views(pair), **wrong), next(iter(wrong)), code)


@pytest.mark.parametrize("wrong, code", [
    ({"sigma_px": 0}, "bad_value"), ({"sigma_px": NAN}, "not_finite"), ({"sigma_px": [0.1, 0.2]}, "bad_value"),
    ({"map_covariance_px2": -0.001 * np.eye(12)}, "bad_value"), ({"map_covariance_px2": np.eye(12)}, "bad_value")])
def test_view_points_refuse(pair, wrong, code):
    error = refused(lambda: helicarm.ViewPoints("AP", pair.xyz, pair.pixels("AP", pair.xyz),
                                                **{"sigma_px": 0.1, **wrong}), next(iter(wrong)), code)
    assert error.view == "AP"


def test_points_in_metres_are_refused(pair):
    uv = pair.pixels("AP", pair.xyz)
    error = refused(lambda: helicarm.ViewPoints("AP", pair.xyz / 1000, uv, sigma_px=0.1), "metres?")
    assert error.figures["limit"] == 10 and error.figures["value"] < 0.2


@pytest.mark.parametrize("call, argument, code", [
    (lambda c: c.predict([0, 0, 40], sigma_px=NAN), "sigma_px", "not_finite"),
    (lambda c: c.locate({"AP": (300, 200), "LAT": (300, 200)}, sigma_px=-1), "sigma_px", "bad_value"),
    (lambda c: c.tre_map([0, 0, 40], half_mm=20, step_mm=5, sigma_px=-0.3), "sigma_px", "bad_value"),
    (lambda c: c.tre_map([0, 0, 40], half_mm=-20, step_mm=5, sigma_px=0.3), "half_mm", "bad_value"),
    (lambda c: c.tre_map([0, 0, 40], half_mm=20, step_mm=0.1, sigma_px=0.3), "step_mm", "bad_value"),
    (lambda c: c.tre_map([0, 0], half_mm=20, step_mm=5, sigma_px=0.3), "centre_mm", "bad_value"),
    (lambda c: c.locate({0: (300, 200), "AP": (300, 200)}), "given twice", "name_clash"),
    (lambda c: c.locate({"AP": (300, 200), "PA": (300, 200)}), "AP, LAT", "bad_value")])
def test_calibration_refuses(calibration, call, argument, code):
    refused(lambda: call(calibration), argument, code)


@pytest.mark.parametrize("wrong, argument, code", [
    ({"focal_px": -1}, "focal_px", "bad_value"), ({"focal_px": NAN}, "focal_px", "not_finite"),
    ({"unit_px": 0}, "unit_px", "bad_value"), ({"aspect": (1, 0)}, "aspect: sigma", "bad_value"),
    ({"principal_px": [[1, 2], [3, 4]]}, "principal_px", "bad_value")])
def test_priors_refuse(wrong, argument, code):
    refused(lambda: helicarm.IntrinsicsPrior(**wrong), argument, code)


def test_c_arm_prior_refuses():
    refused(lambda: helicarm.CArmPrior(focal=(-5, 1)), "focal: common")
    refused(lambda: helicarm.CArmPrior(principal=(5, 0)), "principal: of each view")


@pytest.mark.parametrize("wrong, argument, code", [
    ({"source_detector_mm": 0}, "source_detector_mm", "bad_value"),
    ({"source_detector_mm": NAN}, "source_detector_mm", "not_finite"), ({"pixel_mm": -1}, "pixel_mm", "bad_value"),
    ({"pixel_mm": (0.2, NAN)}, "pixel_mm", "not_finite"), ({"range": (0, 100)}, "pixels: 200", "bad_value"),
    ({"range": (100, 0)}, "range: greatest", "bad_value")])
def test_images_refuse(wrong, argument, code):
    pixels = np.full((40, 60), 200, np.uint8)
    refused(lambda: helicarm.XrayImage(pixels, **{"pixel_mm": 0.2, "source_detector_mm": 1000, **wrong}), argument, code)


@pytest.mark.parametrize("wrong, argument, code", [
    ((0, 480), "width", "bad_value"), ((640, -1), "height", "bad_value"), ((640, 480, -1), "pixel_mm", "bad_value"),
    ((640, 480, NAN), "pixel_mm", "not_finite")])
def test_identity_maps_refuse(wrong, argument, code):
    refused(lambda: helicarm.DistortionMap.identity(*wrong), argument, code)


def test_phantom_refuses_before_it_reads(tmp_path):
    for sigma in (-1, 0):
        refused(lambda: helicarm.measure_phantom(tmp_path, distance_sigma_mm=sigma), "distance_sigma_mm")
    refused(lambda: helicarm.measure_phantom(tmp_path, distances=[("P1", "P2", -3)]), "distances: mm")
    error = refused(lambda: helicarm.measure_phantom(tmp_path, distance_is="inner"), "distance_is", "usage")
    assert "centres, outer" in error.message


def test_run_refuses_with_figures(tmp_path):
    error = refused(lambda: helicarm.run_case(tmp_path, max_error_mm=-1), "max_error_mm")
    assert error.figures["value"] == -1
    refused(lambda: helicarm.run_case(tmp_path, motion_sigma_mm=1000), "motion_sigma_mm")


def test_attributes_are_read_only(pair):
    located = pair.calibration().locate({name: pair.pixels(name, [[1, 2, 40]])[0] for name in pair.pose})
    for array in (helicarm.Calibrator.udcsc().xyz_mm, helicarm.Calibrator.udcsc().diameters_mm,
                  helicarm.Plate.plate48().xy_mm, located.xyz_mm, located.covariance_mm2):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 5


def test_limits_of_files_are_figures():
    given = helicarm.Calibrator.udcsc()
    error = refused(lambda: helicarm.Calibrator.from_arrays(given.labels, given.xyz_mm, 4000), "diameter_mm")
    assert error.figures == {"value": 4000.0, "limit": 30.0}


def test_dicts_may_hold_arrays_and_refuse_what_json_lacks():
    calibrator = helicarm.Calibrator.udcsc().to_dict()
    calibrator["balls"] = [{**ball, "xyz_mm": np.array(ball["xyz_mm"])} for ball in calibrator["balls"]]
    assert helicarm.Calibrator.from_dict(calibrator).labels[-1] == "P12"
    error = refused(lambda: helicarm.Calibrator.from_dict({"name": {1, 2}}), "set", "bad_json")
    assert "Traceback" not in error.message and "\n" not in error.message
