// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

exchange::RunGeometry geometry_of(const Sweep& sweep) {
  exchange::RunGeometry run{{}, sweep.detector.image_size, sweep.pixel_known ? sweep.detector.pixel_mm : 1};
  for (const SweepFrame& frame : sweep.frames)
    if (frame.best) run.images.push_back({frame.view, frame.best->view});
  return run;
}

using Writer = Expected<std::string> (*)(const exchange::RunGeometry&);

/// A writer of text that cannot fail.
template <std::string (*write)(const exchange::RunGeometry&)>
Expected<std::string> always(const exchange::RunGeometry& run) {
  return write(run);
}

constexpr std::array<std::pair<const char*, Writer>, 7> geometry_files{
    {{"rtk.xml", exchange::rtk_geometry},
     {"tigre.json", exchange::tigre_geometry},
     {"leap.json", exchange::leap_modular},
     {"astra.txt", always<exchange::astra_vectors>},
     {"matrices.ompl", always<exchange::ompl_matrices>},
     {"matrices.csv", always<exchange::matrices_csv>},
     {"matrices.npy", always<exchange::matrices_npy>}}};

constexpr const char *about_y = "rtk_axis_y.xml", *to_about_y = "rtk_axis_y.tfm";

/// The run's axis becomes y, upwards in the images, its isocentre the origin.
geometry::RigidTransform about_y_from_calibrator(const SweepPath& path, const exchange::RunGeometry& run) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const exchange::RunGeometry::Image& image : run.images)
    up -= image.view.camera_from_world.rotation.row(1);
  const Eigen::Vector3d axis = path.axis->dot(up) < 0 ? Eigen::Vector3d(-*path.axis) : *path.axis;
  const Eigen::Matrix3d turn = geometry::rotation_between(axis, Eigen::Vector3d::UnitY());
  return {turn, -turn * path.isocentre};
}

/// For programs that weight the images by their angles about y: cameras, and the transform into their world.
void write_about_y(const SweepPath& path, exchange::RunGeometry run, const std::filesystem::path& folder) {
  const geometry::RigidTransform from_calibrator = about_y_from_calibrator(path, run);
  for (exchange::RunGeometry::Image& image : run.images)
    image.view.camera_from_world = image.view.camera_from_world * from_calibrator.inverse();
  value_or_throw(write_file(folder / about_y, value_or_throw(exchange::rtk_geometry(run))));
  value_or_throw(write_file(folder / to_about_y, exchange::itk_transform_text(from_calibrator)));
}

/// plastimatch reads a folder of files in the order of their names.
std::string plastimatch_name(std::size_t image) { return fmt::format("{:04d}.txt", image + 1); }

std::vector<std::string> plastimatch_files(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < pipeline::most_frames; ++i)
    if (std::error_code ignored; std::filesystem::exists(folder / plastimatch_name(i), ignored))
      names.push_back(plastimatch_name(i));
  return names;
}

std::string csv_number(const std::optional<double>& value) {
  return value ? fmt::format(",{:.9g}", *value) : ",";
}

std::string csv_vector(const std::optional<Eigen::Vector3d>& values) {
  std::string fields;
  for (Eigen::Index k = 0; k < 3; ++k)
    fields += csv_number(values ? std::optional((*values)[k]) : std::nullopt);
  return fields;
}

/// Of the path, or of the image's own camera: source, detector, rotation.
std::string csv_deviation(const std::optional<CameraVector>& deviation) {
  if (!deviation) return std::string(9, ',');
  const Eigen::Vector3d rotation_deg = deviation->segment<3>(6) * (180 / EIGEN_PI);
  return csv_vector(Eigen::Vector3d(deviation->head<3>())) +
         csv_vector(Eigen::Vector3d(deviation->segment<3>(3))) + csv_vector(rotation_deg);
}

/// The report's curves: a line per image.
std::string frames_csv(const Sweep& sweep) {
  std::string csv =
      "frame,view,code,primary_deg,secondary_deg,path_angle_deg,fiducials_used,reprojection_rms_px,off_path_"
      "sigma,source_x_mm,source_y_mm,source_z_mm,source_x_sigma_mm,source_y_sigma_mm,source_z_sigma_mm";
  for (const char* of : {"path", "own"})
    for (const char* what : {"source_{}_mm", "detector_{}_mm", "rotation_{}_deg"})
      for (const char* axis : {"u", "v", "w"})
        csv += fmt::format(",{}_", of) + fmt::format(fmt::runtime(what), axis);
  csv += "\n";
  for (const SweepFrame& frame : sweep.frames) {
    csv += fmt::format("{},{},{}", frame.number, csv_field(frame.view),
                       frame.failure ? code(frame.failure->reason) : "");
    csv += csv_number(frame.primary_angle_deg) + csv_number(frame.secondary_angle_deg) +
           csv_number(frame.path_angle_deg) + fmt::format(",{}", frame.fiducials_used);
    std::optional<double> rms;
    std::optional<Eigen::Vector3d> source, sigma;
    if (frame.best) {
      rms = frame.best->reprojection_rms_px;
      source = frame.best->view.source_in_world();
      sigma = calibration::source_covariance(*frame.best).diagonal().cwiseSqrt();
    }
    csv += csv_number(rms) + csv_number(frame.off_path_sigma) + csv_vector(source) + csv_vector(sigma) +
           csv_deviation(frame.best ? frame.flex : std::nullopt) +
           csv_deviation(frame.best ? frame.own : std::nullopt) + "\n";
  }
  return csv;
}

void remove_if_empty(const std::filesystem::path& folder) {
  std::error_code ignored;
  if (std::filesystem::is_directory(folder, ignored) && std::filesystem::is_empty(folder, ignored))
    std::filesystem::remove(folder, ignored);
}

}  // namespace

void forget_sweep(const std::filesystem::path& folder) {
  std::vector<std::string> names{about_y, to_about_y};
  for (const auto& [name, writer] : geometry_files) names.emplace_back(name);
  forget_files(folder / "geometry", names);
  const std::filesystem::path plastimatch = folder / "geometry" / "plastimatch";
  forget_files(plastimatch, plastimatch_files(plastimatch));
  remove_if_empty(plastimatch);
  remove_if_empty(folder / "geometry");
  forget_files(folder, std::vector<std::string>{"check.csv", "frames.csv", "report.html", "sweep.json"});
}

Expected<void> write_sweep(const Sweep& sweep, const std::filesystem::path& folder) {
  return guarded([&] {
    if (!sweep.failure) {
      const exchange::RunGeometry run = geometry_of(sweep);
      for (const auto& [name, writer] : geometry_files)
        value_or_throw(write_file(folder / "geometry" / name, value_or_throw(writer(run))));
      for (std::size_t i = 0; i < run.images.size(); ++i)
        value_or_throw(write_file(folder / "geometry" / "plastimatch" / plastimatch_name(i),
                                  exchange::plastimatch_matrix(run.images[i].view, run.pixel_mm)));
      if (sweep.path && sweep.path->axis) write_about_y(*sweep.path, run, folder / "geometry");
    }
    value_or_throw(write_file(folder / "frames.csv", frames_csv(sweep)));
    if (sweep.check) value_or_throw(write_file(folder / "check.csv", check_csv(*sweep.check)));
    value_or_throw(write_file(folder / "report.html", sweep_report(sweep)));
    value_or_throw(write_file(folder / "sweep.json", to_text(to_json(sweep)) + "\n"));
  });
}

}  // namespace helicarm::sweep
