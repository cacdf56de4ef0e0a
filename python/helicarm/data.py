# SPDX-License-Identifier: Apache-2.0
"""Registration, DRR, sweep and track: of a case's folder, or of arrays in memory."""
import operator
import os
import pathlib
import re
import reprlib
import tempfile
from collections.abc import Mapping

import numpy as np

from . import _helicarm as _c
from .arrays import _named, as_camera, as_image, as_images, as_model, as_volume
from .errors import InputError, RefusedError
from .results import MigrationAnswer, RegistrationAnswer, SequenceAnswer


def _called(function, call, *arguments, **options):
    """call(...), whose TypeError is that of the function which the caller knows."""
    try:
        return call(*arguments, **options)
    except TypeError as error:
        if f"{call.__name__}(): incompatible function arguments" not in str(error):
            raise
        known = set(re.findall(r"(\w+): ", (call.__doc__ or "").split("\n")[0]))
        unknown = [name for name in options if name not in known]
        said = ", ".join(f"{name}={reprlib.repr(value)}" for name, value in options.items() if value is not None)
        raise TypeError(f"{function}() got an unexpected keyword argument '{unknown[0]}'" if unknown else
                        f"{function}(): an argument has a wrong type; of the options {said or 'none was given'}") from None


def _answered(function, answer, call, *arguments, **options):
    try:
        return answer(_called(function, call, *arguments, **options))
    except RefusedError as error:
        if isinstance(error.result, dict):
            error.result = answer(error.result)
        raise


def _one_of(function, folder, given):
    named = [name for name, value in given.items() if value is not None]
    if (folder is not None) == bool(named):
        raise InputError("usage", f"{function}: give the folder of a case, or {', '.join(given)}" if folder is None else
                         f"{function}: a folder is given, which states {', '.join(named)} itself")


def drr(volume, camera, *, shape=None, values="hu", threads=0):
    """Line integrals of a volume's attenuation (1) from the source to each pixel, as `helicarm drr` computes them.

    volume: Volume or what as_volume takes. camera: Camera of the patient frame (LPS, mm) or what as_camera takes, or a list
    of them. shape: (height, width); the cameras' own where None. values: "hu" (water 0.02059 / mm, 0 below -800 HU) or
    "raw". Releases the GIL. Returns (height, width) float32, or (n, height, width) of a list.
    Warns (UserWarning, not_hounsfield) of "hu" whose values are hardly Hounsfield units.
    Raises InputError: bad_value for a source inside the volume and for a mask, bad_size, usage.
    """
    several = isinstance(camera, list)
    cameras = [as_camera(each) for each in (camera if several else [camera])]
    if shape is None:
        if not cameras:
            raise InputError("bad_value", "camera: the list is empty")
        shapes = {each.shape for each in cameras}
        if len(shapes) != 1 or None in shapes:
            raise InputError("usage", "shape: is missing, and the cameras do not state one")
        shape = shapes.pop()
    try:
        height, width = map(operator.index, shape)
    except (TypeError, ValueError):
        raise InputError("bad_value", f"shape: {shape!r} is not (height, width) in whole pixels") from None
    images = _called("drr", _c._drr, as_volume(volume), cameras, (height, width), values, threads=threads)
    return images if several else images[0]


def _write_nrrd(path, volume):
    numbers = [",".join(repr(float(x)) for x in column) for column in volume.affine[:3].T]
    path.write_bytes(("NRRD0004\ntype: float\ndimension: 3\nspace: left-posterior-superior\n"
                      f"sizes: {' '.join(map(str, volume.shape))}\nspace directions: ({numbers[0]}) ({numbers[1]}) ({numbers[2]})\n"
                      f"space origin: ({numbers[3]})\nendian: little\nencoding: raw\n\n").encode()
                     + volume.array.astype("<f4").tobytes("F"))
    return path


