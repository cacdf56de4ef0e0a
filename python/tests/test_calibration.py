# SPDX-License-Identifier: Apache-2.0
import cv2
import numpy as np
import pytest

import helicarm

POINT = np.array([12.0, -7.0, 45.0])


def test_projection_is_that_of_numpy_and_opencv(pair):
    calibration = pair.calibration()
    points = POINT + np.random.default_rng(2).uniform(-30, 30, (20, 3))
    for name in calibration.names:
        uv = calibration.project(points, name)
        homogeneous = np.c_[points, np.ones(20)] @ calibration.projection(name).T
        assert uv == pytest.approx(homogeneous[:, :2] / homogeneous[:, 2:], abs=1e-9)
        pose = calibration.camera_from_calibrator(name)
        expected, _ = cv2.projectPoints(points, cv2.Rodrigues(pose[:3, :3])[0], pose[:3, 3],
                                        calibration.intrinsics(name), None)
        assert uv == pytest.approx(expected.reshape(-1, 2), abs=1e-6)
        assert calibration.project(points[0], name) == pytest.approx(uv[0])


def test_exact_points_give_the_views_back(pair):
    calibration = pair.calibration()
    for name, (rotation, t) in pair.pose.items():
        assert calibration.intrinsics(name) == pytest.approx(pair.k, abs=1e-4)
        assert calibration.camera_from_calibrator(name)[:3] == pytest.approx(np.c_[rotation, t], abs=1e-5)


def test_pose_agrees_with_opencv(pair):
    """Intrinsics known to 0.001 px leave the pose of solvePnP's iterated least squares."""
    random = np.random.default_rng(4)
    uv = pair.pixels("AP", pair.xyz) + 0.2 * random.standard_normal((12, 2))
    k = np.diag([2500.0, 2500, 1])
    k[:2, 2] = 330, 215
    prior = helicarm.IntrinsicsPrior(focal_px=2500, principal_px=(330, 215), aspect=(1, 1e-8))
    arm = helicarm.CArmPrior(focal=(1e-3, 1e-6), principal=(1e-3, 1e-6))
    views = [helicarm.ViewPoints("AP", pair.xyz, uv, sigma_px=0.2, prior=prior)]
    calibration = helicarm.calibrate(views, c_arm=arm, rejection_probability=0, largest_rms_px=100)
    good, r, t = cv2.solvePnP(pair.xyz, uv, k, None, flags=cv2.SOLVEPNP_ITERATIVE)
    r, t = cv2.solvePnPRefineLM(pair.xyz, uv, k, None, r, t)
    pose = calibration.camera_from_calibrator("AP")
    assert good and pose[:3, 3] == pytest.approx(t.ravel(), abs=0.01)
    assert pose[:3, :3] == pytest.approx(cv2.Rodrigues(r)[0], abs=1e-5)


def test_located_point_is_opencvs_for_exact_pixels(pair):
    calibration = pair.calibration()
    seen = {name: calibration.project(POINT, name) for name in calibration.names}
    located = calibration.locate(seen, sigma_px=0.3)
    p = cv2.triangulatePoints(calibration.projection(0), calibration.projection(1), seen["AP"], seen["LAT"]).ravel()
    assert located.xyz_mm == pytest.approx(p[:3] / p[3], abs=1e-6)
    assert located.xyz_mm == pytest.approx(POINT, abs=1e-6)
    assert located.ray_gap_mm < 1e-6 and located.views == ["AP", "LAT"]


def test_covariance_is_that_of_monte_carlo(pair):
    """Noise of fiducials and of the picks together: 400 calibrations, each with its own noise."""
    expected = pair.calibration(sigma=0.1).predict(POINT, sigma_px=0.3)
    random = np.random.default_rng(5)
    errors = []
    for seed in range(400):
        calibration = pair.calibration(noise=0.1, sigma=0.1, seed=seed)
        seen = {name: pair.pixels(name, POINT)[0] + 0.3 * random.standard_normal(2) for name in pair.pose}
        errors.append(calibration.locate(seen, sigma_px=0.3).xyz_mm - POINT)
    scatter = np.cov(np.array(errors).T)
    assert np.trace(scatter) == pytest.approx(np.trace(expected), rel=0.2)
    assert np.diag(scatter) == pytest.approx(np.diag(expected), rel=0.3)


