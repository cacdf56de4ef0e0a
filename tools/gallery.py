#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Figures of the documents from a simulated case: PYTHONPATH=build/python tools/gallery.py [FOLDER]"""
import pathlib
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

import helicarm  # noqa: E402


def main():
    out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parent.parent / "docs")
    with tempfile.TemporaryDirectory() as folder:
        helicarm.simulate_case(folder, seed=3, size=512)
        result = helicarm.run_case(folder)
        centre = helicarm.Calibrator.load(pathlib.Path(folder) / "calibrator.json").xyz_mm.mean(axis=0)
    figures = {"overlay": helicarm.figures.overlay(result, "AP"),
               "residuals": helicarm.figures.residuals(result.calibration, "AP"),
               "tre": helicarm.figures.tre_map(result.calibration, centre, half_mm=60, step_mm=5, sigma_px=0.5)}
    for name, ax in figures.items():
        ax.figure.tight_layout()
        ax.figure.savefig(out / f"python-{name}.png", dpi=100, metadata={"Software": None})
        plt.close(ax.figure)


if __name__ == "__main__":
    main()
