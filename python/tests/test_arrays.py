# SPDX-License-Identifier: Apache-2.0
"""Volumes, surfaces and cameras from arrays, and registration, DRR, sweep and track of them."""
import json

import cv2
import numpy as np
import pytest

import helicarm
from schemas import schema_faults
from test_registration import body_hu, image_of, sequence  # noqa: F401
from test_sweep import BALLS, DISTANCE_MM, FRAMES, PIXEL_MM, drawn, projection

TETRAHEDRON = np.array([[0, 0, 0], [40, 0, 0], [0, 30, 0], [0, 0, 20]], float), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
PLACE = np.array([[0, -2, 0, 5], [1, 0, 0, -7], [0, 0, 3, 11], [0, 0, 0, 1.0]])
LPS_FROM_RAS = np.diag([-1, -1, 1, 1.0])


def refused(code, match, call, *arguments, **options):
    with pytest.raises(helicarm.HelicarmError, match=match) as error:
        call(*arguments, **options)
    assert error.value.code == code, error.value


def test_a_volume_keeps_its_voxels_and_its_place():
    voxels = np.random.default_rng(1).integers(-1000, 3000, (3, 4, 5)).astype(np.int16)
    volume = helicarm.Volume(voxels, PLACE, frame="LPS")
    assert volume.shape == (3, 4, 5) and np.array_equal(volume.array, voxels) and np.array_equal(volume.affine, PLACE)
    assert not volume.array.flags.writeable and volume.array.flags.f_contiguous
    assert np.array_equal(helicarm.Volume(voxels, PLACE[:3], frame="RAS").affine, LPS_FROM_RAS @ PLACE)
    assert volume.centre_mm == pytest.approx((PLACE @ [1, 1.5, 2, 1])[:3])


def test_a_view_of_a_volume_keeps_it_alive():
    array = helicarm.Volume(np.full((50, 50, 50), 7, np.uint8), PLACE, frame="LPS").array
    assert (array == 7).all()