def test_predictions_of_many_points_are_those_of_each(pair):
    calibration = pair.calibration()
    points = POINT + np.array([[0, 0, 0], [5, -3, 2], [0, 10, 0.0]])
    all_at_once = calibration.predict(points, sigma_px=0.5)
    assert all_at_once.shape == (3, 3, 3)
    for point, covariance in zip(points, all_at_once):
        assert calibration.predict(point, sigma_px=0.5) == pytest.approx(covariance)
    behind = calibration.predict(np.array([POINT, [0, -5000, 0]]), sigma_px=0.5)
    assert np.isfinite(behind[0]).all() and np.isnan(behind[1]).all()


def test_tre_map_is_indexed_x_y_z(pair):
    calibration = pair.calibration()
    volume = calibration.tre_map(POINT, half_mm=20, step_mm=10, sigma_px=0.5)
    rms, first = volume["rms_mm"], volume["first_mm"]
    for index in ((0, 1, 4), (4, 0, 2)):
        covariance = calibration.predict(first + volume["step_mm"] * np.array(index), sigma_px=0.5)
        assert rms[index] == pytest.approx(np.sqrt(np.trace(covariance)))


def test_outlier_is_rejected(pair):
    views = []
    for name in pair.pose:
        uv = pair.pixels(name, pair.xyz)
        if name == "AP":
            uv[4] += 8
        views.append(helicarm.ViewPoints(name, pair.xyz, uv, sigma_px=0.1))
    calibration = helicarm.calibrate(views)
    status = {f["label"]: f["status"] for f in calibration.fiducials("AP")}
    assert status["P5"] == "rejected" and list(status.values()).count("used") == 11


def test_joint_covariance_of_independent_balls_is_that_of_each(pair):
    random = np.random.default_rng(6)
    views = [helicarm.ViewPoints(name, pair.xyz, pair.pixels(name, pair.xyz) + 0.1 * random.standard_normal((12, 2)),
                                 sigma_px=0.1) for name in pair.pose]
    each = np.array([np.diag([0.01, 0.02, 0.03])] * 12)
    joint = np.zeros((36, 36))
    for ball in range(12):
        joint[3 * ball:3 * ball + 3, 3 * ball:3 * ball + 3] = each[ball]
    first, second = (helicarm.calibrate(views, ball_covariance_mm2=mm2, rejection_probability=0) for mm2 in (each, joint))
    assert second.covariance("AP") == pytest.approx(first.covariance("AP"), rel=1e-3, abs=1e-6)
    assert second.projection("LAT") == pytest.approx(first.projection("LAT"), rel=1e-6, abs=1e-6)
    with pytest.raises(helicarm.InputError, match="bad_value"):
        helicarm.calibrate(views, ball_covariance_mm2=each[:11])


def permuted(view, order, pair, uv):
    labels = [f"P{i + 1}" for i in order]
    return helicarm.ViewPoints(view, pair.xyz[order], uv[order], sigma_px=0.1, labels=labels)


def noisy_pixels(pair, covariance, seed=7):
    """Of balls displaced by this covariance, the same in both views."""
    random = np.random.default_rng(seed)
    xyz = pair.xyz + np.array([random.multivariate_normal(np.zeros(3), c) for c in covariance])
    return {name: pair.pixels(name, xyz) + 0.1 * random.standard_normal((12, 2)) for name in pair.pose}


COVARIANCE = np.array([np.diag([k + 1.0, 2 * k + 1, 1]) * 0.003 for k in range(12)])


