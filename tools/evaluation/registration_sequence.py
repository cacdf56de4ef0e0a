#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Follows the femur and the tibia of a modelled knee through a simulated biplane sequence.

  tools/evaluation/registration_sequence.py --frames 100
  tools/evaluation/registration_sequence.py --frames 100 --doc docs/motion.md    single frames against smooth motion as a table there, and
                                                                                 an interrupted run that is resumed against a whole one

The knee is that of tools/evaluation/bone_ct.py. The images are made here, by sums along rays, with soft tissue of varying thickness
and noise; both bones move, about 1 mm and 1 degree from frame to frame. Prints the errors of the poses (mean over 14 points of
each bone) and of the tibia's pose relative to the femur, the decisions, and the pairs of images per second that `helicarm register
--frames` states (both bones, reading included). Needs NumPy."""
import argparse
import concurrent.futures
import csv
import json
import pathlib
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import zlib

import numpy as np

import bone_ct
from evaluate import renew
from registration_bodies import TARGETS
from registration_protocol import moved, placed

SIZE, PIXEL_MM, DETECTOR_MM, SOURCE_MM = 320, 0.7, 1100.0, 700.0
STEP_MM = 0.8
CENTRES = {"femur": np.array([0, 5, 25.0]), "tibia": np.array([0, 5, -35.0])}


def camera(degrees):
    """K and camera_from_world of a view that turns about the world's z."""
    angle = np.radians(degrees)
    ray = np.array([np.sin(angle), np.cos(angle), 0])
    right = np.cross(ray, [0, 0, 1])
    focus = DETECTOR_MM / PIXEL_MM
    pose = np.eye(4)
    pose[:3, :3] = [right, np.cross(ray, right), ray]
    pose[2, 3] = SOURCE_MM
    middle = (SIZE - 1) / 2
    return np.array([[focus, 0, middle], [0, focus, middle], [0, 0, 1]]), pose


def cropped(values):
    """The box of a volume (S, P, L) outside which it is 0, and its first voxel's place (mm, L P S)."""
    ends = [np.flatnonzero(values.any(axis=tuple({0, 1, 2} - {axis})))[[0, -1]] for axis in range(3)]
    box = tuple(slice(max(low - 1, 0), high + 2) for low, high in ends)
    return np.ascontiguousarray(values[box]), bone_ct.LOW + bone_ct.VOXEL_MM * np.array([part.start for part in box[::-1]])


def sampled(values, at):
    """Values between the voxels (S, P, L) at `at` (voxels, L P S), which is clipped to the volume."""
    size = np.array(values.shape[::-1])
    at = np.clip(at, 0, size - 1.001)
    whole = at.astype(np.int32)
    part = at - whole
    flat = values.ravel()
    index = (whole[..., 2] * size[1] + whole[..., 1]) * size[0] + whole[..., 0]
    total = np.zeros(index.shape)
    for corner in range(8):
        bits = [corner >> axis & 1 for axis in range(3)]
        weight = np.prod([part[..., axis] if bit else 1 - part[..., axis] for axis, bit in enumerate(bits)], axis=0)
        total += weight * flat[index + bits[0] + size[0] * (bits[1] + size[1] * bits[2])]
    return total


def integrals(bones, poses, k, camera_from_world):
    """Line integrals of the bones at their poses, one image: sums at steps of about STEP_MM between a ray's ends in the bone's box."""
    u, v = np.meshgrid(np.arange(SIZE), np.arange(SIZE))
    rays = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3) @ np.linalg.inv(k).T
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ camera_from_world[:3, :3]
    source = -camera_from_world[:3, :3].T @ camera_from_world[:3, 3]
    image = np.zeros(len(rays))
    for name, (values, low) in bones.items():
        back = np.linalg.inv(poses[name])
        start = (back[:3, :3] @ source + back[:3, 3] - low) / bone_ct.VOXEL_MM
        along = rays @ back[:3, :3].T / bone_ct.VOXEL_MM
        walls = np.stack([-start / along, (np.array(values.shape[::-1]) - 1 - start) / along])
        enter, leave = walls.min(axis=0).max(axis=1), walls.max(axis=0).min(axis=1)
        hit = np.flatnonzero(leave > enter)
        steps = int((leave - enter)[hit].max() / STEP_MM) + 1
        step = (leave - enter)[hit] / steps
        for number in range(steps):
            image[hit] += sampled(values, start + along[hit] * (enter[hit] + (number + 0.5) * step)[:, None]) * step
    return image.reshape(SIZE, SIZE)


def write_image(path, bones, frame, turn, seed):
    """The image of one frame: soft tissue of varying thickness, the bones, and noise."""
    v, u = np.mgrid[:SIZE, :SIZE]
    tissue = 1.2 + 0.3 * np.cos(0.012 * u + 0.02 * frame) + 0.0008 * v
    dose = np.exp(-tissue - integrals(bones, poses_at(frame), *camera(turn)))
    noise = np.random.default_rng([seed, turn, frame]).standard_normal(dose.shape)
    write_png(path, np.clip(65535 * (dose + 0.003 * noise * np.sqrt(dose)), 1, 65535).astype(np.uint16))


def write_png(path, pixels):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in pixels)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIZE, SIZE, 16, 0, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


def poses_at(frame):
    """World_from_patient of both bones: translations of about 1 mm, rotations of about 1 degree a frame."""
    phase = 2 * np.pi * frame / 50
    femur = moved(np.eye(4), CENTRES["femur"], np.array([6 * np.sin(phase), 4 * np.sin(2 * phase), 5 * np.sin(phase)]),
                  np.radians([4 * np.sin(phase), 3 * np.sin(2 * phase), 5 * np.sin(phase)]))
    tibia = moved(femur, placed(femur, np.array([[0, 5, 0.0]]))[0], np.array([0, np.sin(phase), 0]),
                  np.radians([8 * np.sin(phase), 0, 3 * np.sin(2 * phase)]))
    return {"femur": femur, "tibia": tibia}


def make_case(folder, frames, seed):
    knee = bone_ct.Knee(seed)
    scan = bone_ct.rounded(knee.scanned())
    bone_ct.write_nrrd(folder / "scan.nrrd", scan)
    bones, models, views = {}, [], []
    for name, mask in (("femur", knee.femur), ("tibia", knee.tibia)):
        bone_ct.write_nrrd(folder / f"{name}.nrrd", mask.astype(np.uint8))
        bones[name] = cropped(np.where(mask, np.maximum(knee.hu, 0) * 3.2e-5, 0))
        start = moved(poses_at(0)[name], CENTRES[name], np.array([2, -2, 2.0]), np.radians([2, -2, 2]))
        models.append({"name": name, "volume": "scan.nrrd", "mask": f"{name}.nrrd",
                       "start": {"world_from_model": start.tolist()}})
    with concurrent.futures.ProcessPoolExecutor() as pool:
        written = []
        for view, turn in (("A", 0), ("B", 75)):
            k, pose = camera(turn)
            (folder / f"{view}.json").write_text(json.dumps({"K": k.tolist(), "R": pose[:3, :3].tolist(), "t": pose[:3, 3].tolist()}))
            views.append({"name": view, "image": f"{view}_{{frame:03d}}.png", "camera": f"{view}.json"})
            written += [pool.submit(write_image, folder / f"{view}_{frame:03d}.png", bones, frame, turn, seed)
                        for frame in range(frames)]
        for image in written:
            image.result()
    (folder / "case.json").write_text(json.dumps({"format": "helicarm-case/1", "views": views, "models": models}))


def rows_of(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def pose_of(row):
    return np.array([[float(row[f"m{i}{j}"]) for j in range(1, 5)] for i in range(1, 5)])


def summary(errors):
    return f"median {np.median(errors):.3f} mm, 95 % {np.percentile(errors, 95):.3f} mm, largest {max(errors):.3f} mm"


def rotation_vector_deg(rotation):
    """Of a small rotation."""
    return np.degrees([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]) / 2


def motion_errors(rows, name, in_femur, start):
    """Errors of motions against the first frame at the model's points, mm, and the shares of the centre's and of the turn's that
    1.96 sigma hold."""
    errors, inside, count = [], np.zeros(2), 0
    points, centre = placed(start[name], CENTRES[name] + 0.75 * TARGETS), placed(start[name], CENTRES[name][None])
    for row in rows:
        poses = poses_at(int(row["frame"]))
        true = poses[name] @ np.linalg.inv(start[name])
        if in_femur:
            true = np.linalg.inv(poses["femur"] @ np.linalg.inv(start["femur"])) @ true
        errors.append(np.linalg.norm(placed(pose_of(row), points) - placed(true, points), axis=1).mean())
        if row is rows[0]:
            continue  # the identity, without error
        sigma = np.array([float(row[f"sigma_{axis}_mm"]) for axis in "xyz"])
        inside[0] += np.sum(np.abs(placed(pose_of(row), centre) - placed(true, centre))[0] < 1.96 * sigma)
        turn = rotation_vector_deg(pose_of(row)[:3, :3] @ true[:3, :3].T)
        inside[1] += np.sum(np.abs(turn) < 1.96 * np.array([float(row[f"sigma_r{axis}_deg"]) for axis in "xyz"]))
        count += 3
    return errors, inside / max(1, count)


def motion_summary(rows, name, in_femur, start):
    errors, inside = motion_errors(rows, name, in_femur, start)
    return (f"{summary(errors)}; rms {np.sqrt(np.mean(np.square(errors))):.4f} mm; "
            f"{100 * inside[0]:.0f} % of places, {100 * inside[1]:.0f} % of turns inside 95 %")


def moving_rows(folder, kind, name):
    return [row for row in rows_of(folder / f"{kind}.csv") if row["body"] == name and row["m11"]]


def about_mean(rows, name, in_femur, start):
    """rms of the points' errors less their mean over the frames, mm: without the first frame's own error, which all share."""
    points = placed(start[name], CENTRES[name] + 0.75 * TARGETS)
    off = []
    for row in rows:
        poses = poses_at(int(row["frame"]))
        true = poses[name] @ np.linalg.inv(start[name])
        if in_femur:
            true = np.linalg.inv(poses["femur"] @ np.linalg.inv(start["femur"])) @ true
        off.append(placed(pose_of(row), points) - placed(true, points))
    off = np.array(off)
    return np.sqrt(np.mean(np.sum((off - off.mean(0)) ** 2, axis=-1)))


def motion_table(folders, resumed):
    """`folders`: of the results, by their first frame."""
    lines = ["| motion | from frame | by frames, mm rms | about their mean | places, turns inside 95 % | smoothed, mm rms | about their mean | "
             "places, turns inside 95 % |", "| --- " * 8 + "|"]
    for name, kinds, in_femur, words in (("femur", ("bodies", "smoothed"), False, "femur"), ("tibia", ("bodies", "smoothed"), False, "tibia"),
                                         ("tibia", (None, "relative"), True, "tibia in the femur's coordinates")):
        for first, folder in folders.items():
            cells = []
            for kind in kinds:
                if kind is None:
                    cells += ["", "", ""]
                    continue
                rows, start = moving_rows(folder, kind, name), poses_at(first)
                errors, inside = motion_errors(rows, name, in_femur, start)
                cells += [f"{np.sqrt(np.mean(np.square(errors[1:]))):.4f}", f"{about_mean(rows, name, in_femur, start):.4f}",
                          f"{100 * inside[0]:.1f}, {100 * inside[1]:.1f}"]
            lines.append(f"| {words} | {first} | {' | '.join(cells)} |")
    return lines + ["", resumed]


def begun_later(arguments, folder):
    """Results of the same images from later first frames on, which have other errors."""
    folders = {0: folder / "out"}
    for first in (8, 16):
        folders[first] = folder / f"out-{first}"
        done = subprocess.run([arguments.program, "register", folder, "--out", folders[first], "--frames",
                               f"{first}-{arguments.frames - 1}", "--threads", str(arguments.threads)], capture_output=True, text=True, check=False)
        if done.returncode not in (0, 3):
            sys.exit(done.stderr)
    return folders


def resumed_run(arguments, folder):
    """A run that is interrupted and resumed, against the whole one."""
    out = folder / "resumed"
    shutil.rmtree(out, ignore_errors=True)
    command = [arguments.program, "register", folder, "--out", out, "--frames", f"0-{arguments.frames - 1}", "--threads",
               str(arguments.threads)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))  # ignored in the background
    while process.poll() is None:
        if (out / "frames.jsonl").exists() and len((out / "frames.jsonl").read_text().splitlines()) > arguments.frames // 3:
            process.send_signal(signal.SIGINT)
            process.wait()
        time.sleep(0.05)
    if len((out / "frames.jsonl").read_text().splitlines()) > arguments.frames:
        sys.exit("the run ended before it was interrupted")
    done = subprocess.run([*command, "--resume"], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)
    differ = [name for name in ("registration.csv", "bodies.csv", "smoothed.csv", "relative.csv", "smoothed.seq.mha")
              if (out / name).read_bytes() != (folder / "out" / name).read_bytes()]
    return (f"Interrupted after about a third of the {arguments.frames} frames and resumed: "
            f"{'other bytes in ' + ', '.join(differ) if differ else 'the tables have the bytes of the whole run'}.")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="build/bin/helicarm")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--doc", type=pathlib.Path)
    parser.add_argument("--keep", type=pathlib.Path, help="folder for case and result; a case that it holds is used again")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "case.json").exists():
            make_case(folder, arguments.frames, arguments.seed)
        done = subprocess.run([arguments.program, "register", folder, "--out", folder / "out", "--frames",
                               f"0-{arguments.frames - 1}", "--threads", str(arguments.threads)],
                              capture_output=True, text=True, check=False)
        if done.returncode not in (0, 3):
            sys.exit(done.stderr)
        rows = rows_of(folder / "out/registration.csv")
        for name, centre in CENTRES.items():
            own = [row for row in rows if row["model"] == name]
            points = centre + 0.75 * TARGETS
            errors = [np.linalg.norm(placed(pose_of(row), points) - placed(poses_at(int(row["frame"]))[name], points), axis=1).mean()
                      for row in own if row["decision"] != "refuse"]
            decisions = {word: sum(row["decision"] == word for row in own) for word in ("accept", "warn", "refuse")}
            codes = sorted({row["code"] for row in own if row["code"]})
            print(f"{name}: {summary(errors) if errors else '-'}; {decisions}; codes: {', '.join(codes) or '-'}")
        errors = []
        for femur, tibia in zip(*([row for row in rows if row["model"] == name] for name in ("femur", "tibia"))):
            if "refuse" in (femur["decision"], tibia["decision"]):
                continue
            poses, points = poses_at(int(femur["frame"])), CENTRES["tibia"] + 0.75 * TARGETS
            found = np.linalg.inv(pose_of(femur)) @ pose_of(tibia)
            true = np.linalg.inv(poses["femur"]) @ poses["tibia"]
            errors.append(np.linalg.norm(placed(found, points) - placed(true, points), axis=1).mean())
        print(f"tibia in femur: {summary(errors) if errors else '-'}")
        start = poses_at(0)
        for kind in ("bodies", "smoothed", "relative"):
            for name in ("femur", "tibia"):
                own = moving_rows(folder / "out", kind, name)
                if own:
                    print(f"{kind}.csv, {name} against its first frame: {motion_summary(own, name, kind == 'relative', start)}")
        frames, seconds = re.search(r"(\d+) frames in ([\d.]+) s", done.stdout).groups()
        print(f"{frames} pairs in {seconds} s: {int(frames) / float(seconds):.2f} pairs/s, two bones")
        if arguments.doc:
            renew(arguments.doc, "registration_sequence.py", motion_table(begun_later(arguments, folder), resumed_run(arguments, folder)))


if __name__ == "__main__":
    main()
