# SPDX-License-Identifier: Apache-2.0
"""Every command of the program has its Python twin, or a reason why it has none."""
import json
import os
import re
import subprocess

import numpy as np
import pytest

import helicarm

PROGRAM = os.environ.get("HELICARM_PROGRAM")
pytestmark = pytest.mark.skipif(not PROGRAM, reason="HELICARM_PROGRAM does not name the program")

TWINS = {
    "new": ["new_case"],
    "run": ["run_case"],
    "predict": ["Calibration.predict", "Calibration.tre_map"],
    "measure": ["measure", "measure_landmarks"],
    "bundle": ["bundle"],
    "schema": ["schema"],
    "demo": ["simulate_case", "run_case"],
    "solve": ["solve"],
    "locate": ["Calibration.load", "Calibration.locate", "Calibration.locate_all"],
    "rectify": ["rectify", "DistortionMap.rectify_image", "DistortionMap.rectified_from_raw", "DistortionMap.raw_from_rectified"],
    "detect": ["detect"],
    "import": ["import_camera", "import_transform"],
    "export": ["Result.export"],
    "sweep": ["sweep"],
    "c-arm": ["add_to_c_arm", "check_c_arm", "c_arm_report", "run_case"],
    "phantom": ["Calibrator", "measure_phantom", "verify_phantom"],
    "register": ["register", "register_sequence", "check_tunnels"],
    "segment": ["segment"],
    "track": ["track"],
    "migration": ["migration"],
    "replay": ["Session.replay"],
    "simulate": ["simulate_case"],
    "drr": ["drr", "Camera.orbit"],
}
WITHOUT = {
    "pick": "picks by hand in the desktop application or by a table; Calibration.locate takes pixels",
    "slicer": "writes launchers of the program; in 3D Slicer the package is used by the scripted module",
    "receive": "a service that runs beside the program which uses its images",
    "tracker": "a service, and a calibration at the device; its files are CSV",
    "robot": "watches a device",
    "virtual-or": "a service: virtual devices on the protocols of the real ones",
    "navigate": "a person confirms each order at the program; Session reads and replays its record",
    "operate": "an operation with virtual devices; Session reads and replays its record",
    "study": "runs on MPI ranks; its files are CSV and JSON",
}


