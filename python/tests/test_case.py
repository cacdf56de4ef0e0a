# SPDX-License-Identifier: Apache-2.0
import json
import re
import shutil

import cv2
import numpy as np
import pytest

import helicarm


def test_run_announces_its_stages(result, stages):
    assert stages == ["read", "detect", "rectify", "label", "calibrate", "locate"]


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


def test_what_an_earlier_result_left_goes(result, tmp_path):
    (tmp_path / "result.json").write_text(json.dumps({"views": [{"name": "SMITH"}]}))
    left = [tmp_path / name for name in ("SMITH_overlay.png", "measurements.dcm", "registration.json", "registration/registration.json")]
    (tmp_path / "registration").mkdir()
    for file in left:
        file.write_text("{}")
    (tmp_path / "notes.txt").write_text("of the user")
    result.write(tmp_path)
    assert not [file for file in left if file.exists()]
    assert (tmp_path / "notes.txt").exists() and (tmp_path / "AP_overlay.png").exists()


def test_dicom_files_of_another_case_are_refused(case, result, tmp_path):
    helicarm.simulate_case(tmp_path / "other", seed=4, size=512)
    with pytest.raises(helicarm.RefusedError, match="not the image that was measured") as error:
        result.write(tmp_path / "out", dicom=tmp_path / "other")
    assert (error.value.code, error.value.view) == ("patient_mismatch", "AP")
    assert not (tmp_path / "out/measurements.dcm").exists()
    result.write(tmp_path / "out", dicom=case[0])
    assert (tmp_path / "out/measurements.dcm").exists()


def test_a_rectified_pixel_off_the_image_is_no_place(result):
    held = result.calibration
    point = next(p for p in result.points if p.xyz_mm is not None)
    seen = {name: held.project(point.xyz_mm, name) for name in held.names}
    for off in ((5000, 300), (-700, 300)):
        with pytest.raises(helicarm.RefusedError, match="outside the rectified image") as error:
            held.locate({**seen, "AP": off})
        assert (error.value.code, error.value.view) == ("not_seen", "AP")
        many = held.locate_all({**{name: [uv] for name, uv in seen.items()}, "AP": [off]})
        assert np.isnan(many["xyz_mm"]).all() and many["reasons"][0]["code"] == "not_seen"


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


def test_map_of_the_dots_of_xmalabs_grid(tmp_path):
    v, u = np.mgrid[20:460:20, 20:620:20].astype(float)
    straight = np.c_[u.ravel(), v.ravel()]
    off = straight - [320, 240]
    raw = straight + off * 1e-7 * np.sum(off ** 2, axis=1)[:, None]
    for name, points in (("INPTS", raw), ("BSPTS", straight), ("short", straight[:-1])):
        np.savetxt(tmp_path / f"{name}.csv", points, delimiter=",", fmt="%.9g")
    made = helicarm.DistortionMap.from_xmalab(tmp_path / "INPTS.csv", tmp_path / "BSPTS.csv", shape=(480, 640))
    assert made.shape == (480, 640)
    assert made.rectified_from_raw(raw) == pytest.approx(straight, abs=0.05)
    with pytest.raises(helicarm.InputError, match="bad_size"):
        helicarm.DistortionMap.from_xmalab(tmp_path / "INPTS.csv", tmp_path / "short.csv", shape=(480, 640))
    with pytest.raises(helicarm.InputError, match="shape"):
        helicarm.DistortionMap.from_xmalab(tmp_path / "INPTS.csv", tmp_path / "BSPTS.csv", shape=(0, 640))


def test_plate_is_found_in_an_image(case):
    image = helicarm.read_image(case[0] / "AP.dcm")
    found = helicarm.rectify(image, helicarm.Plate.load(case[0] / "plate.json"))
    assert found.dots_found > 20 and found.uv_raw.shape[1] == 2
    assert np.sqrt(np.mean(found.residual_px ** 2)) < 0.3
    assert helicarm.rectify(image, "plate48").dots_found == found.dots_found
    assert helicarm.rectify(image, "plate48", model="radial").map.model == "radial"


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


