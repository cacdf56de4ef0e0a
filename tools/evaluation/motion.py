#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Beads of two bodies through drawn biplane sequences, followed by `track`, against their truth: tables.

  tools/evaluation/motion.py                       three noise levels, faults that are planted (about ten minutes on two cores)
  tools/evaluation/motion.py --frames 100 --seed 7 others
  tools/evaluation/motion.py --doc docs/motion.md  renews the tables between the marks of that document
  tools/evaluation/motion.py --published 3dpts.csv rbt.csv --unit-mm 10 [--cameras cam1.txt cam2.txt]
                                                   bodies of places that XMALab measured against its transforms of them: the places
                                                   (markers of equal numbers of each body in the order of the bodies) are projected exactly

Two bodies of five beads of 1 mm (about 4 px) chew in front of two cameras of 1024 x 1024 pixels, up to 2 mm from frame to frame.
Balls of bone move with each body, beads are hidden in one view for a while, dots stand still. A place counts as carried on by a swap where
it lies within 0.3 mm of another bead and 0.5 mm or more from its own. The best Butterworth filter is the one of the cut-off that is nearest to
the truth, of the mean of a body's places as they are. Needs NumPy."""
import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from evaluate import renew
from motion_published import published_table
from motion_scene import BODIES, NAMES, RATE_HZ, Scene, make_case, rms, table, track


def filtered(places, cut_off):
    """(frames, 3) by the zero-phase Butterworth filter of order 4 of both passes, ends reflected about their points."""
    n = len(places)
    padded = np.vstack([2 * places[0] - places[1:][::-1], places, 2 * places[-1] - places[:-1][::-1]])
    frequency = np.fft.rfftfreq(len(padded), 1 / RATE_HZ)
    response = 1 / (1 + (frequency / cut_off) ** 4)
    trend = np.linspace(0, 1, len(padded))[:, None] * (padded[-1] - padded[0]) + padded[0]
    return (np.fft.irfft(np.fft.rfft(padded - trend, axis=0) * response[:, None], len(padded), axis=0) + trend)[n - 1:2 * n - 1]


def best_linear(places, moved):
    """(frames, 3) by the linear filter without phase that is nearest to the truth: of one gain at each frequency for the three axes, the gain
    that fits the true motion itself best. Ends reflected about their points, as for the Butterworth filter (sine transform)."""
    n = len(places)
    line = np.linspace(0, 1, n)[:, None] * (places[-1] - places[0]) + places[0]
    index = np.arange(1, n - 1)
    sines = np.sin(np.pi * index[:, None] * index / (n - 1)) * np.sqrt(2 / (n - 1))
    measured, true = sines @ (places - line)[1:-1], sines @ (moved - line)[1:-1]
    gain = np.sum(measured * true, 1) / np.maximum(np.sum(measured ** 2, 1), 1e-300)
    made = line.copy()
    made[1:-1] += sines.T @ (measured * gain[:, None])
    return made


