# SPDX-License-Identifier: Apache-2.0
"""The content of a measured case as numbers and shapes, without Slicer.

helicarm's frames are right-handed, in mm; a model's coordinates are the CT's patient frame, LPS. Slicer's are RAS. All
of helicarm's coordinates, the calibrator's too, change the sign of their first two numbers on the way to Slicer, so
that `world_from_model` places a volume which Slicer has read as RAS.
"""
import json
import math
import pathlib
from dataclasses import dataclass, field
from typing import Dict, List, Optional

import numpy as np

RESULTS = ("result.json", "registration.json")
RAS_FROM_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


class SceneError(Exception):
    """A case or result that cannot be shown; the message says why."""


@dataclass
class Point:
    name: str
    xyz_mm: np.ndarray                    # (3,), frame of the scene
    covariance_mm2: Optional[np.ndarray]  # (3, 3)
    error_95_mm: Optional[float] = None


@dataclass
class Tunnel:
    name: str
    start: Point
    end: Point


@dataclass
class Model:
    name: str
    decision: str                        # accept, warn or refuse
    world_from_model: np.ndarray         # (4, 4); frame of the scene from the model's, LPS
    volume: Optional[pathlib.Path] = None
    surface: Optional[pathlib.Path] = None
    plan: Optional[pathlib.Path] = None
    ijk_to_ras: Optional[np.ndarray] = None  # (4, 4), of a TIFF stack, whose file states no size of its voxels


@dataclass
class View:
    name: str
    intrinsics: np.ndarray              # (3, 3), px
    camera_from_world: np.ndarray       # (4, 4)
    width: int
    height: int
    detector_mm: float                  # depth of the plane on which the image is shown
    image: Optional[pathlib.Path] = None


@dataclass
class Scene:
    name: str
    frame: str = "calibrator"  # of all coordinates; "world" where the cameras of another program define it
    points: List[Point] = field(default_factory=list)
    tunnels: List[Tunnel] = field(default_factory=list)
    models: List[Model] = field(default_factory=list)
    views: List[View] = field(default_factory=list)
    messages: List[str] = field(default_factory=list)  # what is not shown, and why

    def model(self, name):
        for model in self.models:
            if model.name == name:
                return model
        raise SceneError(f'no registered model "{name}": the scene has {", ".join(m.name for m in self.models) or "none"}')


# ---- frames ----

def ras_from_lps(points):
    """(..., 3) points or directions in RAS from LPS, or back."""
    return np.asarray(points, float) * (-1.0, -1.0, 1.0)


def ras_transform(lps_transform):
    """(4, 4) transform between two frames in RAS, from the same between the frames in LPS, or back."""
    return RAS_FROM_LPS @ np.asarray(lps_transform, float) @ RAS_FROM_LPS


def shown_from_frame(scene, chosen):
    """(4, 4), RAS: Slicer's world from the frame of the scene. `chosen` is None for that frame itself, or the name of the
    model whose patient frame is Slicer's world."""
    if chosen is None:
        return np.eye(4)
    return np.linalg.inv(ras_transform(scene.model(chosen).world_from_model))


# ---- confidence regions ----

def chi_square_quantile_3(probability):
    """The value below which the sum of three squared standard normal numbers lies with `probability`."""
    if not 0 < probability < 1:
        raise ValueError(f"probability {probability}: between 0 and 1")

    def below(x):
        return math.erf(math.sqrt(x / 2)) - math.sqrt(2 * x / math.pi) * math.exp(-x / 2)

    low, high = 0.0, 1.0
    while below(high) < probability:
        high *= 2
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if below(middle) < probability else (low, middle)
    return (low + high) / 2


def ellipsoid_axes(covariance_mm2, probability=0.95):
    """Semi-axes (3,) in mm, ascending, and their directions, the columns of (3, 3), of the region that holds the point
    with `probability`."""
    variances, directions = np.linalg.eigh(np.asarray(covariance_mm2, float))
    if variances[0] < -1e-9 * max(variances[2], 1e-300):
        raise SceneError("covariance is not positive: " + np.array2string(variances))
    if np.linalg.det(directions) < 0:
        directions = directions * (1, 1, -1)
    return np.sqrt(chi_square_quantile_3(probability) * np.clip(variances, 0, None)), directions


