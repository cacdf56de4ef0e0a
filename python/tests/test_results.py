# SPDX-License-Identifier: Apache-2.0
"""Pickles, frames and rotations of results; Ctrl-C, progress and threads of long calls."""
import copy
import os
import pickle
import signal
import threading

import numpy as np
import pytest

import helicarm
from helicarm.results import RegistrationAnswer
from test_arrays import start, views_of, volume_of_body
from test_registration import sequence  # noqa: F401
from test_sweep import run  # noqa: F401


def again(obj):
    return pickle.loads(pickle.dumps(obj))


def test_version_and_commit_are_texts():
    assert helicarm.__version__.count(".") == 2
    assert isinstance(helicarm.__commit__, str) and "(" not in helicarm.__commit__


@pytest.fixture(scope="module")
def swept(run):  # noqa: F811
    return helicarm.sweep(run)


@pytest.fixture(scope="module")
def registered(sequence):  # noqa: F811
    return registration(sequence)


def registration(folder, **options):
    return helicarm.register(models={"body": {"volume": volume_of_body(), "window_hu": (300, 3000)}}, views=views_of(folder),
                             starts={"body": start()}, **options)


def test_values_are_pickled(case, result):
    volume, image = volume_of_body(), helicarm.read_image(case[0] / "AP.dcm")
    assert np.array_equal(again(volume).array, volume.array) and np.array_equal(again(volume).affine, volume.affine)
    copied = copy.deepcopy(image)
    assert np.array_equal(copied.pixels, image.pixels) and repr(copied) == repr(image)
    for name in ("range", "source_detector_mm", "warnings"):
        assert getattr(copied, name) == getattr(image, name)
    assert np.array_equal(copied.pixel_mm, image.pixel_mm)
    vertices, faces = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [0, 0, 9.0]]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    surface = helicarm.Surface(vertices, faces, frame="LPS")
    assert np.array_equal(again(surface).vertices, surface.vertices) and np.array_equal(again(surface).faces, surface.faces)
    camera = helicarm.Camera.orbit([1, 2, 3], angle_deg=33)
    assert np.array_equal(again(camera).projection, camera.projection) and again(camera).shape == camera.shape
    calibration = result.calibration
    seen = {name: calibration.project([0, 0, 40], name) for name in calibration.names}
    assert again(calibration).locate(seen).xyz_mm == pytest.approx(calibration.locate(seen).xyz_mm, abs=1e-9)
    assert again(calibration).joint_covariance == pytest.approx(calibration.joint_covariance, rel=1e-6, abs=1e-9)
    for thing in (helicarm.Calibrator.udcsc(), helicarm.Plate.plate48(), calibration.map("AP")):
        assert again(thing).to_dict() == thing.to_dict()


def test_a_pickled_result_has_its_values(result):
    copied = again(result)
    assert copied.to_dict() == result.to_dict() and copied.status == "ok" and copied.names == result.names
    assert [point.name for point in copied.points] == [point.name for point in result.points]
    assert np.array_equal(copied.points[0].xyz_mm, result.points[0].xyz_mm)
    assert copied.calibration.projection("AP") == pytest.approx(result.calibration.projection("AP"), rel=1e-9)
    assert "pickled copy" in repr(copied) and again(copied).to_dict() == result.to_dict()
    with pytest.raises(AttributeError):
        copied.write


def test_a_pickled_sweep_has_its_arrays(swept):
    copied = again(swept)
    assert np.array_equal(copied.projections, swept.projections, equal_nan=True) and copied.accepted == swept.accepted
    assert copied.to_dict() == swept.to_dict()


def test_a_pickled_registration_is_equal(registered):
    copied = again(registered)
    assert copied == registered and type(copied) is type(registered)
    assert np.array_equal(copied.models["body"].world_from_model, registered.models["body"].world_from_model)


def test_errors_are_pickled():
    error = again(helicarm.RefusedError("uncertain", "too far", "AP", {"value": 2.0}, {"status": "refused"}))
    assert (error.code, error.view, error.figures, error.result) == ("uncertain", "AP", {"value": 2.0}, {"status": "refused"})


def test_rotations_are_scipys(result, registered):
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    model = registered.models["body"]
    assert isinstance(model.rotation, rotation)
    assert model.rotation.as_matrix() == pytest.approx(model.world_from_model[:3, :3], abs=1e-12)
    calibration = result.calibration
    assert calibration.rotation("AP").as_matrix() == pytest.approx(calibration.camera_from_calibrator("AP")[:3, :3], abs=1e-9)


