# SPDX-License-Identifier: Apache-2.0
import json
import shutil

import cv2
import numpy as np
import pytest

import helicarm
from schemas import schema_faults

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
    assert schema_faults("registration", answer) == []
    pose = np.array(answer["models"][0]["world_from_model"])
    assert pose[:3, 3] == pytest.approx(SHIFT, abs=1e-4)


def test_cameras_without_covariance_are_a_warning(landmarks):
    model = helicarm.register(landmarks)["models"][0]
    assert (model["decision"], [w["code"] for w in model["warnings"]]) == ("warn", ["covariance_missing"])


def test_what_an_earlier_registration_left_goes_before_anything_can_fail(case, tmp_path):
    left = [tmp_path / name for name in ("registration.json", "registration.csv", "measurements.dcm")]
    for file in left:
        file.write_text("{}")
    with pytest.raises(helicarm.InputError):
        helicarm.register(case[0], out=tmp_path)
    assert not [file for file in left if file.exists()]


def test_register_without_models_is_an_input_error(case):
    with pytest.raises(helicarm.InputError) as error:
        helicarm.register(case[0])
    assert error.value.code == "bad_value"


def test_register_names_a_bad_argument(landmarks):
    with pytest.raises(helicarm.InputError, match="search_mm"):
        helicarm.register(landmarks, search_mm=-1)


def test_landmarks_that_leave_a_larger_error_are_refused(landmarks):
    with pytest.raises(helicarm.RefusedError, match="residual") as error:
        helicarm.register(landmarks, max_error_mm=0.1)
    assert error.value.code == "uncertain"


def test_landmarks_without_picks_are_named(landmarks):
    case = json.loads((landmarks / "case.json").read_text())
    case["picks"] = [pick for pick in case["picks"] if pick["name"] in "ab" or (pick["name"], pick["view"]) == ("c", "A")]
    (landmarks / "case.json").write_text(json.dumps(case))
    with pytest.raises(helicarm.InputError, match=r'"body": points.csv: 2 of .* "c" \(in 1 views\), "d" \(in 0 views\)'):
        helicarm.register(landmarks)


SIZE = 96
AXES = np.indices((40, 40, 40)).transpose(1, 2, 3, 0)[..., ::-1]  # (x, y, z) of a voxel, 1 mm


def body_hu():
    """Three ellipsoids in air, [z, y, x]: no plane of symmetry."""
    parts = [((20, 18, 20), (7, 9, 18)), ((28, 20, 10), (9, 7, 8)), ((14, 27, 30), (8, 6, 5))]
    inside = [(((AXES - centre) / np.array(radii)) ** 2).sum(axis=-1) < 1 for centre, radii in parts]
    return np.where(np.any(inside, axis=0), 1200, -1000).astype(np.int16)


def image_of(hu, shift, k, rotation, distance):
    """Sums of the nearest voxels along each pixel's ray, with noise."""
    v, u = np.mgrid[:SIZE, :SIZE]
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(k).T
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True) @ rotation
    source = -rotation.T @ np.array([0, 0, distance])
    total = np.zeros((SIZE, SIZE))
    for along in np.arange(distance - 40, distance + 40, 0.5):
        at = np.rint(source + along * rays - shift + 20).astype(int)
        inside = np.all((at >= 0) & (at < 40), axis=-1)
        x, y, z = np.where(inside[..., None], at, 0).transpose(2, 0, 1)
        total += np.where(inside, np.maximum(hu[z, y, x], 0), 0) * 0.5
    dose = np.exp(-3e-5 * total) + 0.002 * np.random.default_rng(2).standard_normal(total.shape)
    return np.clip(40000 * dose, 1, 65535).astype(np.uint16)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    """A body of 40 mm that moves by 1 mm along x in each of three frames, and the same again as a second model."""
    folder = tmp_path_factory.mktemp("sequence")
    hu = body_hu()
    header = ("NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: 40 40 40\n"
              "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-20,-20,-20)\nencoding: raw\nendian: little\n\n")
    (folder / "ct.nrrd").write_bytes(header.encode() + hu.tobytes())
    k = np.array([[900.0, 0, 47.5], [0, 900, 47.5], [0, 0, 1]])
    views = []
    for name, rotation in (("A", [[1, 0, 0], [0, 0, -1], [0, 1, 0]]), ("B", [[0, -1, 0], [0, 0, -1], [1, 0, 0]])):
        rotation = np.array(rotation, float)
        (folder / f"{name}.json").write_text(json.dumps({"K": k.tolist(), "R": rotation.tolist(), "t": [0, 0, 600.0]}))
        views.append({"name": name, "image": f"{name}{{frame}}.png", "camera": f"{name}.json"})
        for frame in range(1, 4):
            cv2.imwrite(str(folder / f"{name}{frame}.png"), image_of(hu, np.array([frame, 0, 0]), k, rotation, 600))
    start = np.eye(4)
    start[:3, 3] = 2, -1, 1
    models = [{"name": name, "volume": "ct.nrrd", "window_hu": [300, 3000], "start": {"world_from_model": start.tolist()}}
              for name in ("body", "again")]
    (folder / "case.json").write_text(json.dumps({"format": "helicarm-case/1", "views": views, "models": models}))
    return folder


