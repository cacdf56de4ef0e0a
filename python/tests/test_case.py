# SPDX-License-Identifier: Apache-2.0
import json
import re

import cv2
import numpy as np
import pytest

import helicarm


def test_run_announces_its_stages(result, stages):
    assert stages == ["read", "rectify", "detect", "label", "calibrate", "locate"]


def test_targets_are_within_their_regions(case, result):
    known = {t["name"]: np.array(t["xyz_mm"]) for t in json.loads((case[0] / "calibrator.json").read_text())["targets"]}
    located = [p for p in result.points if p.source == "target" and p.xyz_mm is not None]
    assert len(located) >= 3
    for point in located:
        off = point.xyz_mm - known[point.name]
        assert off @ np.linalg.solve(point.covariance_mm2, off) < 16.3  # 0.1 % of chi-square with 3 degrees
        assert np.linalg.norm(off) < 2 * point.error_95_mm


def test_result_is_result_json(result, tmp_path):
    result.write(tmp_path)
    assert json.loads((tmp_path / "result.json").read_text()) == result.to_dict()
    assert {"report.html", "AP_overlay.png", "LAT_overlay.png"} <= {f.name for f in tmp_path.iterdir()}
    overlay = cv2.imdecode(np.frombuffer(result.overlay_png("AP"), np.uint8), cv2.IMREAD_COLOR)
    assert overlay is not None


def test_saved_calibration_locates_as_the_run_did(result, tmp_path):
    result.write(tmp_path)
    loaded, held = helicarm.Calibration.load(tmp_path / "result.json"), result.calibration
    point = next(p for p in result.points if p.xyz_mm is not None)
    seen = {name: held.project(point.xyz_mm, name) for name in held.names}
    a, b = held.locate(seen), loaded.locate(seen)
    assert a.xyz_mm == pytest.approx(b.xyz_mm, abs=1e-7)
    assert a.xyz_mm == pytest.approx(point.xyz_mm, abs=1e-6)
    assert a.covariance_mm2 == pytest.approx(b.covariance_mm2, rel=1e-6)


def test_raw_picks_pass_through_the_map(result):
    held = result.calibration
    point = next(p for p in result.points if p.xyz_mm is not None)
    raw = {name: held.project(point.xyz_mm, name, raw=True) for name in held.names}
    assert held.locate(raw, raw=True).xyz_mm == pytest.approx(point.xyz_mm, abs=1e-5)


def test_image_of_a_result_is_not_copied(result):
    image = result.image("AP")
    assert np.shares_memory(image.pixels, result.image(0).pixels)


def test_map_leads_there_and_back_and_through_a_file(result, tmp_path):
    distortion = result.calibration.map("AP")
    uv = np.random.default_rng(1).uniform(120, 390, (50, 2))
    raw = distortion.raw_from_rectified(uv)
    assert np.abs(raw - uv).max() > 0.5
    assert distortion.rectified_from_raw(raw) == pytest.approx(uv, abs=1e-9)
    distortion.save(tmp_path / "map.json")
    again = helicarm.DistortionMap.load(tmp_path / "map.json")
    assert np.array_equal(again.raw_from_rectified(uv), raw)
    assert np.isnan(distortion.rectified_from_raw([-1e4, 3])).all()


def test_rectified_image_is_opencvs_remap(result):
    image, distortion = result.image("AP"), result.calibration.map("AP")
    height, width = image.shape
    v, u = np.mgrid[200:300, 180:340]
    raw = distortion.raw_from_rectified(np.c_[u.ravel(), v.ravel()].astype(float)).reshape(*u.shape, 2)
    expected = cv2.remap(np.array(image.pixels), raw[..., 0].astype(np.float32), raw[..., 1].astype(np.float32),
                         cv2.INTER_LINEAR)
    ours = distortion.rectify_image(image)
    assert ours.shape == (height, width) and ours.dtype == np.float32
    contrast = np.ptp(image.pixels)
    assert np.abs(ours[200:300, 180:340] - expected).mean() < 0.005 * contrast


