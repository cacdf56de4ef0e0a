# SPDX-License-Identifier: Apache-2.0
"""Bones of a CT by one point on each."""

import helicarm
import numpy as np
import pytest


def write_nrrd(path, voxels):
    depth, height, width = voxels.shape
    path.write_bytes((f"NRRD0004\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: {width} {height} {depth}\n"
                      "endian: little\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-20,-20,100)\n"
                      "encoding: raw\n\n").encode() + voxels.astype("<i2").tobytes())
    return path


@pytest.fixture()
def ct(tmp_path):
    """Two shells that touch, and their labels 1 and 2."""
    z, y, x = np.mgrid[0:56, 0:40, 0:40]
    below = ((x - 20) / 12) ** 2 + ((y - 20) / 11) ** 2 + ((z - 14) / 11) ** 2
    above = ((x - 19) / 10) ** 2 + ((y - 20) / 12) ** 2 + ((z - 38) / 14) ** 2
    least = np.minimum(below, above) ** 0.5
    labels = np.where(least < 1, np.where(below < above, 1, 2), 0)
    hu = np.where(least < 1, np.where(least > 0.8, 1100, 60), 40)
    return write_nrrd(tmp_path / "ct.nrrd", hu), write_nrrd(tmp_path / "map.nrrd", labels), labels


def test_one_point_for_each_bone(ct, tmp_path):
    path, _, truth = ct
    stages = []
    found = helicarm.segment(path, {"shin": (0, 0, 104), "thigh": (-1, 0, 150)}, out=tmp_path / "out", progress=stages.append)
    for i, bone in enumerate(found["bones"]):
        mask = found["labels"] == bone["label"]
        assert 2 * (mask & (truth == i + 1)).sum() / (mask.sum() + (truth == i + 1).sum()) > 0.95
    assert [bone["name"] for bone in found["bones"]] == ["shin", "thigh"]
    assert {"shin.nrrd", "thigh.stl", "segment.png"} < {file.name for file in (tmp_path / "out").iterdir()}
    assert stages == ["read", "threshold", "fill", "distance", "watershed", "label", "surface"]


def test_a_label_of_a_map(ct):
    path, labels, truth = ct
    found = helicarm.segment(path, label_map=labels, labels={"thigh": [2]})
    assert (found["labels"] == (truth == 2)).all()
    with pytest.raises(helicarm.InputError, match="--label|labels"):
        helicarm.segment(path, label_map=labels)


def test_a_volume_in_memory_gives_what_its_file_gives(ct):
    path, labels, _ = ct
    seeds = {"shin": (0, 0, 104), "thigh": (-1, 0, 150)}
    of_file, in_memory = (helicarm.segment(given, seeds) for given in (path, helicarm.read_volume(path)))
    assert (of_file.pop("labels") == in_memory.pop("labels")).all()
    assert of_file.pop("seconds") > 0 and in_memory.pop("seconds") > 0 and of_file == in_memory
    by_map = helicarm.segment(helicarm.read_volume(path), label_map=helicarm.read_volume(labels), labels={"thigh": [2]})
    assert (by_map["labels"] == helicarm.segment(path, label_map=labels, labels={"thigh": [2]})["labels"]).all()


def test_a_turned_volume_in_memory_keeps_its_place(ct):
    volume, turn = helicarm.read_volume(ct[0]), np.array([[0.6, -0.8, 0, 7], [0.8, 0.6, 0, -9], [0, 0, 1, 3], [0, 0, 0, 1]])
    turned = helicarm.Volume(volume.array, turn @ volume.affine, frame="LPS")
    seed = np.array([0, 0, 104, 1.0])
    here, there = helicarm.segment(volume, {"shin": seed[:3]}), helicarm.segment(turned, {"shin": (turn @ seed)[:3]})
    assert there["bones"][0]["centre_mm"] == pytest.approx((turn @ [*here["bones"][0]["centre_mm"], 1])[:3], abs=1e-3)
    assert (here["labels"] == there["labels"]).all()


def test_what_is_no_volume_is_named(ct):
    with pytest.raises(helicarm.InputError, match="an array has no place"):
        helicarm.segment(np.zeros((3, 3, 3)), {"a": (0, 0, 0)})
    with pytest.raises(helicarm.InputError, match="for a TIFF stack"):
        helicarm.segment(helicarm.read_volume(ct[0]), {"a": (0, 0, 104)}, tiff_offset_hu=-1024)


def test_faults_are_refused(ct):
    path, _, _ = ct
    with pytest.raises(helicarm.RefusedError) as refused:
        helicarm.segment(path, {"a": (0, 0, 104), "b": (0, 0, 112)})
    assert refused.value.code == "seeds_in_one_bone"
    with pytest.raises(helicarm.RefusedError, match="nearest bone"):
        helicarm.segment(path, {"a": (18, 18, 101)})
    with pytest.raises(helicarm.InputError, match="space"):
        helicarm.segment(path, {"a": (0, 0, 104)}, space="scanner")


def test_progress_may_end_it(ct):
    def stop(stage):
        if stage == "watershed":
            raise KeyboardInterrupt
    with pytest.raises(KeyboardInterrupt):
        helicarm.segment(ct[0], {"a": (0, 0, 104)}, progress=stop)
