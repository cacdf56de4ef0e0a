# SPDX-License-Identifier: Apache-2.0
"""The attacks of tools/drills/falsify.py, in its order."""
import math
import shutil

from falsify_cases import attack, located, project, projection_of
from falsify_images import (Dicom, covered, disc, flipped, moved, noisy, quantised, radial, raised, resampled, scaled,
                            turned)

PIXEL, IMAGER_PIXEL, DISTANCE, ANGLE = (0x0028, 0x0030), (0x0018, 0x1164), (0x0018, 0x1110), (0x0018, 0x1510)
IDENTITY = ((0x0010, 0x0010), (0x0010, 0x0020), (0x0010, 0x0030), (0x0020, 0x000D), (0x0020, 0x000E), (0x0020, 0x0052))
SEEDS = {"accuracy": (1, 3), "tunnels": (1, 2), "flat": (1, 2)}
MIDDLE = [5.0, -10.0, 40.0]


def moving(case, motion, options=()):
    """A point without a marker that moves between the two acquisitions; its place is that of the first."""
    first, second = case.views()[:2]
    then = [a + b for a, b in zip(MIDDLE, motion)]
    picks = [("M", first, project(projection_of(case, first), MIDDLE)),
             ("M", second, project(projection_of(case, second), then))]
    return located(case, picks, {"M": MIDDLE}, options)


def axis_of(case, view):
    """Direction of a view's central ray in the calibrator's frame."""
    camera = next(v["camera_from_calibrator"] for v in case.untouched.result["views"] if v["name"] == view)
    return camera[2][:3]


def across(case):
    a, b = (axis_of(case, v) for v in case.views()[:2])
    n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    return [x / math.hypot(*n) for x in n]


UNSEEN = "a motion along a ray moves neither ray away from the other"


@attack("bone without marker moves 3 mm along the first view's ray", "tunnels", note="unobservable_motion", reason=UNSEEN)
def _(case):
    return moving(case, [3 * x for x in axis_of(case, case.views()[0])])


@attack("bone without marker moves 3 mm along the first view's ray, --motion-sigma 2", "tunnels")
def _(case):
    return moving(case, [3 * x for x in axis_of(case, case.views()[0])], ["--motion-sigma", "2"])


@attack("bone without marker moves 3 mm along the second view's ray", "tunnels")
def _(case):
    return moving(case, [3 * x for x in axis_of(case, case.views()[1])])


@attack("bone without marker moves 3 mm across both rays", "tunnels")
def _(case):
    return moving(case, [3 * x for x in across(case)])


def wrong_pick(case, du, dv, options=(), imported=False):
    first, second = case.views()[:2]
    u, v = project(projection_of(case, second), MIDDLE)
    picks = [("M", first, project(projection_of(case, first), MIDDLE)), ("M", second, (u + du, v + dv))]
    return located(case, picks, {"M": MIDDLE}, options, imported)


def epipolar(case):
    """Unit vectors in the second image: along the image of the first view's ray, and across it."""
    first, second = case.views()[:2]
    p = projection_of(case, second)
    a, b = project(p, MIDDLE), project(p, [m + x for m, x in zip(MIDDLE, axis_of(case, first))])
    along = [(y - x) / math.dist(a, b) for x, y in zip(a, b)]
    return along, [-along[1], along[0]]


@attack("locate: wrong pick, 80 px across the ray of the other view", "tunnels")
def _(case):
    return wrong_pick(case, *(80 * x for x in epipolar(case)[1]))


@attack("locate: wrong pick, 20 px along the image of the other view's ray", "tunnels", note="unobservable_motion",
        reason="such a pick lies on the other view's ray, as the point of a bone that moved would")
def _(case):
    return wrong_pick(case, *(20 * x for x in epipolar(case)[0]))


@attack("locate, imported cameras: 80 px across", "tunnels")
def _(case):
    return wrong_pick(case, *(80 * x for x in epipolar(case)[1]), imported=True)


@attack("locate: wrong pick, 3 px across", "tunnels")
def _(case):
    return wrong_pick(case, *(3 * x for x in epipolar(case)[1]))


@attack("a click without snapping 40 px off in the lateral view", "tunnels")
def _(case):
    along, aside = epipolar(case)
    for view in case.views():
        pick = case.pick("FE", view)
        pick["snap"] = "none"
        pick.pop("diameter_mm", None)
    pick = case.pick("FE", case.views()[1])
    pick["uv"] = [p + 40 * x for p, x in zip(pick["uv"], aside)]