@pytest.fixture(scope="module")
def labelled(case):
    calibrator, plate = (kind.load(case[0] / f"{kind.__name__.lower()}.json") for kind in (helicarm.Calibrator, helicarm.Plate))
    images = [helicarm.read_image(case[0] / f"{name}.dcm") for name in ("AP", "LAT")]
    return calibrator, [helicarm.label(image, calibrator, helicarm.rectify(image, plate)) for image in images]


def test_labelled_images_calibrate_as_the_run_did(result, labelled):
    calibrator, views = labelled
    calibration = helicarm.calibrate(views, c_arm=helicarm.CArmPrior.unknown(),
                                     ball_covariance_mm2=calibrator.ball_covariance_mm2,
                                     scale_sigma=calibrator.scale_sigma)
    expected = result.calibration
    assert calibration.names == expected.names
    assert calibration.projection("LAT") == pytest.approx(expected.projection("LAT"), rel=1e-9)
    assert calibration.joint_covariance == pytest.approx(expected.joint_covariance, rel=1e-6, abs=1e-12)
    assert (calibration.chi2, calibration.dof) == (pytest.approx(expected.chi2), expected.dof)
    point = next(p for p in result.points if p.xyz_mm is not None)
    raw = {name: calibration.project(point.xyz_mm, name, raw=True) for name in calibration.names}
    assert calibration.locate(raw, raw=True).xyz_mm == pytest.approx(point.xyz_mm, abs=1e-4)


def test_own_points_through_the_map_have_the_maps_covariance(labelled):
    view = labelled[1][0]
    used = [f for f in view.fiducials if f["status"] == "used"]
    uv = np.array([f["uv"] for f in used])
    covariance = view.map.covariance_px2(uv)
    sigma = view.map.sigma_px(uv)
    assert np.diag(covariance) == pytest.approx(sigma ** 2) and np.linalg.eigvalsh(covariance)[0] > -1e-12
    assert view.map.sigma_px(uv[0]) == pytest.approx(sigma[0]) and isinstance(view.map.sigma_px(uv[0]), float)
    own = helicarm.ViewPoints("AP", [f["xyz_mm"] for f in used], [f["uv_raw"] for f in used], sigma_px=0.03, map=view.map)
    assert np.array([f["uv"] for f in own.fiducials]) == pytest.approx(uv, abs=1e-9)
    assert np.array([f["sigma_px"] for f in own.fiducials]) == pytest.approx(np.hypot(0.03, sigma))


def test_label_names_the_image_it_refuses(case):
    blank = helicarm.XrayImage(np.full((300, 400), 7, np.uint8), pixel_mm=0.2, source_detector_mm=1000, name="blank")
    for call in (lambda: helicarm.label(blank, helicarm.Calibrator.udcsc()), lambda: helicarm.rectify(blank, "plate48")):
        with pytest.raises(helicarm.RefusedError) as error:
            call()
        assert error.value.view == "blank"


def test_plate_of_the_other_kind_is_refused_where_the_calibrator_shows_it(case):
    image, calibrator = helicarm.read_image(case[0] / "AP.dcm"), helicarm.Calibrator.load(case[0] / "calibrator.json")
    other = helicarm.Plate.from_dict({**helicarm.Plate.plate48().to_dict(), "kind": "holes"})
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.label(image, calibrator, helicarm.rectify(image, other))
    assert error.value.code == "plate_mismatch" and error.value.view == "AP"


def test_history_is_made_and_added_to_once(case, tmp_path):
    history = tmp_path / "arm.json"
    with pytest.warns(UserWarning, match="did not exist"):
        helicarm.run_case(case[0], history=history)
    entries = json.loads(history.read_text())["shots"]
    assert len(entries) == 2
    helicarm.run_case(case[0], history=history)
    assert json.loads(history.read_text())["shots"] == entries


