// SPDX-License-Identifier: Apache-2.0
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "helicarm/exchange/import_formats.h"
#include "helicarm/exchange/rtk_projection.h"
#include "helicarm/exchange/run_geometry.h"

namespace helicarm::exchange {
namespace {

constexpr std::string_view rtk_root = "/RTKThreeDCircularGeometry";

double* rtk_parameter(RtkProjection& p, std::string_view name) {
  if (name == "SourceToIsocenterDistance") return &p.source_to_isocenter;
  if (name == "SourceToDetectorDistance") return &p.source_to_detector;
  if (name == "GantryAngle" || name == "Angle") return &p.gantry_angle;
  if (name == "OutOfPlaneAngle") return &p.out_of_plane_angle;
  if (name == "InPlaneAngle") return &p.in_plane_angle;
  if (name == "SourceOffsetX") return &p.source_offset.x();
  if (name == "SourceOffsetY") return &p.source_offset.y();
  if (name == "ProjectionOffsetX") return &p.projection_offset.x();
  if (name == "ProjectionOffsetY") return &p.projection_offset.y();
  return nullptr;
}

double one_number(const FileField& field, const std::string& where) {
  const auto numbers = numbers_in(field.text, where);
  if (numbers.size() != 1)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} numbers, must be 1", where, numbers.size()));
  return numbers[0];
}

/// RTK itself refuses a matrix that its parameters do not give.
void check_matrix(const RtkProjection& projection, const FileField& field, const std::string& where) {
  constexpr double limit = 1e-3;  // RTK's
  const auto numbers = numbers_in(field.text, where);
  if (numbers.size() != 12)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} numbers, must be 12", where, numbers.size()));
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(numbers.data());
  const double apart = (matrix - projection.matrix()).cwiseAbs().maxCoeff();
  if (!(apart <= limit))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: differs by {:g} from the matrix of the parameters, limit {:g}", where,
                               apart, limit));
}

/// A parameter holds until it is given anew, as in RTK.
std::vector<RtkProjection> projections_of(std::string_view text, const std::string& origin) {
  RtkProjection current;
  std::vector<RtkProjection> all;
  const FileField* matrix = nullptr;
  const auto fields = xml_fields(text, origin);
  for (const FileField& field : fields) {
    if (!field.path.starts_with(rtk_root)) continue;
    const std::string name = field.path.substr(field.path.rfind('/') + 1);
    const std::string where = fmt::format("{}: projection {}: {}", origin, all.size() + 1, name);
    if (double* parameter = rtk_parameter(current, name)) *parameter = one_number(field, where);
    if (name == "RadiusCylindricalDetector" && one_number(field, where) != 0)
      throw BadInput(Reason::unsupported, fmt::format("{}: only flat detectors are read", where));
    if (name == "Matrix") matrix = &field;
    if (name != "Projection") continue;
    if (matrix)
      check_matrix(current, *matrix, fmt::format("{}: projection {}: Matrix", origin, all.size() + 1));
    matrix = nullptr;
    all.push_back(current);
  }
  if (all.empty()) throw BadInput(Reason::truncated, fmt::format("{}: no Projection", origin));
  for (const RtkProjection& each : all)
    if (!(each.source_to_detector > 0) || !(each.source_to_isocenter > 0))
      throw BadInput(
          Reason::unsupported,
          fmt::format("{}: SourceToDetectorDistance {:g} and SourceToIsocenterDistance {:g} must be positive",
                      origin, each.source_to_detector, each.source_to_isocenter));
  return all;
}

/// The comment of `rtk_geometry`, after spacing and origin: "image W x H px; rows run upwards".
struct StatedImage {
  Eigen::Vector2i size;
  bool rows_upwards;
};
std::optional<StatedImage> stated_image(std::string_view text, const std::string& origin) {
  constexpr std::string_view image = " mm; image ", times = " x ", end = " px; rows ",
                             upwards = "run upwards";
  const std::size_t start = text.find(image), close = text.find("-->");
  if (start == text.npos || start > close) return std::nullopt;
  const std::size_t middle = text.find(times, start), last = text.find(end, start);
  if (middle == text.npos || last == text.npos || middle > last) return std::nullopt;
  const std::string where = origin + ": comment on the projection image";
  auto numbers = numbers_in(text.substr(start + image.size(), middle - start - image.size()), where);
  const auto height = numbers_in(text.substr(middle + times.size(), last - middle - times.size()), where);
  numbers.insert(numbers.end(), height.begin(), height.end());
  return StatedImage{image_size_from(numbers, where), text.substr(last + end.size()).starts_with(upwards)};
}

