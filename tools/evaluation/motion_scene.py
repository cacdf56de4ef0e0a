# SPDX-License-Identifier: Apache-2.0
"""Beads of two bodies in drawn biplane sequences, with their truth, and a run of `track` over a sequence."""
import csv
import json
import os
import struct
import subprocess
import sys
import zlib

import numpy as np

from rotations import rotation

SIZE, FOCUS, DISTANCE, DIAMETER, RATE_HZ = 1024, 3600.0, 900.0, 1.0, 50.0
BODIES = ("jaw", "skull")
AXES = [np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]), np.array([[0.28, -0.96, 0], [0, 0, -1], [0.96, 0.28, 0.0]])]


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
            return rotation(np.array([0.02 * wave(70, 0), 0.01 * wave(55, 1), 0])), np.array([1.5 * wave(90, 2), 0, wave(75, 3)])
        return (rotation(np.array([0.2 * wave(25, 0), 0.04 * wave(40, 1), 0.07 * wave(25, 4)])),
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


def rms(errors):
    return float(np.sqrt(np.mean(np.sum(np.square(errors), axis=-1))))