def test_register_sequence_follows_the_models(sequence, tmp_path):
    shares = []
    answer = helicarm.register_sequence(sequence, range(1, 4), out=tmp_path, progress=shares.append)
    assert answer["frames"] == [1, 2, 3] and shares == pytest.approx([1 / 3, 2 / 3, 1])
    body = answer["models"][0]
    assert body["world_from_model"][:, :3, 3] == pytest.approx(np.array([[1, 0, 0], [2, 0, 0], [3, 0, 0]]), abs=0.2)
    assert body["covariance"].shape == (3, 6, 6) and body["decision"] == ["warn"] * 3 and body["refused"] == [None] * 3
    assert answer["relative"][0]["reference_from_model"] == pytest.approx(np.tile(np.eye(4), (3, 1, 1)), abs=0.05)
    assert body["smoothed"][2, :3, 3] == pytest.approx([2, 0, 0], abs=0.2) and body["smoothed_covariance"].shape == (3, 6, 6)
    assert answer["relative"][0]["smoothed"] == pytest.approx(np.tile(np.eye(4), (3, 1, 1)), abs=0.05)
    assert len((tmp_path / "registration.csv").read_text().splitlines()) == 1 + 3 * 2
    assert len((tmp_path / "bodies.csv").read_text().splitlines()) == 1 + 3 * 2
    again = helicarm.register_sequence(sequence, range(1, 4), out=tmp_path, resume=True)
    assert np.array_equal(again["models"][0]["smoothed"], body["smoothed"])


def test_register_sequence_ends_where_progress_raises(sequence):
    def stop(share):
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        helicarm.register_sequence(sequence, "1-3", progress=stop)


@pytest.mark.parametrize("frames", [[1, 2, 4], [3, 2], [], "3-1", [-1, 0], range(10**9), [-(2**62), 2**62]])
def test_register_sequence_refuses_frames_that_do_not_rise(sequence, frames):
    with pytest.raises(helicarm.InputError, match="frames"):
        helicarm.register_sequence(sequence, frames)


def test_register_sequence_misses_images_before_it_begins(sequence):
    shares = []
    with pytest.raises(helicarm.InputError, match="4 of 10 images do not exist, the first: A4.png"):
        helicarm.register_sequence(sequence, "1-5", progress=shares.append)
    assert not shares


def test_a_mask_drawn_on_a_tiff_stack_may_be_nrrd(sequence, tmp_path):
    hu = body_hu()
    cv2.imwritemulti(str(tmp_path / "ct.tif"), list((hu.astype(int) + 1000).astype(np.uint16)))
    header = ("NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 40 40 40\n"
              "space directions: (-1,0,0) (0,-1,0) (0,0,1)\nspace origin: (5,5,5)\nencoding: raw\n\n")
    (tmp_path / "mask.nrrd").write_bytes(header.encode() + (hu > 0).astype(np.uint8).tobytes())
    case = json.loads((sequence / "case.json").read_text())
    for view in case["views"]:
        view["image"] = view["image"].replace("{frame}", "1")
        for file in (view["image"], view["camera"]):
            (tmp_path / file).write_bytes((sequence / file).read_bytes())
    start = np.eye(4)
    start[:3, 3] = -20, -19, -21  # the first voxel is the stack's origin
    case["models"] = [{"name": "body", "volume": "ct.tif", "voxel_mm": [1, 1, 1], "tiff_offset_hu": -1000,
                       "mask": "mask.nrrd", "start": {"world_from_model": start.tolist()}}]
    (tmp_path / "case.json").write_text(json.dumps(case))
    pose = np.array(helicarm.register(tmp_path)["models"][0]["world_from_model"])
    assert pose[:3, 3] == pytest.approx([-19, -20, -20], abs=0.2)


