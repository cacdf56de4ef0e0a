#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The computation of Fig. 5 for 10,000 groups of 12 balls: the study's SIMD code, plain Eigen, batched NumPy.

    cmake --preset release -DHELICARM_BENCHMARKS=ON && cmake --build build --target helicarm helicarm_benchmark
    benchmarks/number.py [--repetitions 9] [--build build]

Each version draws its own groups, calibrates both views (Eq. 7) and intersects the calibration's pixels of all balls
(Eq. 8); equal "median FRE" confirms that they agree. Then the whole command, including the files. Needs NumPy.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import tempfile
import time

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent
GROUPS, BALLS, SIGMA = 10000, 12, 2.34
LATERAL = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)


def drawn_groups(random):
    t = random.uniform(0, 7 * np.pi, (GROUPS, BALLS))
    radius = 60 * np.exp(-t / 31.529)
    world = np.stack([radius * np.cos(t), radius * np.sin(t), 3.979 * t], -1)
    pixels = []
    for rotation in (np.eye(3), LATERAL):
        camera = world @ rotation.T + [0, 0, 800]
        pixels.append(512 + 6000 * camera[..., :2] / camera[..., 2:] + SIGMA * random.standard_normal((GROUPS, BALLS, 2)))
    return world, pixels


def calibrated(world, pixels):
    """Eq. 7 by normal equations, with centred pixels."""
    mean = pixels.mean(1, keepdims=True)
    u, x = (pixels - mean) / 512, world / 64
    design = np.zeros((GROUPS, 2 * BALLS, 11))
    design[:, :BALLS, :3] = design[:, BALLS:, 7:10] = x
    design[:, :BALLS, 3] = design[:, BALLS:, 10] = 1
    design[:, :BALLS, 4:7] = -u[..., :1] * x
    design[:, BALLS:, 4:7] = -u[..., 1:] * x
    right = np.concatenate([u[..., 0], u[..., 1]], 1)
    turned = design.transpose(0, 2, 1)
    a = np.linalg.solve(turned @ design, turned @ right[..., None])[..., 0]
    projection = np.empty((GROUPS, 3, 4))
    projection[:, 2, :3], projection[:, 2, 3] = a[:, 4:7] / 64, 1
    projection[:, 0, :3], projection[:, 0, 3] = 8 * a[:, :3], 512 * a[:, 3]
    projection[:, 1, :3], projection[:, 1, 3] = 8 * a[:, 7:10], 512 * a[:, 10]
    projection[:, :2] += mean[:, 0, :, None] * projection[:, 2:]
    return projection


def intersected(projections, pixels):
    """Eq. 8 by normal equations."""
    rows = np.stack([pixels[view][..., axis, None] * projections[view][:, None, 2] - projections[view][:, None, axis]
                     for view in (0, 1) for axis in (0, 1)], -2)
    left, right = rows[..., :3], -rows[..., 3:]
    turned = left.swapaxes(-1, -2)
    return np.linalg.solve(turned @ left, turned @ right)[..., 0]


def with_numpy(seed):
    world, pixels = drawn_groups(np.random.default_rng(seed))
    found = intersected([calibrated(world, seen) for seen in pixels], pixels)
    return np.median(np.linalg.norm(found - world, axis=-1).mean(1))


def milliseconds(work, repetitions):
    times = []
    for _ in range(repetitions):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repetitions", type=int, default=9)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    options = parser.parse_args()

    rows = [("batched numpy", milliseconds(lambda: with_numpy(1), options.repetitions), with_numpy(1))]
    done = subprocess.run([options.build / "bin/helicarm_benchmark", "--benchmark_filter=^number_",
                           f"--benchmark_repetitions={options.repetitions}", "--benchmark_report_aggregates_only=true",
                           "--benchmark_format=json"], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    names = {"number_in_eigen": "plain Eigen, group by group", "number_simd": "study number, FRE",
             "number_with_targets": "study number, FRE and TRE of 43 targets, independent noise",
             "number_of_all_readings": "study number, all 48 columns"}
    for entry in json.loads(done.stdout)["benchmarks"]:
        if entry["aggregate_name"] == "median":
            name, *rest = entry["run_name"].split("/")
            threads = rest[0] if rest and rest[0].isdigit() else "1"
            rows.append((f"{names[name]}, {threads} thread{'s' if threads != '1' else ''}", entry["real_time"],
                         entry["median_fre_mm"]))
    with tempfile.TemporaryDirectory() as out:
        for threads in (1, 2):
            command = [options.build / "bin/helicarm", "study", "number", "--threads", str(threads), "--quiet", "--out", out]
            for what, more in ((f"n = {BALLS}, one reading", ["--balls", str(BALLS), "--sigma", "std", "--reading",
                                                              "calibration_pixels"]),
                               ("n = 6..20, all 48 columns", [])):
                taken = milliseconds(lambda: subprocess.run(command + more, check=True), options.repetitions)
                rows.append((f"the command, {what}, {threads} thread{'s' if threads > 1 else ''}", taken, None))

    print(f"| {GROUPS} groups of {BALLS} balls | ms (median of {options.repetitions}) | median FRE, mm |")
    print("| --- | ---: | ---: |")
    for name, taken, fre in rows:
        print(f"| {name} | {taken:.1f} | {'' if fre is None else f'{fre:.4f}'} |")


if __name__ == "__main__":
    main()
