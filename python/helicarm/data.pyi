# SPDX-License-Identifier: Apache-2.0
from typing import Any, Callable, Mapping, Optional, Sequence, Tuple, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._helicarm import Calibrator, Plate, Sweep, Track, _Pair, _Path
from .results import MigrationAnswer, RegistrationAnswer, SequenceAnswer

# What as_volume, as_surface, as_image and as_camera take.
_Volume = Any
_Model = Any
_Image = Any
_Camera = Any
_Progress = Optional[Callable[..., Any]]
_Views = Union[Mapping[str, Tuple[_Image, _Camera]], Sequence[Tuple[_Image, _Camera]]]

def drr(volume: _Volume, camera: Union[_Camera, list[_Camera]], *, shape: Optional[Tuple[int, int]] = None,
        values: str = "hu", threads: int = 0) -> NDArray[np.float32]: ...
def segment(ct: Union[_Path, _Volume], seeds: Optional[Mapping[str, Sequence[float]]] = None, *, space: str = "LPS",
            threshold_hu: Optional[float] = None, gap_mm: float = ..., neck: float = ...,
            label_map: Union[None, _Path, _Volume] = None, labels: Mapping[str, Sequence[int]] = ...,
            voxel_mm: Optional[Sequence[float]] = None, tiff_offset_hu: float = 0.0, out: Optional[_Path] = None,
            progress: _Progress = None) -> dict[str, Any]: ...
@overload
def register(folder: _Path, *, out: Optional[_Path] = None, method: str = "best", max_error_mm: Optional[float] = None,
             motion_sigma_mm: float = 0, search_mm: float = ..., search_deg: float = ..., threads: int = 0,
             history: Optional[_Path] = None, cache: Union[bool, _Path] = True,
             progress: _Progress = None) -> RegistrationAnswer: ...
@overload
def register(folder: None = None, *, models: Mapping[str, _Model], views: _Views,
             starts: Optional[Mapping[str, ArrayLike]] = None, camera_covariance: Optional[ArrayLike] = None,
             usable: Optional[Mapping[str, NDArray[np.bool_]]] = None, out: Optional[_Path] = None,
             max_error_mm: Optional[float] = None, motion_sigma_mm: float = 0, search_mm: float = ...,
             search_deg: float = ..., threads: int = 0, progress: _Progress = None) -> RegistrationAnswer: ...
def check_tunnels(model: _Model, tunnels: Mapping[str, ArrayLike], *, diameter_mm: Union[float, Mapping[str, float]],
                  bridge_mm: Union[None, float, Mapping[str, float]] = None) -> dict[str, dict[str, Any]]: ...
def register_sequence(folder: _Path, frames: Union[str, Sequence[int]], **options: Any) -> SequenceAnswer: ...
def migration(first: _Path, second: _Path, **options: Any) -> MigrationAnswer: ...
@overload
def sweep(folder: _Path, *, path: Optional[str] = None, check: Optional[str] = None,
          wire: Optional[Sequence[Sequence[float]]] = None, against: Optional[_Path] = None, history: Optional[_Path] = None,
          threads: int = 0, progress: _Progress = None) -> Sweep: ...
@overload
def sweep(folder: None = None, *, images: Sequence[_Image], calibrator: Union[Calibrator, _Path],
          plate: Union[None, Plate, _Path] = None, pixel_mm: Union[None, float, Tuple[float, float]] = None,
          source_detector_mm: Optional[float] = None, range: _Pair = None, mirrored: Optional[bool] = None,
          path: Optional[str] = None, check: Optional[str] = None, wire: Optional[Sequence[Sequence[float]]] = None,
          against: Optional[_Path] = None, threads: int = 0, progress: _Progress = None) -> Sweep: ...
@overload
def track(case: _Path, *, frames: str, out: Optional[_Path] = None, resume: bool = False, axes: Optional[_Path] = None,
          butterworth_hz: Optional[float] = None, butterworth_order: int = ..., picks: Optional[_Path] = None,
          points: Optional[_Path] = None, points_first: int = ..., points_from_one: bool = ..., points_y_up: bool = ...,
          points_undistorted: bool = ..., points_sigma: Optional[float] = None, progress: _Progress = None) -> Track: ...
@overload
def track(case: None = None, *, views: _Views, picks: Mapping[str, Mapping[str, ArrayLike]], diameter_mm: float,
          bodies: Optional[Mapping[str, Union[Sequence[str], Mapping[str, ArrayLike]]]] = None,
          frame_rate_hz: Optional[float] = None, camera_covariance: Optional[ArrayLike] = None,
          out: Optional[_Path] = None, progress: _Progress = None) -> Track: ...
