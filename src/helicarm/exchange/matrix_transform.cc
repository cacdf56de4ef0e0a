// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/matrix_transform.h"

#include <sstream>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/exchange/import_formats.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

constexpr std::uintmax_t most_matrix_bytes = 1u << 16;

using Rows4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// Throws BadInput for what is no number.
std::vector<double> numbers_of_rows(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with('#')) continue;
    const auto row = numbers_in(line, "");
    if (!row.empty() && row.size() != 4) return {};
    numbers.insert(numbers.end(), row.begin(), row.end());
  }
  return numbers;
}

std::vector<double> numbers_of_json(const std::string& text, const std::string& origin) {
  Json json = value_or_throw(parse_json(text, origin));
  if (json.is_object() && json.size() == 1) json = Json(json.front());
  const Json rows{{"matrix", std::move(json)}};
  return JsonReader(rows, origin).matrix("matrix", 4, 4, {-1e12, 1e12});
}

bool is_unit_row(const Eigen::RowVector4d& row) { return row == Eigen::RowVector4d(0, 0, 0, 1); }

bool is_rotation(const Eigen::Matrix3d& m) {
  return (m * m.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3 && m.determinant() > 0;
}

}  // namespace

Expected<std::optional<geometry::RigidTransform>> read_matrix_transform(const std::filesystem::path& path) {
  const auto text = read_file(path, most_matrix_bytes);
  if (!text && text.error().reason == Reason::missing_file) return tl::unexpected<Failure>(text.error());
  if (!text) return std::nullopt;
  const std::string origin = path.filename().string(), content(trimmed(without_byte_order_mark(*text)));
  const auto numbers = guarded([&] {
    return content.starts_with('{') || content.starts_with('[') ? numbers_of_json(content, origin)
                                                                : numbers_of_rows(content);
  });
  if (!numbers || numbers->size() != 16) return std::nullopt;  // `import_matrix` names what is wrong with it
  const Rows4 matrix = Eigen::Map<const Rows4>(numbers->data());
  if (!is_rotation(matrix.topLeftCorner<3, 3>())) return std::nullopt;
  if (!is_unit_row(matrix.row(3)))
    return fail(Reason::bad_value,
                fmt::format("{}: {}", origin,
                            is_unit_row(matrix.col(3).transpose())
                                ? "the matrix is transposed: its translation must be its last column"
                                : "the last row of a 4x4 matrix must be 0 0 0 1"));
  return guarded([&]() -> std::optional<geometry::RigidTransform> {
    return value_or_throw(geometry::rigid_transform_from(matrix, origin + ": matrix"));
  });
}

}  // namespace helicarm::exchange
