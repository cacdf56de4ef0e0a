# SPDX-License-Identifier: Apache-2.0
"""Cases for the tests of 3D Slicer's module, and how they wait for its work. Skips them where the module is not there."""
import json
import pathlib
import sys
import time

import numpy as np
import pytest

MODULE = pathlib.Path(__file__).resolve().parents[2] / "packaging" / "slicer" / "Helicarm"
if not MODULE.is_dir():
    pytest.skip("the Slicer module lies in the source tree only", allow_module_level=True)
sys.path.insert(0, str(MODULE))

from HelicarmLib import scene as scenes  # noqa: E402

TURNED = np.array([[0, -1, 0, 10.0], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]])


def with_model(case_folder, folder):
    """The measured case's folder and a result beside it with a model, whose registration is written by hand."""
    case = json.loads((case_folder / "case.json").read_text())
    case["tunnels"] = [{"name": "a", "start": "T1", "end": "T2"}]
    case["models"] = [{"name": "bone", "volume": "ct.nrrd", "plan": "plan.mrk.json"},
                      {"name": "stack", "volume": "stack.tif", "voxel_mm": [0.4, 0.4, 0.6]},
                      {"name": "cup", "surface": "cup.stl"}, {"name": "lost", "surface": "lost.stl"}]
    (folder / "case.json").write_text(json.dumps(case))
    for name in ("ct.nrrd", "stack.tif", "cup.stl", "plan.mrk.json"):
        (folder / name).write_bytes(b"")
    models = [{"name": name, "decision": decision, "world_from_model": TURNED.tolist(), "points": points,
               "warnings": [{"code": "near", "message": "close"}, {"code": "far", "message": name + ": far"}] if decision == "warn" else [],
               "failure": None if decision != "refuse" else {"code": "wrong_model", "message": name + ": no fit"}}
              for name, decision, points in (("bone", "accept", [{"name": "entry", "xyz_mm": [1, 2, 3], "covariance_mm2": None}]),
                                             ("stack", "accept", []), ("cup", "warn", []), ("lost", "refuse", []))]
    return {"models": models}


@pytest.fixture(scope="module")
def shown(case, result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("with-model")
    result.write(folder)
    registration = with_model(pathlib.Path(case[0]), folder)
    (folder / "registration.json").write_text(json.dumps(registration))
    return folder, scenes.read_scene(folder, folder)


def with_cameras(folder, image_size):
    (folder / "case.json").write_text(json.dumps({"views": [{"name": "cam1", "camera": "cam1.json"}], "models": []}))
    (folder / "registration.json").write_text(json.dumps({"models": []}))
    (folder / "cam1_overlay.png").write_bytes(b"\x89PNG\r\n\x1a\n" + (13).to_bytes(4, "big") + b"IHDR"
                                              + (640).to_bytes(4, "big") + (480).to_bytes(4, "big"))
    camera = {"name": "cam1", "K": [[2000, 0, 320], [0, 2000, 240], [0, 0, 1]], "R": np.eye(3).tolist(), "t": [0, 0, 700],
              "image_size": image_size}
    (folder / "cameras.json").write_text(json.dumps({"views": [camera]}))


def ended(job, limit_s=60):
    lines, end = [], time.monotonic() + limit_s
    while not job.done:
        assert time.monotonic() < end, "still at work"
        lines += job.poll()
    return lines


def script(tmp_path, text):
    file = tmp_path / "program"
    file.write_text("#!/bin/sh\n" + text)
    file.chmod(0o755)
    return file


@pytest.fixture
def empty_case(tmp_path):
    (tmp_path / "case.json").write_text("{}")
    return tmp_path
