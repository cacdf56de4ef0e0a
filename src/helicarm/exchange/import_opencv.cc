// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <span>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/exchange/import_formats.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

/// As `key_word` writes them.
using Names = std::span<const std::string_view>;

constexpr std::array<std::string_view, 8> matrix_names{
    "cameramatrix", "k", "intrinsicmatrix", "intrinsics", "intrinsic", "cameraintrinsics", "mtx", "kmatrix"};

/// Numbers of a file by key. Keys are compared without case and underscores.
class CameraKeys {
 public:
  CameraKeys(const Json& json, std::string origin) : json_(json), origin_(std::move(origin)) {}

  const std::string& origin() const { return origin_; }
  std::string where(const std::string& key) const { return fmt::format("{}: {}", origin_, key); }

  /// The file's only key of these that has a value; else empty.
  std::string key_of(Names names) const {
    std::string found;
    for (const auto& [key, value] : json_.items()) {
      if (value.is_null() || std::ranges::find(names, key_word(key)) == names.end()) continue;
      if (!found.empty() && json_[found] != value)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: {} and {} name the same thing and differ", origin_, found, key));
      found = key;
    }
    return found;
  }
  std::string key_of(std::initializer_list<std::string_view> names) const {
    return key_of(Names(names.begin(), names.size()));
  }

  std::vector<double> numbers(const std::string& key) const {
    std::vector<double> numbers;
    add(json_[key], key, numbers);
    return numbers;
  }

  std::vector<double> numbers(const std::string& key, std::size_t count) const {
    auto values = numbers(key);
    if (values.size() != count)
      throw BadInput(Reason::bad_size,
                     fmt::format("{}: {} numbers, must be {}", where(key), values.size(), count));
    return values;
  }

  std::string all_keys() const {
    std::string all;
    for (const auto& [key, value] : json_.items())
      all.append(all.empty() ? "" : ", ").append(key.substr(0, 40));
    return without_control_characters(all.substr(0, 200));
  }

 private:
  void add(const Json& value, const std::string& key, std::vector<double>& numbers) const {
    if (value.is_object() && value.contains("data")) return add(value["data"], key, numbers);
    if (value.is_number() && !std::isfinite(value.get<double>()))
      throw BadInput(Reason::not_finite, fmt::format("{}: a number is not finite", where(key)));
    if (value.is_number()) return numbers.push_back(value.get<double>());
    if (!value.is_array())
      throw BadInput(
          Reason::bad_value,
          fmt::format("{}: {} is not a number", where(key),
                      without_control_characters(
                          value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 40))));
    for (const Json& each : value) add(each, key, numbers);
  }

  const Json& json_;
  std::string origin_;
};

std::vector<double> rows_of_rotation(const Eigen::Vector3d& rvec) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = geometry::rotation_from_vector(rvec);
  return {rows.data(), rows.data() + rows.size()};
}

struct PoseNumbers {
  std::vector<double> r, t;
};

/// calibrateCamera's table: a row of rvec and tvec for each image.
std::vector<PoseNumbers> poses_of_table(const CameraKeys& file, const std::string& key) {
  const auto numbers = file.numbers(key);
  const std::size_t rows = numbers.size() / 6;
  if (rows == 0 || numbers.size() % 6 != 0)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} numbers, must be 6 for each image", file.where(key), numbers.size()));
  std::vector<PoseNumbers> poses;
  for (const double* first = numbers.data(); poses.size() < rows; first += 6)
    poses.push_back({rows_of_rotation(Eigen::Vector3d(first)), {first + 3, first + 6}});
  return poses;
}

/// Rodrigues' vector is in radian; one in degrees is mostly longer than a turn.
void check_rotation_vector(const Eigen::Vector3d& rvec, const std::string& where) {
  constexpr double longest_rad = 2 * EIGEN_PI;
  if (rvec.norm() > longest_rad)
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: length {:.4g}, a rotation vector is in radian and at most {:.4g} long: are "
                    "these degrees?",
                    where, rvec.norm(), longest_rad));
}