class Result:
    """Errors of one run against its truth."""

    def __init__(self, out, truth, shown):
        self.shown = shown.sum()
        self.missed = 0  # of those that both views show
        self.of_place = []  # (frame, marker, tracked, share inside)
        self.status = {word: [] for word in ("tracked", "one_view", "predicted", "lost")}  # (error mm, share inside, carried on)
        places = np.full(truth.shape, np.nan)
        for row in table(out / "markers.csv"):
            f, m = int(row["frame"]) - 1, NAMES.index(row["name"])
            self.missed += shown[f, m] and row["status"] != "tracked"
            self.of_place.append((f, m, row["status"] == "tracked", np.nan))
            if row["status"] == "lost":
                self.status["lost"].append((0, 0, False))
                continue
            places[f, m] = [float(row[axis + "_mm"]) for axis in "xyz"]
            off = places[f, m] - truth[f, m]
            others = np.linalg.norm(np.delete(truth[f], m, 0) - places[f, m], axis=1)
            inside = np.abs(off) <= 1.959964 * np.array([float(row[f"s{axis}_mm"]) for axis in "xyz"])
            self.of_place[-1] = (*self.of_place[-1][:3], inside.mean())
            self.status[row["status"]].append((np.linalg.norm(off), inside.mean(), np.linalg.norm(off) >= 0.5 and others.min() < 0.3))
        self.smooth, self.single, self.butterworth, self.inside, self.about_mean = [], [], [], [], []
        for body, of in zip(BODIES, (slice(0, 5), slice(5, 10))):
            self.add_body(out, body, truth[:, of], places[:, of])

    def add_body(self, out, body, truth, places):
        centre, moved = truth[0].mean(0), truth.mean(1) - truth[0].mean(0)
        for name, errors in (("smoothed.csv", self.smooth), ("bodies.csv", self.single)):
            for row in table(out / name):
                if row["body"] != body or not row["m11"] or row["frame"] == "1":
                    continue
                pose = np.array([[float(row[f"m{i}{k}"]) for k in range(1, 5)] for i in range(1, 4)])
                off = pose[:, :3] @ centre + pose[:, 3] - centre - moved[int(row["frame"]) - 1]
                errors.append(off)
                if name == "smoothed.csv":
                    self.inside.append(np.mean(np.abs(off) <= 1.959964 * np.array([float(row[f"sigma_{axis}_mm"]) for axis in "xyz"])))
        mean = places.mean(1)
        if np.isfinite(mean).all():
            best = best_linear(mean, truth.mean(1))
            smoothed = {int(row["frame"]): row for row in table(out / "smoothed.csv") if row["body"] == body and row["m11"]}
            if len(smoothed) == len(truth):
                poses = np.array([[[float(smoothed[f + 1][f"m{i}{k}"]) for k in range(1, 5)] for i in range(1, 4)] for f in range(len(truth))])
                own = poses[:, :, :3] @ centre + poses[:, :, 3]
                errors = [own - truth.mean(1), best - truth.mean(1)]
                errors.insert(1, min((filtered(mean, cut_off) - truth.mean(1) for cut_off in np.arange(1.5, 24.5, 0.5)),
                                     key=lambda e: rms(e - e.mean(0))))
                self.about_mean += [np.array([e - e.mean(0) for e in errors])]
            tried = [filtered(mean, cut_off) for cut_off in np.arange(1.5, 24.5, 0.5)]
            self.butterworth += list(min(((f - f[0] - moved)[1:] for f in tried), key=rms))

    def count(self, word):
        return len(self.status[word])

    def band(self, word):
        rows = self.status[word]
        return f"{100 * np.mean([row[1] for row in rows]):.1f} ({len(rows)})" if rows else "(0)"


def joined(results):
    made = object.__new__(Result)
    made.shown, made.missed = sum(r.shown for r in results), sum(r.missed for r in results)
    made.status = {word: sum((r.status[word] for r in results), []) for word in results[0].status}
    for name in ("smooth", "single", "butterworth", "inside", "about_mean"):
        setattr(made, name, sum((getattr(r, name) for r in results), []))
    return made


