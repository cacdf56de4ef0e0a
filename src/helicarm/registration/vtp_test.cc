// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/vtp.h"

#include <algorithm>
#include <cstring>

#include <gtest/gtest.h>
#define ZLIB_CONST
#include <zlib.h>

#include "helicarm/registration/surface.h"

namespace helicarm::registration {
namespace {

const std::vector<float> four_corners = {0, 0, 0, 10, 0, 0, 0, 10, 0, 0, 0, 10};
const std::vector<std::int64_t> four_faces = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
const std::vector<std::int64_t> four_ends = {3, 6, 9, 12};

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string base64(const std::string& bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? digits[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

std::string packed(const std::string& bytes) {
  std::string out(compressBound(bytes.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
           bytes.size());
  out.resize(size);
  return out;
}

std::string with_size(const std::string& bytes) {
  return bytes_of<std::uint32_t>({static_cast<std::uint32_t>(bytes.size())}) + bytes;
}

/// A file whose three arrays have these attributes and contents.
std::string file(const std::string& file_attributes, const std::array<std::string, 3>& attributes,
                 const std::array<std::string, 3>& contents, const std::string& appended = "") {
  const auto array = [&](std::size_t i, const char* type) {
    return "<DataArray type=\"" + std::string(type) + "\" " + attributes[i] + ">\n" + contents[i] +
           "\n</DataArray>\n";
  };
  return "<?xml version=\"1.0\"?>\n<!-- a > b -->\n<VTKFile type=\"PolyData\" " + file_attributes +
         ">\n<PolyData>\n<Piece NumberOfPoints=\"4\" NumberOfPolys=\"4\" NumberOfStrips=\"0\">\n<PointData>\n"
         "<DataArray type=\"Float32\" Name=\"points\" format=\"ascii\">\n1 2 3 4\n</DataArray></PointData>\n"
         "<Points>\n" +
         array(0, "Float32") + "</Points>\n<Polys>\n" + array(1, "Int64") + array(2, "Int64") +
         "</Polys>\n</Piece>\n</PolyData>\n" + appended + "</VTKFile>\n";
}

std::string text_file() {
  return file("",
              {"format=\"ascii\"", "Name=\"connectivity\" format=\"ascii\"", "Name='offsets' format='ascii'"},
              {"0 0 0 10 0 0 0 10 0 0 0 10", "0 2 1 0 1 3 0 3 2 1 2 3", "3 6 9 12"});
}

std::string binary_file(const std::array<std::string, 3>& contents, const std::string& attributes) {
  return file(
      attributes,
      {"format=\"binary\"", "Name=\"connectivity\" format=\"binary\"", "Name=\"offsets\" format=\"binary\""},
      contents);
}

std::string appended_file(const std::array<std::string, 3>& contents, const std::string& encoding) {
  std::array<std::string, 3> attributes = {"", "Name=\"connectivity\" ", "Name=\"offsets\" "};
  std::size_t offset = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    attributes[i] += "format=\"appended\" offset=\"" + std::to_string(offset) + "\"";
    offset += contents[i].size();
  }
  return file("byte_order=\"LittleEndian\"", attributes, {},
              "<AppendedData encoding=\"" + encoding + "\">\n_" + contents[0] + contents[1] + contents[2] +
                  "\n</AppendedData>\n");
}

void expect_tetrahedron(const std::string& bytes) {
  const auto read = surface_from(bytes, "t.vtp");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->corners.size(), 4u);
  EXPECT_EQ(read->triangles.size(), 4u);
  EXPECT_NEAR(phantom::volume(*read), 1000.0 / 6, 1e-9);
}

TEST(Vtp, Text) { expect_tetrahedron(text_file()); }

TEST(Vtp, Base64WithItsSizeTogetherOrApart) {
  expect_tetrahedron(
      binary_file({base64(with_size(bytes_of(four_corners))), base64(with_size(bytes_of(four_faces))),
                   base64(with_size(bytes_of(four_ends)))},
                  "byte_order=\"LittleEndian\" header_type=\"UInt32\""));
  const auto apart = [](const std::string& data) {
    return base64(with_size(data).substr(0, 4)) + base64(data);
  };
  expect_tetrahedron(binary_file(
      {apart(bytes_of(four_corners)), apart(bytes_of(four_faces)), apart(bytes_of(four_ends))}, ""));
}

TEST(Vtp, PackedInBlocks) {
  const auto blocks = [](const std::string& data) {
    const std::string first = packed(data.substr(0, 24)), second = packed(data.substr(24));
    return base64(bytes_of<std::uint64_t>({2, 24, data.size() - 24, first.size(), second.size()})) +
           base64(first + second);
  };
  expect_tetrahedron(
      binary_file({blocks(bytes_of(four_corners)), blocks(bytes_of(four_faces)), blocks(bytes_of(four_ends))},
                  "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\""));
}

TEST(Vtp, AppendedRawAndBase64) {
  const std::array<std::string, 3> raw = {with_size(bytes_of(four_corners)), with_size(bytes_of(four_faces)),
                                          with_size(bytes_of(four_ends))};
  expect_tetrahedron(appended_file(raw, "raw"));
  expect_tetrahedron(appended_file({base64(raw[0]), base64(raw[1]), base64(raw[2])}, "base64"));
}

std::string with_field(const std::string& bytes, const std::string& array) {
  const std::string piece = "<PolyData>\n";
  return std::string(bytes).replace(bytes.find(piece), piece.size(),
                                    piece + "<FieldData>\n" + array + "</FieldData>\n");
}

void expect_in_lps(const std::string& bytes) {
  const auto read = surface_from(bytes, "t.vtp");
  ASSERT_TRUE(read) << read.error().message;
  const auto holds = [&](const Eigen::Vector3d& at) {
    return std::ranges::any_of(read->corners, [&](const auto& corner) { return corner.isApprox(at); });
  };
  EXPECT_TRUE(holds({-10, 0, 0}) && holds({0, -10, 0}) && holds({0, 0, 10}));
}

TEST(Vtp, SpaceOfItsFieldDataAsSlicerWritesIt) {
  const std::string head = R"(<Array type="String" Name="SPACE" NumberOfTuples="1" format=)";
  expect_in_lps(with_field(text_file(), head + "\"ascii\">\n82 65 83 0\n</Array>\n"));
  const std::string binary = base64(with_size(std::string("RAS\0", 4)));
  const std::string whole =
      binary_file({base64(with_size(bytes_of(four_corners))), base64(with_size(bytes_of(four_faces))),
                   base64(with_size(bytes_of(four_ends)))},
                  "");
  expect_in_lps(with_field(whole, head + "\"binary\">\n" + binary + "\n</Array>\n"));
}

TEST(Vtp, SpaceOfAComment) {
  expect_in_lps(
      std::string(text_file()).replace(text_file().find("<!-- a > b -->"), 14, "<!-- SPACE=RAS -->"));
}

TEST(Vtp, UnknownSpaceIsRefused) {
  const auto read = surface_from(
      with_field(text_file(),
                 "<Array type=\"String\" Name=\"SPACE\" format=\"ascii\">\n88 89 90 0\n</Array>\n"),
      "t.vtp");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().reason, Reason::unsupported);
  EXPECT_NE(read.error().message.find("XYZ"), std::string::npos) << read.error().message;
}

void expect_refused(std::string bytes, const std::string& what, const std::string& by, Reason reason) {
  const std::size_t at = bytes.find(what);
  ASSERT_NE(at, std::string::npos) << what;
  const auto read = surface_from(bytes.replace(at, what.size(), by), "t.vtp");
  ASSERT_FALSE(read) << by;
  EXPECT_EQ(read.error().reason, reason) << read.error().message;
  EXPECT_TRUE(read.error().message.starts_with("t.vtp: ")) << read.error().message;
}

TEST(Vtp, WhatCannotBeReadIsNamed) {
  expect_refused(text_file(), "PolyData\"", "ImageData\"", Reason::unsupported);
  expect_refused(text_file(), "NumberOfStrips=\"0\"", "NumberOfStrips=\"3\"", Reason::unsupported);
  expect_refused(text_file(), "NumberOfPoints=\"4\"", "NumberOfPoints=\"99999999999\"", Reason::bad_size);
  expect_refused(text_file(), "0 2 1", "0 2 7", Reason::bad_value);
  expect_refused(text_file(), "3 6 9 12", "3 9 6 12", Reason::bad_value);
  expect_refused(text_file(), "connectivity", "cells", Reason::bad_value);
  expect_refused(text_file(), "type=\"PolyData\" ", "type=\"PolyData\" compressor=\"vtkLZ4DataCompressor\"",
                 Reason::unsupported);
}

TEST(Vtp, EveryShortenedFileIsRefused) {
  const std::string whole = appended_file(
      {with_size(bytes_of(four_corners)), with_size(bytes_of(four_faces)), with_size(bytes_of(four_ends))},
      "raw");
  const std::size_t needed = whole.size() - std::strlen("\n</AppendedData>\n</VTKFile>\n");
  for (std::size_t size = 0; size < needed; ++size)
    EXPECT_FALSE(surface_from(whole.substr(0, size), "t.vtp")) << size;
}

}  // namespace
}  // namespace helicarm::registration