@attack("a click without snapping 40 px off in the lateral view, --method paper", "tunnels", ["--method", "paper"])
def _(case):
    along, aside = epipolar(case)
    for view in case.views():
        pick = case.pick("FE", view)
        pick["snap"] = "none"
        pick.pop("diameter_mm", None)
    pick = case.pick("FE", case.views()[1])
    pick["uv"] = [p + 40 * x for p, x in zip(pick["uv"], aside)]


@attack("femur's and tibia's picks exchanged in one view", "tunnels")
def _(case):
    a, b = (case.pick(name, case.views()[1]) for name in ("FE", "TE"))
    a["uv"], b["uv"] = b["uv"], a["uv"]


def on_balls(case, labels, snap):
    for view, label in zip(case.views(), labels):
        pick = case.pick("FE", view)
        pick["uv"] = case.ball(view, label)
        pick["snap"] = snap
        pick["diameter_mm"] = case.diameter(label)
        if snap == "none":
            pick.pop("diameter_mm", None)


@attack("pick lands on one of the calibrator's balls in both views", "tunnels")
def _(case):
    on_balls(case, ("P6", "P6"), "ball")


@attack("click without snapping on one of the calibrator's balls in both views", "tunnels")
def _(case):
    on_balls(case, ("P6", "P6"), "none")


@attack("pick lands on different balls of the calibrator", "tunnels")
def _(case):
    on_balls(case, ("P4", "P9"), "none")


@attack("pick lands on a ball of the calibrator in one view", "tunnels")
def _(case):
    pick = case.pick("FE", case.views()[1])
    pick["uv"] = case.ball(case.views()[1], "P6")


def matrices(poses):
    for value in poses.values():
        yield from matrices(value) if isinstance(value, dict) else [value]


@attack("the tracker's poses in metres", "tunnels")
def _(case):
    for poses in [v["poses"] for v in case.json["views"]] + [case.json["poses_now"]]:
        for pose in matrices(poses):
            for row in pose[:3]:
                row[3] /= 1000


@attack("the bone's pose at the second acquisition is 5 mm off", "tunnels")
def _(case):
    pose = case.json["views"][1]["poses"]["tracker_from_bone"]["femur"]
    for k in range(3):
        pose[k][3] += 5 / math.sqrt(3)


@attack("AP and lateral image exchanged", "tunnels")
def _(case):
    a, b = case.json["views"][:2]
    a["image"], b["image"] = b["image"], a["image"]


@attack("AP and lateral image exchanged, check targets", "accuracy")
def _(case):
    a, b = case.json["views"][:2]
    a["image"], b["image"] = b["image"], a["image"]


def of_other_session(case, kind):
    """The lateral image of another patient and C-arm position, with all tags of identity made equal."""
    other = next(s for s in SEEDS[kind] if f"{kind}-{s}" != case.origin)
    image, like = Dicom(case.bench.simulated(kind, other) / "LAT.dcm"), case.image("LAT")
    for tag in IDENTITY:
        if like.text(tag) is not None:
            image.set_text(tag, like.text(tag))
    image.write(case.folder / "LAT.dcm")


@attack("AP and lateral image of two sessions, equal tags", "tunnels")
def _(case):
    of_other_session(case, "tunnels")


@attack("AP and lateral image of two sessions, check targets", "accuracy")
def _(case):
    of_other_session(case, "accuracy")


@attack("one image given for both views", "accuracy")
def _(case):
    case.json["views"][1]["image"] = case.json["views"][0]["image"]


for share in (0.005, 0.01, -0.005):
    @attack(f"radial distortion of {100 * abs(share):g} % ({'barrel' if share > 0 else 'pincushion'})", "flat")
    def _(case, share=share):
        case.change_images(lambda image: radial(image, share))

for factor in (1.02, 0.98):
    @attack(f"lateral image scaled by {factor:g}", "flat")
    def _(case, factor=factor):
        case.change_images(lambda image: scaled(image, factor), [case.views()[1]])


@attack("lateral image scaled by 1.02, with plate", "accuracy")
def _(case):
    case.change_images(lambda image: scaled(image, 1.02), [case.views()[1]])


for factor in (1.004, 1.01):
    @attack(f"rows {100 * (factor - 1):g} % farther apart than columns", "flat")
    def _(case, factor=factor):
        case.change_images(lambda image: scaled(image, 1, factor))