@pytest.mark.parametrize("array, affine, frame, code, match", [
    (np.zeros((3, 3)), PLACE, "LPS", "bad_size", r"shape \(3, 3\) is not \(i, j, k\)"),
    (np.zeros((3, 3, 0)), PLACE, "LPS", "bad_size", "a side of 0"),
    (np.full((3, 3, 3), np.nan), PLACE, "LPS", "not_finite", r"array: \[0, 0, 0\] is nan"),
    (np.zeros((3, 3, 3), complex), PLACE, "LPS", "bad_value", "array: its elements are complex128"),
    (np.ma.masked_equal(np.arange(27).reshape(3, 3, 3), 5), PLACE, "LPS", "bad_value", "array: 1 of 27 elements are masked"),
    (None, PLACE, "LPS", "bad_value", "array: .*not real numbers"),
    (np.zeros((3, 3, 3)), PLACE, "MNI", "unsupported", "frame.*MNI"),
    (np.zeros((3, 3, 3)), np.diag([1, 1, 0, 1]), "LPS", "bad_value", "a spacing of 0 mm"),
    (np.zeros((3, 3, 3)), np.diag([1, 1, 1, 2]), "LPS", "bad_value", "the last row is not 0 0 0 1"),
    (np.zeros((3, 3, 3)), np.array([[1, 0, 2, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "LPS", "bad_value", "coplanar"),
    (np.zeros((3, 3, 3)), PLACE * np.nan, "LPS", "not_finite", "affine")])
def test_a_volume_without_a_usable_place_is_refused(array, affine, frame, code, match):
    refused(code, match, helicarm.Volume, array, affine, frame=frame)


def test_the_tilt_of_a_gantry_is_kept():
    tilted = np.diag([0.5, 0.5, 2, 1])
    tilted[1, 2] = 2 * np.tan(np.radians(20))
    assert np.array_equal(helicarm.Volume(np.zeros((3, 3, 3)), tilted, frame="LPS").affine, tilted)


def test_a_surface_is_converted_to_lps_and_mm():
    vertices, faces = TETRAHEDRON
    surface = helicarm.Surface(vertices / 10, faces, frame="RAS", unit="cm")
    assert surface.vertices[surface.faces] == pytest.approx((vertices * [-1, -1, 1])[faces])


@pytest.mark.parametrize("vertices, faces, more, code, match", [
    (TETRAHEDRON[0], TETRAHEDRON[1] + 1, {}, "bad_value", "row 1 holds 4, the vertices are 0 to 3"),
    (TETRAHEDRON[0], TETRAHEDRON[1] - 1, {}, "bad_value", "holds -1"),
    (TETRAHEDRON[0], np.zeros((3, 4), int), {}, "bad_value", r"shape \(3, 4\)"),
    (TETRAHEDRON[0], TETRAHEDRON[1].astype(float), {}, "bad_value", "elements are float64, not whole numbers"),
    (np.ma.masked_equal(TETRAHEDRON[0], 40), TETRAHEDRON[1], {}, "bad_value", r"shape \(4, 3\): 1 of 12 elements are masked"),
    (TETRAHEDRON[0].astype(complex), TETRAHEDRON[1], {}, "bad_value", "complex128, not real"),
    (TETRAHEDRON[0] * np.nan, TETRAHEDRON[1], {}, "not_finite", "vertices"),
    (TETRAHEDRON[0] * 1000, TETRAHEDRON[1], {}, "bad_value", "not in mm"),
    (TETRAHEDRON[0], TETRAHEDRON[1], {"unit": "cubit"}, "unsupported", "unit.*cubit")])
def test_a_surface_that_is_none_is_refused(vertices, faces, more, code, match):
    refused(code, match, helicarm.Surface, vertices, faces, frame="LPS", **more)


def test_frames_are_never_assumed():
    refused("usage", "has no place", helicarm.as_volume, np.zeros((3, 3, 3)))
    refused("usage", 'give frame="LPS" or frame="RAS"', helicarm.as_surface, TETRAHEDRON)
    with pytest.raises(TypeError):
        helicarm.Volume(np.zeros((3, 3, 3)), PLACE)


@pytest.mark.parametrize("same", [
    np.asfortranarray, lambda a: a.astype(">i2"), lambda a: a.astype(np.int64), lambda a: np.repeat(a, 2, 1)[:, ::2],
    lambda a: a[::-1, :, ::-1][::-1, :, ::-1], lambda a: a.astype(np.float16), np.ma.asarray, lambda a: a.tolist()])
def test_order_type_and_container_of_an_array_do_not_matter(same):
    voxels = np.random.default_rng(2).integers(0, 250, (3, 4, 5)).astype(np.int16)
    assert np.array_equal(helicarm.Volume(same(voxels), PLACE, frame="LPS").array, voxels)
    image = helicarm.XrayImage(same(voxels[0]) if same is np.asfortranarray else same(voxels)[0], pixel_mm=None,
                               source_detector_mm=None, range=(0, 255))
    assert np.array_equal(image.pixels, voxels[0])
    vertices, faces = TETRAHEDRON
    surface = helicarm.Surface(vertices.tolist(), faces.tolist(), frame="LPS")
    assert np.array_equal(surface.vertices, helicarm.Surface(vertices, np.asfortranarray(faces), frame="LPS").vertices)


@pytest.mark.parametrize("call", [
    lambda a: helicarm.XrayImage(np.ma.masked_equal(np.full((4, 5), 3, np.uint8), 3), pixel_mm=None, source_detector_mm=None),
    lambda a: helicarm.as_image(np.ma.masked_equal(np.full((4, 5), 3, np.uint8), 3)),
    lambda a: helicarm.ViewPoints("A", a, a[:, :2], sigma_px=0.1), lambda a: helicarm.ViewPoints("A", a.data, a[:, :2], sigma_px=0.1),
    lambda a: helicarm.as_surface((a, TETRAHEDRON[1]), frame="LPS"), lambda a: helicarm.Camera(np.eye(3), np.eye(3), a[0])])
def test_masked_elements_are_no_numbers(call):
    refused("bad_value", "elements are masked", call, np.ma.masked_equal(TETRAHEDRON[0], 0))


@pytest.mark.parametrize("vector", [["1", "2", "40"], ("1", 2, 40), [b"1", 2, 40], np.array(["1", 2, None], object), [[np.str_("1"), 2, 40]]])
def test_texts_are_no_numbers_also_in_lists(vector):
    refused("bad_value", "texts, not real numbers", helicarm.Camera, np.eye(3), np.eye(3), vector)


def test_an_argument_that_an_image_does_not_take_is_refused(tmp_path):
    image = helicarm.as_image(np.zeros((4, 5), np.uint8), name="AP")
    refused("usage", "frame is for files", helicarm.as_image, image, frame=3)
    refused("usage", "frame is for files", helicarm.as_image, np.zeros((4, 5), np.uint8), frame=3)
    cv2.imwrite(str(tmp_path / "a.png"), np.arange(20, dtype=np.uint8).reshape(4, 5))
    assert helicarm.as_image(tmp_path / "a.png", name="LAT").name == "LAT"
    assert helicarm.as_image(tmp_path / "a.png").name == "a"


def test_a_camera_takes_opencvs_columns_and_names_what_a_mapping_lacks():
    k, rotation, source = projection(0)
    t = -rotation @ source
    assert np.array_equal(helicarm.Camera(k, rotation, t.reshape(3, 1)).t, t)
    refused("bad_value", r"t: shape \(4,\) is not \(3,\)", helicarm.Camera, k, rotation, [*t, 1])
    refused("unsupported", "'camera_matrix'; must have", helicarm.as_camera, {"camera_matrix": k})
    refused("unsupported", "must have", helicarm.as_camera, {"K": k})


def test_a_camera_of_a_projection_and_of_its_parts_are_one():
    k, rotation, source = projection(2)
    camera = helicarm.Camera(k, rotation, -rotation @ source, shape=(240, 256))
    again = helicarm.as_camera(-3 * camera.projection)
    for name in ("K", "R", "t"):
        assert getattr(again, name) == pytest.approx(getattr(camera, name), abs=1e-9)
    assert camera.source_mm == pytest.approx(source) and camera.shape == (240, 256) and again.shape is None
    homogeneous = camera.projection @ [1, 2, 3, 1]
    assert camera.project([1, 2, 3]) == pytest.approx(homogeneous[:2] / homogeneous[2])
    assert np.isnan(camera.project(2 * source)).all()


def test_a_camera_that_is_none_is_refused():
    k, rotation, source = projection(0)
    refused("bad_value", "not a proper rotation", helicarm.Camera, k, -rotation, source)
    refused("bad_value", "not upper triangular", helicarm.Camera, k.T, rotation, source)
    refused("not_finite", "K", helicarm.Camera, k * np.nan, rotation, source)
    refused("point_at_infinity", "", helicarm.as_camera, np.eye(3, 4) * [[1], [1], [0]])
    refused("unsupported", "neither a Camera", helicarm.as_camera, 7)


def test_a_drr_is_the_exact_chord_of_a_block():
    volume = helicarm.Volume(np.ones((10, 10, 10)), np.diag([2, 2, 2, 1.0]), frame="LPS")
    camera = helicarm.Camera.orbit(volume.centre_mm, size=5, pixel_mm=1)
    image = helicarm.drr(volume, camera, values="raw")
    assert image.shape == (5, 5) and image[2, 2] == pytest.approx(20, rel=1e-4)
    assert image[2, 0] == pytest.approx(20 * np.hypot(1, 2 / 1020), rel=1e-4)
    both = helicarm.drr(volume, [camera, camera], shape=(3, 5), values="raw", threads=1)
    assert both.shape == (2, 3, 5) and np.array_equal(both[0], both[1])
    refused("bad_value", "inside", helicarm.drr, volume, helicarm.Camera.orbit(volume.centre_mm, source_centre_mm=1))
    refused("usage", "values", helicarm.drr, volume, camera, values="ct")
    refused("usage", "shape", helicarm.drr, volume, (camera.K, camera.R, camera.t))
    for shape in (5, (5.5, 5), (1, 2, 3)):
        refused("bad_value", "shape: .* is not", helicarm.drr, volume, camera, shape=shape)
    refused("bad_value", "camera: the list is empty", helicarm.drr, volume, [])
    with pytest.raises(TypeError, match=r"drr\(\): an argument has a wrong type; of the options threads=-1"):
        helicarm.drr(volume, camera, threads=-1)


def test_values_that_are_no_hounsfield_units_are_warned_of():
    voxels = np.random.default_rng(3).integers(0, 256, (6, 6, 6))
    voxels.flat[:2] = 0, 255
    camera = helicarm.Camera.orbit([2.5, 2.5, 2.5], size=3, pixel_mm=1)
    with pytest.warns(UserWarning, match="not_hounsfield: volume: values of 0 to 255"):
        helicarm.drr(helicarm.Volume(voxels, np.eye(4), frame="LPS"), camera)
    refused("bad_value", "it is a mask", helicarm.drr, helicarm.Volume(voxels > 128, np.eye(4), frame="LPS"), camera)


def views_of(folder, frame=1):
    views = {}
    for name in "AB":
        k, rotation, t = json.loads((folder / f"{name}.json").read_text()).values()
        views[name] = helicarm.read_image(folder / f"{name}{frame}.png"), (k, rotation, t)
    return views


def start():
    pose = np.eye(4)
    pose[:3, 3] = 2, -1, 1
    return pose


def volume_of_body():
    place = np.eye(4)
    place[:3, 3] = -20
    return helicarm.Volume(body_hu().transpose(2, 1, 0), place, frame="LPS")


def alike(model):
    return {key: value for key, value in model.items() if key != "seconds"}


def test_arrays_and_files_are_registered_alike(sequence, tmp_path):  # noqa: F811
    steps = []
    answer = helicarm.register(models={"body": {"volume": volume_of_body(), "window_hu": (300, 3000)}}, views=views_of(sequence),
                               starts={"body": start()}, out=tmp_path / "out", progress=steps.append)
    case = json.loads((sequence / "case.json").read_text())
    case["models"] = case["models"][:1]
    for view in case["views"]:
        view["image"] = view["image"].replace("{frame}", "1")
    for file in sequence.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "case.json").write_text(json.dumps(case))
    of_files = helicarm.register(tmp_path)
    assert alike(answer["models"][0]) == alike(of_files["models"][0]) and steps
    assert answer == json.loads((tmp_path / "out/registration.json").read_text())
    assert schema_faults("registration", answer) == []
    assert answer.models["body"].world_from_model[:3, 3] == pytest.approx([1, 0, 0], abs=0.2)
    assert (tmp_path / "out/report.html").exists() and (tmp_path / "out/A_overlay.png").exists()


def test_a_mask_may_be_an_array_on_the_volumes_grid(sequence):  # noqa: F811
    volume = volume_of_body()
    body = volume.array > 300
    held = helicarm.Volume(body.astype(np.float32), volume.affine, frame="LPS")
    by_array, by_volume = (helicarm.register(models={"body": {"volume": volume, "mask": mask}}, views=views_of(sequence),
                                             starts={"body": start()})["models"][0] for mask in (body, held))
    assert alike(by_array) == alike(by_volume)
    refused("bad_value", r"mask: an array of shape .* the volume's grid", helicarm.register,
            models={"body": {"volume": volume, "mask": body[:-1]}}, views=views_of(sequence))


def test_planned_points_in_memory_are_those_of_a_plan(sequence, tmp_path):  # noqa: F811
    planned = {"entry": (0.0, 3, 12), "deep": (-4.0, 2, -9)}
    body = {"volume": volume_of_body(), "window_hu": (300, 3000)}
    found = helicarm.register(models={"body": {**body, "points": planned}}, views=views_of(sequence), starts={"body": start()}).models["body"]
    points = [{"label": name, "position": list(at)} for name, at in planned.items()]
    case = json.loads((sequence / "case.json").read_text())
    for view in case["views"]:
        view["image"] = view["image"].replace("{frame}", "1")
    case["models"] = [{**case["models"][0], "plan": "plan.mrk.json"}]
    for file in sequence.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "plan.mrk.json").write_text(json.dumps({"markups": [{"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": points}]}))
    (tmp_path / "case.json").write_text(json.dumps(case))
    of_files = helicarm.register(tmp_path)["models"][0]["points"]
    assert found["points"] == [{key: other[key] for key in own} for own, other in zip(found["points"], of_files)]
    assert list(found.points) == list(planned)
    assert found.points["entry"]["xyz_mm"] == pytest.approx([1, 3, 12], abs=0.3) and found.points["deep"]["covariance_mm2"].shape == (3, 3)
    for points, code, match in (({"far": (0, 0, 900)}, "bad_value", "far"), ({"short": (0, 0)}, "bad_value", "short")):
        refused(code, match, helicarm.register, models={"body": {**body, "points": points}}, views=views_of(sequence), starts={"body": start()})
    far = helicarm.register(models={"body": {**body, "points": {"off": (0, 0, 38)}}}, views=views_of(sequence), starts={"body": start()})
    assert "outside_model" in [warning["code"] for warning in far["models"][0]["warnings"]]


def test_a_start_may_be_one_of_several_and_views_a_list(sequence):  # noqa: F811
    far = start()
    far[:3, 3] += 60
    answer = helicarm.register(models={"body": {"volume": volume_of_body(), "window_hu": (300, 3000)}},
                               views=list(views_of(sequence).values()), starts={"body": [far, start()]}, search_mm=5)
    assert answer["models"][0]["world_from_model"][0][3] == pytest.approx(1, abs=0.2)
    assert [view["name"] for view in answer["views"]] == ["V1", "V2"]


def test_what_registration_of_arrays_needs_is_named(sequence):  # noqa: F811
    models, views = {"body": volume_of_body()}, views_of(sequence)
    refused("usage", "folder of a case, or models, views", helicarm.register)
    refused("usage", "states models itself", helicarm.register, sequence, models=models)
    refused("usage", "both required", helicarm.register, models=models)
    refused("bad_value", 'starts: there is no "femur"', helicarm.register, models=models, views=views, starts={"femur": start()})
    refused("bad_value", "not a rigid motion", helicarm.register, models=models, views=views, starts={"body": 2 * start()})
    refused("bad_value", "with one view a pose is needed", helicarm.register, models=models, views={"A": views["A"]})
    refused("unknown_key", "window", helicarm.register, models={"body": {"volume": models["body"], "window": 3}}, views=views)
    refused("bad_size", "usable", helicarm.register, models=models, views=views, usable={"A": np.ones((3, 3), bool)})
    image = views["A"][0]
    small = helicarm.Camera(*views["A"][1], shape=(10, 10))
    refused("bad_size", "the camera is for 10 x 10", helicarm.register, models=models, views={"A": (image, small), "B": views["B"]})
    refused("bad_value", "views: A: range", helicarm.register, models=models, views={"A": (image.pixels, small)}, starts={"body": start()})
    refused("usage", r"views: A: .* is not \(image, camera\)", helicarm.register, models=models, views={"A": image})
    refused("unsupported", "views: A: camera", helicarm.register, models=models, views={"A": (image, image)})
    refused("usage", "starts: ndarray", helicarm.register, models=models, views=views, starts=start())
    refused("usage", "body: volume: an array has no place", helicarm.register, models={"body": models["body"].array}, views=views)
    for wrong in (200, (1, 2, 3), ("a", "b")):
        refused("bad_value", r"body: window_hu: .* is not \(low, high\)", helicarm.register, views=views,
                models={"body": {"volume": models["body"], "window_hu": wrong}})
    refused("bad_value", "body: scale_sigma: 'x' is not a number", helicarm.register, views=views,
            models={"body": {"volume": models["body"], "window_hu": (300, 3000), "scale_sigma": "x"}})
    for mask, code, match in ((np.full(models["body"].shape, np.nan), "not_finite", "mask: holds values"),
                              (np.ma.masked_less(models["body"].array, 300), "bad_value", "mask: a masked array"),
                              (np.full(models["body"].shape, "1"), "unsupported", "mask: its elements are <U1")):
        refused(code, match, helicarm.register, views=views, models={"body": {"volume": models["body"], "mask": mask}})
    refused("usage", "body: points: ndarray is not", helicarm.register, views=views,
            models={"body": {"volume": models["body"], "points": np.zeros((2, 3))}})
    with pytest.raises(TypeError, match=r"register\(\) got an unexpected keyword argument 'serch_mm'"):
        helicarm.register(models=models, views=views, serch_mm=5)


def test_an_output_folder_that_cannot_be_written_is_refused_before_the_search(sequence, tmp_path):  # noqa: F811
    (tmp_path / "file").write_text("")
    steps = []
    refused("cannot_write", "is not a folder", helicarm.register, models={"body": {"volume": volume_of_body(), "window_hu": (300, 3000)}},
            views=views_of(sequence), starts={"body": start()}, out=tmp_path / "file/out", progress=steps.append)
    assert not steps


def test_a_sweep_of_arrays_is_that_of_files():
    stack = np.stack([drawn(frame) for frame in range(FRAMES)])
    calibrator = helicarm.Calibrator.from_arrays([f"G{i}" for i in range(len(BALLS))], BALLS,
                                                 [7 if i % 3 == 0 else 5 for i in range(len(BALLS))])
    shares = []
    sweep = helicarm.sweep(images=stack.astype(np.uint16), calibrator=calibrator, pixel_mm=PIXEL_MM, source_detector_mm=DISTANCE_MM,
                           progress=shares.append)
    assert sweep.frames == [1, 2, 3, 4] and all(sweep.accepted) and len(shares) == FRAMES
    for frame in range(FRAMES):
        assert np.linalg.norm(sweep.sources[frame] - projection(frame)[2]) < 4 * np.sqrt(np.trace(sweep.source_covariances[frame]))
    refused("usage", "both required", helicarm.sweep, images=stack)
    refused("usage", "give the folder", helicarm.sweep)
    refused("usage", "images: one path: give an array", helicarm.sweep, images="run.dcm", calibrator=calibrator)
    refused("bad_value", "images: image 1: range", helicarm.sweep, images=stack / 4095, calibrator=calibrator)
    refused("usage", "calibrator: ndarray is neither a Calibrator", helicarm.sweep, images=stack, calibrator=np.eye(3))


def spheres(places, camera, shape):
    """Dark discs of markers of 3 mm."""
    v, u = np.mgrid[:shape[0], :shape[1]]
    image = np.full(shape, 3000.0)
    for at in places:
        uv = camera.project(at)
        radius = 1.5 * camera.K[1, 1] / (camera.R @ at + camera.t)[2]
        chord = np.sqrt(np.maximum(radius ** 2 - (u - uv[0]) ** 2 - (v - uv[1]) ** 2, 0)) / radius
        image *= np.exp(-1.2 * chord)
    return np.rint(image + np.random.default_rng(5).normal(0, 8, shape)).astype(np.uint16)


def test_markers_are_tracked_in_arrays(tmp_path):
    shape, n = (200, 220), 4
    cameras = {name: helicarm.Camera.orbit([0, 0, 0], angle_deg=angle, size=200, pixel_mm=0.5) for name, angle in (("A", 0), ("B", 80))}
    body = np.array([[0, 0, 0], [20, 0, 5], [0, 18, -8], [-12, 6, 14.0]])
    moved = [body + [0.5 * frame, 0, 0.25 * frame] for frame in range(n)]
    views = {name: (np.stack([spheres(places, camera, shape) for places in moved]), camera) for name, camera in
             ((name, helicarm.Camera(c.K, c.R, c.t, shape=shape)) for name, c in cameras.items())}
    names = ["a", "b", "c", "d"]
    picks = {name: {view: views[view][1].project(at) for view in views} for name, at in zip(names, body)}
    shares = []
    motion = helicarm.track(views=views, picks=picks, diameter_mm=3, bodies={"bone": names}, out=tmp_path / "out", progress=shares.append)
    assert motion.markers == names and motion.frames == [1, 2, 3, 4] and shares == pytest.approx([0.25, 0.5, 0.75, 1])
    assert motion.places == pytest.approx(np.array(moved), abs=0.1)
    assert motion.smoothed["bone"][-1, :3, 3] == pytest.approx([1.5, 0, 0.75], abs=0.1)
    assert (tmp_path / "out/markers.csv").exists() and (tmp_path / "out/bone.tra").exists()
    (tmp_path / "out/earlier.tra").write_text("")  # of a body of another measurement
    motion.write(tmp_path / "out")
    assert not (tmp_path / "out/earlier.tra").exists() and (tmp_path / "out/bone.tra").exists()
    assert motion.joint_angles == {} == motion.joint_covariances
    spot = {"a": {"B": views["B"][1].project(moved[2][1])}}
    corrected = helicarm.track(views=views, picks=picks, diameter_mm=3, bodies={"bone": names}, corrections={3: spot}, out=tmp_path / "corrected")
    seen = np.genfromtxt(tmp_path / "corrected/points2d.csv", delimiter=",", skip_header=1)
    assert seen[2, 2:4] == pytest.approx(spot["a"]["B"], abs=0.2) and np.isnan(seen[2, 6:8]).all()
    assert corrected.places[:2, 1:] == pytest.approx(motion.places[:2, 1:], abs=0.05)
    refused("bad_value", "frames 2 to 4", helicarm.track, views=views, picks=picks, diameter_mm=3, corrections={1: spot})
    refused("bad_value", '"x" has no pick', helicarm.track, views=views, picks=picks, diameter_mm=3, corrections={3: {"x": spot["a"]}})
    for name, (_, camera) in views.items():
        (tmp_path / f"{name}.json").write_text(json.dumps({"K": camera.K.tolist(), "R": camera.R.tolist(), "t": camera.t.tolist()}))
    (tmp_path / "case.json").write_text(json.dumps({
        "format": "helicarm-case/2", "bodies": [{"name": "bone", "markers": names}],
        "views": [{"name": name, "image": f"{name}.avi", "camera": f"{name}.json"} for name in views]}))
    placed = helicarm.track(tmp_path, frames="1-4", points=tmp_path / "out/points2d.csv")
    assert placed.places == pytest.approx(motion.places, abs=0.1)
    refused("usage", "only one of them", helicarm.track, tmp_path, frames="1-4", points="a.csv", picks="b.csv")
    refused("bad_value", '"hip" is no body', helicarm.track, views=views, picks=picks, diameter_mm=3, bodies={"bone": names}, axes={"hip": np.eye(3)})
    refused("bad_value", "axes of 1 body, a joint has two", helicarm.track, views=views, picks=picks, diameter_mm=3, bodies={"bone": names},
            axes={"bone": np.eye(3)})
    bodies = {"bone": names[:3], "other": ["d", "e", "f"]}
    more = np.array([[-20, -16, 3], [6, -22, -12.0]])
    moved = [np.vstack([places, more + [0.5 * frame, 0, 0.25 * frame]]) for frame, places in enumerate(moved[:3])]
    views = {name: (np.stack([spheres(places, camera, shape) for places in moved]), camera) for name, (_, camera) in views.items()}
    picks.update({name: {view: views[view][1].project(at) for view in views} for name, at in zip("ef", more)})
    joint = helicarm.track(views=views, picks=picks, diameter_mm=3, bodies=bodies, axes={"bone": np.eye(3), "other": np.eye(3)})
    assert joint.joint_angles["other"] == pytest.approx(np.zeros((3, 3)), abs=0.02)
    assert joint.joint_covariances["other"].shape == (3, 3, 3) and joint.butterworth is None
    assert np.isnan(joint.joint_translations["other"]).all()
    placed = {"bone": np.c_[np.eye(3), [0, 0, 0]], "other": np.c_[np.eye(3), [3, 4, -5]]}
    joint = helicarm.track(views=views, picks=picks, diameter_mm=3, bodies=bodies, axes=placed)
    assert joint.joint_translations["other"] == pytest.approx(np.tile([3, 4, 5], (3, 1)), abs=0.3)
    assert np.isfinite(joint.joint_translation_covariances["other"]).all()
    refused("too_few_views", "two views", helicarm.track, views={"A": views["A"]}, picks=picks, diameter_mm=3)
    refused("bad_size", "numbers of images differ", helicarm.track, views={"A": views["A"], "B": (views["B"][0][:2], views["B"][1])},
            picks=picks, diameter_mm=3)
    refused("bad_value", '"x" has no pick', helicarm.track, views=views, picks=picks, diameter_mm=3, bodies={"bone": ["x"]})
    refused("bad_value", "diameter_mm", helicarm.track, views=views, picks=picks, diameter_mm=300)
    for wrong, code, match in ([(1, 2)], "usage", "picks: list is not"), ({"a": [(1, 2)]}, "usage", "picks: a: list is not"), \
            ({"a": {"A": (np.nan, 3)}}, "not_finite", r"picks: a: A: \(nan, 3\)"), ({"a": {"A": (1, 2, 3)}}, "bad_value", r"picks: a: A: shape \(3,\)"), \
            ({"a": {"A": np.ma.masked_equal([1, 2], 2)}}, "not_finite", r"picks: a: A: \(1, nan\)"):
        refused(code, match, helicarm.track, views=views, picks=wrong, diameter_mm=3)
    refused("bad_value", "corrections: frame '2'", helicarm.track, views=views, picks=picks, diameter_mm=3, corrections={"2": spot})
    refused("usage", "bodies: list", helicarm.track, views=views, picks=picks, diameter_mm=3, bodies=["bone"])
    refused("bad_size", "views: A: image 1: pixels", helicarm.track, views={"A": (views["A"][0][0], views["A"][1]), "B": views["B"]}, picks=picks,
            diameter_mm=3)


def test_a_wrong_option_is_named_by_the_function_that_was_called():
    volume = volume_of_body()
    for call, match in ((lambda: helicarm.segment(volume, {"b": (0, 0, 0)}, gapmm=1), r"^segment\(\) got an unexpected keyword argument 'gapmm'"),
                        (lambda: helicarm.segment(volume, labels={"b": 1}), r"^segment\(\): .* wrong type.*labels=\{'b': 1\}"),
                        (lambda: helicarm.check_tunnels({"volume": volume, "window_hu": (300, 3000)}, {"F": ((0, 0, 0), (9, 0, 0))}, diameter_mm="8"),
                         r"^check_tunnels\(\): an argument has a wrong type"),
                        (lambda: helicarm.sweep("folder", treads=2), r"^sweep\(\) got an unexpected keyword argument 'treads'")):
        with pytest.raises(TypeError, match=match):
            call()
    refused("usage", "seeds: list is not", helicarm.segment, volume, [(1, 2, 3)])
    refused("usage", "tunnels: list is not", helicarm.check_tunnels, volume, [((0, 0, 0), (9, 0, 0))], diameter_mm=8)
    refused("bad_value", "seeds: b: 1 of 3 elements are masked", helicarm.segment, volume, {"b": np.ma.masked_equal([1.0, 2, 3], 2)})
