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
import csv
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np

from evaluate import renew

SIZE, FOCUS, DISTANCE, DIAMETER, RATE_HZ = 1024, 3600.0, 900.0, 1.0, 50.0
BODIES = ("jaw", "skull")
AXES = [np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]), np.array([[0.28, -0.96, 0], [0, 0, -1], [0.96, 0.28, 0.0]])]


def turn(vector):
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Scene:
    """Beads, bone and motion of one seed."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.phase = rng.uniform(0, 2 * np.pi, 6)
        self.beads = {body: rng.normal(0, 1, (5, 3)) * [16, 12, 12] + offset for body, offset in
                      (("jaw", [0, 6, -14]), ("skull", [2, -4, 20]))}
        self.balls = {body: (rng.normal(0, 20, (30, 3)) + offset, rng.uniform(3, 13, 30)) for body, offset in
                      (("jaw", [0, 0, -16]), ("skull", [0, 0, 20]))}

    def pose(self, body, t):
        """world_from_body of a moment, in frames."""
        wave = lambda period, k: np.sin(2 * np.pi * t / period + self.phase[k]) - np.sin(self.phase[k])
        if body == "skull":
            return turn(np.array([0.02 * wave(70, 0), 0.01 * wave(55, 1), 0])), np.array([1.5 * wave(90, 2), 0, wave(75, 3)])
        return (turn(np.array([0.2 * wave(25, 0), 0.04 * wave(40, 1), 0.07 * wave(25, 4)])),
                np.array([3.5 * wave(30, 5), 3 * wave(25, 3), 4 * wave(25, 0)]))

    def places(self, t):
        """Beads of all bodies, mm."""
        return np.vstack([self.beads[body] @ rotation.T + shift for body in BODIES for rotation, shift in [self.pose(body, t)]])


NAMES = [f"{body}{i}" for body in BODIES for i in range(1, 6)]


def projected(view, points):
    at = points @ AXES[view].T + [0, 0, DISTANCE]
    return FOCUS * at[:, :2] / at[:, 2:] + (SIZE - 1) / 2, FOCUS / at[:, 2]


def add_ball(shade, uv, radius, value, samples=1):
    """Adds the chord of a ball, relative to its diameter, over its projection."""
    low = np.maximum(np.floor(uv - radius - 1).astype(int), 0)
    high = np.minimum(np.ceil(uv + radius + 2).astype(int), SIZE)
    if (low >= high).any():
        return
    v, u = np.mgrid[low[1]:high[1], low[0]:high[0]]
    offsets = (np.arange(samples) - (samples - 1) / 2) / samples
    for du in offsets:
        for dv in offsets:
            square = ((u + du - uv[0]) ** 2 + (v + dv - uv[1]) ** 2) / radius ** 2
            shade[v, u] += value * np.sqrt(np.maximum(0, 1 - square)) / samples ** 2


def blurred(image, sigma):
    at = np.arange(-3, 4)
    kernel = np.exp(-at ** 2 / (2 * sigma ** 2))
    kernel /= kernel.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(3, 3) if axis == k else (0, 0) for k in (0, 1)], mode="edge")
        image = sum(w * np.take(padded, range(k, k + SIZE), axis=axis) for k, w in enumerate(kernel))
    return image


def drawn(scene, view, t, options, rng, hidden):
    """An image of one moment as 8 bits."""
    shade = np.zeros((SIZE, SIZE))
    for body in BODIES:
        rotation, shift = scene.pose(body, t)
        uv, scale = projected(view, scene.balls[body][0] @ rotation.T + shift)
        for at, mm, radius in zip(uv, scale, scene.balls[body][1]):
            add_ball(shade, at, radius * mm, options["bone"] * 2 * radius)
    moments = t + (np.linspace(-0.5, 0.5, 5) * options["blur"] if options["blur"] else np.zeros(1))
    for moment in moments:
        points = scene.places(moment)
        if options.get("loose") and t >= options["loose"]:
            points[2] += scene.pose("jaw", moment)[0] @ [0.6, 0.3, 0]
        uv, scale = projected(view, points)
        for i, (at, mm) in enumerate(zip(uv, scale)):
            if i not in hidden:
                add_ball(shade, at, DIAMETER / 2 * mm, 1.1 * DIAMETER / len(moments), 5)
    for at, radius in options["dots"][view]:
        add_ball(shade, at, radius, 0.8, 3)
    image = blurred(np.exp(-shade), 0.7) * 150 + 25
    image += rng.normal(0, 1, image.shape) * options["noise"] * np.sqrt(image) * 0.18
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def bead_profile(radius):
    """What a sharp bead of this radius takes of the radiation, blurred, about its centre."""
    side = 2 * int(np.ceil(radius + 4)) + 1
    shade = np.zeros((side, side))
    v, u = np.mgrid[:side, :side] - side // 2
    for du in (np.arange(5) - 2) / 5:
        for dv in (np.arange(5) - 2) / 5:
            shade += 1.1 * DIAMETER * np.sqrt(np.maximum(0, 1 - ((u + du) ** 2 + (v + dv) ** 2) / radius ** 2)) / 25
    at = np.arange(-3, 4)
    kernel = np.exp(-at ** 2 / (2 * 0.7 ** 2)) / np.exp(-at ** 2 / (2 * 0.7 ** 2)).sum()
    profile = 1 - np.exp(-shade)
    for axis in (0, 1):
        profile = np.apply_along_axis(np.convolve, axis, profile, kernel, "same")
    return profile


def clearness(image, uv, radius, noise):
    """Signal to noise of a bead for a detector that knows its place, size and contrast (matched filter); 0 outside the image."""
    u, v = np.rint(uv).astype(int)
    if not (8 <= u < SIZE - 8 and 8 <= v < SIZE - 8):
        return 0.0
    rows, columns = np.mgrid[v - 7:v + 8, u - 7:u + 8]
    away = np.hypot(columns - uv[0], rows - uv[1])
    around = float(np.median(image[v - 7:v + 8, u - 7:u + 8][(away > 5) & (away < 7)]))
    sigma = np.hypot(noise * 0.18 * np.sqrt(around), 12 ** -0.5)
    return max(0.0, around - 25) * float(np.sqrt(np.square(bead_profile(radius)).sum())) / sigma


def png(image):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + row.tobytes() for row in image)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


def make_case(folder, scene, seed, frames, **options):
    """Images and case.json; the markers' true places (frames, markers, 3), and which are shown by both views."""
    rng = np.random.default_rng([seed, 1])
    options = {"noise": 1, "hide": 0, "blur": 0, "decoys": 0, "delay": 0, "bone": 0.022, **options}
    clear = np.zeros((frames, 10, 2))
    options["dots"] = [[(rng.uniform(150, SIZE - 150, 2), rng.uniform(1.5, 4)) for _ in range(options["decoys"])] for _ in AXES]
    spans = [(rng.integers(10), rng.integers(2), start, start + rng.integers(5, 26))
             for start in rng.integers(3, max(4, frames - 10), options["hide"])]
    folder.mkdir(parents=True)
    truth = np.array([scene.places(t) for t in range(frames)])
    if options.get("loose"):
        for t in range(options["loose"], frames):
            truth[t, 2] += scene.pose("jaw", t)[0] @ [0.6, 0.3, 0]
    picks, views = [], []
    for view, axes in enumerate(AXES):
        name = f"cam{view + 1}"
        for t in range(frames):
            hidden = [i for i, k, first, last in spans if k == view and first <= t <= last]
            moment = t + (options["delay"] if view else 0)
            image = drawn(scene, view, moment, options, rng, hidden)
            (folder / f"{name}_{t + 1:04d}.png").write_bytes(png(image))
            for i, (at, mm) in enumerate(zip(*projected(view, truth[t]))):
                clear[t, i, view] = 0 if i in hidden else clearness(image, at, DIAMETER / 2 * mm, options["noise"])
        middle = (SIZE - 1) / 2
        (folder / f"{name}.json").write_text(json.dumps({
            "K": [[FOCUS, 0, middle], [0, FOCUS, middle], [0, 0, 1]], "R": axes.tolist(), "t": [0, 0, DISTANCE],
            "image_size": [SIZE, SIZE]}))
        views.append({"name": name, "image": name + "_{frame:04d}.png", "camera": name + ".json"})
        uv = projected(view, truth[0])[0] + rng.normal(0, 0.7, (10, 2))
        picks += [{"name": n, "view": name, "frame": 1, "uv": [round(float(x), 1) for x in at]} for n, at in zip(NAMES, uv)]
    case = {"format": "helicarm-case/2", "views": views, "markers": {"diameter_mm": DIAMETER}, "frame_rate_hz": RATE_HZ, "picks": picks,
            "bodies": [{"name": body, "markers": [n for n in NAMES if n.startswith(body)]} for body in BODIES]}
    (folder / "case.json").write_text(json.dumps(case))
    np.save(folder / "clear.npy", clear)
    shown = np.ones((frames, 10), bool)
    for i, _, first, last in spans:
        shown[first:last + 1, i] = False
    return truth, shown