def segment(ct, seeds=None, *, label_map=None, voxel_mm=None, tiff_offset_hu=0.0, **options):
    """Masks and surfaces of the bones of a CT, by one point on each, as `helicarm segment` makes them.

    segment(ct, seeds={}, *, space="LPS", threshold_hu=None, gap_mm, neck, label_map=None, labels={}, voxel_mm=None,
    tiff_offset_hu=0, out=None, progress=None)
      ct, label_map: a file (MetaImage, NRRD, NIfTI-1, TIFF stack with voxel_mm and tiff_offset_hu) or a folder of DICOM
        slices, or what as_volume takes: a Volume, or an object of nibabel, SimpleITK, ITK or pydicom.
      seeds: {name: (x, y, z)} in the volume's patient frame, mm; space: of the seeds, "LPS", "RAS" or "LAS". threshold_hu:
        bone is what has at least this value; None: 200, more in a noisy CT. gap_mm: gaps of the cortex up to twice this
        width do not open the marrow cavity. neck: parts are one bone where the neck between them has at least this share of
        the smaller part's radius, or two thirds of that where the neck is long. label_map, labels: instead of seeds, a label
        map on the CT's grid and {name: [label, ...]}. out: folder for the masks (NRRD), surfaces (STL), segment.png and
        segment.json, or None. progress: called with the name of each step; an exception from it ends the work.
    Returns segment.json (threshold_hu, bones with volume_cm3, surface_cm2, centre_mm, box_mm, cut_off, contacts; warnings,
    notes) and labels: (z, y, x) bytes with each bone's label, 0 elsewhere; .transpose(2, 1, 0) is on the grid of a Volume.
    Raises InputError, and RefusedError for a seed on no bone and for two seeds on one.
    """
    def is_file(given):
        return given is None or isinstance(given, (str, os.PathLike))

    if not is_file(ct) and (voxel_mm is not None or tiff_offset_hu):
        raise InputError("usage", "segment: voxel_mm and tiff_offset_hu are for a TIFF stack; a volume states its own")
    with tempfile.TemporaryDirectory() as folder:
        ct, label_map = (given if is_file(given) else _write_nrrd(pathlib.Path(folder) / name, as_volume(given))
                         for given, name in ((ct, "ct.nrrd"), (label_map, "label_map.nrrd")))
        return _called("segment", _c.segment, ct, _mapping("seeds", seeds, "{name: (x, y, z)}"), label_map=label_map,
                       voxel_mm=voxel_mm, tiff_offset_hu=tiff_offset_hu, **options)


def _mapping(what, given, form):
    if given is None or isinstance(given, Mapping):
        return given or {}
    raise InputError("usage", f"{what}: {type(given).__name__} is not {form}")


def _views_of(views):
    """[(name, image or images, camera)]."""
    named = list(views.items() if isinstance(views, Mapping) else ((f"V{i}", pair) for i, pair in enumerate(views, 1)))
    for name, pair in named:
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError("usage", f"views: {name}: {type(pair).__name__} is not (image, camera)")
    return [(name, *pair) for name, pair in named]


def _cameras_of(views, covariance):
    """[(Camera, DistortionMap or None)], and the covariance of calibrated views."""
    cameras, held = [], []
    for name, _, camera in views:
        if isinstance(camera, _c.Calibration):
            camera = (camera, name)
        if isinstance(camera, (tuple, list)) and len(camera) == 2 and isinstance(camera[0], _c.Calibration):
            calibration, view = camera
            cameras.append((as_camera((calibration, view)), calibration.map(view)))
            held.append((calibration, view if isinstance(view, int) else calibration.names.index(view)))
        else:
            cameras.append((_named(as_camera, camera, f"views: {name}"), None))
    one = len(held) == len(views) and all(calibration is held[0][0] for calibration, _ in held)
    if covariance is None and one and held[0][0].joint_covariance.size:
        rows = np.concatenate([np.arange(11 * i, 11 * i + 11) for _, i in held])
        covariance = held[0][0].joint_covariance[np.ix_(rows, rows)]
    return cameras, covariance