def test_c_arm_that_has_changed_is_refused(case, tmp_path):
    record = tmp_path / "arm.json"
    for seed in (11, 12, 13):
        helicarm.simulate_case(tmp_path / str(seed), seed=seed, size=512)
        helicarm.run_case(tmp_path / str(seed), history=record)
    report = helicarm.c_arm_report(record, out=tmp_path / "report")
    assert len(report["acquisitions"]) == 6
    assert (tmp_path / "report" / "report.html").exists()
    shots = json.loads(record.read_text())
    for shot in shots["shots"]:
        shot["estimate_mm"][1] += 60  # as if the receiver had been moved since
    moved = tmp_path / "moved.json"
    moved.write_text(json.dumps(shots))
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.check_c_arm(moved, case[0])
    assert error.value.code == "c_arm_changed"
    assert error.value.result["chi2"] > error.value.result["limit"]
    with pytest.raises(helicarm.RefusedError):
        helicarm.add_to_c_arm(moved, case[0])
    assert helicarm.add_to_c_arm(record, case[0]) == 2
    assert helicarm.add_to_c_arm(record, case[0]) == 0


def test_images_without_plate_take_their_distortion_from_the_record(case, result, tmp_path):
    record, bare = tmp_path / "arm.json", tmp_path / "bare"
    assert helicarm.add_to_c_arm(record, case[0]) == 2
    assert helicarm.c_arm_report(record)["distortion"]["maps"] == 2
    copy = tmp_path / "copy.json"
    copy.write_text(record.read_text().replace('"picture": "', '"picture": "other '))
    assert [each["code"] for each in helicarm.check_c_arm(copy, case[0])["warnings"]] == ["plate_mismatch"]  # two maps do not tell
    shutil.copytree(case[0], bare)
    given = json.loads((bare / "case.json").read_text())
    given["plate"] = None
    (bare / "case.json").write_text(json.dumps(given))
    found = helicarm.run_case(bare, history=record)
    by_plate = {p.name: p.xyz_mm for p in result.points if p.xyz_mm is not None}
    for point in found.points:
        if point.name in by_plate:
            assert np.linalg.norm(point.xyz_mm - by_plate[point.name]) < 0.3


def test_motion_enlarges_the_covariance(tmp_path):
    helicarm.simulate_case(tmp_path, seed=3, size=512, kind="tunnels")
    given = json.loads((tmp_path / "case.json").read_text())
    for view in given["views"]:
        view.pop("poses", None)  # the bones are not tracked
    (tmp_path / "case.json").write_text(json.dumps(given))
    still, moving = (helicarm.run_case(tmp_path, motion_sigma_mm=mm).points[0] for mm in (0, 1))
    assert moving.error_95_mm > 1 > still.error_95_mm


def test_lost_ball_is_a_fault_as_of_the_program(tmp_path):
    truth = helicarm.simulate_case(tmp_path, seed=3, size=512, faults=["lost:P4"])
    assert truth
    status = {f["label"]: f["status"] for f in helicarm.run_case(tmp_path).calibration.fiducials("AP")}
    assert status["P4"] != "used" and status["P5"] == "used"


def test_plate_may_be_anywhere(case, tmp_path):
    image = helicarm.read_image(case[0] / "AP.dcm")
    helicarm.Plate.plate48().save(tmp_path / "plate.json")
    for path in (tmp_path / "plate.json", str(tmp_path / "plate.json")):
        assert helicarm.rectify(image, path).dots_found > 20
    with pytest.raises(helicarm.InputError, match='missing_file.*built-in plate is "plate48"'):
        helicarm.rectify(image, tmp_path / "none.json")


def test_calibration_of_a_run_has_its_figures(result, tmp_path):
    result.write(tmp_path)
    held, loaded = result.calibration, helicarm.Calibration.load(tmp_path / "result.json")
    assert held.dof > 10 and 0.2 < held.chi2 / held.dof < 5 and held.variance_scale >= 1
    assert (loaded.chi2, loaded.dof) == (held.chi2, held.dof)
    assert loaded.fiducials("AP")[3]["uv"] == pytest.approx(held.fiducials("AP")[3]["uv"])
    assert repr(result).startswith("<Result: 2 views, ")


