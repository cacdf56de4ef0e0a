# SPDX-License-Identifier: Apache-2.0
"""Exhaustive evaluation of a simulated view's labellings, for tools/drills/falsify_views.py; shares no code with the program.

The phantom is posed on all ordered triples of balls and on so many triples of candidates that a labelling of one
fiducial less than the true one is missed with a probability of 0.01, in both handednesses unless it is known (P3P by
Newton's method). Poses that further candidates support are matched and refitted (pose, focal length, principal point),
and their log odds are those of docs/method.md (Evidence). S labellings are computed at once. A screw of many balls is posed
by what maps the screw onto itself instead (steps along it, and reversed), also reversed in depth and mirrored."""
import itertools
import json
import math

import numpy as np

LEAST, GATE_PX = 6, 15.0
MOST_EXHAUSTIVE = 30  # balls
RECTIFICATION_PX = 0.2  # sigma that the program assumes for any rectification
LOG_2PI = math.log(2 * math.pi)


class View:
    """A simulated view: balls (b, 3) mm from their centroid, candidates (n, 2) px, prior."""

    def __init__(self, line):
        self.json = json.loads(line)
        balls = np.array(self.json["balls"])
        self.centroid = balls[:, :3].mean(0)
        self.balls, self.ball_radius = balls[:, :3] - self.centroid, balls[:, 3]
        self.exact = np.array(self.json["exact"])
        seen = np.array(self.json["candidates"]).reshape(-1, 5)
        self.uv, self.radius, self.radius_sigma = seen[:, :2], seen[:, 2], seen[:, 3]
        self.sigma = self.json["noise_px"]
        prior = self.json["prior"]
        self.focal, self.focal_sigma = prior["focal_px"], prior["focal_sigma"]
        self.principal, self.principal_sigma = np.array(prior["principal_px"]), prior["principal_sigma_px"]
        self.field, self.bias_sigma = prior["field_radius_px"], prior["radius_bias_sigma"]
        self.mirrored = self.json["mirrored"]
        self.sign = -1.0 if self.mirrored else 1.0
        self.signs = [self.sign] if self.json["handedness_known"] else [1.0, -1.0]
        self.truth = np.full(len(balls), -1)
        for i, ball in enumerate(seen[:, 4].astype(int)):
            if ball >= 0:
                self.truth[ball] = i

    def true_fit(self):
        """The pose fitted to the true labels, and whether a false candidate i can be told from ball k (b, n): not where it
        lies within 4 sigma (candidate, rectification, prediction) of the ball's predicted image."""
        camera = self.json["camera"]
        rotation = np.array(camera["rotation"]).reshape(1, 3, 3)
        translation = np.array(camera["translation"])[None] + rotation[0] @ self.centroid
        labels = self.truth[None]
        pose = fit(self, Poses(self, rotation, translation, np.array([self.sign])), labels, 12)
        information, _, _, _, j = normal_equations(self, pose, labels, np.full(labels.shape, 1 / self.sigma))
        spread = (self.sigma**2 + RECTIFICATION_PX**2) * np.eye(2) + j[0] @ np.linalg.inv(information[0]) @ j[0].transpose(0, 2, 1)
        off = self.uv[None] - pose.project(self.balls)[0][0][:, None]
        return pose, np.einsum("bni,bij,bnj->bn", off, np.linalg.inv(spread), off) > 16

    def is_true(self):
        """Whether the handedness and all labels found are the true ones."""
        found = self.json["labelling"]
        return found["mirrored"] == self.mirrored and all(
            i < 0 or i == true for i, true in zip(found["candidate_of_ball"], self.truth))

    def verdict(self, excluded):
        """The reason of a refusal, or right, imitated (a false candidate stands where a hidden ball may be) or wrong."""
        found = self.json.get("labelling")
        if not found:
            return self.json["refused"]
        false = [(k, i) for k, i in enumerate(found["candidate_of_ball"]) if i >= 0 and i != self.truth[k]]
        if found["mirrored"] != self.mirrored or any(excluded[k, i] or i in self.truth for k, i in false):
            return "wrong"
        return "imitated" if false else "right"


class Poses:
    """S cameras: rotation (S, 3, 3), translation (S, 3) mm, focal length, principal point (S, 2), sign of fx."""

    def __init__(self, view, rotation, translation, sign):
        self.rotation, self.translation, self.sign = rotation, translation, sign
        self.focal = np.full(len(sign), view.focal)
        self.principal = np.tile(view.principal, (len(sign), 1))

    def __getitem__(self, which):
        part = object.__new__(Poses)
        part.__dict__ = {name: value[which] for name, value in self.__dict__.items()}
        return part

    def points(self, balls):
        turned = (self.rotation @ balls.T).transpose(0, 2, 1)
        return turned, turned + self.translation[:, None]

    def project(self, balls):
        _, p = self.points(balls)
        xy = p[..., :2] / p[..., 2:]
        return self.principal[:, None] + self.focal[:, None, None] * xy * np.stack([self.sign, np.ones_like(self.sign)], 1)[:, None], p[..., 2]


