#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Figures of the documents from simulated cases: PYTHONPATH=build/python tools/evaluation/gallery.py [FOLDER]"""
import base64
import json
import pathlib
import re
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import bone_ct  # noqa: E402
import helicarm  # noqa: E402

VIEWS = [f"V{i + 1}:{20 * i - 70},{15 * (-1) ** i}" for i in range(8)]


def save(figure, path):
    figure.tight_layout()
    figure.savefig(path, dpi=100, metadata={"Software": None})
    plt.close(figure)


def measured_phantom(out):
    """A phantom whose balls are 0.3 mm per axis off its file: the eight images, and what their measurement finds."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        helicarm.simulate_case(folder, seed=3, size=512, knee=False, views=VIEWS)
        nominal = json.loads((folder / "calibrator.json").read_text())
        true = helicarm.Calibrator.load(folder / "calibrator.json").xyz_mm
        random = np.random.default_rng(3)
        for ball in nominal["balls"]:
            ball["xyz_mm"] = (np.array(ball["xyz_mm"]) + random.normal(0, 0.3, 3)).tolist()
        (folder / "calibrator.json").write_text(json.dumps({**nominal, "targets": []}))
        measured = helicarm.measure_phantom(folder, distances=[("P1", "P3", float(np.linalg.norm(true[0] - true[2])))])
        case = json.loads((folder / "case.json").read_text())
        figure, axes = plt.subplots(2, 4, figsize=(10, 5.4))
        for ax, view in zip(axes.flat, case["views"]):
            ax.imshow(helicarm.read_image(folder / view["image"]).pixels, cmap="gray")
            ax.set(title=view["name"], xticks=[], yticks=[])
    save(figure, out / "phantom-views.png")
    save(helicarm.figures.phantom(measured).figure, out / "phantom-measured.png")


def planned_line(knee):
    """Through the lateral condyle, from the notch's side to the outer cortex."""
    slab = np.flatnonzero(np.abs(knee.s.ravel() - 18) < 0.5)[0]
    p, l = np.nonzero(knee.femur_itself[slab])
    to_mm = lambda i, axis: bone_ct.LOW[axis] + bone_ct.VOXEL_MM * i
    middle = float(np.median(to_mm(p, 1)))
    row = l[np.abs(to_mm(p, 1) - middle) < 1]
    outer = float(to_mm(row.max(), 0)) + 3
    ends = [(outer - 38, middle - 6, 12.0), (outer, middle, 26.0)]
    return {"markups": [{"type": "Line", "name": "tunnel", "coordinateSystem": "LPS",
                         "controlPoints": [{"label": str(i), "position": list(end)} for i, end in enumerate(ends)]}]}


def registered_knee(out):
    """The femur of a modelled knee, registered from a start 8 mm off, over the images that are not its own renderer's, and a
    planned tunnel in slices of its CT."""
    with tempfile.TemporaryDirectory() as name:
        case = pathlib.Path(name) / "case"
        knee = bone_ct.Knee(0)
        bone_ct.write_nrrd(case.with_name("true.nrrd"), bone_ct.rounded(knee.hu))
        helicarm.simulate_case(case, seed=100, kind="flat", ct=case.with_name("true.nrrd"))
        bone_ct.write_nrrd(case / "scan.nrrd", bone_ct.rounded(knee.scanned()))
        bone_ct.write_nrrd(case / "femur.nrrd", knee.femur.astype(np.uint8))
        start = np.array(json.loads((case / "truth.json").read_text())["ct"]["calibrator_from_patient"])
        start[:3, 3] += [5, -5, 4]
        given = json.loads((case / "case.json").read_text())
        given["models"] = [{"name": "femur", "volume": "scan.nrrd", "mask": "femur.nrrd",
                            "start": {"world_from_model": start.tolist()}, "plan": "plan.mrk.json"}]
        given["tunnels"] = [{"name": "tunnel", "model": "femur", "diameter_mm": 8}]
        (case / "plan.mrk.json").write_text(json.dumps(planned_line(knee)))
        (case / "case.json").write_text(json.dumps(given))
        try:
            helicarm.register(case, out=case.with_name("out"))
        except helicarm.RefusedError as error:
            print(error)
        slices = re.search(r'alt="slices of tunnel" src="data:image/png;base64,([^"]+)"', (case.with_name("out") / "report.html").read_text())
        (out / "tunnel-slices.png").write_bytes(base64.b64decode(slices[1]))
        figure, axes = plt.subplots(1, 2, figsize=(10, 5))
        for ax, view in zip(axes, given["views"]):
            ax.imshow(plt.imread(case.with_name("out") / f"{view['name']}_overlay.png"))
            ax.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, wspace=0.01)
    figure.savefig(out / "registration-overlay.jpg", dpi=100, pil_kwargs={"quality": 85})
    plt.close(figure)


def main():
    out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2] / "docs")
    with tempfile.TemporaryDirectory() as folder:
        helicarm.simulate_case(folder, seed=3, size=512)
        result = helicarm.run_case(folder)
        centre = helicarm.Calibrator.load(pathlib.Path(folder) / "calibrator.json").xyz_mm.mean(axis=0)
    figures = {"overlay": helicarm.figures.overlay(result, "AP"),
               "residuals": helicarm.figures.residuals(result.calibration, "AP"),
               "tre": helicarm.figures.tre_map(result.calibration, centre, half_mm=60, step_mm=5, sigma_px=0.5)}
    for name, ax in figures.items():
        save(ax.figure, out / f"python-{name}.png")
    measured_phantom(out)
    registered_knee(out)


if __name__ == "__main__":
    main()
