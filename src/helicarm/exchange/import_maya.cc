// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <numbers>
#include <sstream>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/exchange/import_formats.h"

namespace helicarm::exchange {
namespace {

bool is_title(std::string_view line) {
  return !line.empty() && std::isalpha(static_cast<unsigned char>(line[0])) && !line.starts_with("nan") &&
         !line.starts_with("inf");
}

/// Numbers after a section's title, up to the next title.
std::vector<double> section(const std::string& text, const std::string& title, std::size_t count,
                            const std::string& origin) {
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line) && trimmed(line) != title) continue;
  const std::string where = fmt::format("{}: {}", origin, title);
  std::vector<double> numbers;
  while (numbers.size() < count && std::getline(lines, line)) {
    const auto more = numbers_in(line, where);
    numbers.insert(numbers.end(), more.begin(), more.end());
  }
  if (numbers.size() < count)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: {} numbers, must be {}", where, numbers.size(), count));
  if (numbers.size() > count)
    throw BadInput(Reason::bad_value, fmt::format("{}: a line has too many numbers", where));
  while (std::getline(lines, line))
    if (trimmed(line) == title) throw BadInput(Reason::bad_value, fmt::format("{}: is given twice", where));
  return numbers;
}

/// XMALab's "undistortion" is OpenCV's lens model; other titles that name one are treated alike.
void check_undistorted(const std::string& text, const std::string& origin, const ImportOptions& options) {
  std::istringstream lines(text);
  std::string title;
  std::vector<double> numbers;
  const auto check = [&] {
    if (names_lens(title)) refuse_lens_distortion(numbers, fmt::format("{}: {}", origin, title), options);
    numbers.clear();
  };
  for (std::string line; std::getline(lines, line);) {
    if (is_title(trimmed(line))) {
      check();
      title = trimmed(line);
    } else if (names_lens(title)) {
      const auto more = numbers_in(line, fmt::format("{}: {}", origin, title));
      numbers.insert(numbers.end(), more.begin(), more.end());
    }
  }
  check();
}

Eigen::Matrix3d turn_about(int axis, double degrees) {
  return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
}

/// The image plane's centre in the camera follows from the other lines.
void check_image_plane(const std::vector<double>& plane, const Eigen::Vector3d& expected, double scale,
                       const std::string& origin, ImportedMatrix& camera) {
  const double limit = std::max(2 * std::abs(scale), 1e-2 * std::abs(expected.z()));
  const Eigen::Vector3d centre(plane[0], plane[1], plane[2]);
  const double apart = (centre - expected).cwiseAbs().maxCoeff();
  if (apart <= limit) return;
  camera.warnings.push_back(
      {Reason::tag_disagrees,
       fmt::format(
           "{}: line 3, the image plane {:g}, {:g}, {:g}, contradicts lines 4 and 5, which give {:g}, {:g}, "
           "{:g}; these are used",
           origin, centre.x(), centre.y(), centre.z(), expected.x(), expected.y(), expected.z()),
       {},
       {{"apart", apart}, {"limit", limit}}});
}

}  // namespace

ImportedMatrix parse_maya_cam(const std::string& text, const std::string& origin,
                              const ImportOptions& options) {
  check_undistorted(text, origin, options);
  ImportedMatrix result{
      camera_of(section(text, "camera matrix", 9, origin), section(text, "rotation", 9, origin),
                section(text, "translation", 3, origin), origin),
      std::nullopt};
  result.image_size = image_size_from(section(text, "image size", 2, origin), origin);
  return result;
}

ImportedMatrix from_maya_cam_1(const std::vector<std::vector<double>>& rows, const std::string& origin,
                               const ImportOptions& options) {
  const auto &source = rows[0], &angles = rows[1], &centre = rows[3], &plane = rows[4];
  std::optional<Eigen::Vector2i> size = options.image_size;
  if (plane[1] != 0 || plane[2] != 0) size = image_size_from({plane[1], plane[2]}, origin + ": line 5");
  if (!size)
    throw BadInput(
        Reason::usage,
        fmt::format("{}: MayaCam 1 without the image's size (line 5): give it (--image-size; programs "
                    "that read such files assume 1024,1024)",
                    origin));
  const double focal = -centre[2];
  if (!(focal > 0))
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: line 4: the focal length in px, {:g}, must be negative", origin, centre[2]));
  // Maya's camera: x to the right, y up, z backwards.
  const Eigen::Matrix3d world_from_maya =
      turn_about(2, angles[2]) * turn_about(1, angles[1]) * turn_about(0, angles[0]);
  geometry::RigidTransform pose{Eigen::Vector3d(1, -1, -1).asDiagonal() * world_from_maya.transpose(), {}};
  pose.translation = -(pose.rotation * Eigen::Vector3d(source[0], source[1], source[2]));
  // The first pixel is 1, and rows count upwards.
  ImportedMatrix result{{{focal, focal, centre[0] - 1, size->y() - centre[1], 0}, pose}, size};
  const double scale = plane[0];
  check_image_plane(
      rows[2], scale * Eigen::Vector3d(0.5 * size->x() - centre[0], 0.5 * size->y() - centre[1], centre[2]),
      scale, origin, result);
  return result;
}

}  // namespace helicarm::exchange