def exponential(v):
    """Rotations of the vectors v (S, 3), Rodrigues."""
    angle = np.maximum(np.linalg.norm(v, axis=1), 1e-12)[:, None, None]
    k = np.zeros((len(v), 3, 3))
    k[:, 0, 1], k[:, 0, 2], k[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    k = (k - k.transpose(0, 2, 1)) / angle
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def normal_equations(view, poses, labels, weight):
    """Information (S, 9, 9), gradient and chi2 of pose, ln f and principal point, with the prior."""
    turned, p = poses.points(view.balls)
    uv, _ = poses.project(view.balls)
    f = poses.focal[:, None, None] * np.stack([poses.sign, np.ones_like(poses.sign)], 1)[:, None]
    z = p[..., 2:]
    j = np.zeros((*p.shape[:2], 2, 9))
    by_point = np.zeros((*p.shape[:2], 2, 3))
    by_point[..., 0, 0], by_point[..., 1, 1] = (f[..., 0] / z[..., 0]), (f[..., 1] / z[..., 0])
    by_point[..., 2] = -f * p[..., :2] / z**2
    j[..., :3] = np.cross(turned[:, :, None], by_point)
    j[..., 3:6], j[..., 6] = by_point, f * p[..., :2] / z
    j[..., 0, 7] = j[..., 1, 8] = 1
    used = labels >= 0
    residual = np.where(used[..., None], uv - view.uv[labels], 0)
    w = np.where(used, weight, 0)[..., None]
    s, b = labels.shape
    rows = (j * w[..., None]).reshape(s, 2 * b, 9)
    off = (residual * w).reshape(s, 2 * b)
    over = np.stack([np.log(poses.focal / view.focal) / view.focal_sigma,
                     *((poses.principal - view.principal) / view.principal_sigma).T], 1)
    sigmas = np.array([view.focal_sigma, view.principal_sigma, view.principal_sigma])
    information = rows.transpose(0, 2, 1) @ rows
    information[:, range(6, 9), range(6, 9)] += sigmas**-2
    gradient = np.einsum("srp,sr->sp", rows, off)
    gradient[:, 6:] += over / sigmas
    return information, gradient, (off**2).sum(1) + (over**2).sum(1), residual, j


def moved(poses, step):
    new = poses[:]
    new.rotation = exponential(step[:, :3]) @ poses.rotation
    new.translation = poses.translation + step[:, 3:6]
    new.focal = poses.focal * np.exp(step[:, 6])
    new.principal = poses.principal + step[:, 7:]
    return new


def fit(view, poses, labels, steps, robust_px=0.0):
    """Gauss-Newton with the step halved where chi2 grows; Cauchy weights with robust_px."""
    damping = np.full(len(labels), 1e-6)
    weight = np.full(labels.shape, 1 / view.sigma)
    for _ in range(steps):
        information, gradient, chi2, residual, _ = normal_equations(view, poses, labels, weight)
        if robust_px:
            weight = 1 / np.sqrt(view.sigma**2 + robust_px**2 + (residual**2).sum(2))
            information, gradient, chi2, *_ = normal_equations(view, poses, labels, weight)
        diagonal = np.einsum("sii->si", information)
        diagonal *= 1 + damping[:, None]
        new = moved(poses, np.clip(-np.linalg.solve(information, gradient[..., None])[..., 0], -50, 50))
        after = normal_equations(view, new, labels, weight)[2]
        worse = ~(after <= chi2 * (1 + 1e-9)) | ~(new.translation[:, 2] > 200)
        damping = np.where(worse, damping * 30 + 1e-3, damping * 0.1)
        for name, value in new.__dict__.items():
            value[worse] = getattr(poses, name)[worse]
        poses = new
    return poses


def log_factorial(n):
    return np.array([math.lgamma(x + 1) for x in np.atleast_1d(n)])


def log_odds(view, poses, labels):
    """Against chance, of S labellings with their fitted poses (docs/method.md)."""
    information, _, chi2, *_ = normal_equations(view, poses, labels, np.full(labels.shape, 1 / view.sigma))
    n, b, m = len(view.uv), len(view.balls), (labels >= 0).sum(1)
    area = math.pi * view.field**2
    odds = -0.5 * chi2 + m * (math.log(area / view.sigma**2) - LOG_2PI)
    odds += log_factorial(n - m) - log_factorial(n) + log_factorial(m) + log_factorial(b - m) - log_factorial(b) - math.log(b + 1)
    z = poses.translation[:, 2]
    odds += np.log((view.focal / z) ** 2 / area / (1.4 * z)) - math.log(8 * math.pi**2) - math.log(2)
    odds -= math.log(view.focal_sigma) + 2 * math.log(view.principal_sigma)
    odds += -0.5 * np.linalg.slogdet(information)[1] + 3 * LOG_2PI
    return odds + radius_odds(view, poses, labels)


def radius_odds(view, poses, labels):
    depth = poses.project(view.balls)[1]
    used = labels >= 0
    expected = poses.focal[:, None] * view.ball_radius / depth
    with np.errstate(invalid="ignore", divide="ignore"):
        excess = np.where(used, np.log(view.radius[labels] / expected), 0)
    sigma = np.maximum(view.radius_sigma / view.radius, 0.02)[labels]
    w = np.where(used, sigma**-2, 0)
    bias = view.bias_sigma**-2
    chi2 = (w * excess**2).sum(1) - (w * excess).sum(1) ** 2 / (w.sum(1) + bias)
    peak = np.where(used, np.maximum(0, np.log(0.2 / (sigma * math.sqrt(2 * math.pi)))), 0).sum(1)
    return np.maximum(0, peak - 0.5 * np.log1p(w.sum(1) / bias)) - 0.5 * chi2


def nearest(view, poses, gate_px):
    """Labels (S, b): each ball's nearest candidate within the gate, one to one."""
    uv, depth = poses.project(view.balls)
    distance = np.linalg.norm(uv[:, :, None] - view.uv, axis=3)
    gate = np.broadcast_to(np.asarray(gate_px), distance.shape[:2])[..., None]
    distance = np.where((distance < gate) & (depth > 0)[..., None], distance, np.inf)
    of_ball = distance.argmin(2)
    least = np.take_along_axis(distance, of_ball[..., None], 2)[..., 0]
    taken = (distance.min(1)[np.arange(len(uv))[:, None], of_ball] < least)
    return np.where(np.isfinite(least) & ~taken, of_ball, -1)


def weak_starts(view, triangles, triples):
    """Candidate triple, ball triangle and depths (N, 3) of scaled orthography, where the radii allow the distance."""
    v = (view.uv - view.principal) / view.focal
    e = view.balls[triangles[:, 1:]] - view.balls[triangles[:, :1]]
    A, B, C = (e[:, 0] ** 2).sum(1), (e[:, 1] ** 2).sum(1), (e[:, 0] * e[:, 1]).sum(1)
    d = v[triples[:, 1:]] - v[triples[:, :1]]
    a, b, c = ((d[:, i] * d[:, j]).sum(1)[:, None] for i, j in ((0, 0), (1, 1), (0, 1)))
    q2, q1 = A * B - C * C, (A * b + a * B) / 2 - C * c
    w = (q1 + np.sqrt(np.maximum(0, q1**2 - q2 * (a * b - c * c)))) / q2
    distance = w**-0.5
    by_radius = view.focal * view.ball_radius[0] / view.radius[triples[:, :1]]
    i, t = np.nonzero(np.abs(np.log(distance / by_radius)) < 0.25)
    w, h1 = w[i, t], np.sqrt(np.maximum(0, w[i, t] * A[t] - a[i, 0]))
    h2 = np.copysign(np.sqrt(np.maximum(0, w * B[t] - b[i, 0])), w * C[t] - c[i, 0])
    behind = np.stack([np.zeros_like(h1), h1, h2], 1)
    z = np.concatenate([1 + behind, 1 - behind]) * np.tile(distance[i, t], 2)[:, None]
    return np.tile(i, 2), np.tile(t, 2), z


def solved_depths(directions, sides2, z):
    """Newton's method for the depths z (N, 3) at which the corners have their distances; and which converged."""
    dots = {(p, q): (directions[:, p] * directions[:, q]).sum(1) for p in range(3) for q in range(p, 3)}
    pairs = ((0, 1), (0, 2), (1, 2))
    for _ in range(7):
        value, j = np.empty_like(z), {}
        for r, (p, q) in enumerate(pairs):
            own, other = z[:, p] * dots[p, p] - z[:, q] * dots[p, q], z[:, q] * dots[q, q] - z[:, p] * dots[p, q]
            value[:, r] = z[:, p] * own + z[:, q] * other - sides2[:, r]
            j[r, p], j[r, q] = 2 * own, 2 * other
        (a, b), (c, d), (e, f) = ((j[r, p], j[r, q]) for r, (p, q) in enumerate(pairs))
        x, y, w = value.T
        det = -a * d * e - b * c * f
        det = np.where(np.abs(det) < 1e-6, 1e-6, det)
        step = np.stack([-x * d * e - y * b * f + w * b * d, a * (y * f - w * d) - x * c * f, x * c * e - y * a * e - w * b * c], 1)
        z = z - np.clip(step / det[:, None], -60, 60)
    good = (np.abs(value) < 0.02 * sides2).all(1) & (z > 200).all(1)
    return z, good


def frames(corners):
    x = corners[:, 1] - corners[:, 0]
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    n = np.cross(x, corners[:, 2] - corners[:, 0])
    n = n / np.linalg.norm(n, axis=1, keepdims=True)
    return np.stack([x, np.cross(n, x), n], 2)


def all_poses(view, least, random):
    """Poses on triples of balls and candidates that candidates near at least `least` balls support."""
    order = np.array(list(itertools.permutations(range(len(view.balls)), 3)))
    e1, e2 = (view.balls[order[:, i]] - view.balls[order[:, 0]] for i in (1, 2))
    longest = np.maximum((e1**2).sum(1), np.maximum((e2**2).sum(1), ((e1 - e2) ** 2).sum(1)))
    order = order[np.linalg.norm(np.cross(e1, e2), axis=1) > 0.05 * longest]
    triples = np.array(list(itertools.combinations(range(len(view.uv)), 3)))
    d1, d2 = (view.uv[triples[:, i]] - view.uv[triples[:, 0]] for i in (1, 2))
    side = np.sqrt(np.maximum((d1**2).sum(1), np.maximum((d2**2).sum(1), ((d1 - d2) ** 2).sum(1))))
    needed = math.ceil(math.log(100) * math.comb(len(view.uv), 3) / math.comb(max(least, 4), 3))
    triples = triples[np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 20 * side]
    triples = random.permutation(triples)[:needed]
    if not len(triples):
        return None
    i, t, z = weak_starts(view, order, triples)
    v = np.concatenate([(view.uv - view.principal) / view.focal, np.ones((len(view.uv), 1))], 1)
    corners = view.balls[order[t]]
    sides2 = np.stack([((corners[:, p] - corners[:, q]) ** 2).sum(1) for p, q in ((0, 1), (0, 2), (1, 2))], 1)
    z, good = solved_depths(v[triples[i]], sides2, z)
    parts = []
    for sign in view.signs:
        there = z[good, :, None] * v[triples[i[good]]] * np.array([sign, 1, 1])
        rotation = frames(there) @ frames(corners[good]).transpose(0, 2, 1)
        translation = there[:, 0] - np.einsum("sij,sj->si", rotation, corners[good][:, 0])
        poses = Poses(view, rotation, translation, np.full(len(rotation), sign))
        parts.append(poses[support(view, poses) >= least])
    return joined(parts)


def screw_poses(view, true_pose):
    """The true labels' pose after each congruence of the endless screw on which the balls lie, in the handednesses that are open;
    mirrored poses are reversed in depth, which far from the source shows the same image."""
    rotation, translation = true_pose.rotation[0], true_pose.translation[0]
    n = len(view.balls)
    angle = np.unwrap(np.arctan2(view.balls[:, 1] + view.centroid[1], view.balls[:, 0] + view.centroid[0]))
    turn, step = (angle[-1] - angle[0]) / (n - 1), (view.balls[-1, 2] - view.balls[0, 2]) / (n - 1)
    axis = np.array([-view.centroid[0], -view.centroid[1], 0])  # a place on the axis; balls are from their centroid
    half = axis + np.array([np.cos(angle.mean()), np.sin(angle.mean()), 0])
    moves = []
    for k in range(1 - n, n):
        c, s = np.cos(k * turn), np.sin(k * turn)
        along = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        moves.append((along, axis + np.array([0, 0, k * step]) - along @ axis))
        direction = half - axis
        reverse = 2 * np.outer(direction, direction) - np.eye(3)  # a half turn about the middle ball's radius
        moves.append((along @ reverse, axis + np.array([0, 0, k * step]) - along @ reverse @ axis))
    parts = []
    for sign in view.signs:
        depth = np.eye(3) if sign == view.sign else np.diag([-1.0, 1.0, -1.0])
        aside = np.array([sign * view.sign, 1, 1])
        turned = np.array([depth @ rotation @ r for r, _ in moves])
        centres = np.array([translation + rotation @ t for _, t in moves])
        off = centres - translation
        poses = Poses(view, turned, aside * translation + off @ depth.T, np.full(len(moves), sign))
        poses.focal[:], poses.principal[:] = true_pose.focal, true_pose.principal
        parts.append(poses)
    return joined(parts)


def joined(parts):
    whole = parts[0][:]
    for name in whole.__dict__:
        setattr(whole, name, np.concatenate([getattr(part, name) for part in parts]))
    return whole


def support(view, poses):
    """Balls near a candidate, by a raster of the gates."""
    side, cell = 512, 2.0
    ys, xs = np.mgrid[:side, :side] * cell
    near = np.zeros((side, side), bool)
    for u, v in view.uv:
        near |= (xs - u) ** 2 + (ys - v) ** 2 < GATE_PX**2
    x, y, z = poses.rotation.transpose(1, 0, 2) @ view.balls.T + poses.translation.T[:, :, None]
    u = np.clip((view.principal[0] + view.focal * poses.sign[:, None] * x / z) / cell + 0.5, 0, side - 1).astype(int)
    v = np.clip((view.principal[1] + view.focal * y / z) / cell + 0.5, 0, side - 1).astype(int)
    return near[v, u].sum(1)


def distinct(poses, labels):
    _, first = np.unique(np.column_stack([labels, poses.sign]), axis=0, return_index=True)
    return poses[first], labels[first]


def rivals(view, random, true_pose):
    """Labellings with their fitted poses and log odds: a list of (labels (S, b), poses, odds (S,))."""
    least = max(LEAST - 1, int((view.truth >= 0).sum()) - 1)
    poses = screw_poses(view, true_pose) if len(view.balls) > MOST_EXHAUSTIVE else all_poses(view, max(LEAST - 1, least - 2), random)
    if poses is None or not len(poses.sign):
        return []
    labels = nearest(view, poses, GATE_PX)
    keep = (labels >= 0).sum(1) >= LEAST - 1
    poses, labels = distinct(poses[keep], labels[keep])
    for gate in (15, 10, 6, 3):
        poses = fit(view, poses, labels, 4, gate / 3)
        labels = nearest(view, poses, gate)
        keep = (labels >= 0).sum(1) >= max(LEAST - 1, least - 2)
        poses, labels = distinct(poses[keep], labels[keep])
        if not len(labels):
            return []
    found = []
    for gate in (max(1.5, 6 * view.sigma), 4.5 * view.sigma, 4.5 * view.sigma, 4.5 * view.sigma):
        poses = fit(view, poses, labels, 4, 0 if len(found) else gate / 3)
        labels = nearest(view, poses, gate)
        keep = (labels >= 0).sum(1) >= LEAST - 1
        poses, labels = distinct(poses[keep], labels[keep])
        if not len(labels):
            return found
        final = fit(view, poses, labels, 6)
        found.append((labels, final, log_odds(view, final, labels)))
    return found


def contradicts(view, labels, sign, excluded):
    """Another handedness, or a candidate with another label than its true one."""
    return sign != view.sign or any(
        view.truth[k] != i and (view.truth[k] >= 0 or i in view.truth or excluded[k, i])
        for k, i in enumerate(labels) if i >= 0)


def contradicted(view, labels, sign, accepted):
    """Whether a labelling gives an accepted label of candidates to another ball or candidate, or mirrors the image."""
    ball_of = {int(i): k for k, i in enumerate(accepted) if i >= 0}
    return sign != view.sign or any(accepted[k] >= 0 and accepted[k] != i or ball_of.get(int(i), k) != k
                                    for k, i in enumerate(labels) if i >= 0)


def evaluated(view, random):
    """The verdict on the labels found; the log odds of the true labels over the best labelling that contradicts them or
    chance, and what that is; and those over the best one that contradicts the labels found. NaN: fewer than six balls."""
    pose, excluded = view.true_fit()
    verdict = view.verdict(excluded)
    if (view.truth >= 0).sum() < LEAST:
        return verdict, math.nan, "", math.nan
    truth = float(log_odds(view, pose, view.truth[None])[0])
    least, kind = truth, "chance"
    found = view.json.get("labelling")
    of_found = truth if found else math.nan
    for labels, poses, odds in rivals(view, random, pose):
        for k in np.argsort(-odds):
            if truth - odds[k] < least and contradicts(view, labels[k], poses.sign[k], excluded):
                least, kind = truth - float(odds[k]), "other labels" if poses.sign[k] == view.sign else "mirrored"
            if found and truth - odds[k] < of_found and contradicted(view, labels[k], poses.sign[k], found["candidate_of_ball"]):
                of_found = truth - float(odds[k])
    return verdict, least, kind, of_found