PoseNumbers pose_of(const CameraKeys& file) {
  const auto t = file.key_of({"tvec", "tvecs", "translationvector", "translation", "t"});
  const auto rvec = file.key_of({"rvec", "rvecs", "rotationvector"});
  const auto r = file.key_of({"r", "rotationmatrix", "rotation"});
  if (t.empty() || (r.empty() && rvec.empty()))
    throw BadInput(Reason::truncated,
                   fmt::format("{}: no pose: the file needs rvec or R, and tvec or T (keys: {})",
                               file.origin(), file.all_keys()));
  if (!r.empty() && file.numbers(r).size() == 3)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: three numbers may be a rotation vector or angles: name a rotation vector "
                               "rvec, or give the 9 numbers of the matrix",
                               file.where(r)));
  if (!rvec.empty()) check_rotation_vector(Eigen::Vector3d(file.numbers(rvec, 3).data()), file.where(rvec));
  const auto by_vector =
      rvec.empty() ? std::vector<double>() : rows_of_rotation(Eigen::Vector3d(file.numbers(rvec, 3).data()));
  if (r.empty()) return {by_vector, file.numbers(t, 3)};
  const auto by_matrix = file.numbers(r, 9);
  constexpr double rounding = 1e-4;
  for (std::size_t i = 0; i < by_vector.size(); ++i)
    if (!(std::abs(by_vector[i] - by_matrix[i]) <= rounding))
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: {} and {} are different rotations", file.origin(), rvec, r));
  return {by_matrix, file.numbers(t, 3)};
}

std::optional<Eigen::Vector2i> size_of(const CameraKeys& file) {
  const auto width = file.key_of({"imagewidth", "width", "imgwidth"}),
             height = file.key_of({"imageheight", "height", "imgheight"});
  const auto both = file.key_of({"imagesize", "imgsize", "framesize"});
  std::optional<Eigen::Vector2i> size;
  if (!width.empty() && !height.empty())
    size = image_size_from({file.numbers(width, 1)[0], file.numbers(height, 1)[0]}, file.origin());
  if (both.empty()) return size;
  auto numbers = file.numbers(both, 2);
  if (both == "ImageSize") std::swap(numbers[0], numbers[1]);  // MATLAB's: rows, columns
  const Eigen::Vector2i listed = image_size_from(numbers, file.where(both));
  if (size && *size != listed)
    throw BadInput(Reason::bad_value, fmt::format("{}: {} and {} differ", file.origin(), both, width));
  return listed;
}

/// K, whose skew may stand apart: Bouguet's alpha_c is skew / fx.
std::vector<double> camera_matrix(const CameraKeys& file) {
  const auto key = file.key_of(Names(matrix_names));
  if (key.empty())
    throw BadInput(Reason::truncated,
                   fmt::format("{}: camera_matrix is missing (keys: {}); of several cameras, write each with "
                               "its pose in a file of its own",
                               file.origin(), file.all_keys()));
  auto k = file.numbers(key, 9);
  if (k[1] == 0 && k[2] == 0 && (k[6] != 0 || k[7] != 0))
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: is transposed, as MATLAB has it: transpose it and the rotation", file.where(key)));
  const auto skew = file.key_of({"skew", "alphac", "skewness"});
  if (skew.empty()) return k;
  const double stated_skew = file.numbers(skew, 1)[0] * (key_word(skew) == "alphac" ? k[0] : 1);
  if (std::abs(stated_skew - k[1]) > 1e-6 * std::abs(k[0]))
    throw BadInput(Reason::bad_value, fmt::format("{}: {:g} px, but the second number of {} is {:g}",
                                                  file.where(skew), stated_skew, key, k[1]));
  return k;
}

}  // namespace

bool holds_camera(const Json& json) {
  if (!json.is_object()) return false;
  for (const auto& [key, value] : json.items())
    if (std::ranges::find(matrix_names, key_word(key)) != matrix_names.end()) return true;
  return false;
}

bool is_opencv_file(std::string_view text) {
  if (text.starts_with("%YAML") || text.find("<opencv_storage") != text.npos) return true;
  std::size_t at = 0;  // YAML: the first line is "key:"
  while (at < text.size()) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string line(trimmed(text.substr(at, end - at)));
    at = end + 1;
    if (line.empty() || line[0] == '#' || line == "---") continue;
    const std::size_t colon = line.find(':');
    return colon != line.npos && colon > 0 && (colon + 1 == line.size() || line[colon + 1] == ' ') &&
           std::isalpha(static_cast<unsigned char>(line[line[0] == '"' || line[0] == '\'' ? 1 : 0])) != 0;
  }
  return false;
}

Cameras camera_of_keys(const Json& json, const std::string& origin, const ImportOptions& options) {
  const CameraKeys file(json, origin);
  const auto k = camera_matrix(file);
  refuse_lens(json, origin, options);
  const auto table = file.key_of({"extrinsicparameters"});
  const auto poses = table.empty() ? std::vector<PoseNumbers>{pose_of(file)} : poses_of_table(file, table);
  Cameras cameras;
  for (const PoseNumbers& pose : poses)
    cameras.push_back({camera_of(k, pose.r, pose.t, origin), size_of(file)});
  return cameras;
}

Cameras parse_opencv_camera(std::string_view text, const std::string& origin, const ImportOptions& options) {
  return camera_of_keys(file_storage_json(text, origin), origin, options);
}

}  // namespace helicarm::exchange