def track(program, folder, out, frames, *options):
    """Exit code, track.json or {}, CPU seconds."""
    before = os.times()
    done = subprocess.run([program, "track", folder, "--frames", f"1-{frames}", "--out", out, "--json", *options],
                          capture_output=True, text=True)
    after = os.times()
    answer = json.loads(done.stdout) if done.stdout else {}
    if not answer and not done.stderr:
        sys.exit(f"{program}: exit code {done.returncode}, no output")
    return done, answer, after.children_user + after.children_system - before.children_user - before.children_system


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


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


def rms(errors):
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=-1))))


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


def published_rows(path, scale):
    """Numbers of a file of XMALab, (frames, columns), and its heading."""
    with open(path, newline="") as file:
        heading, *rows = csv.reader(file)
    return heading, scale * np.array([[float(x) for x in row] for row in rows])


def kept_run(program, folder, out, frames, places, names):
    """A run whose images were found exactly where the places are: only its estimates are made anew."""
    track(program, folder, out, frames)
    lines = [(out / "sights.csv").read_text().split("\n")[0]]
    for f, points in enumerate(places):
        uv = [projected(view, points)[0] for view in range(2)]
        lines += [f"{f + 1},{name},cam{view + 1},{uv[view][m][0]:.12g},{uv[view][m][1]:.12g},0.05,2,40,120,0"
                  for m, name in enumerate(names) for view in range(2)]
    (out / "sights.csv").write_text("\n".join(lines) + "\n")
    done = track(program, folder, out, frames, "--resume")[0]
    if done.returncode:
        sys.exit(done.stderr)


