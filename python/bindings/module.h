// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "failures.h"

namespace helicarm::python {

/// XrayImage, read_image, detect.
void add_images(py::module_& module);
/// Calibrator, Plate.
void add_phantom(py::module_& module);
/// DistortionMap, Rectification, rectify.
void add_rectification(py::module_& module);
/// IntrinsicsPrior, CArmPrior, ViewPoints, label.
void add_view_points(py::module_& module);
/// LocatedPoint.
void add_points(py::module_& module);
/// calibrate, Calibration.
void add_calibration(py::module_& module);
/// measure.
void add_measures(py::module_& module);
/// run_case, Result, simulate_case.
void add_cases(py::module_& module);
/// register, register_sequence.
void add_registration(py::module_& module);
/// add_to_c_arm, check_c_arm, c_arm_report.
void add_c_arm(py::module_& module);
/// Volume, read_volume, drr.
void add_volume(py::module_& module);
/// Surface, read_surface.
void add_surface(py::module_& module);
/// Camera, import_camera, import_transform, solve.
void add_camera(py::module_& module);
/// register, sweep with arrays.
void add_in_memory(py::module_& module);
/// Session.
void add_session(py::module_& module);
/// new_case, bundle, schema, Result.export.
void add_files(py::module_& module);
/// sweep, Sweep.
void add_sweep(py::module_& module);
/// track, Track.
void add_track(py::module_& module);
/// migration.
void add_migration(py::module_& module);
/// segment.
void add_segmentation(py::module_& module);
/// measure_phantom, MeasuredPhantom, verify_phantom.
void add_phantom_calibration(py::module_& module);

}  // namespace helicarm::python