def test_identity_map_keeps_a_non_square_image():
    pixels = np.random.default_rng(1).integers(0, 255, (60, 90), np.uint8)
    image = helicarm.XrayImage(pixels, pixel_mm=None, source_detector_mm=None)
    ours = helicarm.DistortionMap.identity(90, 60).rectify_image(image)
    assert ours.shape == (60, 90) and np.abs(ours[2:-2, 2:-2] - pixels[2:-2, 2:-2]).max() < 1e-3
    with pytest.raises(helicarm.InputError, match="bad_size"):
        helicarm.DistortionMap.identity(60, 90).rectify_image(image)


def test_plate_is_found_in_an_image(case):
    image = helicarm.read_image(case[0] / "AP.dcm")
    found = helicarm.rectify(image, helicarm.Plate.load(case[0] / "plate.json"))
    assert found.dots_found > 20 and found.uv_raw.shape[1] == 2
    assert np.sqrt(np.mean(found.residual_px ** 2)) < 0.3
    assert helicarm.rectify(image, "plate48").dots_found == found.dots_found


def test_blank_image_is_refused():
    blank = helicarm.XrayImage(np.full((300, 400), 7, np.uint8), pixel_mm=0.2, source_detector_mm=1000)
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.rectify(blank, "plate48")
    assert error.value.code in ("blank_image", "plate_not_found")


def test_refused_case_keeps_what_was_computed(tmp_path):
    helicarm.simulate_case(tmp_path, seed=1, size=512, kind="flat", views=["A:0,0", "B:8,0"])
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.run_case(tmp_path)
    assert error.value.code == "views_too_close"
    assert error.value.result.status == "refused" and error.value.result.image("A").shape == (512, 512)


def test_exception_of_progress_ends_the_run(case):
    class Stop(Exception):
        pass

    def progress(stage):
        if stage == "rectify":
            raise Stop

    with pytest.raises(Stop):
        helicarm.run_case(case[0], progress=progress)


def test_bad_options_are_input_errors(case, tmp_path):
    for wrong in ({"method": "worst"}, {"max_error_mm": -1}):
        with pytest.raises(helicarm.InputError):
            helicarm.run_case(case[0], **wrong)
    with pytest.raises(helicarm.InputError, match="missing_file"):
        helicarm.run_case(tmp_path / "nowhere")
    with pytest.raises(helicarm.InputError, match="usage"):
        helicarm.simulate_case(tmp_path / "x", kind="odd")


def test_calibrator_and_plate_lead_through_files(tmp_path):
    for thing in (helicarm.Calibrator.udcsc(), helicarm.Plate.plate48()):
        thing.save(tmp_path / "thing.json")
        assert type(thing).load(tmp_path / "thing.json").to_dict() == thing.to_dict()
        assert type(thing).from_dict(thing.to_dict()).name == thing.name
    calibrator = helicarm.Calibrator.udcsc()
    assert calibrator.xyz_mm.shape == (12, 3) and calibrator.labels[0] == "P1"
    with pytest.raises(helicarm.InputError, match="unknown_key"):
        helicarm.Calibrator.from_dict({**calibrator.to_dict(), "colour": "red"})


def test_figures_draw(result):
    figures = helicarm.figures
    ax = figures.overlay(result, "AP")
    assert len(ax.lines) >= 10
    assert figures.residuals(result.calibration, "LAT").get_title().startswith("residuals")
    centre = helicarm.Calibrator.udcsc().xyz_mm.mean(axis=0)
    figures.tre_map(result.calibration, centre, half_mm=20, step_mm=5, sigma_px=0.5)


def test_stubs_name_what_the_module_has():
    import inspect
    from helicarm import _helicarm
    stub = (inspect.getsourcefile(helicarm) or "").replace("__init__.py", "_helicarm.pyi")
    text = open(stub).read()
    for name, thing in vars(_helicarm).items():
        if name.startswith("__"):
            continue
        assert re.search(rf"^(class|def) {name}\b", text, re.M), name
        if not inspect.isclass(thing):
            continue
        body = re.search(rf"^class {name}\b.*?(?=^(class|def) |\Z)", text, re.M | re.S).group()
        for member in vars(thing):
            if not member.startswith("_"):
                assert re.search(rf"def {member}\(", body), f"{name}.{member}"