def test_frames_are_pandas(result, swept, registered):
    pandas = pytest.importorskip("pandas")
    points = result.to_frame()
    assert isinstance(points, pandas.DataFrame) and list(points.name) == [point.name for point in result.points]
    located = points[points.reason.isna()]
    assert np.allclose(located[["x_mm", "y_mm", "z_mm"]], [point.xyz_mm for point in result.points if point.xyz_mm is not None])
    frames = swept.to_frame()
    assert list(frames.accepted) == swept.accepted and frames.source_x_mm.isna().sum() == 1
    row = registered.to_frame().iloc[0]
    model = registered.models["body"]
    assert (row.name, row["name"], row.m14) == (0, "body", model.world_from_model[0, 3])
    assert row.sigma_x_mm == pytest.approx(np.sqrt(model.covariance[3, 3]))
    assert again(swept).to_frame().equals(frames)


def heading(path):
    return path.read_text().splitlines()[0].split(",")


def test_columns_of_frames_are_those_of_the_csv_files(result, sequence, tmp_path):  # noqa: F811
    pytest.importorskip("pandas")
    result.export(tmp_path, ["csv"])
    assert set(heading(tmp_path / "points.csv")) - {"frame"} <= set(result.to_frame().columns)
    followed = helicarm.register_sequence(sequence, "1-2", out=tmp_path)
    assert set(heading(tmp_path / "registration.csv")) - {"code"} <= set(followed.to_frame().columns)
    one = {"name": "cup", "decision": "refuse", "world_from_model": None, "covariance": None}
    assert RegistrationAnswer({"models": [one]}).to_frame().m11.isna().all()


def test_a_pickled_copy_says_what_it_lacks(result, swept):
    with pytest.raises(AttributeError, match="Sweep.write: a pickled copy.*before pickling"):
        again(swept).write("x")
    with pytest.raises(AttributeError, match="Result.export"):
        again(result).export("x")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        again(result).nothing
    assert not hasattr(again(swept), "write") and copy.copy(again(swept)).frames == swept.frames


def test_what_is_missing_for_a_frame_is_named(monkeypatch, swept):
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ImportError, match="pandas is not installed"):
        swept.to_frame()


def interrupted_after(started):
    """Ctrl-C from another thread once the call has begun."""
    def press():
        started.wait(60)
        os.kill(os.getpid(), signal.SIGINT)
    thread = threading.Thread(target=press)
    thread.start()
    return thread


def test_ctrl_c_ends_a_registration(sequence):  # noqa: F811
    started = threading.Event()
    thread = interrupted_after(started)
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):  # it may be pressed between two steps
            registration(sequence, progress=lambda step: started.set())
    thread.join()


def test_ctrl_c_ends_a_sweep(run):  # noqa: F811
    started = threading.Event()
    thread = interrupted_after(started)
    with pytest.raises(KeyboardInterrupt):
        for _ in range(1000):
            helicarm.sweep(run, progress=lambda share: started.set())
    thread.join()


def test_an_exception_of_progress_ends_the_call(sequence, run):  # noqa: F811
    def stop(at):
        raise ZeroDivisionError
    for call in (lambda: registration(sequence, progress=stop), lambda: helicarm.sweep(run, progress=stop)):
        with pytest.raises(ZeroDivisionError):
            call()


def test_progress_that_takes_a_share_is_told_how_much_of_the_search_is_done(sequence):  # noqa: F811
    steps, told = [], []
    registration(sequence, progress=steps.append)
    registration(sequence, progress=lambda step, share=None: told.append((step, share)))
    assert [step for step, share in told if share is None] == steps
    shares = [share for _, share in told if share is not None]
    assert len(shares) > 10 and shares == sorted(shares) and shares[-1] == 1 and shares[0] > 0
    assert {step for step, share in told if share is not None} <= set(steps)


def test_progress_with_other_parameters_is_told_the_names_alone(sequence):  # noqa: F811
    told = []
    registration(sequence, progress=lambda step, *others: told.append((step, others)))
    assert told and all(others == () for _, others in told)


def test_an_exception_of_progress_at_a_share_ends_the_call(sequence):  # noqa: F811
    def stop(step, share=None):
        if share is not None:
            raise ZeroDivisionError
    with pytest.raises(ZeroDivisionError):
        registration(sequence, progress=stop)


def test_other_threads_run_meanwhile():
    volume = helicarm.Volume(np.ones((200, 200, 200), np.float32), np.eye(4), frame="LPS")
    camera = helicarm.Camera.orbit(volume.centre_mm, size=1500)
    worker = threading.Thread(target=lambda: helicarm.drr(volume, camera, values="raw", threads=1))
    worker.start()
    turns = 0
    while worker.is_alive():
        turns += 1
    assert turns > 1000


def test_threads_do_not_disturb_each_other(sequence, registered):  # noqa: F811
    answers = []
    workers = [threading.Thread(target=lambda: answers.append(registration(sequence))) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    poses = [answer["models"][0]["world_from_model"] for answer in answers]
    assert poses == 3 * [registered["models"][0]["world_from_model"]]