def rigid_fit(body, places):
    """world_from_body of least squares of the places (Kabsch)."""
    left, _, right = np.linalg.svd((body - body.mean(0)).T @ (places - places.mean(0)))
    rotation = (left @ np.diag([1, 1, np.sign(np.linalg.det(left @ right))]) @ right).T
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, places.mean(0) - rotation @ body.mean(0)
    return pose


def image_fit(body, places, cameras):
    """world_from_body whose images lie nearest to those of the places."""
    pose = rigid_fit(body, places)
    for _ in range(4):
        information, gradient = np.zeros((6, 6)), np.zeros(6)
        for at, seen in zip((np.c_[body, np.ones(len(body))] @ pose.T)[:, :3], places):
            by_step = np.hstack([np.cross(np.eye(3), at - pose[:3, 3]).T, np.eye(3)])
            for focal, rotation, shift in cameras:
                x, y, z = rotation @ at + shift
                by_place = np.array([[focal[0] / z, 0, -focal[0] * x / z**2], [0, focal[1] / z, -focal[1] * y / z**2]]) @ rotation
                information += (by_place @ by_step).T @ by_place @ by_step
                gradient += (by_place @ by_step).T @ by_place @ (seen - at)
        step = np.linalg.solve(information, gradient)
        pose[:3, :3] = turn(step[:3]) @ pose[:3, :3]
        pose[:3, 3] += step[3:]
    return pose


def mean_shape(places):
    """Of a body's places in all frames, each fitted to it."""
    shape = places[0]
    for _ in range(20):
        poses = [rigid_fit(shape, at) for at in places]
        shape = np.mean([(at - pose[:3, 3]) @ pose[:3, :3] for at, pose in zip(places, poses)], 0)
    return shape


def differences(theirs, ours, body):
    """Of a body's markers by two series of transforms (frames, markers, 3), up to the body's place in its own frame."""
    moved = ours @ np.c_[body, np.ones(len(body))].T
    return (theirs @ np.mean(np.linalg.inv(theirs) @ moved, 0) - moved)[:, :3].transpose(0, 2, 1)


