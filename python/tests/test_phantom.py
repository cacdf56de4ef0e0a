# SPDX-License-Identifier: Apache-2.0
import _thread

import numpy as np
import pytest

import helicarm


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    folder = tmp_path_factory.mktemp("phantom")
    helicarm.simulate_case(folder, seed=5, size=512, knee=False, preset="flat-panel",
                           views=["A:0,0", "B:30,0", "C:-30,0", "D:0,25"])
    return folder


@pytest.fixture(scope="module")
def measured(views):
    nominal = helicarm.Calibrator.udcsc().xyz_mm
    mm = float(np.linalg.norm(nominal[0] - nominal[11]))
    return helicarm.measure_phantom(views, distances=[("P1", "P12", mm)])


def test_balls_are_measured_to_within_their_covariances(measured):
    nominal = helicarm.Calibrator.udcsc()
    assert measured.labels == nominal.labels and measured.xyz_mm.shape == (12, 3)
    error = measured.xyz_mm - nominal.xyz_mm
    np.testing.assert_allclose(measured.from_nominal_mm, error, atol=1e-9)
    sigma = np.sqrt(np.trace(measured.covariance_mm2, axis1=1, axis2=2))
    assert np.linalg.norm(error, axis=1).max() < 4 * sigma.max() < 0.5
    assert measured.scale_source == "distances"
    assert [note["code"] for note in measured.notes] == ["scale_unverified"]


def test_measured_file_serves_a_run(measured, tmp_path):
    measured.write(tmp_path)
    for file in ("calibrator.json", "result.json", "report.html"):
        assert (tmp_path / file).stat().st_size > 500
    loaded = helicarm.Calibrator.load(tmp_path / "calibrator.json")
    np.testing.assert_array_equal(loaded.xyz_mm, measured.calibrator.xyz_mm)
    assert measured.to_dict()["format"] == "helicarm-phantom/1"


def test_two_distances_that_contradict_each_other_are_refused_with_a_result(views):
    with pytest.raises(helicarm.RefusedError, match="distances_disagree") as refusal:
        helicarm.measure_phantom(views, distances=[("P1", "P12", 100.0), ("P1", "P6", 100.0)])
    assert refusal.value.result.warnings is not None


def test_phantom_without_diameters_is_refused_from_scratch(views):
    with pytest.raises(helicarm.InputError, match="bad_value: .*diameters_mm"):
        helicarm.measure_phantom(views, from_scratch=True)


def test_progress_names_the_stages_and_ends_the_measurement(views):
    stages = []

    def progress(stage):
        stages.append(stage)
        if stage == "adjust":
            raise StopIteration(stage)

    with pytest.raises(StopIteration):
        helicarm.measure_phantom(views, progress=progress)
    assert stages == ["read", "detect", "rectify", "adjust"]


def test_ctrl_c_ends_the_measurement(views):
    with pytest.raises(KeyboardInterrupt):
        helicarm.measure_phantom(views, progress=lambda stage: stage == "rectify" and _thread.interrupt_main())


def test_measured_covariance_serves_calibrate_without_the_scale(measured):
    mm2 = measured.calibrator.ball_covariance_mm2
    assert mm2.shape == (36, 36) and np.trace(mm2) < np.trace(measured.covariance_mm2, axis1=1, axis2=2).sum()
    assert repr(measured).startswith("<MeasuredPhantom: 12 balls, 4 views, ")


def test_bad_distances_are_input_errors(views):
    with pytest.raises(helicarm.InputError, match="usage"):
        helicarm.measure_phantom(views, distance_is="inner")
    with pytest.raises(helicarm.InputError):
        helicarm.measure_phantom(views, distances=[("P1", "nowhere", 50.0)])


def test_verification_names_every_ball_and_keeps_a_history(views, tmp_path):
    history = tmp_path / "history.json"
    verified = helicarm.verify_phantom(views, history=history)
    assert [ball["label"] for ball in verified["balls"]] == helicarm.Calibrator.udcsc().labels
    assert {ball["state"] for ball in verified["balls"]} == {"as in the file"}
    assert history.exists()


def test_figure_draws_an_arrow_for_each_ball(measured):
    ax = helicarm.figures.phantom(measured)
    assert len(ax.texts) == 12 and ax.get_title().startswith("measured less nominal")
