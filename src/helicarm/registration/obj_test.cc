// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <gmock/gmock.h>

#include "helicarm/registration/surface.h"

namespace helicarm::registration {
namespace obj_test {

using Eigen::Vector3d;
using testing::HasSubstr;

const std::string vertices = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 20\n";
const std::string faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

SurfaceMesh surface_of(const std::string& bytes, std::size_t triangles = 4) {
  const auto read = surface_from(bytes, "t.obj");
  EXPECT_TRUE(read) << read.error().message;
  if (!read) return {};
  EXPECT_EQ(read->triangles.size(), triangles);
  EXPECT_TRUE(prepare_surface(*read, "t.obj"));
  return *read;
}

Failure failure_of(const std::string& bytes) {
  const auto read = surface_from(bytes, "t.obj");
  EXPECT_FALSE(read) << bytes;
  return read ? Failure{Reason::usage, ""} : read.error();
}

bool has_corner(const SurfaceMesh& mesh, const Vector3d& at) {
  return std::ranges::any_of(mesh.corners, [&](const Vector3d& corner) { return corner.isApprox(at); });
}

TEST(Obj, VerticesAndFacesInEachNotation) {
  EXPECT_NEAR(phantom::volume(surface_of(vertices + faces)), 1000.0 / 3, 1e-9);
  const std::string more = "vt 0 0\nvn 0 0 1\n";
  for (const char* behind : {"/1", "/1/1", "//1"}) {
    std::string marked = faces;
    for (const char* corner : {"1 ", "2 ", "3 ", "4 ", "2\n", "3\n", "4\n"})
      for (std::size_t at = 0; (at = marked.find(corner, at)) != std::string::npos;
           at += 1 + std::string_view(behind).size())
        if (marked[at - 1] == ' ') marked.insert(at + 1, behind);
    EXPECT_THAT(marked, HasSubstr("f 1" + std::string(behind) + " 3" + behind + " 2" + behind + "\n"));
    EXPECT_NEAR(phantom::volume(surface_of(vertices + more + marked)), 1000.0 / 3, 1e-9);
  }
}

TEST(Obj, NegativeNumbersCountBackFromTheLastVertexSoFar) {
  const std::string backwards = "f -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n";
  EXPECT_NEAR(phantom::volume(surface_of(vertices + backwards + "v 99 99 99\n")), 1000.0 / 3, 1e-9);
}

TEST(Obj, PolygonsAreCutAndGroupsJoined) {
  const std::string cube =
      "mtllib a.mtl\no cube\nv 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\ng low\nusemtl bone\ns off\nf 4 3 2 1\n"
      "v 0 0 10\nv 10 0 10\nv 10 10 10\nv 0 10 10\ng high\nf 5 6 7 8\ng sides\nf 1 2 6 5\nf 2 3 7 6\n"
      "f 3 4 8 7\nf 4 1 5 8\nl 1 2\np 1\n";
  const SurfaceMesh mesh = surface_of(cube, 12);
  EXPECT_EQ(mesh.corners.size(), 8U);
  EXPECT_NEAR(phantom::volume(mesh), 1000, 1e-9);
}

TEST(Obj, CommentsColoursContinuedLinesAndOtherLineEnds) {
  std::string windows = "# made by hand\n\n" + vertices + "f 1 \\\n3 2 # base\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  for (std::size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2)
    windows.insert(at, "\r");
  surface_of(windows);
  surface_of("\xEF\xBB\xBFv 0 0 0 0.5 0.5 1\nv 10 0 0 1\nv 0 10 0 # third\nv 0 0 20 0 0 0\n" + faces);
  surface_of(faces + vertices);  // vertices may follow
}

TEST(Obj, ASpaceOrUnitThatACommentStatesIsConverted) {
  EXPECT_TRUE(has_corner(surface_of("# 3D Slicer output. SPACE=RAS\n" + vertices + faces), {-10, 0, 0}));
  EXPECT_TRUE(has_corner(surface_of("# units: cm\n" + vertices + faces), {0, 0, 200}));
  EXPECT_TRUE(has_corner(surface_of("# Blender 3.4\n" + vertices + faces), {0, 10, 0}));
  EXPECT_EQ(failure_of("# SPACE=scanner\n" + vertices + faces).reason, Reason::unsupported);
  EXPECT_EQ(failure_of("# SPACE=RAS\n" + vertices + "# SPACE=LPS\n" + faces).reason, Reason::bad_value);
}

TEST(Obj, WhatIsWrongIsNamedByItsLine) {
  const auto expect = [](const std::string& bytes, Reason reason, const std::string& words) {
    const Failure failure = failure_of(bytes);
    EXPECT_EQ(failure.reason, reason) << failure.message;
    EXPECT_THAT(failure.message, HasSubstr(words));
    EXPECT_THAT(failure.message, testing::StartsWith("t.obj: "));
  };
  expect(vertices + "f 1 2 5\n" + faces, Reason::bad_value, "line 5: a face names vertex 5 of 4");
  expect(vertices + "f 1 2 0\n", Reason::bad_value, "line 5: a face names vertex 0, must be 1 to 4");
  expect(vertices + "f 1 2 -5\n", Reason::bad_value, "names vertex -5");
  expect(vertices + "f 1 2 99999999999999999999\n", Reason::bad_value, "names vertex 99999999999999999999");
  expect(vertices + "f 1 2 999999999\n", Reason::bad_value, "names vertex 999999999");
  expect(vertices + "f 1 2\n", Reason::bad_value, "line 5: the face has 2 corners, must be at least 3");
  expect(vertices + "f 1 2", Reason::truncated, "line 5: the file ends within a face");
  expect(vertices + "f 1 2 x\n", Reason::bad_value, "\"x\" is not a vertex number");
  expect("v 0 0\n" + faces, Reason::truncated, "line 1: ends within a number list");
  expect("v 0 0 0,5\n" + faces, Reason::bad_value, "line 1: \"0,5\" is not a number");
  expect("v 0 nan 0\n" + vertices + faces, Reason::not_finite, "corner 0 is not finite");
  expect("v 0 0 0 0.5\n" + vertices + faces, Reason::unsupported, "weight 0.5");
  expect(vertices + "surf 0 1 0 1 1 2 3 4\n", Reason::unsupported, "line 5: \"surf\"");
  expect(vertices + "call other.obj\n", Reason::unsupported, "other files");
  expect(vertices + "facet 1 2 3\n", Reason::bad_value, "\"facet\" is no statement of OBJ");
  expect(vertices, Reason::bad_value, "0 triangles");
}

TEST(Obj, AFileThatIsCutIsRefusedOrWarnedOf) {
  const std::string whole = vertices + faces;
  const SurfaceMesh mesh = surface_of(whole.substr(0, whole.size() - 1));
  ASSERT_EQ(mesh.warnings.size(), 1U);
  EXPECT_EQ(mesh.warnings[0].reason, Reason::irregular_file);
  for (std::size_t size = 0; size + 1 < whole.size(); ++size)
    EXPECT_FALSE(surface_from(whole.substr(0, size), "t")) << size;
}

}  // namespace obj_test
}  // namespace helicarm::registration