def register(folder=None, *, models=None, views=None, starts=None, camera_covariance=None, usable=None, **options):
    """Registers CT volumes and surfaces to X-ray images: of a case, or of arrays.

    register(folder, *, out=None, dicom=False, method="best", max_error_mm=None, motion_sigma_mm=0, search_mm, search_deg, threads=0,
    history=None, cache=True, progress=None): the models of a case, as `helicarm register` does.

    register(models={name: model}, views={name: (image, camera)}, starts={name: world_from_model}, ...): in memory.
      model: what as_volume or as_surface takes, or a dict of "volume" with "mask" (a volume, or an array of the volume's
        shape, what is not 0 is the body) or "window_hu" (low, high), or "surface", and "scale_sigma" (relative), and
        "points" {name: (x, y, z)}: planned points, carried into the world. Model coordinates: L, P, S, mm.
      image: what as_image takes, metal dark; of floats an XrayImage, which states their range. Free of distortion unless its
        camera has a map.
      camera: what as_camera takes, all of one world; or a Calibration, whose view of that name is used with its map, and
        whose covariance then counts. Views may also be a list of pairs.
      starts: 4 x 4 (rigid, mm) or a list of them for each model; without, two views or more are searched everywhere.
      camera_covariance: (11 n, 11 n) of the cameras, as Calibration.joint_covariance; None: taken as exact, with a warning.
      usable: {view: (height, width) bool}, False where fiducials, plate dots or tools are.
      out, max_error_mm, motion_sigma_mm, search_mm, search_deg, threads, progress: as of a case.

    Returns the content of registration.json: ["models"][i]["world_from_model"], "covariance" (6 x 6: rotation vector in
    rad, then mm, world axes, about centre_mm), "decision", ...; each model also has .world_from_model, .covariance,
    .rotation (SciPy) and .points {name: {"xyz_mm", "covariance_mm2", "error_95_mm"}}, the whole .to_frame() (pandas). World: the calibrator's frame, or that of the cameras.
    Releases the GIL; progress is called with the name of each step before it begins and, if it has a parameter share
    (def progress(step, share=None)), with the name and the share, 0 to 1, of the searches for all models that is done. An
    exception from it ends the work, and Ctrl-C does.
    Raises InputError; RefusedError if the views or a model are refused, with all that was computed in .result.
    """
    given = {"models": models, "views": views, "starts": starts, "camera_covariance": camera_covariance, "usable": usable}
    _one_of("register", folder, given)
    if folder is not None:
        return _answered("register", RegistrationAnswer, _c.register, folder, **options)
    if not models or not views:
        raise InputError("usage", "register: models and views are both required")
    if not isinstance(models, Mapping):
        raise InputError("bad_value", "models: is not {name: model}")
    triples = _views_of(views)
    names = [name for name, _, _ in triples]
    starts = _mapping("starts", starts, "{name of the model: world_from_model}")
    usable = _mapping("usable", usable, "{name of the view: mask}")
    for what, of, known in (("starts", starts, models), ("usable", usable, names)):
        for name in of:
            if name not in known:
                raise InputError("bad_value", f'{what}: there is no "{name}"')
    cameras, covariance = _cameras_of(triples, camera_covariance)
    held = [(name, _named(as_image, image, f"views: {name}", name=name), camera, map_)
            for (name, image, _), (camera, map_) in zip(triples, cameras)]
    poses = {name: list(start) if np.ndim(start) == 3 else [start] for name, start in starts.items()}
    return _answered("register", RegistrationAnswer, _c._register_given,
                     [(name, _named(as_model, model, name)) for name, model in models.items()],
                     poses, held, covariance, [usable.get(name) for name in names], **options)


def check_tunnels(model, tunnels, *, diameter_mm, bridge_mm=None):
    """Planned tunnels against their bone, without images: bridge, length in the bone, entry, exit, angles, distances.

    model: as register takes it: a volume with "mask" or "window_hu", or a surface; "tunnel_mask" in place of the mask: the bone that
    holds the tunnels, of a model of several. tunnels: {name: (start, end)}, (2, 3) L, P, S,
    mm, drilled from the start. diameter_mm, bridge_mm (bone that the wall should keep; None: as of a case): of all, or {name:
    value}.
    Releases the GIL. Returns {name: bone_check} as in registration.json: "bridge_mm", "bridge_sigma_mm", "length_in_bone_mm",
    "entry_mm", "exit_mm", "entry_angle_deg", "end_mm", "least_sure", "breach", "thin", "to_tunnels", ... The error of a registration is no part
    of it: "breach" is that of the surface's own error. Raises InputError: bad_value, usage, and as register of a model.
    """
    def of(name, value, what):
        if not isinstance(value, Mapping):
            return value
        if name not in value:
            raise InputError("bad_value", f'{what}: there is none of "{name}"')
        return value[name]

    tunnels = _mapping("tunnels", tunnels, "{name: (start, end)}")
    if isinstance(model, Mapping) and "tunnel_mask" in model:
        model = dict(model)
        if (bone := model.pop("tunnel_mask")) is not None:
            model = {**model, "mask": bone, "window_hu": None}
    return _called("check_tunnels", _c._check_tunnels, as_model(model),
                   [(name, ends, of(name, diameter_mm, "diameter_mm"), of(name, bridge_mm, "bridge_mm")) for name, ends in tunnels.items()])


def register_sequence(folder, frames, **options):
    return _answered("register_sequence", SequenceAnswer, _c.register_sequence, folder, frames, **options)


def migration(first, second, **options):
    return MigrationAnswer(_called("migration", _c.migration, first, second, **options))


