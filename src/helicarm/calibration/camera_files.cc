// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/camera_files.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "helicarm/exchange/import_matrix.h"
#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::calibration {
namespace {

constexpr Range camera_numbers{-1e15, 1e15};

/// One view of a file: the whole file, and the view's index in it.
struct Camera {
  const SavedCalibration* file;
  std::size_t index = 0;
};

SavedCalibration one_view(CalibratedView view) {
  SavedCalibration one;
  one.joint_covariance = view.covariance.isZero(0) ? Eigen::MatrixXd() : Eigen::MatrixXd(view.covariance);
  one.views.push_back(std::move(view));
  one.maps.emplace_back();
  one.fiducials.emplace_back();
  return one;
}

/// Printed by `helicarm solve --json`.
SavedCalibration from_solve(const Json& json, const std::string& origin) {
  JsonReader reader(json, origin);
  CalibratedView view;
  const geometry::RigidTransform pose =
      geometry::exact_pose_from(reader, "camera_from_world", camera_numbers);
  const auto numbers = reader.matrix("projection", 3, 4, camera_numbers);
  const geometry::Projection projection =
      Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(numbers.data());
  view.view = value_or_throw(geometry::decompose(projection, pose.inverse() * Eigen::Vector3d::UnitZ()));
  view.dlt = geometry::factors_from_projection(projection);
  view.reprojection_rms_px = reader.optional_number("reprojection_rms_px", camera_numbers).value_or(0);
  if (reader.has("covariance"))
    view.covariance = Eigen::Map<const ViewCovariance>(
        reader.matrix("covariance", view_parameters, view_parameters, camera_numbers).data());
  for (const char* other : {"dlt", "intrinsics", "covariance", "condition", "warnings"}) reader.raw(other);
  reader.finish();
  return one_view(std::move(view));
}

SavedCalibration from_file(const std::filesystem::path& path) {
  const std::string origin = path.filename().string();
  const auto json = read_json(path);
  if (!json && json.error().reason == Reason::missing_file) throw BadInput(json.error());
  if (json && json->is_object() && json->contains("format"))
    return value_or_throw(saved_calibration_from_json(*json, origin));
  if (json && json->is_object() && json->contains("camera_from_world")) return from_solve(*json, origin);
  CalibratedView view;
  view.view = value_or_throw(exchange::import_matrix(path)).view;
  view.dlt = geometry::factors_from_projection(view.view.projection());
  return one_view(std::move(view));
}

Camera camera_in(const CameraFile& camera_file, const SavedCalibration& file) {
  const auto found = std::ranges::find(file.views, camera_file.view, &CalibratedView::name);
  if (found != file.views.end()) return {&file, std::size_t(found - file.views.begin())};
  if (file.views.size() == 1) return {&file, 0};
  std::vector<std::string> names;
  for (const CalibratedView& view : file.views) names.push_back(view.name);
  throw BadInput(Reason::bad_value,
                 fmt::format("{}: has no view \"{}\"; its views are {}", camera_file.path.filename().string(),
                             camera_file.view, fmt::join(names, ", ")));
}

/// Independent between files; joint among the views of one file. Empty if all have none.
Eigen::MatrixXd covariance_of(const std::vector<Camera>& cameras) {
  const auto size = view_parameters * Eigen::Index(cameras.size());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(size, size);
  const auto at = [](std::size_t index) { return view_parameters * Eigen::Index(index); };
  for (std::size_t i = 0; i < cameras.size(); ++i)
    for (std::size_t j = 0; j < cameras.size(); ++j)
      if (cameras[i].file == cameras[j].file && cameras[i].file->joint_covariance.size() > 0)
        joint.block<view_parameters, view_parameters>(at(i), at(j)) =
            cameras[i].file->joint_covariance.block<view_parameters, view_parameters>(at(cameras[i].index),
                                                                                      at(cameras[j].index));
  return joint.isZero(0) ? Eigen::MatrixXd() : joint;
}

}  // namespace

Expected<CameraFile> camera_file_from(const std::string& word) {
  const std::size_t equals = word.find('=');
  if (equals == word.npos || equals == 0 || equals + 1 == word.size())
    return fail(Reason::usage, fmt::format("--calibration: \"{}\" is not VIEW=FILE", word));
  return CameraFile{word.substr(0, equals), word.substr(equals + 1)};
}

Expected<SavedCalibration> calibration_of_cameras(std::span<const CameraFile> files) {
  return guarded([&] {
    std::map<std::filesystem::path, SavedCalibration> read;
    std::vector<Camera> cameras;
    SavedCalibration joined;
    for (const CameraFile& camera_file : files) {
      if (std::ranges::count(files, camera_file.view, &CameraFile::view) > 1)
        throw BadInput(Reason::name_clash,
                       fmt::format("--calibration: two files for the view \"{}\"", camera_file.view));
      std::error_code ignored;
      const std::filesystem::path same = std::filesystem::weakly_canonical(camera_file.path, ignored);
      const auto [known, is_new] = read.try_emplace(ignored ? camera_file.path : same);
      if (is_new) known->second = from_file(camera_file.path);
      cameras.push_back(camera_in(camera_file, known->second));
      const auto& [file, index] = cameras.back();
      joined.views.push_back(file->views[index]);
      joined.views.back().name = camera_file.view;
      joined.maps.push_back(file->maps[index]);
      joined.fiducials.push_back(index < file->fiducials.size() ? file->fiducials[index]
                                                                : std::vector<fiducials::Fiducial>{});
      if (joined.balls.empty()) joined.balls = file->balls;
    }
    joined.joint_covariance = covariance_of(cameras);
    return joined;
  });
}

}  // namespace helicarm::calibration
