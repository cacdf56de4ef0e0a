# SPDX-License-Identifier: Apache-2.0
"""What tools/drills/falsify.py attacks and measures with: copies of cases, runs of the program, the judgement of an answer."""
import json
import math
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "evaluation"))
from evaluate import places_of  # noqa: E402
from falsify_images import Dicom

ATTACKS = []


@dataclass
class Answer:
    """What a run gave: exit code, reason of a refusal, warnings and notes, points with their claims."""
    exit: int = 0
    failure: str = ""
    message: str = ""
    warnings: list = field(default_factory=list)
    notes: set = field(default_factory=set)
    points: dict = field(default_factory=dict)
    at_points: dict = field(default_factory=dict)  # name: messages of its warnings
    missing: dict = field(default_factory=dict)    # name: why it is not located
    result: dict = field(default_factory=dict)


@dataclass
class Row:
    attack: str
    case: str
    outcome: str
    error: float
    claim: float
    wrong: bool
    mark: str = ""


def attack(name, kind, options=(), note="", reason=""):
    """Registers an attack; it gets a copy of a case and may return rows of picks for `locate`, or a true motion."""
    def register(function):
        ATTACKS.append((name, kind, options, note, reason, function))
        return function
    return register


class Case:
    """A copy of a case that an attack changes."""

    def __init__(self, folder, bench, untouched):
        self.folder, self.bench, self.untouched = folder, bench, untouched
        self.origin = ""
        self.json = json.loads((folder / "case.json").read_text())
        self.truth = json.loads((folder / "truth.json").read_text())

    def image(self, view):
        entry = next(v for v in self.json["views"] if v["name"] == view)
        return Dicom(self.folder / entry["image"])

    def views(self):
        return [v["name"] for v in self.json["views"]]

    def change_images(self, change, views=None):
        for view in views or self.views():
            image = self.image(view)
            change(image)
            image.write()

    def pick(self, name, view):
        return next(p for p in self.json["picks"] if p["name"] == name and p["view"] == view)

    def ball(self, view, label):
        """Raw pixel of a fiducial, as the untouched run found it."""
        seen = next(v for v in self.untouched.result["views"] if v["name"] == view)
        return next(f["uv_raw"] for f in seen["fiducials"] if f["label"] == label)

    def diameter(self, label):
        balls = json.loads((self.folder / "calibrator.json").read_text())["balls"]
        return next(b["diameter_mm"] for b in balls if b["label"] == label)

    def edit(self, name, change):
        value = json.loads((self.folder / name).read_text())
        change(value)
        (self.folder / name).write_text(json.dumps(value))

    def save(self):
        (self.folder / "case.json").write_text(json.dumps(self.json))


def project(projection, point):
    h = [sum(a * b for a, b in zip(row, [*point, 1])) for row in projection]
    return h[0] / h[2], h[1] / h[2]


def answer_of(done, result):
    answer = Answer(done.returncode)
    if done.returncode:
        answer.message = done.stderr.strip().split("\n")[-1]
        answer.failure = answer.message.split(": ")[1] if ": " in answer.message else answer.message
    if result:
        answer.result = result
        answer.warnings = [(w["code"], w["view"], w["message"]) for w in result.get("warnings", [])]
        answer.notes = {n["code"] for n in result.get("notes", [])}
        if result.get("failure"):
            answer.failure = result["failure"]["code"]
            answer.message = result["failure"]["message"]
        answer.points = {p["name"]: (p["xyz_mm"], p["error_95_mm"]) for p in result["points"] if p["xyz_mm"]}
        answer.at_points = {p["name"]: {w["message"] for w in p["warnings"]} for p in result["points"]}
        answer.missing = {p["name"]: p["reason"] for p in result["points"] if not p["xyz_mm"]}
    return answer