@attack("sheared by 0.5 %", "flat")
def _(case):
    case.change_images(lambda image: resampled(image, lambda u, v: (u + 0.005 * (v - 512), v)))


@attack("lateral image shifted by 40 pixels", "flat")
def _(case):
    case.change_images(lambda image: moved(image, 40, -20), [case.views()[1]])


@attack("lateral image turned by 90 degrees, untagged", "flat")
def _(case):
    case.change_images(turned, [case.views()[1]])


@attack("lateral image mirrored, untagged", "flat")
def _(case):
    case.change_images(flipped, [case.views()[1]])


for kind in ("flat", "accuracy"):
    suffix = ", with plate" if kind == "accuracy" else ""
    for factor in (0.8, 0.93, 1.05, 1.3):
        @attack(f"source distance {factor:g} times as large{suffix}", kind)
        def _(case, factor=factor):
            case.change_images(lambda image: image.scale_text(DISTANCE, factor))
    for factor in (0.97, 1.05):
        @attack(f"source distance of the lateral image {factor:g} times as large{suffix}", kind)
        def _(case, factor=factor):
            case.change_images(lambda image: image.scale_text(DISTANCE, factor), [case.views()[1]])
    for factor in (0.9, 1.3):
        @attack(f"pixel size {factor:g} times as large{suffix}", kind)
        def _(case, factor=factor):
            case.change_images(lambda image: image.scale_text(PIXEL, factor).scale_text(IMAGER_PIXEL, factor))


@attack("plate.json: pitch 2 % too large", "accuracy")
def _(case):
    def change(plate):
        plate["pitch_mm"] *= 1.02
        if plate.get("dots_xy_mm"):
            plate["dots_xy_mm"] = [[1.02 * x for x in dot] for dot in plate["dots_xy_mm"]]
    case.edit("plate.json", change)


@attack("plate.json: 10 mm higher than it is", "accuracy")
def _(case):
    case.edit("plate.json", lambda plate: plate.update(height_above_receiver_mm=plate["height_above_receiver_mm"] + 10))


@attack("an intensifier's images without their plate", "accuracy")
def _(case):
    case.json["plate"] = None


@attack("distortion maps of the two views exchanged", "accuracy")
def _(case):
    maps = []
    for view in case.json["views"]:
        out = case.folder / f"rectified-{view['name']}"
        case.bench.call("rectify", case.folder / view["image"], "--plate", case.folder / case.json["plate"], "--out", out)
        maps.append(f"{out.name}/map.json")
    for view, other in zip(case.json["views"], reversed(maps)):
        view["map"] = other


@attack("another response of the detector (grey values to the power 0.6)", "flat")
def _(case):
    case.change_images(lambda image: raised(image, 0.6))


@attack("32 grey levels", "flat")
def _(case):
    case.change_images(lambda image: quantised(image, 32))


@attack("noise of 3 % of the range added", "flat")
def _(case):
    case.change_images(lambda image: noisy(image, 120, 1))


@attack("shadow beside a fiducial in both views", "flat")
def _(case):
    for view in case.views():
        u, v = case.ball(view, "P5")
        case.change_images(lambda image: disc(image, u + 6, v + 3, 9, 0.6), [view])


@attack("lead marker over three fiducials", "flat")
def _(case):
    for view in case.views():
        u, v = case.ball(view, "P3")
        case.change_images(lambda image: covered(image, u - 90, v - 60, u + 90, v + 60, 40), [view])


@attack("bone plate over three fiducials, a screw over a fourth and six among them", "flat")
def _(case):
    for view in case.views():
        image = case.image(view)
        u, v = (int(x) for x in case.ball(view, "P1"))
        steel = image.pixels()[v * image.size[0] + u]
        balls = [case.ball(view, f"P{i}") for i in range(1, 13)]
        for u, v in balls[2:5]:
            image = covered(image, u - 30, v - 24, u + 30, v + 24, steel)
        u, v = balls[7]
        image = disc(image, u + 9, v + 5, 12, 0.35)
        for i in (0, 1, 5, 6, 8, 9):
            image = disc(image, balls[i][0] + 36, balls[i][1] + 21, 12, 0.35)
        image.write()


@attack("a decoy ball near a fiducial that is hidden", "flat")
def _(case):
    u, v = case.ball(case.views()[0], "P8")
    case.change_images(lambda image: disc(covered(image, u - 9, v - 9, u + 9, v + 9, 2600), u + 14, v + 8, 7, 0.3),
                       [case.views()[0]])