def sweep(folder=None, *, images=None, calibrator=None, plate=None, pixel_mm=None, source_detector_mm=None, range=None,
          mirrored=None, **options):
    """Calibrates every image of a rotation or tomosynthesis and all of them on one path: of a case, or of arrays.

    sweep(folder, *, path=None, check=None, wire=None, against=None, history=None, threads=0, progress=None): folder holds case.json, whose view has "frames".

    sweep(images=..., calibrator=..., ...): images: (n, height, width) array, or a list of arrays, XrayImages, paths or pydicom
    datasets, in the order of the path. calibrator: Calibrator, its path, or "udcsc". plate: Plate, its path or "plate48", seen
    in every image; None for a flat panel. pixel_mm, source_detector_mm, range: of arrays, as XrayImage has them. mirrored:
    what the C-arm is known to do.

    path: "smooth", "free" or None (smooth for 16 or more images of one run). check: "FDK" reconstructs balls and a wire with
    plastimatch, with these cameras and with the ideal circle; .check holds their widths. wire: its two ends, mm, calibrator
    frame. against: file of another program's cameras, compared too. history: a C-arm's record, whose maps rectify images without a
    plate by their angles. progress: called with the share of the images
    that are done; an exception from it ends the run, and Ctrl-C does. Releases the GIL. Returns a Sweep.
    Raises InputError; RefusedError with .result if the run as a whole is refused.
    """
    given = {"images": images, "calibrator": calibrator, "plate": plate, "pixel_mm": pixel_mm,
             "source_detector_mm": source_detector_mm, "range": range, "mirrored": mirrored}
    _one_of("sweep", folder, given)
    if folder is not None:
        return _called("sweep", _c.sweep, folder, **options)
    if images is None or calibrator is None:
        raise InputError("usage", "sweep: images and calibrator are both required")
    stated = {"pixel_mm": pixel_mm, "source_detector_mm": source_detector_mm, "range": range}
    return _called("sweep", _c._sweep_images, as_images(images, "images", **stated),
                   _loaded(calibrator, _c.Calibrator, "udcsc", "calibrator"), _loaded(plate, _c.Plate, "plate48", "plate"),
                   mirrored=mirrored, **options)


def _loaded(given, kind, built_in, what):
    if given is None or isinstance(given, kind):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise InputError("usage", f'{what}: {type(given).__name__} is neither a {kind.__name__}, a path nor "{built_in}"')
    return getattr(kind, built_in)() if given == built_in else kind.load(given)


