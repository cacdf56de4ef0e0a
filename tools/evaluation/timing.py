#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whole-process times and peak memory of measurements of simulated images: a table.

  tools/evaluation/timing.py                       all tasks (about ten minutes on two cores, most of it simulation)
  tools/evaluation/timing.py --images 50           runs of 50 images alone
  tools/evaluation/timing.py --enlarged 10         a pair of images with ten times the pixels along each side alone
  tools/evaluation/timing.py --readme README.md    renews the table between the tasks marks of that document

CPU seconds are user and system time of the program and hardly depend on other work of the machine; wall seconds do. Each is
the least of --repeat processes."""
import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from evaluate import renew

ROOT = Path(__file__).resolve().parents[2]
HEAD = ["| task | CPU s | wall s | memory, MB |", "| --- | --- | --- | --- |"]
DENSE = {"name": "perforated", "kind": "holes", "lattice": "hexagonal", "pitch_mm": 3.175, "diameter_mm": 2.0, "dots_xy_mm": None,
         "height_above_receiver_mm": None}


def cost(command):
    """CPU and wall seconds and peak megabytes of one process that succeeds."""
    begin = time.monotonic()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    problem = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(map(str, command))}: {problem.strip()}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - begin, usage.ru_maxrss / 1024


def row(task, commands, repeat):
    costs = [cost(command) for command in commands for _ in range(repeat)]
    cpu, wall, memory = (pick(numbers) for pick, numbers in zip((min, min, max), zip(*costs)))
    line = f"| {task} | {cpu:.2f} | {wall:.2f} | {memory:.0f} |"
    print(line, flush=True)
    return line


def enlarge(case, factor):
    """Gives the case's images so many times the pixels along each side; what they show stays."""
    import cv2
    import numpy
    import pydicom
    for file in case.glob("*.dcm"):
        image = pydicom.dcmread(file)
        pixels = cv2.resize(image.pixel_array, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        image.Rows, image.Columns = pixels.shape
        image.PixelData = numpy.ascontiguousarray(pixels).tobytes()
        image.ImagerPixelSpacing = [float(step) / factor for step in image.ImagerPixelSpacing]
        image.save_as(file)
    return pixels.shape[0]


def enlarged_pair(helicarm, folder, a):
    cost([helicarm, "simulate", folder / "large", "--seed", a.seed, "--quiet"])
    side = enlarge(folder / "large", a.enlarged)
    yield row(f"two images of {side} x {side} pixels, plate of 48 dots: `run --no-report`",
              [[helicarm, "run", folder / "large", "--out", folder / "out", "--quiet", "--no-cache", "--no-report"]], 1)


def pairs(helicarm, folder, a):
    (folder / "dense.json").write_text(json.dumps(DENSE))
    for name, options in (("pair", []), ("dense", ["--plate", folder / "dense.json"])):
        cost([helicarm, "simulate", folder / name, "--seed", a.seed, "--quiet", *options])
    run = lambda name, *options: [[helicarm, "run", folder / name, "--out", folder / "out", "--quiet", *options]]
    yield row("two images, plate of 48 dots: `run --no-report`", run("pair", "--no-cache", "--no-report"), a.repeat)
    yield row("the same with report: `run`", run("pair", "--no-cache"), a.repeat)
    cost(run("dense", "--no-cache")[0])
    holes = min(view["rectification"]["dots_found"] for view in json.loads((folder / "out" / "result.json").read_text())["views"])
    yield row(f"two images, perforated plate, {holes} holes and more found: `run`", run("dense", "--no-cache"), a.repeat)


def runs(helicarm, folder, a):
    for images in a.images:
        case = folder / f"run-{images}"
        cost([helicarm, "simulate", case, "--kind", "flat", "--run", images, "--seed", a.seed, "--quiet"])
        yield row(f"run of {images} images, flat panel, knee: `sweep`", [[helicarm, "sweep", case, "--out", folder / "out", "--quiet"]], 1)
        for file in case.glob("*.dcm"):
            file.unlink()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--images", type=int, nargs="+", help="sizes of the runs (default: 50 100 400), and runs alone")
    parser.add_argument("--enlarged", type=int, metavar="FACTOR")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--readme", type=Path)
    parser.add_argument("--helicarm", default=str(ROOT / "build/bin/helicarm"))
    options = parser.parse_args()
    alone, options.images = options.images is not None, options.images or [50, 100, 400]
    print(*HEAD, sep="\n")
    with tempfile.TemporaryDirectory() as made:
        if options.enlarged:
            return list(enlarged_pair(options.helicarm, Path(made), options))
        lines = [] if alone else list(pairs(options.helicarm, Path(made), options))
        lines += runs(options.helicarm, Path(made), options)
    if options.readme:
        renew(options.readme, "tasks", HEAD + lines)


if __name__ == "__main__":
    main()
