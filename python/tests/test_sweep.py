# SPDX-License-Identifier: Apache-2.0
"""sweep on images of steel balls drawn by their exact chords."""
import json
import struct
import zlib

import numpy as np
import pytest

import helicarm
from schemas import schema_faults

WIDTH, HEIGHT, PIXEL_MM, DISTANCE_MM, FRAMES = 256, 240, 1.0, 1000.0, 4
BALLS = np.random.default_rng(21).uniform([-55, -55, -45], [55, 55, 45], (14, 3))


def projection(frame):
    angle = np.radians(8 * frame)
    rotation = np.array([[-np.sin(angle), np.cos(angle), 0], [0, 0, -1], [-np.cos(angle), -np.sin(angle), 0]])
    source = -620 * rotation[2]
    k = np.array([[DISTANCE_MM / PIXEL_MM, 0, WIDTH / 2 + frame], [0, DISTANCE_MM / PIXEL_MM, HEIGHT / 2], [0, 0, 1]])
    return k, rotation, source


def drawn(frame):
    k, rotation, source = projection(frame)
    part = (np.arange(3) - 1) / 3
    u = (np.arange(WIDTH)[:, None] + part).ravel()
    v = (np.arange(HEIGHT)[:, None] + part).ravel()
    pixels = np.stack([*np.meshgrid(u, v), np.ones((v.size, u.size))], -1)
    rays = pixels @ np.linalg.inv(k).T @ rotation
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    chord = 0
    for i, ball in enumerate(BALLS):
        away = ball - source
        chord = chord + 2 * np.sqrt(np.maximum((3.5 if i % 3 == 0 else 2.5) ** 2 - (away @ away - (rays @ away) ** 2), 0))
    light = np.exp(-0.3 * chord).reshape(HEIGHT, 3, WIDTH, 3).mean((1, 3))
    return np.clip(30000 * light + np.random.default_rng(frame).normal(0, 120, light.shape), 0, 65535).astype(">u2")


def png(pixels):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 16, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    balls = [{"label": f"G{i}", "xyz_mm": list(ball), "diameter_mm": 7 if i % 3 == 0 else 5} for i, ball in enumerate(BALLS)]
    (folder / "calibrator.json").write_text(json.dumps({"name": "drawn", "balls": balls}))
    view = {"name": "RUN", "image": "run_{frame:02d}.png", "frames": "all", "pixel_mm": PIXEL_MM, "source_detector_mm": DISTANCE_MM}
    (folder / "case.json").write_text(json.dumps({"format": "helicarm-case/1", "calibrator": "calibrator.json",
                                                  "plate": None, "views": [view]}))
    for frame in range(FRAMES):
        pixels = drawn(frame)
        (folder / f"run_{frame + 1:02d}.png").write_bytes(png(pixels if frame != 2 else np.full_like(pixels, 9000)))
    return folder


def test_cameras_are_arrays(run, tmp_path):
    shares = []
    sweep = helicarm.sweep(run, progress=shares.append)
    assert sweep.frames == [1, 2, 3, 4] and sweep.accepted == [True, True, False, True] and len(shares) == FRAMES
    assert sweep.projections.shape == (FRAMES, 3, 4) and np.isnan(sweep.projections[2]).all()
    assert sweep.covariances.shape == (FRAMES, 11, 11) and sweep.source_covariances.shape == (FRAMES, 3, 3)
    for frame in (0, 1, 3):
        k, rotation, source = projection(frame)
        expected = (BALLS - source) @ rotation.T @ k.T
        found = np.c_[BALLS, np.ones(len(BALLS))] @ sweep.projections[frame].T
        apart = expected[:, :2] / expected[:, 2:] - found[:, :2] / found[:, 2:]
        assert np.sqrt((apart ** 2).sum(1).mean()) < 0.15
        off = sweep.sources[frame] - source
        assert off @ np.linalg.solve(sweep.source_covariances[frame], off) < 16
    assert [warning["code"] for warning in sweep.warnings] == ["blank_image"]
    sweep.write(tmp_path)
    written = json.loads((tmp_path / "sweep.json").read_text())
    assert written == sweep.to_dict()
    assert schema_faults("sweep", written) == []
    array = np.load(tmp_path / "geometry/matrices.npy")
    assert np.array_equal(array, sweep.projections[[0, 1, 3]])


def test_a_check_that_is_not_possible_is_a_warning(run):
    sweep = helicarm.sweep(run, check="FDK", wire=((0, 0, -20), (0, 0, 20)))
    assert sweep.check is None and sweep.to_dict()["check"] is None
    assert "left out" in sweep.warnings[-1]["message"]  # no plastimatch, or 24 degrees
    with pytest.raises(helicarm.InputError, match="ART"):
        helicarm.sweep(run, check="ART")
    with pytest.raises(helicarm.InputError, match="check"):
        helicarm.sweep(run, wire=((0, 0, -20), (0, 0, 20)))


def test_a_simulated_run_is_swept_and_compared_with_its_truth(tmp_path):
    truth = helicarm.simulate_case(tmp_path / "run", seed=2, kind="flat", knee=False, size=256, run=5, arc_deg=40, flex_mm=2, jitter_mm=0.1)
    assert truth["run"] == {"file": "RUN.dcm", "frames": 5, "arc_deg": 40, "flex_mm": pytest.approx(2, abs=1e-6), "jitter_mm": 0.1}
    sweep = helicarm.sweep(tmp_path / "run")
    assert all(sweep.accepted)
    for view, source, covariance in zip(truth["views"], sweep.sources, sweep.source_covariances):
        assert np.linalg.norm(source - view["source_mm"]) < 4 * np.sqrt(np.trace(covariance))
    arms = [helicarm.simulate_case(tmp_path / str(arm), seed=2, arm_seed=arm, kind="flat", knee=False, size=256, run=2) for arm in (2, 3)]
    assert [arm["arm_seed"] for arm in arms] == [2, 3] and arms[0]["views"][0]["camera"] != arms[1]["views"][0]["camera"]
    with pytest.raises(helicarm.InputError, match="of a run"):
        helicarm.simulate_case(tmp_path / "none", flex_mm=2)
    with pytest.raises(helicarm.InputError, match="must be 2 to 1000"):
        helicarm.simulate_case(tmp_path / "none", kind="flat", run=1)


def test_a_case_of_a_run_names_the_function_for_it(run):
    with pytest.raises(helicarm.InputError, match="helicarm sweep"):
        helicarm.run_case(run)
    with pytest.raises(helicarm.InputError, match="path"):
        helicarm.sweep(run, path="curved")
