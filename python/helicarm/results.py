# SPDX-License-Identifier: Apache-2.0
"""What results offer beside their numbers: SciPy rotations, pandas frames, pickles. Neither package is required."""
import copyreg

import numpy as np

from . import _helicarm as _c

_AXES = "xyz"


def rotation_of(matrices):
    """A scipy.spatial.transform.Rotation of (3 or 4, 3 or 4) or (N, ., .) matrices."""
    try:
        from scipy.spatial.transform import Rotation
    except ImportError as error:
        raise ImportError("rotation: SciPy is not installed (Debian: python3-scipy)") from error
    return Rotation.from_matrix(np.array(matrices, float)[..., :3, :3].copy())


def frame_of(rows, columns=None):
    """A pandas.DataFrame of dicts."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("to_frame: pandas is not installed (Debian: python3-pandas)") from error
    return pandas.DataFrame(rows, columns=columns)


def _pose_columns(matrix):
    """A pose with the names of the CSV files: m11 to m44, by rows."""
    values = np.full((4, 4), np.nan) if matrix is None else np.asarray(matrix, float)
    return {f"m{row + 1}{column + 1}": float(values[row, column]) for row in range(4) for column in range(4)}


def _sigma_columns(covariance):
    sigma = np.full(6, np.nan) if covariance is None else np.sqrt(np.diag(np.asarray(covariance, float)))
    return {**{f"sigma_r{axis}_deg": float(np.degrees(sigma[i])) for i, axis in enumerate(_AXES)},
            **{f"sigma_{axis}_mm": float(sigma[3 + i]) for i, axis in enumerate(_AXES)}}


class RegisteredModel(dict):
    """A model of registration.json."""

    @property
    def world_from_model(self):
        """(4, 4), mm."""
        return np.array(self["world_from_model"])

    @property
    def rotation(self):
        """scipy.spatial.transform.Rotation of world_from_model."""
        return rotation_of(self["world_from_model"])

    @property
    def points(self):
        """{name: {"xyz_mm", "covariance_mm2", "error_95_mm", ...}} of the planned points, in the world."""
        return {point["name"]: {key: np.array(value) if key in ("xyz_mm", "covariance_mm2") else value
                                for key, value in point.items()} for point in self["points"]}

    @property
    def covariance(self):
        """(6, 6): rotation vector in rad, then mm, world axes, about centre_mm; NaN where it is not determined."""
        return np.full((6, 6), np.nan) if self["covariance"] is None else np.array(self["covariance"])


class _ModelsAnswer(dict):
    """A dict whose "models" are of the class `_Model`."""

    _Model = dict

    def __init__(self, content):
        super().__init__(content, models=[self._Model(model) for model in content["models"]])

    def __reduce__(self):
        return type(self), (dict(self),)

    @property
    def models(self):
        """{name: model}"""
        return {model["name"]: model for model in self["models"]}


class RegistrationAnswer(_ModelsAnswer):
    """The content of registration.json."""

    _Model = RegisteredModel

    def to_frame(self):
        """pandas.DataFrame, a row for each model: name, decision, pose and standard deviations as in registration.csv."""
        return frame_of([{"name": model["name"], "decision": model["decision"], **_pose_columns(model["world_from_model"]),
                          **_sigma_columns(model["covariance"])} for model in self["models"]])


class ModelSequence(dict):
    """The poses of a model through a sequence."""

    @property
    def rotation(self):
        """scipy.spatial.transform.Rotation, N."""
        return rotation_of(self["world_from_model"])


class SequenceAnswer(_ModelsAnswer):
    """The answer of register_sequence."""

    _Model = ModelSequence

    def to_frame(self):
        """pandas.DataFrame, a row for each frame and model, as registration.csv."""
        return frame_of([{"frame": frame, "model": model["name"], "decision": model["decision"][i],
                          **_pose_columns(model["world_from_model"][i]), **_sigma_columns(model["covariance"][i]),
                          "refused": model["refused"][i]}
                         for i, frame in enumerate(self["frames"]) for model in self["models"]])


class MigrationAnswer(dict):
    """The content of migration.json."""

    def __reduce__(self):
        return type(self), (dict(self),)

    def to_frame(self):
        """pandas.DataFrame, a row for each body: its six numbers."""
        return frame_of([{"body": body.get("name"), **{f"r{axis}_deg": body["rotation_deg"][i] for i, axis in enumerate(_AXES)},
                          **{f"t{axis}_mm": body["translation_mm"][i] for i, axis in enumerate(_AXES)}}
                         for body in self["bodies"]])


def _point_row(point):
    xyz = np.full(3, np.nan) if point.xyz_mm is None else point.xyz_mm
    covariance = np.full((3, 3), np.nan) if point.covariance_mm2 is None else point.covariance_mm2
    return {"name": point.name, "source": point.source, **{f"{axis}_mm": xyz[i] for i, axis in enumerate(_AXES)},
            **{f"sigma_{axis}_mm": np.sqrt(covariance[i, i]) for i, axis in enumerate(_AXES)},
            "error_95_mm": np.nan if point.error_95_mm is None else point.error_95_mm,
            "reason": None if point.reason is None else point.reason["code"]}


def _result_frame(self):
    """pandas.DataFrame, a row for each point, as points.csv: place, standard deviations, error_95_mm; and reason."""
    return frame_of([_point_row(point) for point in self.points])


def _sweep_frame(self):
    """pandas.DataFrame, a row for each image: frame, accepted, source and its standard deviations, NaN where refused."""
    rows = []
    for i, frame in enumerate(self.frames):
        sigma = np.sqrt(np.diag(self.source_covariances[i]))
        rows.append({"frame": frame, "accepted": self.accepted[i],
                     **{f"source_{axis}_mm": self.sources[i, k] for k, axis in enumerate(_AXES)},
                     **{f"source_sigma_{axis}_mm": sigma[k] for k, axis in enumerate(_AXES)}})
    return frame_of(rows)


def _track_frame(self):
    """pandas.DataFrame, a row for each frame and marker, as markers.csv: place, standard deviations, status."""
    places, sigmas = self.places, np.sqrt(np.diagonal(self.covariances, axis1=2, axis2=3))
    return frame_of([{"frame": frame, "name": name, **{f"{axis}_mm": places[i, m, k] for k, axis in enumerate(_AXES)},
                      **{f"s{axis}_mm": sigmas[i, m, k] for k, axis in enumerate(_AXES)}, "status": self.status[i][m]}
                     for i, frame in enumerate(self.frames) for m, name in enumerate(self.markers)])


def _track_rotation(self, body):
    """scipy.spatial.transform.Rotation of a body's smoothed motion, one for each frame; a frame without a pose is refused."""
    poses = self.smoothed[body]
    if not np.isfinite(poses).all():
        raise ValueError(f'{body}: frames without a pose: choose those of smoothed["{body}"] that are finite')
    return rotation_of(poses)