def ellipsoid_mesh(centre_mm, covariance_mm2, probability=0.95, enlarged=1, rings=12, sectors=24):
    """Corners (n, 3) and triangles (m, 3), outward, of the region's surface, `enlarged` times about its centre."""
    semi_axes, directions = ellipsoid_axes(covariance_mm2, probability)
    semi_axes = enlarged * semi_axes
    polar = np.pi * np.arange(1, rings) / rings
    azimuth = 2 * np.pi * np.arange(sectors) / sectors
    rim = np.stack([np.outer(np.sin(polar), np.cos(azimuth)), np.outer(np.sin(polar), np.sin(azimuth)),
                    np.outer(np.cos(polar), np.ones(sectors))], axis=-1).reshape(-1, 3)
    sphere = np.vstack([[0, 0, 1], rim, [0, 0, -1]])
    last = len(sphere) - 1
    triangles = []
    for sector in range(sectors):
        following = (sector + 1) % sectors
        triangles.append((0, 1 + sector, 1 + following))
        for ring in range(rings - 2):
            a, b = 1 + ring * sectors + sector, 1 + ring * sectors + following
            triangles += [(a, a + sectors, b), (b, a + sectors, b + sectors)]
        triangles.append((last, last - sectors + following, last - sectors + sector))
    return np.asarray(centre_mm, float) + (sphere * semi_axes) @ directions.T, np.array(triangles)


def regions_mesh(points, enlarged=1):
    """`ellipsoid_mesh` of all points that have a covariance, in one; None where none has."""
    meshes = [ellipsoid_mesh(point.xyz_mm, point.covariance_mm2, enlarged=enlarged) for point in points
              if point.covariance_mm2 is not None]
    if not meshes:
        return None
    first = np.cumsum([0] + [len(corners) for corners, _ in meshes])
    return (np.vstack([corners for corners, _ in meshes]),
            np.vstack([triangles + start for (_, triangles), start in zip(meshes, first)]))


# ---- cameras ----

def on_detector(view, u, v):
    """(3,) place of a rectified pixel on the view's plane."""
    ray = np.linalg.solve(view.intrinsics, (u, v, 1.0))
    turn, shift = view.camera_from_world[:3, :3], view.camera_from_world[:3, 3]
    return turn.T @ (ray / ray[2] * view.detector_mm - shift)


def source_of(view):
    """(3,) focal spot."""
    return -view.camera_from_world[:3, :3].T @ view.camera_from_world[:3, 3]


def image_corners(view):
    """Corners (4, 3) of the image on the view's plane: top left, top right, bottom right, bottom left as stored; the
    outer edges of its pixels."""
    right, bottom = view.width - 0.5, view.height - 0.5
    return np.array([on_detector(view, u, v) for u, v in ((-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom))])


def frustum(view):
    """Corners (5, 3) and lines (8, 2): the source, then the image's corners."""
    corners = np.vstack([source_of(view), image_corners(view)])
    return corners, np.array([(0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4), (4, 1)])


# ---- reading ----

def _read(path):
    try:
        return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise SceneError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise SceneError(f"{path}: not JSON: {error}") from error