def test_phantoms_and_plates_come_from_arrays():
    given = helicarm.Calibrator.udcsc()
    covariance = np.array([0.01 * np.eye(3)] * 12)
    made = helicarm.Calibrator.from_arrays(given.labels, given.xyz_mm, 4, name="mine", tolerance_mm=0.1,
                                           covariance_mm2=covariance)
    assert np.array_equal(made.xyz_mm, given.xyz_mm) and made.diameters_mm.tolist() == [4] * 12
    assert made.ball_covariance_mm2 == pytest.approx(covariance + 0.01 * np.eye(3))
    joint = helicarm.Calibrator.from_arrays(given.labels, given.xyz_mm, given.diameters_mm, covariance_mm2=0.01 * np.eye(36))
    assert joint.ball_covariance_mm2.shape == (36, 36) and given.ball_covariance_mm2 is None
    plate = helicarm.Plate.plate48()
    again = helicarm.Plate.from_arrays(plate.xy_mm, diameter_mm=2.5, pitch_mm=25, height_above_receiver_mm=15, name="plate48")
    assert again.to_dict() == plate.to_dict()
    with pytest.raises(helicarm.InputError, match="differ in length: 12, 11 and 1"):
        helicarm.Calibrator.from_arrays(given.labels, given.xyz_mm[:11], 4)
    with pytest.raises(helicarm.InputError, match="metres"):
        helicarm.Calibrator.from_arrays(given.labels, given.xyz_mm / 1000, 4)


def test_stubs_name_what_the_module_has():
    import inspect
    from helicarm import _helicarm
    stub = (inspect.getsourcefile(helicarm) or "").replace("__init__.py", "_helicarm.pyi")
    text = open(stub).read()
    for name, thing in vars(_helicarm).items():
        if name.startswith("_"):
            continue
        assert re.search(rf"^(class|def) {name}\b", text, re.M), name
        if not inspect.isclass(thing):
            continue
        body = re.search(rf"^class {name}\b.*?(?=^(class|def) |\Z)", text, re.M | re.S).group()
        for member in vars(thing):
            if not member.startswith("_"):
                assert re.search(rf"def {member}\(", body), f"{name}.{member}"


def test_a_result_tells_where_the_tracked_bones_were(tmp_path):
    helicarm.simulate_case(tmp_path, seed=3, size=512, kind="tunnels")
    result = helicarm.run_case(tmp_path)
    views = json.loads((tmp_path / "case.json").read_text())["views"]
    for view, found in zip(views, result.to_dict()["views"]):
        poses = view["poses"]
        for bone, pose in poses["tracker_from_bone"].items():
            expected = np.linalg.inv(poses["tracker_from_calibrator"]) @ pose
            assert np.allclose(found["calibrator_from_bone"][bone], expected, atol=1e-6)
    # A model in the femur's marker is found in these views, which its registration does not name.
    first = np.array(result.to_dict()["views"][0]["calibrator_from_bone"]["femur"])
    lateral = {"axis_medial": (0, -30, 0), "axis_lateral": (0, 30, 0), "anterior": (25, 0, 0), "posterior": (-25, 0, 0), "p": (5, 0, 0)}
    registration = {"views": [], "models": [{"name": "femur", "decision": "accept", "world_from_model": np.eye(4).tolist(),
                                             "covariance": (1e-6 * np.eye(6)).tolist(), "centre_mm": [0, 0, 0], "moves_with": "femur",
                                             "bone_from_model": np.linalg.inv(first).tolist()}]}
    found = helicarm.measure_landmarks("tibia_ap", lateral, registration=registration, calibration=result.calibration)
    assert next(iter(found["positions"][0]["percent"].values())) == pytest.approx(40)
    registration["models"][0]["moves_with"] = "another"
    with pytest.raises(helicarm.InputError, match='"femur" moves with a bone\'s marker'):
        helicarm.measure_landmarks("tibia_ap", lateral, registration=registration, calibration=result.calibration)
