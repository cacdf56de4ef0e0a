// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/displacement_field.h"

#include <cstring>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/rectification/models/polynomial.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

/// About 15 px of pincushion at the corner.
DistortionMap pincushion_map(int width, int height) {
  const Vector2d centre(width / 2.0, height / 2.0);
  const double scale = width / 2.0;
  Eigen::MatrixX2d coefficients = Eigen::MatrixX2d::Zero(10, 2);
  coefficients.row(0) << centre.x() + 1, centre.y() - 2;
  coefficients.row(1) << scale, 1;
  coefficients.row(2) << -1, scale;
  coefficients.row(6) << 7, 0;
  coefficients.row(7) << 0, 7;
  coefficients.row(8) << 7, 0;
  coefficients.row(9) << 0, 7;
  DistortionMap map;
  map.model = polynomial_model(3, {centre, scale}, coefficients);
  map.width = width;
  map.height = height;
  return map;
}

/// What a reader of NRRD makes of the file: the displacement at a position in mm.
class FieldReader {
 public:
  explicit FieldReader(const std::string& nrrd) {
    const auto data = nrrd.find("\n\n") + 2;
    header = nrrd.substr(0, data);
    std::istringstream sizes(header.substr(header.find("\nsizes: ") + 8));
    int components = 0, slices = 0;
    sizes >> components >> columns >> rows >> slices;
    EXPECT_EQ(components, 3);
    EXPECT_EQ(slices, 1);
    values.resize(std::size_t(3 * columns * rows));
    EXPECT_EQ(nrrd.size() - data, values.size() * sizeof(float));
    std::memcpy(values.data(), nrrd.data() + data, nrrd.size() - data);
  }

  Vector2d node(int column, int row) const {
    const std::size_t at = std::size_t(3 * (row * columns + column));
    return {values[at], values[at + 1]};
  }

  Vector2d at(const Vector2d& mm, const Vector2d& spacing) const {
    const Vector2d index = mm.cwiseQuotient(spacing);
    const int i = std::min(int(index.x()), columns - 2), j = std::min(int(index.y()), rows - 2);
    const double x = index.x() - i, y = index.y() - j;
    return (1 - y) * ((1 - x) * node(i, j) + x * node(i + 1, j)) +
           y * ((1 - x) * node(i, j + 1) + x * node(i + 1, j + 1));
  }

  std::string header;
  int columns = 0, rows = 0;
  std::vector<float> values;
};

TEST(DisplacementField, LeadsFromARectifiedPointToItsRawOne) {
  const DistortionMap map = pincushion_map(301, 222);
  const Vector2d pixel(0.3, 0.4);
  const FieldReader field(displacement_field(map, pixel));
  for (const Vector2d& rectified : {Vector2d(0, 0), {150, 110}, {13.7, 200.2}, {300, 221}, {299.5, 1.25}}) {
    const Vector2d mm = rectified.cwiseProduct(pixel);
    const Vector2d raw = (mm + field.at(mm, 4 * pixel)).cwiseQuotient(pixel);
    EXPECT_LT((raw - map.raw_from_rectified(rectified)).norm(), 0.01) << rectified.transpose();
  }
}

TEST(DisplacementField, HeaderStatesLpsSpacingAndSize) {
  const FieldReader field(displacement_field(pincushion_map(301, 222), {0.25, 0.5}));
  EXPECT_EQ(field.columns, 76);
  EXPECT_EQ(field.rows, 57);
  EXPECT_THAT(field.header, testing::StartsWith("NRRD000"));
  EXPECT_THAT(field.header, testing::HasSubstr("\nspace: left-posterior-superior\n"));
  EXPECT_THAT(field.header, testing::HasSubstr("\nspace directions: none (1,0,0) (0,2,0) (0,0,1)\n"));
  EXPECT_THAT(field.header, testing::HasSubstr("\nkinds: vector domain domain domain\n"));
}

}  // namespace
}  // namespace helicarm::rectification