def _array(numbers, shape, what):
    array = np.array(numbers, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise SceneError(f"{what}: {shape} finite numbers expected")
    return array


def _points(listed, scene, prefix=""):
    found: Dict[str, Point] = {}
    for point in listed:
        name = prefix + point["name"]
        if point.get("xyz_mm") is None:
            scene.messages.append(f"{name}: not located: {point.get('message') or point.get('reason') or 'refused'}")
            continue
        covariance = point.get("covariance_mm2")
        found[name] = Point(name, _array(point["xyz_mm"], (3,), name),
                            None if covariance is None else _array(covariance, (3, 3), name), point.get("error_95_mm"))
    scene.points += found.values()
    return found


def _size_of_png(path):
    """Width and height by the file's header, or None."""
    head = path.read_bytes()[:24] if path.is_file() else b""
    return (int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")) if head[12:16] == b"IHDR" else None


def _imported_view(camera, folder):
    """A camera of another program; its image is free of distortion."""
    image = folder / f"{camera['name']}_overlay.png"
    size = camera.get("image_size") or _size_of_png(image)
    if not size:
        raise SceneError(f"{camera['name']}: size of the image is not known")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = _array(camera["R"], (3, 3), camera["name"]), _array(camera["t"], (3,), camera["name"])
    return View(camera["name"], _array(camera["K"], (3, 3), camera["name"]), pose, *size, _behind_the_world(pose),
                image if image.is_file() else None)


def _behind_the_world(pose):
    """Without the detector's place: as far behind the world's origin as the source lies before it, mm."""
    return 2 * float(pose[2, 3]) if pose[2, 3] > 0 else 1000.0


def _view(view, folder):
    intrinsics = view["intrinsics"]
    width, height = view["image_size"]
    matrix = np.array([[intrinsics["fx_px"], intrinsics.get("skew", 0) or 0, intrinsics["u0"]],
                       [0, intrinsics["fy_px"], intrinsics["v0"]], [0, 0, 1.0]])
    pose = _array(view["camera_from_calibrator"], (4, 4), view["name"])
    detector = intrinsics.get("f_mm") or _behind_the_world(pose)
    image = folder / f"{view['name']}_overlay.png"
    return View(view["name"], matrix, pose, width, height, float(detector), image if image.is_file() else None)


def _stack_grid(model):
    voxel = model.get("voxel_mm")
    return None if voxel is None else RAS_FROM_LPS @ np.diag([*_array(voxel, (3,), "voxel_mm"), 1.0])


def _named(name, message):
    """What is said of a model begins with its name once."""
    return message if message.startswith(name + ": ") else f"{name}: {message}"


def _models(case, registration, folder, scene):
    described = {model["name"]: model for model in case.get("models", [])}

    def path_of(model, key):
        return folder / model[key] if model.get(key) else None

    for registered in registration.get("models", []):
        name, pose = registered["name"], registered.get("world_from_model")
        if pose is None or registered.get("decision") == "refuse":
            reason = (registered.get("failure") or {}).get("message", "no pose")
            scene.messages.append(f"{name}: registration refused, not shown: {_named(name, reason)[len(name) + 2:]}")
            continue
        scene.messages += [_named(name, warning["message"]) for warning in registered.get("warnings") or []]
        model = described.get(name, {})
        scene.models.append(Model(name, registered["decision"], _array(pose, (4, 4), name), path_of(model, "volume"),
                                  path_of(model, "surface"), path_of(model, "plan"), _stack_grid(model)))
        _points(registered.get("points") or [], scene, name + ": ")


def _calibrated(case, result, folder, scene):
    if result.get("failure"):
        scene.messages.append(f"refused: {result['failure']['code']}: {result['failure']['message']}")
    scene.messages += [f"{warning['code']}: {warning['message']}" for warning in result.get("warnings") or []]
    located = _points(result.get("points") or [], scene)
    for tunnel in case.get("tunnels", []):
        if tunnel.get("start") in located and tunnel.get("end") in located:
            scene.tunnels.append(Tunnel(tunnel["name"], located[tunnel["start"]], located[tunnel["end"]]))
    for view in result.get("views") or []:
        if view.get("intrinsics") and view.get("camera_from_calibrator") and view.get("image_size"):
            scene.views.append(_view(view, folder))
        else:
            scene.messages.append(f"{view['name']}: not calibrated")


def read_scene(case_folder, result_folder):
    """The scene of a case and the folder that `helicarm run` wrote, or `helicarm register` of a case with cameras of
    another program; a refused result is shown as far as it was computed."""
    case_folder, result_folder = pathlib.Path(case_folder), pathlib.Path(result_folder)
    case = _read(case_folder / "case.json")
    scene = Scene(case_folder.resolve().name)
    registration, cameras = result_folder / "registration.json", result_folder / "cameras.json"
    brings_cameras = any(view.get("camera") for view in case.get("views", []))
    if brings_cameras:
        scene.frame = "world"
    if not brings_cameras:
        _calibrated(case, _read(result_folder / "result.json"), result_folder, scene)
    elif cameras.is_file():
        scene.views += [_imported_view(camera, result_folder) for camera in _read(cameras)["views"]]
    else:
        scene.messages.append("cameras are not shown: measure here, not outside Slicer, to have them")
    if brings_cameras or registration.is_file():
        _models(case, _read(registration), case_folder, scene)
    return scene
