# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import helicarm

FEMUR = {"blumensaat_posterior": (200.0, 240.0), "blumensaat_anterior": (280.0, 180.0), "inferior": (260.0, 257.5)}


def test_distance_in_the_plane_of_a_point_is_numpys(pair):
    calibration = pair.calibration()
    rotation, _ = pair.pose["LAT"]
    here = pair.xyz.mean(axis=0)
    there = here + rotation.T @ (12, -9, 0)
    uv = calibration.project(np.array([here, there]), "LAT")
    found = helicarm.measure("distance", {"from": uv[0], "to": uv[1]}, calibration=calibration, view="LAT", at=here)
    length = found["quantities"][0]
    assert (length["name"], length["unit"]) == ("length", "mm")
    assert length["value"] == pytest.approx(15, abs=1e-6)
    assert found["depth_mm"] == pytest.approx(800, abs=1e-4)
    by_fiducials = helicarm.measure("distance", {"from": uv[0], "to": uv[1]}, calibration=calibration, view="LAT")
    assert by_fiducials == found


def test_lengths_without_a_calibration_are_pixels():
    length = helicarm.measure("distance", {"from": (1, 2), "to": (4, 6)}, sigma_px=0.2)["quantities"][0]
    assert length == {"name": "length", "unit": "px", "value": pytest.approx(5), "sigma": pytest.approx(0.2 * 2**0.5)}


def test_quadrants_of_a_click_and_of_a_located_point(pair):
    calibration = pair.calibration()
    point = np.array([3.0, 5.0, 40.0])
    uv = calibration.project(point, "LAT")
    covariance = np.diag([0.04, 0.09, 0.01])
    found = helicarm.measure("femoral_quadrants", {**FEMUR, "clicked": uv}, calibration=calibration, view="LAT",
                             points={"located": (point, covariance)})
    origin, anterior, inferior = (np.array(FEMUR[name]) for name in FEMUR)

    def percent(uv):
        """In mm: the pixels are not square."""
        scale = 1 / np.diag(pair.k)[:2]
        along, way, down = ((end - origin) * scale for end in (anterior, uv, inferior))
        return np.array([100 * along @ way / (along @ along), 100 * np.cross(along, way) / np.cross(along, down)])

    for position in found["positions"]:
        assert list(position["percent"].values()) == pytest.approx(percent(uv), abs=1e-9)
    clicked, located = (np.array(p["covariance_percent2"]) for p in found["positions"])
    by_point = np.array([(calibration.project(point + d, "LAT") - calibration.project(point - d, "LAT")) / 2e-4
                         for d in 1e-4 * np.eye(3)]).T
    by_pixel = np.array([(percent(uv + d) - percent(uv - d)) / 2 for d in np.eye(2)]).T
    expected = by_pixel @ (by_point @ covariance @ by_point.T - 0.25 * np.eye(2)) @ by_pixel.T
    assert located - clicked == pytest.approx(expected, abs=1e-4)


def test_refusals_are_named(pair):
    with pytest.raises(helicarm.InputError, match="\"lateral\" is missing"):
        helicarm.measure("tibia_ml", {"medial": (1, 2)})
    with pytest.raises(helicarm.InputError, match="kind"):
        helicarm.measure("length", {})
    with pytest.raises(helicarm.InputError, match="require a calibration"):
        helicarm.measure("distance", {"from": (1, 2), "to": (4, 6)}, depth_mm=700)
    with pytest.raises(helicarm.InputError, match="distortion map"):
        helicarm.measure("distance", {"from": (1, 2), "to": (4, 6)}, calibration=pair.calibration(), view="AP",
                         raw=True)


def test_position_outside_the_landmarks_is_warned_of():
    found = helicarm.measure("tibia_ml", {"medial": (200, 9), "lateral": (1000, 9), "X": (0, 9)}, sigma_px=0.5)
    (warning,) = found["positions"][0]["warnings"]
    assert warning["code"] == "outside_reference"
    assert warning["figures"]["percent"] == pytest.approx(-25)
    assert '"X" with "medial" (20.0 %)' in warning["message"]
    assert found["notes"] == []


