// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface_file.h"

#include <bit>
#include <cstring>

#include <gmock/gmock.h>

#include "helicarm/registration/surface.h"
#include "helicarm/registration/weld.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

phantom::TriangleMesh tetrahedron(double size = 10) {
  return {{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, 2 * size}},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

std::string tetrahedron_text(const std::string& first = "solid t", const std::string& end = "\n") {
  std::string text = first + end;
  const auto mesh = tetrahedron();
  for (const auto& t : mesh.triangles) {
    text += "facet normal 0 0 0" + end + "outer loop" + end;
    for (const auto corner : t) {
      const Vector3d& at = mesh.corners[corner];
      text += fmt::format("vertex {} {} {}{}", at.x(), at.y(), at.z(), end);
    }
    text += "endloop" + end + "endfacet" + end;
  }
  return text + "endsolid t" + end;
}

std::string tetrahedron_binary(std::string header) {
  header.resize(80, ' ');
  return phantom::to_stl(tetrahedron()).replace(0, 80, header);
}

std::string tetrahedron_ply(const std::string& comments, const std::string& behind = "") {
  return "ply\nformat ascii 1.0\n" + comments +
         "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 4\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0\n10 0 0\n0 10 0\n0 0 20\n"
         "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n" +
         behind;
}

SurfaceMesh read_all(const std::string& bytes) {
  const auto read = surface_from(bytes, "t");
  EXPECT_TRUE(read) << read.error().message;
  if (!read) return {};
  EXPECT_EQ(read->triangles.size(), 4U);
  EXPECT_EQ(read->corners.size(), 4U);
  return *read;
}

Failure refusal_of(const std::string& bytes) {
  const auto read = surface_from(bytes, "t");
  EXPECT_FALSE(read);
  return read ? Failure{Reason::usage, ""} : read.error();
}

Vector3d farthest_along(const phantom::TriangleMesh& mesh) {
  Vector3d far = Vector3d::Zero();
  for (const Vector3d& corner : mesh.corners)
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(corner[axis]) > std::abs(far[axis])) far[axis] = corner[axis];
  return far;
}

TEST(StlText, WithCapitalsMarkBlanksAndOtherLineEnds) {
  std::string capitals = tetrahedron_text();
  for (char& c : capitals) c = char(std::toupper(c));
  EXPECT_TRUE(read_all(capitals).warnings.empty());
  read_all("\xEF\xBB\xBF" + tetrahedron_text());
  read_all(" \n\t" + tetrahedron_text());
  read_all(tetrahedron_text("solid t", "\r\n"));
  read_all(tetrahedron_text("solid t", "\r"));
  read_all("solid one line " + tetrahedron_text("", " "));
}

TEST(StlText, WordsOfTheNameAreNoFacets) {
  read_all(tetrahedron_text("solid outer vertex of facet 3"));
  read_all(tetrahedron_text("solid"));
}

TEST(StlText, CutFileIsRefusedOrWarnedOf) {
  const std::string whole = tetrahedron_text();
  EXPECT_EQ(refusal_of(whole.substr(0, whole.find("endsolid") - 12)).reason, Reason::truncated);
  const auto unended = read_all(whole.substr(0, whole.find("endsolid")));
  ASSERT_EQ(unended.warnings.size(), 1U);
  EXPECT_EQ(unended.warnings[0].reason, Reason::irregular_file);
}

TEST(StlText, FacetWithoutItsEndIsRefused) {
  std::string whole = tetrahedron_text();
  whole.erase(whole.find("endfacet"), 8);
  EXPECT_THAT(refusal_of(whole).message, testing::HasSubstr("facet 1 has no \"endfacet\""));
}

TEST(Ply, ElementsWithoutAPropertyAreRefused) {
  std::string header = "ply\nformat ascii 1.0\n";
  for (int i = 0; i < 40; ++i) header += "element vertex 5000000\n";
  EXPECT_EQ(refusal_of(header + "end_header\n").reason, Reason::bad_value);
}

TEST(StlBinary, WhoseHeaderBeginsWithSolid) {
  EXPECT_TRUE(read_all(tetrahedron_binary("solid bone")).warnings.empty());
  EXPECT_EQ(read_all(tetrahedron_binary("solid facet normal") + "x").warnings.size(), 1U);
}

TEST(StlBinary, BytesBehindTheTrianglesAreWarnedOf) {
  const auto read = read_all(tetrahedron_binary("bone") + "x");
  ASSERT_EQ(read.warnings.size(), 1U);
  EXPECT_EQ(read.warnings[0].reason, Reason::surplus_data);
}

TEST(Ply, BytesBehindTheElementsAreWarnedOf) {
  EXPECT_TRUE(read_all(tetrahedron_ply("")).warnings.empty());
  ASSERT_EQ(read_all(tetrahedron_ply("", "3 1 2 3\n")).warnings.size(), 1U);
}