@pytest.mark.parametrize("joint", [False, True])
def test_order_of_a_views_points_does_not_matter(pair, joint):
    uv = noisy_pixels(pair, COVARIANCE)
    mm2 = np.zeros((36, 36))
    for k in range(12):
        mm2[3 * k:3 * k + 3, 3 * k:3 * k + 3] = COVARIANCE[k]
    given = mm2 if joint else COVARIANCE
    rows, mixed = np.arange(12), np.random.default_rng(8).permutation(12)
    expected, found = (
        helicarm.calibrate([permuted("AP", rows, pair, uv["AP"]), permuted("LAT", order, pair, uv["LAT"])],
                           ball_covariance_mm2=given, rejection_probability=0) for order in (rows, mixed))
    assert found.chi2 == pytest.approx(expected.chi2, rel=1e-6)
    assert found.covariance("LAT") == pytest.approx(expected.covariance("LAT"), rel=1e-6, abs=1e-12)


def test_view_may_lack_a_ball(pair):
    uv = noisy_pixels(pair, COVARIANCE)
    rows, fewer = np.arange(12), np.delete(np.arange(12), 3)
    for first, second in ((rows, fewer), (fewer, rows)):
        views = [permuted("AP", first, pair, uv["AP"]), permuted("LAT", second, pair, uv["LAT"])]
        calibration = helicarm.calibrate(views, ball_covariance_mm2=COVARIANCE, rejection_probability=0,
                                         ball_labels=[f"P{i + 1}" for i in range(12)])
        assert 0.4 < calibration.chi2 / calibration.dof < 2
        lacking = {f["label"]: f["status"] for f in calibration.fiducials("AP" if len(first) < 12 else "LAT")}
        assert lacking["P4"] == "not_found" and len(lacking) == 12
    with pytest.raises(helicarm.InputError, match="usage: AP: .*lacks P4: give ball_labels"):
        helicarm.calibrate(views, ball_covariance_mm2=COVARIANCE)
    with pytest.raises(helicarm.InputError, match='bad_value: ball_labels: "P12" is missing'):
        helicarm.calibrate(views, ball_covariance_mm2=COVARIANCE[:11], ball_labels=[f"P{i + 1}" for i in range(11)])


def test_labels_and_names_must_agree(pair):
    uv = {name: pair.pixels(name, pair.xyz) for name in pair.pose}
    rows = np.arange(12)
    with pytest.raises(helicarm.InputError, match="name_clash"):
        helicarm.calibrate([permuted("A", rows, pair, uv["AP"]), permuted("A", rows, pair, uv["LAT"])])
    other = helicarm.ViewPoints("LAT", pair.xyz + [0, 0, 1], uv["LAT"], sigma_px=0.1)
    with pytest.raises(helicarm.InputError, match="P1 is 1 mm from its coordinates in another view") as error:
        helicarm.calibrate([permuted("AP", rows, pair, uv["AP"]), other])
    assert error.value.view == "LAT" and error.value.figures["distance_mm"] == pytest.approx(1)


def test_views_a_few_degrees_apart_are_refused_unless_wanted(pair):
    uv = pair.pixels("AP", pair.xyz)
    views = [helicarm.ViewPoints(name, pair.xyz, uv, sigma_px=0.1) for name in "AB"]
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.calibrate(views)
    assert error.value.code == "views_too_close" and error.value.figures["limit_deg"] == 30
    assert len(helicarm.calibrate(views, least_angle_deg=0)) == 2


def test_exchanged_axes_are_ambiguous_handedness(pair):
    uv = {name: pair.pixels(name, pair.xyz) for name in pair.pose}
    swapped = {name: points[:, ::-1] for name, points in uv.items()}
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.calibrate([helicarm.ViewPoints(n, pair.xyz, p, sigma_px=0.1) for n, p in swapped.items()])
    assert error.value.code == "ambiguous_handedness"
    stated = [helicarm.ViewPoints(n, pair.xyz, p, sigma_px=0.1, mirrored=True) for n, p in swapped.items()]
    assert helicarm.calibrate(stated).warnings == []
    one = helicarm.calibrate([helicarm.ViewPoints("AP", pair.xyz, uv["AP"], sigma_px=0.1),
                              helicarm.ViewPoints("LAT", pair.xyz, swapped["LAT"], sigma_px=0.1)])
    assert [(w["code"], w["view"]) for w in one.warnings] == [("ambiguous_handedness", "LAT")]
    assert "ambiguous_handedness" in repr(one)