@pytest.fixture(scope="module")
def planned(case, tmp_path_factory):
    """The simulated case with its check targets as landmarks of a body, and a planned tunnel."""
    folder = tmp_path_factory.mktemp("planned") / "case"
    shutil.copytree(case[0], folder)
    truth, content = case[1], json.loads((folder / "case.json").read_text())
    rows = ["name,x_mm,y_mm,z_mm"]
    content["picks"] = []
    for name, (x, y, z) in truth["targets_in_calibrator"].items():
        rows.append(f"p{name},{x},{y},{z}")
        for view in truth["views"]:
            raw = next(target["raw"] for target in view["targets"] if target["name"] == name)
            content["picks"].append({"name": f"p{name}", "view": view["name"], "uv": raw})
    (folder / "points.csv").write_text("\n".join(rows) + "\n")
    ends = [{"label": "s", "position": [0, 0, 40]}, {"label": "e", "position": [0, 20, 60]}]
    line = {"type": "Line", "name": "planned", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": ends}
    (folder / "plan.mrk.json").write_text(json.dumps({"markups": [line]}))
    content["models"] = [{"name": "body", "start": {"landmarks": "points.csv"}, "plan": "plan.mrk.json"}]
    (folder / "case.json").write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize("options", [{}, {"method": "paper"}, {"motion_sigma_mm": 1.0}])
def test_run_case_registers_models_by_the_options_of_register(planned, options):
    result = helicarm.run_case(planned, **options)
    model, alone = result.registration["models"][0], helicarm.register(planned, **options)["models"][0]
    assert (model["world_from_model"], model["covariance"]) == (alone["world_from_model"], alone["covariance"])
    assert [tunnel["model"] for tunnel in result.to_dict()["tunnels"]] == ["body"]


def test_the_limit_of_run_case_holds_for_models(planned):
    with pytest.raises(helicarm.RefusedError) as error:
        helicarm.run_case(planned, max_error_mm=0.02)
    assert error.value.code == "uncertain"


def test_a_result_with_models_writes_their_files(planned, tmp_path):
    helicarm.run_case(planned).write(tmp_path)
    assert json.loads((tmp_path / "registration.json").read_text())["status"] == "ok"
    assert (tmp_path / "registration/report.html").exists()


def test_tunnels_are_compared_with_a_bone_in_memory():
    # A box of 24 x 24 x 40 mm of bone in voxels of 1 mm; walls 2 and 3 mm below its faces.
    hu = np.zeros((34, 34, 50), np.float32)
    hu[5:29, 5:29, 5:45] = 1000
    volume, mask = helicarm.Volume(hu, np.eye(4), frame="LPS"), hu > 500
    lines = {"thin": ([28.5 - 5, 16.5, 0], [28.5 - 5, 16.5, 49]), "blind": ([16.5, 28.5 - 6, 0], [16.5, 28.5 - 6, 30])}
    found = helicarm.check_tunnels({"volume": volume, "mask": mask}, lines, diameter_mm=6, bridge_mm={"thin": 3, "blind": 2})
    assert found["thin"]["bridge_mm"] == pytest.approx(2, abs=0.3) and found["thin"]["thin"] and not found["thin"]["breach"]
    assert found["thin"]["length_in_bone_mm"] == pytest.approx(40, abs=0.5)
    assert found["blind"]["bridge_mm"] == pytest.approx(3, abs=0.3) and not found["blind"]["thin"]
    assert found["blind"]["exit_mm"] is None and found["blind"]["end_mm"] == pytest.approx(14.5, abs=0.5)
    assert [other["name"] for other in found["blind"]["to_tunnels"]] == ["thin"]
    one_bone = helicarm.check_tunnels({"volume": volume, "window_hu": (500, 2000), "tunnel_mask": mask}, lines, diameter_mm=6,
                                      bridge_mm={"thin": 3, "blind": 2})
    assert one_bone == found
    by_window = helicarm.check_tunnels({"volume": volume, "window_hu": (500, 2000)}, lines, diameter_mm=6)
    assert by_window["thin"]["bridge_mm"] == pytest.approx(found["thin"]["bridge_mm"], abs=0.2)
    assert by_window["thin"]["required_bridge_mm"] == 2
    for model, given, message in ((volume, lines, "without one it has no outline"), ({"volume": volume, "mask": mask}, {"a": lines["thin"][0]}, "a"),
                                  ({"volume": volume, "mask": mask}, {"a": ([1, 2, 3], [1, 2, 3])}, "a: is shorter than")):
        with pytest.raises(helicarm.InputError, match=message):
            helicarm.check_tunnels(model, given, diameter_mm=6)
    with pytest.raises(helicarm.InputError, match='bridge_mm: there is none of "blind"'):
        helicarm.check_tunnels({"volume": volume, "mask": mask}, lines, diameter_mm=6, bridge_mm={"thin": 3})
