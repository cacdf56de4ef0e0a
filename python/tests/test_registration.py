# SPDX-License-Identifier: Apache-2.0
import json

import cv2
import numpy as np
import pytest

import helicarm

POINTS = {"a": (10, 0, 5), "b": (-12, 8, 0), "c": (3, -9, 20), "d": (0, 14, -11)}
SHIFT = np.array([4.0, -2, 6])


@pytest.fixture
def landmarks(tmp_path):
    """A body of landmarks, shifted by SHIFT, in two views with cameras of their own; images of 96 x 80 pixels."""
    k = np.array([[900.0, 0, 47.5], [0, 900, 39.5], [0, 0, 1]])
    views, picks = [], []
    for name, rotation in (("A", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]), ("B", [[0, -1, 0], [0, 0, -1], [1, 0, 0]])):
        rotation, shift = np.array(rotation, float), np.array([0, 0, 800.0])
        (tmp_path / f"camera{name}.json").write_text(json.dumps({"K": k.tolist(), "R": rotation.tolist(), "t": shift.tolist()}))
        grey = np.random.default_rng(1).integers(900, 1100, (80, 96)).astype(np.uint16)
        cv2.imwrite(str(tmp_path / f"{name}.png"), grey)
        views.append({"name": name, "image": f"{name}.png", "camera": f"camera{name}.json"})
        for point, place in POINTS.items():
            at = k @ (rotation @ (np.array(place) + SHIFT) + shift)
            picks.append({"name": point, "view": name, "uv": (at[:2] / at[2]).tolist()})
    rows = [f"{name},{x},{y},{z}" for name, (x, y, z) in POINTS.items()]
    (tmp_path / "points.csv").write_text("\n".join(["name,x_mm,y_mm,z_mm", *rows]) + "\n")
    case = {"format": "helicarm-case/1", "views": views, "picks": picks,
            "models": [{"name": "body", "start": {"landmarks": "points.csv"}}]}
    (tmp_path / "case.json").write_text(json.dumps(case))
    return tmp_path


def test_register_returns_registration_json(landmarks, tmp_path):
    answer = helicarm.register(landmarks, out=tmp_path / "out")
    assert answer == json.loads((tmp_path / "out/registration.json").read_text())
    pose = np.array(answer["models"][0]["world_from_model"])
    assert pose[:3, 3] == pytest.approx(SHIFT, abs=1e-4)


def test_cameras_without_covariance_are_a_warning(landmarks):
    model = helicarm.register(landmarks)["models"][0]
    assert (model["decision"], [w["code"] for w in model["warnings"]]) == ("warn", ["covariance_missing"])


def test_register_without_models_is_an_input_error(case):
    with pytest.raises(helicarm.InputError) as error:
        helicarm.register(case[0])
    assert error.value.code == "bad_value"


def test_register_names_a_bad_argument(landmarks):
    with pytest.raises(helicarm.InputError, match="search_mm"):
        helicarm.register(landmarks, search_mm=-1)
