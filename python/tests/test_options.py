# SPDX-License-Identifier: Apache-2.0
"""Every option of a measurement gives the same answer through Python and through each command."""
import csv
import json
import os
import subprocess

import pytest

import helicarm

PROGRAM = os.environ.get("HELICARM_PROGRAM")
pytestmark = pytest.mark.skipif(not PROGRAM, reason="HELICARM_PROGRAM does not name the program")

OPTIONS = {
    "none": ({}, []),
    "method": ({"method": "paper"}, ["--method", "paper"]),
    "max_error": ({"max_error_mm": 0.06}, ["--max-error", "0.06"]),
    "motion_sigma": ({"motion_sigma_mm": 1}, ["--motion-sigma", "1"]),
    "search_mm": ({"search_mm": 3}, ["--search-mm", "3"]),
    "search_deg": ({"search_deg": 2}, ["--search-deg", "2"]),
    "threads": ({"threads": 1}, ["--threads", "1"]),
    "cache": ({"cache": False}, ["--no-cache"]),
    "history": ({"history": "arm.json"}, ["--machine", "arm.json"]),
}
WITHOUT_EFFECT = ("none", "threads", "cache", "search_mm", "search_deg")  # a model of landmarks alone is not searched for


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """A case with points, tunnels and a model of landmarks, whose bones are not tracked; and a C-arm's history."""
    folder = tmp_path_factory.mktemp("options")
    helicarm.simulate_case(folder / "case", seed=3, size=512, kind="tunnels")
    path = folder / "case" / "case.json"
    case = json.loads(path.read_text())
    for view in case["views"]:
        view.pop("poses", None)
    case.pop("poses_now", None)
    names = sorted({pick["name"] for pick in case["picks"]})
    at = {point.name: point.xyz_mm for point in helicarm.run_case(path.parent).points}
    rows = [f"{name},{at[name][0] - 5},{at[name][1]},{at[name][2]}" for name in names]
    (folder / "case" / "points.csv").write_text("\n".join(["name,x_mm,y_mm,z_mm", *rows]) + "\n")
    case["models"] = [{"name": "body", "start": {"landmarks": "points.csv"}}]
    path.write_text(json.dumps(case))
    helicarm.simulate_case(folder / "earlier", seed=8, size=512)
    history = folder / "arm.json"
    helicarm.run_case(folder / "earlier", history=history)
    return path.parent, history.read_bytes()


def program(*arguments, folder):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, encoding="utf-8", cwd=folder)
    assert done.returncode in (0, 3), done.stderr
    return done.returncode


def answer(file):
    content = json.loads(file.read_text())
    content.pop("timing_ms", None)
    content.get("options", {}).pop("threads", None)
    return content


def measured(call, *arguments, **options):
    """The measurement, refused or not."""
    try:
        return call(*arguments, **options)
    except helicarm.RefusedError as error:
        return error.result


def run_both(both, tmp_path, name):
    case, history = both
    (tmp_path / "arm.json").write_bytes(history)
    of_python, of_program = OPTIONS[name]
    if "history" in of_python:
        of_python = {"history": tmp_path / "arm.json"}
    by_python = measured(helicarm.run_case, case, **of_python)
    by_python.write(tmp_path / "python")
    (tmp_path / "arm.json").write_bytes(history)  # a run adds its acquisitions
    program("run", case, "--out", "program", *of_program, folder=tmp_path)
    return tmp_path / "python", tmp_path / "program"


@pytest.mark.parametrize("name", OPTIONS)
def test_run_is_run_case(both, tmp_path, name):
    by_python, by_program = run_both(both, tmp_path, name)
    for file in ("result.json", "registration.json"):
        assert (by_python / file).exists() == (by_program / file).exists()
        if (by_program / file).exists():
            assert answer(by_python / file) == answer(by_program / file)


@pytest.mark.parametrize("name", [name for name in OPTIONS if name not in WITHOUT_EFFECT])
def test_option_reaches_points_and_models(both, tmp_path, name):
    (tmp_path / "usual").mkdir()
    (tmp_path / "other").mkdir()
    usual = answer(run_both(both, tmp_path / "usual", "none")[1] / "result.json")
    other = answer(run_both(both, tmp_path / "other", name)[1] / "result.json")
    if name == "max_error":
        assert (usual["status"], other["status"]) == ("ok", "refused")
        return
    assert [p["covariance_mm2"] for p in usual["points"]] != [p["covariance_mm2"] for p in other["points"]]
    of_models = [answer(tmp_path / which / "program/registration.json")["models"] for which in ("usual", "other")]
    assert of_models[0] != of_models[1]


@pytest.mark.parametrize("name", OPTIONS)
def test_register_and_export_answer_as_run(both, tmp_path, name):
    case, history = both
    _, by_run = run_both(both, tmp_path, name)
    (tmp_path / "arm.json").write_bytes(history)
    of_program = OPTIONS[name][1]
    exit_of_register = program("register", case, "--out", "register", *of_program, folder=tmp_path)
    exit_of_export = program("export", case, "--out", "export", "--as", "csv", *of_program, folder=tmp_path)
    result = answer(by_run / "result.json")
    assert (exit_of_export == 3) == (result["status"] == "refused")
    if (by_run / "registration.json").exists():
        assert answer(tmp_path / "register/registration.json") == answer(by_run / "registration.json")
    else:
        assert exit_of_register == 3
    if exit_of_export == 0:
        with open(tmp_path / "export/points.csv", newline="") as file:
            rows = {row["name"]: row for row in csv.DictReader(file)}
        for point in result["points"]:
            if point["xyz_mm"]:
                assert float(rows[point["name"]]["x_mm"]) == pytest.approx(point["xyz_mm"][0], abs=1e-6)


@pytest.mark.parametrize("command", ["export", "predict", "register"])
def test_a_history_that_is_only_read_must_exist(both, tmp_path, command):
    case, _ = both
    words = {"predict": ["--at", "0,0,40"]}.get(command, ["--out", tmp_path / "out"])
    done = subprocess.run([PROGRAM, command, str(case), "--machine", "absent.json", *map(str, words)],
                          capture_output=True, encoding="utf-8", cwd=tmp_path)
    assert done.returncode == 2 and "missing_file" in done.stderr and "absent.json" in done.stderr


def test_register_refuses_an_absent_history_and_run_case_begins_it(both, tmp_path):
    case, _ = both
    with pytest.raises(helicarm.InputError) as refused:
        helicarm.register(case, history=tmp_path / "absent.json")
    assert refused.value.code == "missing_file"
    helicarm.run_case(case, history=tmp_path / "new.json")
    assert (tmp_path / "new.json").exists()
