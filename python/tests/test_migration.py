# SPDX-License-Identifier: Apache-2.0
"""Migration between two examinations."""

import json

import helicarm
import numpy as np
import pytest

BONE = np.array([(-14, 3, -20), (11, 9, -26), (2, -13, -12), (-6, 12, -8)], float)
TRAY = np.array([(-19, -4, 14), (20, -2, 16), (0, 18, 15), (4, -15, 24)], float)


def exam(path, shift=(0, 0, 0), seed=0):
    noise = np.random.default_rng(seed)
    rows = ["name,x_mm,y_mm,z_mm,segment"]
    for segment, places in (("bone", BONE), ("tray", TRAY + shift)):
        for i, place in enumerate(places + noise.normal(0, 0.01, places.shape)):
            rows.append(f"{segment}{i},{place[0]},{place[1]},{place[2]},{segment}")
    path.write_text("\n".join(rows) + "\n")
    return path


def test_migration_is_the_shift_of_the_second_segment(tmp_path):
    first, second = exam(tmp_path / "a.csv", seed=1), exam(tmp_path / "b.csv", (0.5, 0, -1), seed=2)
    pairs = [(exam(tmp_path / f"c{i}.csv", seed=2 * i + 3), exam(tmp_path / f"d{i}.csv", seed=2 * i + 4)) for i in range(3)]
    answer = helicarm.migration(first, second, double=pairs, out=tmp_path / "out")
    tray = answer["bodies"][0]
    assert tray["name"] == "tray" and tray["translation_mm"] == pytest.approx([0.5, 0, -1], abs=0.06)
    assert np.array(tray["covariance"]).shape == (6, 6)
    assert answer["precision"][0]["n"] == 3
    assert (tmp_path / "out" / "migration.csv").exists()


def test_segments_may_be_given_and_are_checked(tmp_path):
    first, second = exam(tmp_path / "a.csv"), exam(tmp_path / "b.csv", seed=1)
    answer = helicarm.migration(first, second, segments={"a": ["bone0", "bone1", "bone2"], "b": ["tray0", "tray1", "tray2"]},
                                reference="b", by_name=True)
    assert answer["reference"] == "b"
    unsorted = {"tibia": ["bone0", "bone1", "bone2"], "stem": ["tray0", "tray1", "tray2"]}
    assert helicarm.migration(first, second, segments=unsorted, by_name=True)["reference"] == "tibia"
    with pytest.raises(TypeError, match="segments"):
        helicarm.migration(first, second, segments={"a": "bone0"})
    with pytest.raises(helicarm.InputError, match="cup"):
        helicarm.migration(first, second, reference="cup")
    with pytest.raises(helicarm.InputError, match="same examination"):
        helicarm.migration(first, first)


def test_a_refusal_replaces_what_was_written_earlier(tmp_path):
    first, second, out = exam(tmp_path / "a.csv", seed=1), exam(tmp_path / "b.csv", seed=2), tmp_path / "out"
    helicarm.migration(first, second, out=out)
    with pytest.raises(helicarm.InputError):
        helicarm.migration(first, first, out=out)
    assert not (out / "migration.json").exists()
    few = tmp_path / "few.csv"
    few.write_text("name,x_mm,y_mm,z_mm\nA,0,0,0\nB,10,0,0\nC,0,12,0\n")
    with pytest.raises(helicarm.RefusedError):
        helicarm.migration(first, few, out=out)
    assert json.loads((out / "migration.json").read_text())["status"] == "refused"
