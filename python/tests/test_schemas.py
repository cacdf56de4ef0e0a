# SPDX-License-Identifier: Apache-2.0
"""What is written is what its schema says: no key more, none less, and null only where it may be."""
import json

import pytest

import helicarm
from schemas import faults, schema_faults


def edited(folder, tmp_path, change):
    """The case of a folder after a change, in the same folder under another name of its own."""
    case = json.loads((folder / "case.json").read_text())
    change(case)
    for file in folder.iterdir():
        if file.name != "case.json" and file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "case.json").write_text(json.dumps(case))
    return tmp_path


def test_the_checker_sees_what_is_wrong():
    schema = {"type": "object", "required": ["n"], "properties": {"n": {"type": "integer"}}}
    assert faults({"n": 1}, schema) == []
    assert faults({"n": 1.5}, schema) and faults({}, schema) and faults({"n": 1, "m": 2}, schema) and faults(None, schema)


def test_a_result(result):
    assert schema_faults("result", result.to_dict()) == []


@pytest.mark.parametrize("kind", ["tunnels", "accuracy"])
def test_a_result_with_tunnels_and_targets(tmp_path, kind):
    helicarm.simulate_case(tmp_path / "case", seed=5, size=512, kind=kind)
    assert schema_faults("result", helicarm.run_case(tmp_path / "case").to_dict()) == []


def test_a_refused_result(case, tmp_path):
    def swap(of):
        of["views"] = [{**view, "image": of["views"][0]["image"]} for view in of["views"]]

    with pytest.raises(helicarm.RefusedError) as refused:
        helicarm.run_case(edited(case[0], tmp_path, swap))
    content = refused.value.result.to_dict()
    assert content["status"] == "refused" and schema_faults("result", content) == []


def test_a_result_by_the_papers_recipe(case):
    content = helicarm.run_case(case[0], method="paper").to_dict()
    assert content["views"][0]["parameters"] is None and schema_faults("result", content) == []