def imported_cameras(a, middle):
    cameras = []
    for path in a.cameras or []:
        done = subprocess.run([a.helicarm, "import", path, "--unit", "cm" if a.unit_mm == 10 else "mm", "--json"], check=True,
                              capture_output=True, text=True)
        camera = json.loads(done.stdout)
        rotation = np.array(camera["R"])
        cameras.append((np.diag(camera["K"])[:2], rotation, np.array(camera["t"]) + rotation @ middle))
    return cameras


def published_table(a, root):
    """Bodies of published places against the transforms that XMALab computed of them, up to the place of each body in its own frame."""
    heading, numbers = published_rows(a.published[0], a.unit_mm)
    names = [column.rsplit("_", 1)[0] for column in heading[::3]]
    places = numbers.reshape(len(numbers), -1, 3)
    middle = places.mean((0, 1))
    places -= middle
    columns, poses = published_rows(a.published[1], 1)
    bodies = [column.split("_")[0] for column in columns[::16]]
    of_body = dict(zip(bodies, np.array_split(range(len(names)), len(bodies))))
    folder, out = root / "published", root / "published-out"
    folder.mkdir()
    blank = png(np.full((SIZE, SIZE), 150, np.uint8))
    views, picks = [], []
    for view, axes in enumerate(AXES):
        name = f"cam{view + 1}"
        shade = np.zeros((SIZE, SIZE))
        uv, mm = projected(view, places[0])
        for at, scale in zip(uv, mm):
            add_ball(shade, at, DIAMETER / 2 * scale, 1.1 * DIAMETER, 5)
        (folder / f"{name}_0001.png").write_bytes(png(np.rint(blurred(np.exp(-shade), 0.7) * 150).astype(np.uint8)))
        for f in range(2, len(places) + 1):
            (folder / f"{name}_{f:04d}.png").write_bytes(blank)
        middle_px = (SIZE - 1) / 2
        (folder / f"{name}.json").write_text(json.dumps({"K": [[FOCUS, 0, middle_px], [0, FOCUS, middle_px], [0, 0, 1]], "R": axes.tolist(),
                                                         "t": [0, 0, DISTANCE], "image_size": [SIZE, SIZE]}))
        views.append({"name": name, "image": name + "_{frame:04d}.png", "camera": name + ".json"})
        picks += [{"name": n, "view": name, "frame": 1, "uv": list(map(float, at))} for n, at in zip(names, uv)]
    (folder / "case.json").write_text(json.dumps({
        "format": "helicarm-case/2", "views": views, "markers": {"diameter_mm": DIAMETER}, "picks": picks,
        "bodies": [{"name": body, "markers": [names[m] for m in of]} for body, of in of_body.items()]}))
    kept_run(a.helicarm, folder, out, len(places), places, names)
    cameras = imported_cameras(a, middle)
    lines = ["| body | frames | centre, mm rms | largest | markers, mm rms | places by least squares: markers | images by least squares: markers |",
             "| --- | --- | --- | --- | --- | --- | --- |"]
    for b, body in enumerate(bodies):
        theirs = poses[:, 16 * b:16 * b + 16].reshape(-1, 4, 4).transpose(0, 2, 1).copy()
        theirs[:, :3, 3] = a.unit_mm * theirs[:, :3, 3] - middle
        ours = np.tile(np.eye(4), (len(places), 1, 1))
        for row in table(out / "bodies.csv"):
            if row["body"] == body:
                ours[int(row["frame"]) - 1] = [[float(row[f"m{i}{k}"]) for k in range(1, 5)] for i in range(1, 5)]
        of = places[:, of_body[body]]
        off = differences(theirs, ours, of[0])
        centres = np.linalg.norm(off.mean(1), axis=1)
        shape = mean_shape(of)
        by_places = differences(theirs, np.array([rigid_fit(shape, at) for at in of]), shape)
        by_images = differences(theirs, np.array([image_fit(shape, at, cameras) for at in of]), shape) if cameras else None
        lines.append(f"| {body} | {len(places)} | {np.sqrt(np.mean(centres ** 2)):.4f} | {centres.max():.4f} | {rms(off):.4f} | "
                     f"{rms(by_places):.4f} | {'' if by_images is None else f'{rms(by_images):.4f}'} |")
    return lines


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