TEST(DeclaredSurface, RasBecomesLps) {
  const Vector3d lps(-10, -10, 20);
  EXPECT_EQ(farthest_along(read_all(tetrahedron_binary("3D Slicer output. SPACE=RAS"))), lps);
  EXPECT_EQ(farthest_along(read_all(tetrahedron_text("solid 3D Slicer output. SPACE=RAS"))), lps);
  EXPECT_EQ(farthest_along(read_all(tetrahedron_ply("comment SPACE=RAS\n"))), lps);
  EXPECT_EQ(farthest_along(read_all(tetrahedron_binary("SPACE=LPS"))), Vector3d(10, 10, 20));
}

TEST(DeclaredSurface, LasIsTurnedOutsideOutAgain) {
  const auto prepared = prepare_surface(read_all(tetrahedron_binary("SPACE=LAS")), "t");
  ASSERT_TRUE(prepared);
  EXPECT_GT(phantom::volume(prepared->mesh), 0);
}

TEST(DeclaredSurface, UnitsBecomeMillimetres) {
  EXPECT_EQ(farthest_along(read_all(tetrahedron_ply("comment units: cm\n"))), Vector3d(100, 100, 200));
  EXPECT_EQ(farthest_along(read_all(tetrahedron_ply("obj_info unit = mm\n"))), Vector3d(10, 10, 20));
}

TEST(DeclaredSurface, UnknownSpacesAndUnitsAreRefused) {
  const Failure space = refusal_of(tetrahedron_binary("SPACE=scanner"));
  EXPECT_EQ(space.reason, Reason::unsupported);
  EXPECT_THAT(space.message, HasSubstr("scanner"));
  EXPECT_EQ(refusal_of(tetrahedron_ply("comment units: cubits\n")).reason, Reason::unsupported);
  EXPECT_EQ(refusal_of(tetrahedron_ply("comment SPACE=RAS\ncomment SPACE=LPS\n")).reason, Reason::bad_value);
}

class FarCorner : public testing::TestWithParam<double> {};

TEST_P(FarCorner, IsNamedBeforeAnythingIsBuilt) {
  const std::string far = fmt::format("{}", GetParam());
  std::string text = tetrahedron_text();
  text.replace(text.find("vertex 0 0 20"), 13, "vertex 0 " + far + " 20");
  std::string ply = tetrahedron_ply("");
  ply.replace(ply.find("0 0 20"), 6, "0 " + far + " 20");
  for (const std::string& bytes : {text, ply}) {
    const Failure failure = refusal_of(bytes);
    EXPECT_EQ(failure.reason, Reason::bad_value);
    EXPECT_THAT(failure.message, HasSubstr("corner"));
    EXPECT_NEAR(failure.figures.at("distance_mm"), GetParam(), 0.1 * GetParam());
  }
}

INSTANTIATE_TEST_SUITE_P(TwoToTwentyMetres, FarCorner, testing::Values(2e3, 2e4, 1e30));

TEST(FarCorner, OfNoTriangleDoesNotMatter) {
  std::string ply = tetrahedron_ply("");
  ply.replace(ply.find("vertex 4"), 8, "vertex 5").replace(ply.find("3 0 2 1"), 0, "1e9 0 0\n");
  read_all(ply);
}

TEST(Welded, CornersEqualUpToRounding) {
  const phantom::TriangleMesh mesh = tetrahedron(300);
  for (const double rounding : {0.0, 1e-5, 1e-3}) {
    phantom::TriangleMesh soup;
    double sign = 1;
    for (const auto& triangle : mesh.triangles) {
      const auto first = static_cast<std::uint32_t>(soup.corners.size());
      for (const auto corner : triangle) {
        soup.corners.push_back(mesh.corners[corner] + Vector3d(1000, -200, 50) +
                               sign * rounding * Vector3d(1, -0.5, 0.3));
        sign = -sign;
      }
      soup.triangles.push_back({first, first + 1, first + 2});
    }
    EXPECT_EQ(welded(soup).corners.size(), 4U) << rounding;
    EXPECT_TRUE(prepare_surface(welded(soup), "t")) << rounding;
  }
}

TEST(OtherSurfaces, AreNamedWithTheWayOut) {
  EXPECT_THAT(refusal_of("OFF\n4 4 6\n").message, HasSubstr("VTP"));
  EXPECT_THAT(refusal_of(std::string("\x1c\2\0\0n+2\0", 8) + std::string(600, ' ')).message,
              HasSubstr("\"volume\""));
  EXPECT_THAT(refusal_of("NRRD0004\ntype: short\n").message, HasSubstr("\"volume\""));
  EXPECT_THAT(refusal_of("<?xml version=\"1.0\"?><GIFTI></GIFTI>").message, HasSubstr("VTP"));
}

}  // namespace
}  // namespace helicarm::registration