LANDMARKS = {"axis_medial": (-45, -25, -20), "axis_lateral": (5, -25, -20), "blumensaat_posterior": (0, -20, 0),
             "blumensaat_anterior": (-3, 20, 0), "inferior": (8, 3, -25), "posterior": (6, -25, -10), "anterior": (7, 25, -4)}


def test_landmarks_of_a_ct_give_quadrants_with_zones():
    found = helicarm.measure_landmarks("femoral_quadrants", {**LANDMARKS, "P": (-20, -12.5, -7)}, sigma_mm=0.5)
    (position,) = found["positions"]
    assert position["percent"] == pytest.approx({"depth": 25, "height": 28})
    assert position["zones"][0]["from_centre_percent"]["depth"] == pytest.approx(0.2)
    assert found["laterals"] == [] and found["missing"] == []


def test_points_of_the_world_are_carried_into_the_model_and_views_judged(pair, tmp_path):
    calibration = pair.calibration()
    rotation, translation = pair.pose["LAT"]
    # The bone's x axis lies along the ray to its origin, at the balls' middle: LAT is a true lateral image of it.
    along = pair.xyz.mean(axis=0) + rotation.T @ translation
    along /= np.linalg.norm(along)
    second = np.cross(along, (0, 0, 1))
    second /= np.linalg.norm(second)
    pose = np.eye(4)
    pose[:3, :3] = np.array([along, second, np.cross(along, second)]).T
    pose[:3, 3] = pair.xyz.mean(axis=0)
    model = {"name": "femur", "decision": "accept", "world_from_model": pose.tolist(), "covariance": (1e-6 * np.eye(6)).tolist(),
             "centre_mm": pose[:3, 3].tolist(), "points": []}
    world = pose[:3, :3] @ (-20, -12.5, -7) + pose[:3, 3]
    landmarks = {**LANDMARKS, "axis_medial": (-25, 0, 0), "axis_lateral": (25, 0, 0)}
    found = helicarm.measure_landmarks("femoral_quadrants", landmarks, registration={"models": [model]}, calibration=calibration,
                                       points={"P": (world, 0.01 * np.eye(3))})
    assert found["model"] == "femur"
    assert found["positions"][0]["percent"] == pytest.approx({"depth": 25, "height": 28})
    (view,) = [each for each in found["laterals"] if each["view"] == "LAT"]
    assert view["is_lateral"] and view["off_deg"] < 0.01
    # Perspective: the landmarks' depths differ by up to 13 mm of 800.
    assert view["positions"][0]["percent"] == pytest.approx({"depth": 25, "height": 28}, abs=3)
    # A tracked bone had turned by 10 degrees at LAT's acquisition.
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(np.pi / 18), -np.sin(np.pi / 18)], [np.sin(np.pi / 18), np.cos(np.pi / 18)]]
    at = {"AP": pose, "LAT": pose @ turn}
    tracked = {**model, "acquisitions": [{"view": name, "world_from_model": at[name].tolist()} for name in at]}
    later = helicarm.measure_landmarks("femoral_quadrants", landmarks, registration={"models": [tracked]}, calibration=calibration)
    (view,) = [each for each in later["laterals"] if each["view"] == "LAT"]
    assert not view["is_lateral"] and view["off_deg"] == pytest.approx(10, abs=0.01)
    camera = np.eye(4)
    camera[:3, 3] = 0, 0, 900
    with pytest.raises(helicarm.InputError, match="they are of other images"):
        helicarm.measure_landmarks("femoral_quadrants", landmarks, calibration=calibration, registration={
            "models": [model], "views": [{"name": "LAT", "camera_from_world": camera.tolist()}]})
    with pytest.raises(helicarm.InputError, match="no registered model"):
        helicarm.measure_landmarks("femoral_quadrants", {**landmarks, "Q": None})
    with pytest.raises(helicarm.InputError, match="kind"):
        helicarm.measure_landmarks("distance", landmarks)