def test_raw_needs_a_map_and_a_place_in_the_image(pair):
    flat = pair.calibration()
    for call in (lambda: flat.locate({"AP": (300, 200), "LAT": (300, 200)}, raw=True),
                 lambda: flat.project(POINT, "AP", raw=True)):
        with pytest.raises(helicarm.InputError, match="usage") as error:
            call()
        assert error.value.view == "AP"
    panel = helicarm.DistortionMap.identity(640, 480)
    calibration = helicarm.calibrate([
        helicarm.ViewPoints(name, pair.xyz, pair.pixels(name, pair.xyz), sigma_px=0.1, map=panel)
        for name in pair.pose])
    raw = {name: calibration.project(POINT, name, raw=True) for name in calibration.names}
    assert calibration.locate(raw, raw=True).xyz_mm == pytest.approx(POINT, abs=1e-6)
    for outside in ((-50, 3), (300, 600), (-500, -500)):
        with pytest.raises(helicarm.RefusedError) as error:
            calibration.locate({**raw, "AP": outside}, raw=True)
        assert (error.value.code, error.value.view) == ("not_seen", "AP")
        assert error.value.figures == {"u": outside[0], "v": outside[1]}
    with pytest.raises(helicarm.RefusedError, match="not_seen"):
        helicarm.ViewPoints("AP", pair.xyz, pair.pixels("AP", pair.xyz) + 500, sigma_px=0.1, map=panel)


def test_points_located_at_once_are_those_of_each(pair):
    calibration = pair.calibration()
    points = POINT + np.random.default_rng(3).uniform(-20, 20, (40, 3))
    seen = {name: calibration.project(points, name) for name in calibration.names}
    seen["AP"][7] = np.nan
    together = calibration.locate_all(seen, sigma_px=0.4)
    assert together["xyz_mm"].shape == (40, 3) and together["covariance_mm2"].shape == (40, 3, 3)
    for i in (0, 39):
        one = calibration.locate({name: uv[i] for name, uv in seen.items()}, sigma_px=0.4)
        assert together["xyz_mm"][i] == pytest.approx(one.xyz_mm)
        assert together["covariance_mm2"][i] == pytest.approx(one.covariance_mm2)
        assert together["error_95_mm"][i] == pytest.approx(one.error_95_mm)
    assert np.isnan(together["xyz_mm"][7]).all() and together["reasons"][7]["code"] == "not_seen"
    assert together["reasons"][0] is None
    with pytest.raises(helicarm.InputError, match="another view has 40"):
        calibration.locate_all({"AP": seen["AP"], "LAT": seen["LAT"][:5]})


def test_views_that_contradict_each_other_vouch_for_no_point(pair):
    calibration = pair.calibration()
    points = np.array([POINT, POINT + 5, POINT - 5])
    seen = {name: calibration.project(points, name) for name in calibration.names}
    assert calibration.locate_all(seen, sigma_px=0.4)["warnings"] == [None] * 3
    seen["LAT"][:2] += (11, 13)
    contradicting = calibration.locate_all(seen, sigma_px=0.4)
    assert [w["code"] for w in contradicting["warnings"]] == ["residual_too_large"] * 3
    alone = calibration.locate({name: uv[2] for name, uv in seen.items()}, sigma_px=0.4)
    assert alone.warning is None and alone.note is None and contradicting["notes"] == []
    assert contradicting["error_95_mm"][2] > 3 * alone.error_95_mm


def test_own_calibration_is_saved_whole(pair, tmp_path):
    calibration = pair.calibration(noise=0.1, seed=2)
    calibration.save(tmp_path / "calibration.json")
    loaded = helicarm.Calibration.load(tmp_path / "calibration.json")
    seen = {name: calibration.project(POINT, name) for name in calibration.names}
    a, b = calibration.locate(seen), loaded.locate(seen)
    assert a.xyz_mm == pytest.approx(b.xyz_mm, abs=1e-7)
    assert a.covariance_mm2 == pytest.approx(b.covariance_mm2, rel=1e-6)
    assert loaded.covariance("LAT") == pytest.approx(calibration.covariance("LAT"))
    assert (loaded.chi2, loaded.dof, loaded.variance_scale) == (calibration.chi2, calibration.dof,
                                                                calibration.variance_scale)
    assert [f["label"] for f in loaded.fiducials("AP")] == [f["label"] for f in calibration.fiducials("AP")]
    assert helicarm.figures.residuals(loaded, "AP").get_title().startswith("residuals")