def _export(self, folder, as_=None, at=None):
    """Files for other programs, as `helicarm export` writes them: as_ lists the formats, None: the usual ones. at: a located
    point, planned point or model, whose depth gives the rectified images their Pixel Spacing.

    Returns the paths. Raises InputError: usage, name_clash, cannot_write; RefusedError where the result is refused.
    """
    return _c._export(self, folder, as_, at)


class Snapshot:
    """A result that was pickled: its values without the methods that need what it was computed from."""

    def __init__(self, kind, values, content=None):
        self.__dict__.update(values, _kind=kind, _content=content)

    def to_dict(self):
        """As of the result."""
        if self._content is None:
            raise AttributeError("to_dict")
        return self._content

    def __reduce__(self):
        values = {name: value for name, value in self.__dict__.items() if not name.startswith("_")}
        return Snapshot, (self._kind, values, self._content)

    def __getattr__(self, name):
        if not name.startswith("_") and hasattr(getattr(_c, self.__dict__.get("_kind", ""), None), name):
            raise AttributeError(f"{self._kind}.{name}: a pickled copy has values, to_dict and to_frame only; call {name} "
                                 "before pickling")
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __repr__(self):
        return f"<{self._kind}: a pickled copy>"


for _kind, _frame in (("Result", _result_frame), ("Sweep", _sweep_frame), ("Track", _track_frame)):
    setattr(Snapshot, f"_{_kind}_frame", _frame)


def _snapshot_frame(self):
    """pandas.DataFrame, as of the result."""
    return getattr(self, f"_{self._kind}_frame")()


Snapshot.to_frame = _snapshot_frame


def _values_of(obj):
    values = {}
    for name in dir(type(obj)):
        if not name.startswith("_") and isinstance(getattr(type(obj), name), property):
            try:
                values[name] = getattr(obj, name)
            except Exception:  # a refused result lacks what was not reached
                continue
    return values


def _reduced(obj):
    content = obj.to_dict() if hasattr(obj, "to_dict") else None
    return Snapshot, (type(obj).__name__, _values_of(obj), content)


def _of_dict(kind, content):
    return kind.from_dict(content)


def install():
    """Adds to the compiled classes what is written in Python."""
    _c.Result.to_frame, _c.Sweep.to_frame, _c.Track.to_frame = _result_frame, _sweep_frame, _track_frame
    _c.Result.export = _export
    _c.Track.rotation = _track_rotation
    _c.Camera.rotation = property(lambda self: rotation_of(self.R), doc="scipy.spatial.transform.Rotation of R.")
    _c.Calibration.rotation = lambda self, view: rotation_of(self.camera_from_calibrator(view))
    _c.Calibration.rotation.__doc__ = "scipy.spatial.transform.Rotation of camera_from_calibrator(view)."
    for kind in (_c.Calibrator, _c.Plate, _c.DistortionMap, _c.Calibration):
        copyreg.pickle(kind, lambda obj: (_of_dict, (type(obj), obj.to_dict())))
    for kind in (_c.Result, _c.ResultPoint, _c.LocatedPoint, _c.Sweep, _c.Track, _c.MeasuredPhantom, _c.Rectification):
        copyreg.pickle(kind, _reduced)