def track(case=None, *, frames=None, views=None, picks=None, diameter_mm=None, bodies=None, frame_rate_hz=None,
          camera_covariance=None, axes=None, corrections=None, **options):
    """Follows markers and bodies through a sequence: of a case, or of arrays.

    track(case, *, frames="A-B[:STEP]", out=None, resume=False, axes=None, butterworth_hz=None, progress=None): case: folder that holds case.json; the markers
    are picked in frame A. out: folder for all files, whose rows are written as they are computed. resume: go on after the
    frames of an interrupted run in `out`. picks: path of XMALab's 2-D points, whose first frame are the picks; points: likewise, whose
    points of all frames are placed as they are, without images; points_first, points_from_one, points_y_up, points_undistorted,
    points_sigma: as the program's options.

    track(views={name: (images, camera)}, picks={marker: {view: (u, v)}}, diameter_mm=...): in memory.
      images: (n, height, width) array, or a list of arrays, XrayImages, paths or pydicom datasets, as many in every view,
        metal dark; frame i of all views is one moment. camera: as register takes it.
      picks: raw pixels in the first frame, each marker in one view or more. diameter_mm: of the markers, 0.1 to 30.
      corrections: {frame: {marker: {view: (u, v)}}} of frames 2 to n: the marker is at the nearest disc there, and is followed
        from it on. Of a case: picks of later frames in case.json.
      bodies: {name: [markers]}, or {name: {marker: (x, y, z)}} where the body's geometry is known, mm.
      axes: {body: 3 x 3} of two bodies or more, columns x (right), y (anterior), z (proximal) in the first frame's
        world: joint angles against the first one; 3 x 4 with the origin, mm: joint translations too. Of a case: the path of
        a CSV body,axis,x,y,z, or of 3D Slicer's markups.
      butterworth_hz, butterworth_order=4: cut-off and order (2 or 4, of both passes) of places filtered as motion
        laboratories do, for comparison; frame_rate_hz is then required.
      frame_rate_hz, out, progress: as of a case; camera_covariance: as register takes it.

    progress: called with the share of the frames that are done; an exception from it ends the run, and Ctrl-C does.
    Releases the GIL. Returns a Track. Raises InputError; RefusedError if the picks contradict each other or the geometry.
    """
    if case is not None and isinstance(picks, (str, os.PathLike)):
        options["picks"], picks = picks, None
    given = {"views": views, "picks": picks, "diameter_mm": diameter_mm, "bodies": bodies, "frame_rate_hz": frame_rate_hz,
             "camera_covariance": camera_covariance}
    _one_of("track", case, {**given, "corrections": corrections})
    if case is not None:
        if frames is None:
            raise InputError("usage", "track: frames is missing, such as frames=\"1-100\"")
        return _called("track", _c.track, case, frames=frames, axes=axes, **options)
    if views is None or not picks or diameter_mm is None or frames is not None:
        raise InputError("usage", "track: views, picks and diameter_mm are required; frames is for a case")
    triples = _views_of(views)
    if len(triples) < 2:
        raise RefusedError("too_few_views", "track: markers are located in two views or more")
    cameras, covariance = _cameras_of(triples, camera_covariance)
    stacks = {name: as_images(images, f"views: {name}", name=name) for name, images, _ in triples}
    counts = {name: len(images) for name, images in stacks.items()}
    if len(set(counts.values())) != 1 or 0 in counts.values():
        raise InputError("bad_size", f"views: numbers of images differ or are 0: {counts}")
    held = [(name, stacks[name], camera, map_) for (name, _, _), (camera, map_) in zip(triples, cameras)]
    picks = _mapping("picks", picks, "{marker: {view: (u, v)}}")
    corrections = _mapping("corrections", corrections, "{frame: {marker: {view: (u, v)}}}")
    axes, bodies = _mapping("axes", axes, "{body: axes}"), _mapping("bodies", bodies, "{body: markers}")
    names, markers = list(counts), list(picks)

    def place_of(given, what):
        place = np.ma.filled(np.ma.asarray(given, float), np.nan)
        if place.shape != (2,):
            raise InputError("bad_value", f"{what}: shape {place.shape} is not (2,): u, v")
        if not np.isfinite(place).all():
            raise InputError("not_finite", f"{what}: ({place[0]:g}, {place[1]:g}) is not finite; leave out what is not seen")
        return map(float, place)

    def flattened(places_of, what, *frame):
        made = []
        for marker, places in places_of.items():
            if marker not in markers:
                raise InputError("bad_value", f'{what}: "{marker}" has no pick in the first frame')
            for view, uv in _mapping(f"{what}: {marker}", places, "{view: (u, v)}").items():
                if view not in counts:
                    raise InputError("bad_value", f'{what}: "{marker}": there is no view "{view}"')
                u, v = place_of(uv, f"{what}: {marker}: {view}")
                made.append((markers.index(marker), names.index(view), *frame, u, v))
        return made
    last = next(iter(counts.values()))
    for frame in corrections:
        if not isinstance(frame, (int, np.integer)) or not 2 <= frame <= last:
            raise InputError("bad_value", f"corrections: frame {frame!r}: they are of frames 2 to {last}, picks of the first")
    later = [each for frame, of in corrections.items() for each in flattened(of, "corrections", int(frame))]
    for name in axes:
        if name not in bodies:
            raise InputError("bad_value", f'axes: "{name}" is no body')
    held_axes = [(list(bodies).index(name), np.array(matrix, float)) for name, matrix in axes.items()]
    return _called("track", _c._track_images, held, covariance, markers, flattened(picks, "picks"), _bodies_of(bodies, markers),
                   axes=held_axes, diameter_mm=diameter_mm, frame_rate_hz=frame_rate_hz, corrections=later, **options)


def _bodies_of(bodies, markers):
    plans, taken = [], set()
    for name, members in bodies.items():
        if not name or name.startswith(".") or "/" in name or os.sep in name:
            raise InputError("bad_value", f'bodies: "{name}" is no file name: NAME.tra is written')
        for marker in members:
            if marker not in markers:
                raise InputError("bad_value", f'bodies: "{name}": "{marker}" has no pick')
            if marker in taken:
                raise InputError("name_clash", f'bodies: "{marker}" is given twice')
            taken.add(marker)
        places = np.array(list(members.values()), float) if isinstance(members, Mapping) else None
        plans.append((name, [markers.index(marker) for marker in members], places))
    return plans


register_sequence.__doc__, migration.__doc__ = _c.register_sequence.__doc__, _c.migration.__doc__