class Bench:
    """Simulates cases once and runs the program on changed copies."""

    def __init__(self, helicarm, work):
        self.helicarm, self.work, self.untouched = helicarm, work, {}

    def call(self, *arguments):
        return subprocess.run([self.helicarm, *map(str, arguments)], capture_output=True, text=True)

    def simulated(self, kind, seed):
        folder = self.work / f"{kind}-{seed}"
        if not folder.exists():
            done = self.call("simulate", folder, "--kind", kind, "--seed", seed, "--quiet")
            if done.returncode:
                sys.exit(done.stderr)
        return folder

    def run(self, folder, options=()):
        out = self.work / "out"
        shutil.rmtree(out, ignore_errors=True)
        done = self.call("run", folder, "--out", out, "--no-report", "--quiet", *options)
        path = out / "result.json"
        return answer_of(done, json.loads(path.read_text()) if path.exists() else None)

    def locate(self, calibration, picks, options=()):
        (self.work / "calibration.json").write_text(json.dumps(calibration))
        lines = ["name,view,u_px,v_px,sigma_px", *(f"{n},{v},{u!r},{w!r},0.5" for n, v, (u, w) in picks)]
        (self.work / "picks.csv").write_text("\n".join(lines) + "\n")
        done = self.call("locate", "--calibration", self.work / "calibration.json", "--picks",
                         self.work / "picks.csv", "--json", *options)
        return answer_of(done, json.loads(done.stdout) if done.returncode == 0 else None)

    def base(self, folder, options=()):
        key = (folder, tuple(o for o in options if not o.startswith("--motion")))
        if key not in self.untouched:
            self.untouched[key] = self.run(folder, options)
        return self.untouched[key]

    def copy(self, folder):
        target = self.work / "attacked"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(folder, target)
        return target


def judged(name, case, answer, untouched, truth, note, reason):
    if answer.failure:
        kind = "refused" if answer.exit == 3 or answer.result else "exit 2"
        hint = " (names the value that fits)" if " fits, the file has " in answer.message else ""
        return Row(name, case, f"{kind}: {answer.failure}{hint}", math.nan, math.nan, False)
    known = {(code, view, message.split(" ")[0]) for code, view, message in untouched.warnings}
    new = [w for w in answer.warnings if (w[0], w[1], w[2].split(" ")[0]) not in known]
    codes = list(dict.fromkeys(w[0] for w in new))
    of_points = set().union(*answer.at_points.values()) if answer.at_points else set()
    of_all = [w for w in new if w[2] not in of_points and w[0] != "uncertain"]
    changed = {n: p for n, p in answer.points.items() if untouched.points.get(n) != p and n in truth}
    errors = {n: (math.dist(xyz, truth[n]), claim) for n, (xyz, claim) in changed.items()}
    unseen = {n: e for n, e in errors.items()
              if e[0] > e[1] and not of_all and not answer.at_points[n] & {w[2] for w in new}}
    shown = unseen or errors
    worst = max(shown.values(), key=lambda e: e[0] / max(e[1], 1e-9) if unseen or not codes else e[0],
                default=(math.nan, math.nan))
    error, claim = worst
    lost = sorted({answer.missing[n] for n in answer.missing if n in untouched.points})
    if codes and not unseen:
        return Row(name, case, "warned: " + ", ".join(codes), error, claim, False)
    if not unseen:
        return Row(name, case, "not located: " + ", ".join(lost) if lost else "bound holds", error, claim, False)
    if note and note in answer.notes:
        return Row(name, case, f"note: {note}", error, claim, False, f"no data can show it: {reason}")
    return Row(name, case, "**not seen**", error, claim, True)


def attacked(bench, folder, entry):
    name, _, options, note, reason, function = entry
    untouched = bench.base(folder)
    case = Case(bench.copy(folder), bench, untouched)
    case.origin = folder.name
    truth = places_of(case.truth)
    special = function(case)
    if special is not None:
        answer, untouched, truth = special
    else:
        case.save()
        answer = bench.run(case.folder, options)
        if options:
            untouched = bench.base(folder, options)
    return judged(name, folder.name, answer, untouched, truth, note, reason)


def located(case, picks, truth, options=(), imported=False):
    """Rectified picks in the untouched calibration; imported: by its matrices alone."""
    calibration = json.loads(json.dumps(case.untouched.result))
    if imported:
        calibration.pop("calibration")
        for view in calibration["views"]:
            view["reprojection_rms_px"] = view["dof"] = None
    true_picks = [(n, v, project(projection_of(case, v), truth[n])) for n, v, _ in picks]
    return (case.bench.locate(calibration, picks, options), case.bench.locate(calibration, true_picks, options), truth)


def projection_of(case, view):
    return next(v["projection"] for v in case.untouched.result["views"] if v["name"] == view)