def program(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    return done.stdout


def commands():
    listed = program("--help").split("Options:")[1]
    return re.findall(r"^  ([a-z][a-z-]*)  +[A-Z]", listed, re.MULTILINE)


def test_every_command_has_a_twin_or_a_reason():
    assert sorted(commands()) == sorted([*TWINS, *WITHOUT])


@pytest.mark.parametrize("name", sorted({name for names in TWINS.values() for name in names}))
def test_a_twin_is_there_and_says_what_it_does(name):
    twin = helicarm
    for part in name.split("."):
        twin = getattr(twin, part)
    assert callable(twin) and twin.__doc__


def csv(path, rows, header):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize("method", ["ml", "dlt", "homogeneous"])
@pytest.mark.parametrize("sigma", [None, 0.3])
def test_solve_gives_the_same_numbers(pair, tmp_path, method, sigma):
    uv = pair.pixels("AP", pair.xyz) + np.random.default_rng(4).normal(0, 0.2, (len(pair.xyz), 2))
    more = "" if sigma is None else ",sigma_px"
    rows = [(f"P{i}", *map(repr, map(float, (*xyz, *at))), *([] if sigma is None else [sigma])) for i, (xyz, at) in enumerate(zip(pair.xyz, uv))]
    file = csv(tmp_path / "p.csv", rows, "label,x_mm,y_mm,z_mm,u_px,v_px" + more)
    answer = json.loads(program("solve", "--points", file, "--method", method, "--json"))
    found = helicarm.solve(pair.xyz, uv, sigma_px=sigma, method=method)
    assert found["camera"].projection == pytest.approx(np.array(answer["projection"]), rel=1e-9, abs=1e-9)
    assert found["dlt"] == pytest.approx(answer["dlt"], rel=1e-8)
    assert found["condition"] == pytest.approx(answer["condition"], rel=1e-6)
    assert found["reprojection_rms_px"] == pytest.approx(answer["reprojection_rms_px"], rel=1e-6)
    if method == "ml":
        assert found["covariance"] == pytest.approx(np.array(answer["covariance"]), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("off_px, word", [(3, "times the stated sigma_px"), (40, "px rms, over 5 px")])
def test_solve_warns_alike_of_a_point_that_does_not_fit(pair, tmp_path, off_px, word):
    uv = pair.pixels("AP", pair.xyz)
    uv[4] += off_px
    labels = [f"Q{i}" for i in range(len(uv))]
    rows = [(label, *map(repr, map(float, (*xyz, *at))), 0.1) for label, xyz, at in zip(labels, pair.xyz, uv)]
    file = csv(tmp_path / "p.csv", rows, "label,x_mm,y_mm,z_mm,u_px,v_px,sigma_px")
    answer = json.loads(program("solve", "--points", file, "--json"))["warnings"]
    found = helicarm.solve(pair.xyz, uv, sigma_px=0.1, labels=labels)["warnings"]
    assert [w["message"] for w in found] == [w["message"] for w in answer] and len(found) == 1
    assert word in found[0]["message"] and found[0]["code"] == "residual_too_large"


def test_solve_names_a_mirrored_image_in_its_answer_and_in_its_camera(pair):
    found = helicarm.solve(pair.xyz, pair.pixels("AP", pair.xyz) * [-1, 1] + [639, 0])
    for warnings in (found["warnings"], found["camera"].warnings):
        assert [warning["code"] for warning in warnings] == ["ambiguous_handedness"]


@pytest.mark.parametrize("method", ["ml", "dlt", "homogeneous"])
def test_solve_refuses_places_in_cm_alike(pair, tmp_path, method):
    uv, places = pair.pixels("AP", pair.xyz), pair.xyz / 10
    rows = [(f"P{i}", *map(repr, map(float, (*xyz, *at)))) for i, (xyz, at) in enumerate(zip(places, uv))]
    file = csv(tmp_path / "p.csv", rows, "label,x_mm,y_mm,z_mm,u_px,v_px")
    done = subprocess.run([PROGRAM, "solve", "--points", file, "--method", method], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "usage: p.csv: in mm the source lies" in done.stderr
    with pytest.raises(helicarm.InputError, match="in mm the source lies") as refused:
        helicarm.solve(places, uv, method=method)
    assert refused.value.code == "usage"


def test_solve_refuses_a_label_given_twice(pair):
    labels = ["P1", "P1", *(f"P{i}" for i in range(3, len(pair.xyz) + 1))]
    with pytest.raises(helicarm.InputError) as refused:
        helicarm.solve(pair.xyz, pair.pixels("AP", pair.xyz), labels=labels)
    assert refused.value.code == "name_clash"


def test_drr_gives_the_same_pixels(tmp_path):
    voxels = np.random.default_rng(2).integers(-1000, 2000, (9, 8, 7)).astype("<i2")
    (tmp_path / "a.mha").write_bytes(b"NDims = 3\nDimSize = 9 8 7\nElementSpacing = 2 2 3\nElementType = MET_SHORT\n"
                                     b"ElementDataFile = LOCAL\n" + voxels.tobytes("F"))
    program("drr", tmp_path / "a.mha", "--raw", tmp_path / "a.f32", "--size", 40, "--pixel", 1, "--angle", 30, "--tilt", 10)
    volume = helicarm.read_volume(tmp_path / "a.mha")
    camera = helicarm.Camera.orbit(volume.centre_mm, angle_deg=30, tilt_deg=10, size=40, pixel_mm=1)
    assert np.array_equal(helicarm.drr(volume, camera).ravel(), np.fromfile(tmp_path / "a.f32", "<f4"))


def test_import_gives_the_same_camera(tmp_path):
    camera = helicarm.Camera.orbit([1, 2, 3], angle_deg=20)
    (tmp_path / "m.json").write_text(json.dumps(camera.projection.tolist()))
    answer = json.loads(program("import", tmp_path / "m.json", "--json"))
    found = helicarm.import_camera(tmp_path / "m.json")
    for key, value in (("K", found.K), ("R", found.R), ("t", found.t), ("projection", found.projection)):
        assert np.array_equal(value, answer[key])
    assert found.warnings == answer["warnings"]


def test_import_gives_the_same_transform(tmp_path):
    (tmp_path / "t.tfm").write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: Euler3DTransform_double_3_3\n"
                                    "Parameters: 0.1 0.2 0.3 4 5 6\nFixedParameters: 7 8 9 0\n")
    answer = json.loads(program("import", tmp_path / "t.tfm", "--json"))
    found = helicarm.import_transform(tmp_path / "t.tfm")
    assert {key: value.tolist() for key, value in found.items()} == answer
    (tmp_path / "t.tfm").write_text("nothing")
    with pytest.raises(helicarm.InputError, match="import_camera reads cameras"):
        helicarm.import_transform(tmp_path / "t.tfm")


def test_import_gives_the_same_sequence(tmp_path):
    file = tmp_path / "s.seq.mha"
    file.write_text("Seq_Frame0000_jawToWorldTransform = 0 -1 0 10 1 0 0 20 0 0 1 30 0 0 0 1\nSeq_Frame0000_Timestamp = 1\n"
                    "Seq_Frame0001_jawToWorldTransformStatus = INVALID\nSeq_Frame0001_Timestamp = 2\nElementDataFile = LOCAL\n")
    answer = json.loads(program("import", file, "--json"))
    found = helicarm.import_transform(file)
    assert found["index"].tolist() == answer["index"] == [1, 2]
    assert found["transforms"]["jawToWorld"][0].tolist() == answer["transforms"]["jawToWorld"][0]
    assert np.isnan(found["transforms"]["jawToWorld"][1]).all() and answer["transforms"]["jawToWorld"][1] is None


def test_export_writes_the_same_files(case, result, tmp_path):
    program("export", case[0], "--out", tmp_path / "program", "--as", "csv,opencv,npy", "--quiet")
    written = result.export(tmp_path / "python", ["csv", "opencv", "npy"])
    assert sorted(written) == sorted(str(tmp_path / "python" / file.name) for file in (tmp_path / "program").iterdir())
    for file in (tmp_path / "program").iterdir():
        assert file.read_bytes() == (tmp_path / "python" / file.name).read_bytes()
    with pytest.raises(helicarm.InputError, match="word.*csv"):
        result.export(tmp_path / "python", ["word"])


@pytest.mark.parametrize("name", ["calibrator", "case", "machine", "plan", "plate", "registration", "result", "session", "sweep"])
def test_schemas_are_the_same(name):
    assert helicarm.schema(name) == json.loads(program("schema", name))


def test_a_schema_of_another_file_is_refused():
    with pytest.raises(helicarm.InputError, match="none of: calibrator, case"):
        helicarm.schema("report")


def test_a_new_case_is_the_same(case, tmp_path):
    images = [f"{name}={case[0] / name}.dcm" for name in ("AP", "LAT")]
    program("new", *images, "--calibrator", "udcsc", "--plate", "plate48", "--out", tmp_path / "program", "--quiet")
    made = helicarm.new_case(images, tmp_path / "python", calibrator="udcsc", plate="plate48")
    assert made["case"] == str(tmp_path / "python/case.json")
    for name in ("case.json", "AP.dcm"):
        assert (tmp_path / "python" / name).stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "program/case.json").read_text() == (tmp_path / "python/case.json").read_text()
    with pytest.raises(helicarm.InputError, match="calibrator"):
        helicarm.new_case(images, tmp_path / "other", calibrator="")
    with pytest.raises(helicarm.InputError, match="primary_deg"):
        helicarm.new_case(images, tmp_path / "other", calibrator="udcsc", angles={"AP": (170, 0)})


def test_a_bundle_is_the_same(case, tmp_path):
    program("bundle", case[0], "--out", tmp_path / "program.tar.gz", "--no-run", "--quiet")
    made = helicarm.bundle(case[0], out=tmp_path / "python.tar.gz", run=False)
    assert "case.json" in made["files"]
    assert (tmp_path / "program.tar.gz").read_bytes() == (tmp_path / "python.tar.gz").read_bytes()
    with pytest.raises(helicarm.InputError, match="is a file that the bundle is made of"):
        helicarm.bundle(case[0], out=case[0] / "case.json", run=False)
    assert (case[0] / "case.json").exists()
    with pytest.raises(helicarm.InputError):
        helicarm.bundle(tmp_path / "nowhere", out=tmp_path / "python.tar.gz")
    assert not (tmp_path / "python.tar.gz").exists()


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """An operation with virtual devices. On a busy machine late poses may stop it: then its record ends there."""
    folder = tmp_path_factory.mktemp("operate")
    done = subprocess.run([PROGRAM, "operate", "--cases", "1", "--size", "512", "--out", folder, "--quiet"], capture_output=True, encoding="utf-8")
    assert done.returncode in (0, 3), done.stderr
    return next(path.parent for path in folder.rglob("session.log"))


def test_a_session_is_listed_and_replayed(session):
    record = helicarm.Session(session)
    assert record.records[0].kind == "session" and not record.torn and len(record) == sum(record.kinds.values())
    assert [each.number for each in record.records] == list(range(len(record)))
    assert all(result["format"] == "helicarm-result/1" for result in record.results) and record.results
    assert len(record.of_kind("exposure")) == record.kinds["exposure"]
    shares = []
    report = record.replay(progress=shares.append)
    assert report["complete"] and report["records"] == len(record) and shares == sorted(shares) and len(shares) > 1
    answer = json.loads(program("replay", session, "--json"))
    assert {key: report[key] for key in answer} == answer


def test_a_changed_or_cut_session_is_refused(session, tmp_path):
    lines = (session / "session.log").read_bytes().split(b"\n")
    (tmp_path / "session.log").write_bytes(b"\n".join(lines[:5]) + b"\n")
    with pytest.raises(helicarm.RefusedError, match="no end|differ") as error:
        helicarm.Session(tmp_path).replay()
    assert error.value.code == "replay_differs" and not error.value.result["complete"]
    (tmp_path / "session.log").write_bytes(b"\n".join([lines[0], *lines[2:]]))
    with pytest.raises(helicarm.InputError):
        helicarm.Session(tmp_path)
    with pytest.raises(helicarm.InputError) as error:
        helicarm.Session(tmp_path / "nowhere")
    assert error.value.code == "missing_file"


def test_a_replay_ends_where_progress_raises(session):
    def stop(share):
        raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        helicarm.Session(session).replay(progress=stop)
