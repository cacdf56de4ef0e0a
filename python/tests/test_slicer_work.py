# SPDX-License-Identifier: Apache-2.0
"""The module of 3D Slicer: the measurement beside its window, by the package or by the program."""
import json
import os

import pytest

import helicarm
from slicer_cases import empty_case, ended, scenes, script, shown, with_cameras  # noqa: F401

from HelicarmLib import work


def test_work_by_the_package_writes_the_result(case, tmp_path):
    job = work.Work(case[0], tmp_path / "result")
    lines = ended(job)
    assert job.failure is None and "calibrate" in lines
    assert (tmp_path / "result" / "result.json").is_file()


def test_work_can_be_cancelled(case, tmp_path):
    job = work.Work(case[0], tmp_path / "result")
    job.cancel()
    ended(job)
    assert job.failure == "cancelled" and not (tmp_path / "result" / "result.json").exists()


def test_case_without_a_file_fails_by_name(tmp_path):
    job = work.Work(tmp_path, tmp_path / "out")
    ended(job)
    assert "case.json" in job.failure


def test_case_with_cameras_is_registered_and_its_cameras_are_kept(tmp_path):
    with_cameras(tmp_path, [640, 480])
    answer = (tmp_path / "cameras.json").read_text()
    one = json.dumps(json.loads(answer)["views"][0])
    job = work.Work(tmp_path, tmp_path, program=script(tmp_path, f"echo '{one}'; echo $1 >> {tmp_path}/calls"))
    lines = ended(job)
    assert job.failure is None and (tmp_path / "calls").read_text().split() == ["register", "import"] and len(lines) == 1
    assert json.loads((tmp_path / "cameras.json").read_text())["views"][0]["t"] == [0, 0, 700]


def test_work_by_a_program_gives_its_lines_and_its_exit_code(empty_case):
    tmp_path = empty_case
    job = work.Work(tmp_path, tmp_path / "out", program=script(tmp_path, 'echo "$@"; echo no such thing >&2; exit 2'))
    assert ended(job) == [f"run {tmp_path} --out {tmp_path / 'out'}", "no such thing"]
    assert job.failure == "exit code 2: no such thing"


def test_program_can_be_cancelled(empty_case):
    tmp_path = empty_case
    job = work.Work(tmp_path, tmp_path, program=script(tmp_path, "echo begun; exec sleep 60"))
    while "begun" not in job.poll():
        pass
    job.cancel()
    ended(job)
    assert job.failure == "cancelled"


def test_program_is_the_chosen_one_or_none(tmp_path, monkeypatch):
    chosen = script(tmp_path, "")
    assert work.find_program(str(chosen)) == str(chosen)
    assert work.find_program(str(tmp_path / "none")) is None and work.find_program(str(tmp_path)) is None
    monkeypatch.setenv("HELICARM_PROGRAM", str(chosen))
    assert work.find_program() == str(chosen)


PROGRAM = os.environ.get("HELICARM_PROGRAM")


@pytest.mark.skipif(not PROGRAM, reason="HELICARM_PROGRAM does not name the program")
def test_program_and_package_give_one_scene(case, shown, tmp_path):
    job = work.Work(case[0], tmp_path / "result", program=PROGRAM)
    ended(job)
    assert job.failure is None
    by_program = scenes.read_scene(case[0], tmp_path / "result")
    for point, other in zip(by_program.points, shown[1].points):
        assert point.name == other.name and point.xyz_mm == pytest.approx(other.xyz_mm)


def test_version_of_the_package_is_the_one_under_test():
    assert work.package() is helicarm
