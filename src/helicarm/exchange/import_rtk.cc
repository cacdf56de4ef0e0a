// SPDX-License-Identifier: Apache-2.0
#include <optional>

#include <Eigen/Core>
#include <fmt/format.h>

#include "helicarm/exchange/import_formats.h"
#include "helicarm/exchange/rtk_projection.h"

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
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> given(numbers.data());
  const double apart = (given - projection.matrix()).cwiseAbs().maxCoeff();
  if (!(apart <= limit))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: differs by {:g} from the matrix of the parameters, limit {:g}", where,
                               apart, limit));
}

/// The chosen projection. A parameter holds until it is given anew, as in RTK.
RtkProjection chosen_projection(std::string_view text, const std::string& origin, std::optional<int> column) {
  RtkProjection current;
  std::optional<RtkProjection> chosen;
  const FileField* matrix = nullptr;
  int count = 0;
  const auto fields = xml_fields(text, origin);
  for (const FileField& field : fields) {
    if (!field.path.starts_with(rtk_root)) continue;
    const std::string name = field.path.substr(field.path.rfind('/') + 1);
    const std::string where = fmt::format("{}: projection {}: {}", origin, count + 1, name);
    if (double* parameter = rtk_parameter(current, name)) *parameter = one_number(field, where);
    if (name == "RadiusCylindricalDetector" && one_number(field, where) != 0)
      throw BadInput(Reason::unsupported, fmt::format("{}: only flat detectors are read", where));
    if (name == "Matrix") matrix = &field;
    if (name != "Projection") continue;
    if (matrix) check_matrix(current, *matrix, fmt::format("{}: projection {}: Matrix", origin, count + 1));
    if (++count == column.value_or(1)) chosen = current;
  }
  if (count == 0) throw BadInput(Reason::truncated, fmt::format("{}: no Projection", origin));
  if (count > 1 && !column)
    throw BadInput(Reason::usage, fmt::format("{}: {} projections: choose one (--column)", origin, count));
  if (!chosen)
    throw BadInput(Reason::bad_value, fmt::format("{}: column {}, must be 1 to {}", origin, *column, count));
  if (!(chosen->source_to_detector > 0) || !(chosen->source_to_isocenter > 0))
    throw BadInput(
        Reason::unsupported,
        fmt::format("{}: SourceToDetectorDistance {:g} and SourceToIsocenterDistance {:g} must be positive",
                    origin, chosen->source_to_detector, chosen->source_to_isocenter));
  return *chosen;
}

RtkPixels pixels_of(const std::string& origin, const ImportOptions& options) {
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

ImportedMatrix parse_rtk_geometry(std::string_view text, const std::string& origin,
                                  const ImportOptions& options) {
  const RtkPixels pixels = pixels_of(origin, options);
  const geometry::Projection projection =
      pixels.pixels_from_mm() * chosen_projection(text, origin, options.column).matrix();
  const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows = projection;
  ImportedMatrix result = imported({rows.data(), rows.data() + rows.size()}, origin);
  result.image_size = options.image_size;
  result.in_mm = true;
  return result;
}

}  // namespace helicarm::exchange
