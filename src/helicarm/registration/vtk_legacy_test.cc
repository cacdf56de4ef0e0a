// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>

#include <gmock/gmock.h>

#include "helicarm/registration/surface.h"

namespace helicarm::registration {
namespace vtk_legacy_test {

using Eigen::Vector3d;
using testing::HasSubstr;

std::string head(const std::string& coding, const std::string& version = "3.0",
                 const std::string& title = "bone") {
  return "# vtk DataFile Version " + version + "\n" + title + "\n" + coding + "\nDATASET POLYDATA\n";
}

const std::string text_points = "POINTS 4 float\n0 0 0 10 0 0 0 10 0\n0 0 20 \n";
const std::string text_polygons = "POLYGONS 4 16\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
const std::string text_offsets =
    "POLYGONS 5 12\nOFFSETS vtktypeint64\n0 3 6 9 12\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3 0 3 2 1 2 3\n";
const std::string text_file = head("ASCII") + text_points + text_polygons;

/// In big-endian order, as the format demands.
template <class T>
std::string big(std::initializer_list<T> values) {
  std::string bytes;
  for (const T value : values) {
    const auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
    bytes.append(raw.rbegin(), raw.rend());
  }
  return bytes;
}

const std::string binary_points =
    "POINTS 4 double\n" + big<double>({0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 20}) + "\n";
const std::string binary_file = head("BINARY") + binary_points + "POLYGONS 4 16\n" +
                                big<std::int32_t>({3, 0, 2, 1, 3, 0, 1, 3, 3, 0, 3, 2, 3, 1, 2, 3}) + "\n";
const std::string binary_offsets_file =
    head("BINARY", "5.1") + binary_points + "POLYGONS 5 12\nOFFSETS vtktypeint64\n" +
    big<std::int64_t>({0, 3, 6, 9, 12}) + "\nCONNECTIVITY vtktypeint64\n" +
    big<std::int64_t>({0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}) + "\n";

SurfaceMesh surface_of(const std::string& bytes) {
  const auto read = surface_from(bytes, "t.vtk");
  EXPECT_TRUE(read) << read.error().message;
  if (!read) return {};
  EXPECT_EQ(read->triangles.size(), 4U);
  EXPECT_EQ(read->corners.size(), 4U);
  EXPECT_NEAR(phantom::volume(*read), 1000.0 / 3, 1e-9);
  EXPECT_TRUE(prepare_surface(*read, "t.vtk"));
  return *read;
}

bool has_corner(const SurfaceMesh& mesh, const Vector3d& at) {
  return std::ranges::any_of(mesh.corners, [&](const Vector3d& corner) { return corner.isApprox(at); });
}

void expect_refused(std::string bytes, const std::string& what, const std::string& by, Reason reason,
                    const std::string& words) {
  const std::size_t at = bytes.find(what);
  ASSERT_NE(at, std::string::npos) << what;
  const auto read = surface_from(bytes.replace(at, what.size(), by), "t.vtk");
  ASSERT_FALSE(read) << by;
  EXPECT_EQ(read.error().reason, reason) << read.error().message;
  EXPECT_THAT(read.error().message, HasSubstr(words));
  EXPECT_THAT(read.error().message, testing::StartsWith("t.vtk: "));
}

TEST(LegacyVtk, TextAndBinaryOfEitherFormOfCells) {
  surface_of(text_file);
  surface_of(head("ASCII", "5.1") + text_points + text_offsets);
  surface_of(binary_file);
  surface_of(binary_offsets_file);
}

TEST(LegacyVtk, TriangleStripsTurnAlternately) {
  // Five corners around a tetrahedron's edges; the last triangle closes it.
  const std::string strips = "TRIANGLE_STRIPS 1 7\n6 0 2 1 3 0 2\n";
  surface_of(head("ASCII") + text_points + strips);
  surface_of(head("ASCII", "5.1") + text_points +
             "TRIANGLE_STRIPS 2 6\nOFFSETS vtktypeint64\n0 6\nCONNECTIVITY vtktypeint64\n0 2 1 3 0 2\n");
}

TEST(LegacyVtk, WhatIsNoSurfaceIsPassedOver) {
  const std::string metadata =
      "METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 20\n\n";
  const std::string field =
      "FIELD FieldData 3\nTimeValue 1 1 double\n0.5\n" + metadata + "note 1 1 string\na%20b\nNULL_ARRAY\n";
  surface_of(head("ASCII") + field + text_points + metadata + "VERTICES 1 2\n1 0\nLINES 1 3\n2 0 1\n" +
             text_polygons + metadata + "CELL_DATA 4\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4\n");
  surface_of(head("ASCII", "5.1") + text_points + metadata +
             "LINES 2 2\nOFFSETS vtktypeint64\n0 2\nCONNECTIVITY vtktypeint64\n0 1\n" + metadata +
             text_offsets + metadata);
  std::string binary = binary_file;
  const std::string between = "FIELD FieldData 2\nids 2 2 vtkIdType\n" + big<std::int32_t>({1, 2, 3, 4}) +
                              "\nnote 1 1 string\n\xC3" + "abc\n" + "VERTICES 1 2\n" +
                              big<std::int32_t>({1, 0}) + "\n";
  surface_of(binary.insert(binary.find("POINTS"), between));
  std::string windows = text_file;
  for (std::size_t at = 0; (at = windows.find('\n', at)) != std::string::npos; at += 2)
    windows.insert(at, "\r");
  surface_of(windows);
}

TEST(LegacyVtk, SpaceAndUnitOfItsTitleOrFieldDataAreConverted) {
  const Vector3d ras(-10, 0, 0);
  const auto titled = [](const std::string& title) {
    return surface_from(head("ASCII", "4.2", title) + text_points + text_polygons, "t.vtk");
  };
  EXPECT_TRUE(has_corner(*titled("3D Slicer output. SPACE=RAS"), ras));
  EXPECT_TRUE(has_corner(*titled("3D Slicer output. SPACE=LPS"), -ras));
  EXPECT_TRUE(has_corner(*titled("vtk output"), -ras));
  EXPECT_TRUE(has_corner(*titled("units: cm"), Vector3d(0, 0, 200)));
  EXPECT_EQ(titled("SPACE=scanner").error().reason, Reason::unsupported);
  const std::string text_field = "FIELD FieldData 1\nSPACE 1 1 string\nRAS\n";
  const auto in_text = surface_from(head("ASCII") + text_field + text_points + text_polygons, "t.vtk");
  ASSERT_TRUE(in_text) << in_text.error().message;
  EXPECT_TRUE(has_corner(*in_text, ras));
  std::string binary = binary_file;
  binary.insert(binary.find("POINTS"), "FIELD FieldData 1\nSPACE 1 1 string\n\xC3" + std::string("RAS\n"));
  const auto in_binary = surface_from(binary, "t.vtk");
  ASSERT_TRUE(in_binary) << in_binary.error().message;
  EXPECT_TRUE(has_corner(*in_binary, ras));
  const std::string both = head("ASCII", "3.0", "SPACE=LPS") + text_field + text_points + text_polygons;
  EXPECT_EQ(surface_from(both, "t.vtk").error().reason, Reason::bad_value);
}

TEST(LegacyVtk, WhatCannotBeReadIsNamed) {
  expect_refused(text_file, "POLYDATA", "STRUCTURED_POINTS", Reason::unsupported,
                 "\"STRUCTURED_POINTS\"; save");
  expect_refused(text_file, "3.0", "9.0", Reason::unsupported, "version 9");
  expect_refused(text_file, "ASCII", "UTF-8", Reason::bad_value, "must be ASCII or BINARY");
  expect_refused(text_file, "4 float", "99999999999 float", Reason::bad_size, "POINTS is 99999999999, limit");
  expect_refused(text_file, "4 float", "-4 float", Reason::bad_value, "POINTS: the number is -4");
  expect_refused(text_file, "4 float", "15000000 float", Reason::truncated, "POINTS needs 45000000 numbers");
  expect_refused(binary_file, "4 double", "9000000 double", Reason::truncated,
                 "POINTS needs 216000000 bytes");
  expect_refused(text_file, "float", "long", Reason::unsupported, "type \"long\"");
  expect_refused(text_file, "0 0 20", "0 nan 20", Reason::not_finite, "corner 3 is not finite");
  expect_refused(text_file, "3 0 2 1", "3 0 2 7", Reason::bad_value,
                 "polygons 0 names point 7, must be 0 to 3");
  expect_refused(text_file, "3 0 2 1", "3 0 2 -1", Reason::bad_value, "names point -1");
  expect_refused(text_file, "3 0 2 1", "9999999 0 2 1", Reason::bad_value,
                 "has 9999999 corners, must be 0 to 15");
  expect_refused(text_file, "POLYGONS 4 16", "POLYGONS 3 16", Reason::bad_value,
                 "3 cells have 12 numbers, 16 are stated");
  expect_refused(text_file, "POLYGONS 4 16", "POLYGONS 5 16", Reason::bad_value,
                 "hold 4 cells, 5 are stated");
  expect_refused(text_file, "POLYGONS", "PENTAGONS", Reason::bad_value, "\"pentagons\" is no section");
  const std::string offsets = head("ASCII", "5.1") + text_points + text_offsets;
  expect_refused(offsets, "0 3 6 9 12", "0 6 3 9 12", Reason::bad_value, "has the offsets 6 and 3");
  expect_refused(offsets, "0 3 6 9 12", "0 3 6 9 99", Reason::bad_value, "be 0 to 12");
  expect_refused(offsets, "OFFSETS", "ENDS", Reason::bad_value, "\"ends\" where offsets must follow");
}

TEST(LegacyVtk, EveryShortenedFileIsRefused) {
  for (const std::string& whole : {text_file, binary_file, binary_offsets_file})
    for (std::size_t size = 0; size + 2 < whole.size(); ++size)
      EXPECT_FALSE(surface_from(whole.substr(0, size), "t.vtk")) << size;
}

TEST(LegacyVtk, ChangedBytesAreReadOrRefused) {
  for (const std::string& whole : {text_file, binary_file, binary_offsets_file})
    for (std::size_t at = 0; at < whole.size(); ++at)
      for (const int change : {1, 0x80, 0xFF}) {
        std::string other = whole;
        other[at] = static_cast<char>(other[at] ^ change);
        surface_from(other, "t.vtk");
      }
}

}  // namespace vtk_legacy_test
}  // namespace helicarm::registration