def test_representations_say_what_matters(pair):
    calibration = pair.calibration()
    assert repr(calibration).startswith("<Calibration of AP, LAT: chi2 / dof ")
    prior = helicarm.IntrinsicsPrior(focal_px=3400, principal_px=(320, 240), unit_px=3.4, aspect=(1, 0.001))
    assert repr(prior) == ("IntrinsicsPrior(focal_px=3400, principal_px=(320, 240), unit_px=3.4, aspect=(1, 0.001), "
                           "skew=(0, 1e-12))")
    assert repr(helicarm.CArmPrior(focal=(10, 1.4))) == "CArmPrior(focal=(10, 1.4), principal=None)"
    seen = {name: calibration.project(POINT, name) for name in calibration.names}
    seen["AP"] = seen["AP"] + [0, 40]
    point = calibration.locate(seen, sigma_px=0.5)
    assert point.warning["code"] == "residual_too_large" and "warning residual_too_large" in repr(point)


def test_residual_figure_holds_every_arrow_and_the_rejected_fiducial(pair):
    views = []
    for name in pair.pose:
        uv = pair.pixels(name, pair.xyz) + 0.2 * np.random.default_rng(9).standard_normal((12, 2))
        uv[4] += 12 if name == "AP" else 0
        views.append(helicarm.ViewPoints(name, pair.xyz, uv, sigma_px=0.2))
    calibration = helicarm.calibrate(views)
    ax = helicarm.figures.residuals(calibration, "AP")
    assert "1 rejected" in ax.get_title() and len(ax.texts) == 12
    (left, right), (bottom, top) = ax.get_xlim(), sorted(ax.get_ylim())
    for arrows in ax.collections[:1]:
        ends = arrows.get_offsets() + np.c_[arrows.U, arrows.V]
        assert ((left < ends[:, 0]) & (ends[:, 0] < right) & (bottom < ends[:, 1]) & (ends[:, 1] < top)).all()


def test_tre_figure_refuses_a_plane_outside_its_lattice(pair):
    with pytest.raises(ValueError, match="z_mm: 400 is outside the lattice"):
        helicarm.figures.tre_map(pair.calibration(), POINT, half_mm=20, step_mm=10, sigma_px=0.5, z_mm=400)


def test_one_view_places_nothing(pair):
    with pytest.raises(helicarm.RefusedError) as error:
        pair.calibration().locate({"AP": (300, 200)})
    assert error.value.code == "not_seen"


def test_flat_phantom_is_refused_with_figures(pair):
    flat = pair.xyz * [1, 1, 0]
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.calibrate([helicarm.ViewPoints("AP", flat, pair.pixels("AP", flat), sigma_px=0.1)])
    assert error.value.code == "coplanar_fiducials" and error.value.view == "AP"
    assert all(isinstance(v, float) for v in error.value.figures.values()) and error.value.figures


@pytest.mark.parametrize("xyz, uv, code", [(np.zeros((5, 2)), np.zeros((5, 2)), "bad_value"),
                                           (np.zeros((5, 3)), np.zeros((4, 2)), "bad_value"),
                                           (np.full((5, 3), np.nan), np.zeros((5, 2)), "not_finite")])
def test_wrong_arrays_are_input_errors(xyz, uv, code):
    with pytest.raises(helicarm.InputError) as error:
        helicarm.ViewPoints("AP", xyz, uv, sigma_px=0.1)
    assert error.value.code == code


def test_unknown_view_is_an_input_error(pair):
    with pytest.raises(helicarm.InputError, match="no view"):
        pair.calibration().projection("PA")