def noise_table(a, root):
    lines = ["| noise | tracked, % of those that both views show | swaps carried on | tracked, mm rms | inside 95 %: tracked | one_view | predicted | lost | "
             "bodies by frames, mm rms | smoothed | inside 95 % | best Butterworth | CPU s a pair |",
             "| --- " * 13 + "|"]
    about_mean = []
    for row, (noise, blur) in enumerate(((0.5, 0.5), (1, 0), (3, 0.3))):
        results, seconds = [], 0
        for k in range(a.seeds):
            seed = a.seed + row * a.seeds + k
            truth, shown = make_case(root / f"n{noise}-{k}", Scene(seed), seed, a.frames, noise=noise, hide=6, decoys=3, blur=blur)
            done, answer, cpu = track(a.helicarm, root / f"n{noise}-{k}", root / f"o{noise}-{k}", a.frames)
            if done.returncode:
                sys.exit(done.stderr)
            results.append(Result(root / f"o{noise}-{k}", truth, shown))
            seconds += cpu
            shutil.rmtree(root / f"n{noise}-{k}")
        all_ = joined(results)
        carried = sum(row[2] for rows in all_.status.values() for row in rows)
        about_mean += all_.about_mean
        lines.append(
            f"| {noise}, blur {blur} | {100 * (1 - all_.missed / all_.shown):.1f} | {carried} | "
            f"{np.sqrt(np.mean([row[0] ** 2 for row in all_.status['tracked']])):.3f} | {all_.band('tracked')} | {all_.band('one_view')} | "
            f"{all_.band('predicted')} | {all_.count('lost')} | {rms(all_.single):.4f} | {rms(all_.smooth):.4f} | "
            f"{100 * np.mean(all_.inside):.1f} | {rms(all_.butterworth) if all_.butterworth else np.nan:.4f} | "
            f"{seconds / (a.frames * a.seeds):.3f} |")
        print(lines[-1], flush=True)
    smooth, butterworth, linear = (rms(np.concatenate([of[kind] for of in about_mean])) for kind in range(3))
    lines += ["", f"About their mean over the frames, centres of all rows: smoothed {smooth:.4f} mm rms, best Butterworth {butterworth:.4f}, "
                  f"best linear {linear:.4f} ({linear / butterworth:.2f} of the best Butterworth; smoothed {smooth / butterworth:.2f})."]
    print(lines[-1], flush=True)
    return lines


def clear_table(a, root):
    """Places that both views show, in dense bone under noise, by how clear the weaker image is."""
    limits = (0, 2, 3, 4, 5, 6, 8, 12, np.inf)
    rows = []
    for k in range(max(2, a.seeds)):
        seed, folder, out = a.seed + 100 + k, root / f"dense-{k}", root / f"dense-out-{k}"
        truth, shown = make_case(folder, Scene(seed), seed, a.frames, noise=3, hide=6, decoys=3, blur=0.3, bone=0.04)
        done = track(a.helicarm, folder, out, a.frames)[0]
        if done.returncode:
            sys.exit(done.stderr)
        result, clear = Result(out, truth, shown), np.load(folder / "clear.npy").min(2)
        rows += [(clear[f, m], tracked, inside) for f, m, tracked, inside in result.of_place if shown[f, m]]
        shutil.rmtree(folder)
    lines = ["| signal to noise of the weaker image | places | tracked, % | inside 95 %: tracked |", "| --- " * 4 + "|"]
    for low, high in zip(limits, limits[1:]):
        of = [row for row in rows if low <= row[0] < high]
        bands = [row[2] for row in of if row[1]]
        span = f"below {high}" if low == 0 else f"{low} and more" if high == np.inf else f"{low} to {high}"
        lines.append(f"| {span} | {len(of)} | "
                     f"{100 * np.mean([row[1] for row in of]) if of else np.nan:.1f} | {100 * np.mean(bands) if bands else np.nan:.1f} |")
    for line in lines:
        print(line, flush=True)
    return lines


def named(answer, done, code):
    """The warning or refusal of that code."""
    for warning in answer.get("warnings", []):
        if warning["code"] == code:
            return warning["message"].split(":")[0]
    return done.stderr.strip().split("\n")[-1][:110] if code in done.stderr else "not named"


def exchange_sights(path, frame, names):
    """Exchanges the images of two markers from a frame on."""
    lines = path.read_text().splitlines()
    at = {tuple(line.split(",")[:3]): i for i, line in enumerate(lines)}
    for (f, name, view), i in list(at.items()):
        if f.isdigit() and int(f) >= frame and name == names[0]:
            other = at[f, names[1], view]
            heads = [lines[k].split(",", 3)[:3] for k in (i, other)]
            tails = [lines[k].split(",", 3)[3] for k in (i, other)]
            lines[i], lines[other] = ",".join(heads[0] + [tails[1]]), ",".join(heads[1] + [tails[0]])
    path.write_text("\n".join(lines) + "\n")