/// The comment of `rtk_geometry`: "Projection image: spacing A B mm, origin C D mm".
std::optional<RtkPixels> stated_pixels(std::string_view text, const std::string& origin) {
  constexpr std::string_view spacing = "<!-- Projection image: spacing ", between = " mm, origin ",
                             end = " mm";
  const std::size_t start = text.find(spacing);
  if (start == text.npos) return std::nullopt;
  const std::size_t middle = text.find(between, start);
  const std::size_t last = middle == text.npos ? text.npos : text.find(end, middle + between.size());
  if (last == text.npos) return std::nullopt;
  const std::string where = origin + ": comment on the projection image";
  auto numbers = numbers_in(text.substr(start + spacing.size(), middle - start - spacing.size()), where);
  const auto of_origin =
      numbers_in(text.substr(middle + between.size(), last - middle - between.size()), where);
  if (numbers.size() != 2 || of_origin.size() != 2 || !(numbers[0] > 0) || !(numbers[1] > 0))
    throw BadInput(Reason::bad_value, fmt::format("{}: spacing and origin must be two numbers each", where));
  return RtkPixels{{numbers[0], numbers[1]}, {of_origin[0], of_origin[1]}};
}

void check_stated(const std::optional<Eigen::Vector2d>& option, const Eigen::Vector2d& stated,
                  const char* name, double tolerance, const std::string& origin) {
  if (option && (*option - stated).cwiseAbs().maxCoeff() > tolerance)
    throw BadInput(Reason::bad_value, fmt::format("{}: its comment states {},{} mm, {} {},{}", origin,
                                                  stated.x(), stated.y(), name, option->x(), option->y()));
}

RtkPixels pixels_of(std::string_view text, const std::string& origin, const ImportOptions& options) {
  if (const auto stated = stated_pixels(text, origin)) {
    const double tolerance = 1e-3 * stated->spacing_mm.minCoeff();
    check_stated(options.pixel_mm, stated->spacing_mm, "--pixel-mm", tolerance, origin);
    check_stated(options.origin_mm, stated->origin_mm, "--origin-mm", tolerance, origin);
    return *stated;
  }
  if (!options.pixel_mm || (!options.image_size && !options.origin_mm))
    throw BadInput(
        Reason::usage,
        fmt::format("{}: an RTK geometry ends at mm on the detector: give the spacing of the projection "
                    "images (--pixel-mm), and their size or origin (--image-size, --origin-mm)",
                    origin));
  if (options.origin_mm) return {*options.pixel_mm, *options.origin_mm};
  return RtkPixels::centred(*options.pixel_mm, *options.image_size);
}

}  // namespace

bool is_rtk_geometry(std::string_view text) { return text.find("<RTKThreeDCircularGeometry") != text.npos; }

Cameras parse_rtk_geometry(std::string_view text, const std::string& origin, const ImportOptions& options) {
  // The projections are in the file's unit, the pixels in mm.
  const double unit = options.mm_per_unit.value_or(1);
  const Eigen::Matrix3d pixels =
      pixels_of(text, origin, options).pixels_from_mm() * Eigen::Vector3d(unit, unit, 1).asDiagonal();
  const bool in_mm = stated_pixels(text, origin).has_value();
  const auto image = stated_image(text, origin);
  if (image && !image->rows_upwards && options.rows_upwards)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: its comment states that the first row is at the top, --rows-upwards "
                               "that the last one is",
                               origin));
  Cameras cameras;
  for (const RtkProjection& projection : projections_of(text, origin)) {
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = pixels * projection.matrix();
    ImportedMatrix& camera = cameras.emplace_back(imported({rows.data(), rows.data() + rows.size()}, origin));
    camera.in_mm = in_mm;
    if (!image) continue;
    camera.image_size = image->size;
    // Where the option states it too, it is done with the other options.
    if (image->rows_upwards && !options.rows_upwards)
      camera.view = with_rows_reversed(camera.view, image->size.y());
  }
  return cameras;
}

}  // namespace helicarm::exchange
