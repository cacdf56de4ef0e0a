// SPDX-License-Identifier: Apache-2.0
#include <initializer_list>
#include <map>

#include <fmt/format.h>

#include "helicarm/geometry/import_formats.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

/// Texts of an OpenCV file by key; of a matrix its "data".
class OpenCvFile {
 public:
  OpenCvFile(std::string_view text, std::string origin) : origin_(std::move(origin)) {
    const bool xml = text.find("<opencv_storage") != text.npos;
    constexpr std::string_view xml_root = "/opencv_storage", data = "/data";
    for (FileField& field : xml ? xml_fields(text, origin_) : yaml_fields(text, origin_)) {
      std::string key = field.path.substr(xml && field.path.starts_with(xml_root) ? xml_root.size() : 0);
      if (key.ends_with(data))
        texts_[key.substr(0, key.size() - data.size())] = std::move(field.text);
      else
        texts_.emplace(std::move(key), std::move(field.text));
    }
  }

  std::string where(const std::string& key) const { return fmt::format("{}: {}", origin_, key); }

  /// The first of these keys that the file has; else empty.
  std::string key_of(std::initializer_list<const char*> names) const {
    for (const char* name : names)
      if (texts_.contains(std::string("/") + name)) return name;
    return {};
  }

  std::vector<double> numbers(const std::string& key) const {
    return numbers_in(texts_.at("/" + key), where(key));
  }

  std::vector<double> numbers(const std::string& key, std::size_t count) const {
    auto values = numbers(key);
    if (values.size() != count)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: {} numbers, must be {}", where(key), values.size(), count));
    return values;
  }

 private:
  std::string origin_;
  std::map<std::string, std::string> texts_;
};

std::vector<double> rows_of_rotation(const Eigen::Vector3d& rvec) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = rotation_from_vector(rvec);
  return {rows.data(), rows.data() + rows.size()};
}

struct PoseNumbers {
  std::vector<double> r, t;
};

/// calibrateCamera's table: a row of rvec and tvec for each image.
PoseNumbers pose_of_image(const OpenCvFile& file, const std::string& key, std::optional<int> row) {
  const auto numbers = file.numbers(key);
  const std::size_t rows = numbers.size() / 6;
  if (rows == 0 || numbers.size() % 6 != 0)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} numbers, must be 6 for each image", file.where(key), numbers.size()));
  if (rows > 1 && !row)
    throw BadInput(Reason::usage,
                   fmt::format("{}: poses of {} images: choose one (--column)", file.where(key), rows));
  const int chosen = row.value_or(1);
  if (chosen < 1 || std::size_t(chosen) > rows)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: column {}, must be 1 to {}", file.where(key), chosen, rows));
  const double* first = numbers.data() + 6 * std::size_t(chosen - 1);
  return {rows_of_rotation(Eigen::Vector3d(first)), {first + 3, first + 6}};
}

PoseNumbers pose_of(const OpenCvFile& file, const std::string& origin, std::optional<int> row) {
  if (const auto table = file.key_of({"extrinsic_parameters"}); !table.empty())
    return pose_of_image(file, table, row);
  const auto t = file.key_of({"tvec", "translation_vector", "T", "t"});
  const auto rvec = file.key_of({"rvec", "rotation_vector"});
  const auto r = file.key_of({"R", "rotation_matrix"});
  if (t.empty() || (r.empty() && rvec.empty()))
    throw BadInput(Reason::truncated,
                   fmt::format("{}: no pose: the file needs rvec or R, and tvec or T", origin));
  return {r.empty() ? rows_of_rotation(Eigen::Vector3d(file.numbers(rvec, 3).data())) : file.numbers(r, 9),
          file.numbers(t, 3)};
}

}  // namespace

bool is_opencv_file(std::string_view text) {
  return text.starts_with("%YAML") || text.find("<opencv_storage") != text.npos ||
         text.find("camera_matrix:") != text.npos;
}

ImportedMatrix parse_opencv_camera(std::string_view text, const std::string& origin,
                                   const ImportOptions& options) {
  const OpenCvFile file(text, origin);
  const auto k = file.key_of({"camera_matrix", "cameraMatrix", "K"});
  if (k.empty()) throw BadInput(Reason::truncated, fmt::format("{}: camera_matrix is missing", origin));
  if (const auto lens = file.key_of({"distortion_coefficients", "dist_coeffs", "distCoeffs", "D"});
      !lens.empty())
    refuse_lens_distortion(file.numbers(lens), file.where(lens), options);
  const PoseNumbers pose = pose_of(file, origin, options.column);
  ImportedMatrix result{camera_of(file.numbers(k, 9), pose.r, pose.t, origin), options.image_size};
  if (!file.key_of({"image_width"}).empty() && !file.key_of({"image_height"}).empty())
    result.image_size =
        image_size_from({file.numbers("image_width", 1)[0], file.numbers("image_height", 1)[0]}, origin);
  return result;
}

}  // namespace helicarm::geometry