def faults_table(a, root):
    frames, seed = max(30, a.frames // 2), a.seed + 50
    rows = []

    def add(*cells):
        rows.append("| " + " | ".join(str(cell) for cell in cells) + " |")
        print(rows[-1], flush=True)

    truth, shown = make_case(root / "plain", Scene(seed), seed, frames)
    track(a.helicarm, root / "plain", root / "plain-out", frames)
    for what, first in (("in one frame", False), ("from a frame on", True)):
        shutil.copytree(root / "plain-out", root / f"swap{first}")
        middle = frames // 2
        sights = root / f"swap{first}" / "sights.csv"
        if first:
            exchange_sights(sights, middle, ("jaw2", "jaw4"))
        else:
            exchange_sights(sights, middle, ("jaw2", "jaw4"))
            exchange_sights(sights, middle + 1, ("jaw2", "jaw4"))
        done, answer, _ = track(a.helicarm, root / "plain", root / f"swap{first}", frames, "--resume")
        result = Result(root / f"swap{first}", truth, shown)
        carried = sum(row[2] for of in result.status.values() for row in of)
        add(f"images of two markers of a body exchanged {what}",
            f"{answer['swaps_repaired']} repaired, {carried} places carried on; {named(answer, done, 'markers_swapped')}")
    case = json.loads((root / "plain" / "case.json").read_text())
    for body in BODIES:
        rows_of = "".join(f"{body}{i + 1},{','.join(f'{x:.4f}' for x in at)}\n" for i, at in
                          enumerate(truth[0, :5] if body == "skull" else truth[0, 5:]))
        (root / "plain" / f"{body}.csv").write_text("name,x_mm,y_mm,z_mm\n" + rows_of)
    case["bodies"] = [{**body, "geometry": body["name"] + ".csv"} for body in case["bodies"]]
    (root / "plain" / "case.json").write_text(json.dumps(case))
    done, answer, _ = track(a.helicarm, root / "plain", root / "bodies-out", frames)
    add("geometry of two bodies exchanged", f"exit code {done.returncode}: {named(answer, done, 'bodies_exchanged')}")
    make_case(root / "loose", Scene(seed + 1), seed, frames, loose=frames // 2)
    done, answer, _ = track(a.helicarm, root / "loose", root / "loose-out", frames)
    add(f"jaw3 moves by 0.67 mm in its bone at frame {frames // 2 + 1}", named(answer, done, "marker_loose"))
    for delay in (-0.25, 0.1, 0.25):
        make_case(root / f"delay{delay}", Scene(seed + 2), seed, frames, delay=delay)
        done, answer, _ = track(a.helicarm, root / f"delay{delay}", root / f"delay{delay}-out", frames)
        view = answer["views"][1]
        sigma = 1000 * view["delay_sigma_frames"] / RATE_HZ
        add(f"second camera exposes {1000 * delay / RATE_HZ:g} ms later", f"{view['delay_ms']:.2f} ms, standard deviation {sigma:.2f}")
    return ["| planted | named |", "| --- | --- |", *rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helicarm", default="build/bin/helicarm")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--doc", type=Path)
    parser.add_argument("--published", nargs=2, type=Path, metavar=("POINTS", "BODIES"))
    parser.add_argument("--cameras", nargs=2, type=Path, metavar="CAMERA", help="of the published places")
    parser.add_argument("--unit-mm", type=float, default=10)
    a = parser.parse_args()
    a.helicarm = shutil.which(a.helicarm) or a.helicarm
    with tempfile.TemporaryDirectory() as root:
        if a.published:
            print("\n".join(published_table(a, Path(root))))
            return
        text = "\n".join(noise_table(a, Path(root)) + [""] + clear_table(a, Path(root)) + [""] + faults_table(a, Path(root)))
    if a.doc:
        renew(a.doc, "motion.py", [text])
    else:
        print("\n" + text)


if __name__ == "__main__":
    main()
