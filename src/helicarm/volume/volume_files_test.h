// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstring>
#include <filesystem>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include "helicarm/core/files.h"
#include "helicarm/volume/read_volume.h"

/// Small volume files of each format for tests.
namespace helicarm::volume {

class VolumeFiles : public testing::Test {
 protected:
  VolumeFiles() { std::filesystem::create_directories(folder_); }
  ~VolumeFiles() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path put(const std::string& name, const std::string& bytes) const {
    EXPECT_TRUE(write_file(folder_ / name, bytes));
    return folder_ / name;
  }
  Expected<Volume> read(const std::string& name, const std::string& bytes) const {
    return read_volume(put(name, bytes));
  }
  Reason refusal(const std::string& bytes) const {
    const auto volume = read("odd", bytes);
    EXPECT_FALSE(volume.has_value());
    return volume ? Reason::usage : volume.error().reason;
  }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / fmt::format("helicarm_volume_files_{}", ::getpid());
};

template <class T>
std::string stored(std::initializer_list<T> values, bool big = false) {
  std::string bytes;
  for (const T value : values) {
    std::string word(sizeof value, '\0');
    std::memcpy(word.data(), &value, sizeof value);
    bytes += big ? std::string(word.rbegin(), word.rend()) : word;
  }
  return bytes;
}

inline std::string packed(const std::string& bytes, bool gzip) {
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, 15 + (gzip ? 16 : 0), 8, Z_DEFAULT_STRATEGY);
  std::string out(compressBound(bytes.size()) + 32, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

inline std::string meta(const std::string& lines, const std::string& data,
                        const std::string& size = "2 1 2") {
  return "ObjectType = Image\nNDims = 3\nDimSize = " + size + "\n" + lines + "ElementDataFile = LOCAL\n" +
         data;
}

inline std::string nrrd(const std::string& lines, const std::string& data,
                        const std::string& type = "short") {
  return "NRRD0004\n# a comment\ntype: " + type + "\ndimension: 3\nsizes: 2 1 2\nendian: little\n" + lines +
         "\n" + data;
}

/// NIfTI-1 header for 2 x 1 x 2 voxels of int16, followed by the voxels.
struct Nifti {
  std::string bytes = std::string(352, '\0');
  bool big = false;

  explicit Nifti(bool big_endian = false) : big(big_endian) {
    set<std::int32_t>(0, 348);
    for (const auto& [at, value] : {std::pair{40, 3}, {42, 2}, {44, 1}, {46, 2}, {70, 4}, {72, 16}, {254, 1}})
      set<std::int16_t>(static_cast<std::size_t>(at), static_cast<std::int16_t>(value));
    for (const auto& [at, value] : {std::pair{80, 1.F},
                                    {84, 2.F},
                                    {88, 3.F},
                                    {108, 352.F},
                                    {280, 1.F},
                                    {292, 10.F},
                                    {300, 2.F},
                                    {308, 20.F},
                                    {320, 3.F},
                                    {324, 30.F}})
      set<float>(static_cast<std::size_t>(at), value);
    bytes.replace(344, 4, std::string("n+1\0", 4));
    bytes += stored<std::int16_t>({1, 2, -3, 4}, big);
  }
  template <class T>
  Nifti& set(std::size_t at, T value) {
    bytes.replace(at, sizeof value, stored({value}, big));
    return *this;
  }
};

/// NIfTI-2 header for 2 x 1 x 2 voxels of int16, followed by the voxels. Offsets are those of nifti2.h.
struct Nifti2 {
  std::string bytes = std::string(544, '\0');
  bool big = false;

  explicit Nifti2(bool big_endian = false) : big(big_endian) {
    set<std::int32_t>(0, 540);
    bytes.replace(4, 8, std::string("n+2\0\r\n\x1a\n", 8));
    set<std::int16_t>(12, 4).set<std::int16_t>(14, 16);
    const std::int64_t dims[] = {3, 2, 1, 2, 1, 1, 1, 1};
    for (std::size_t i = 0; i < 8; ++i) set<std::int64_t>(16 + 8 * i, dims[i]);
    set<std::int64_t>(168, 544).set<std::int32_t>(348, 1);
    const double pixdim[] = {1, 1, 2, 3}, rows[] = {1, 0, 0, 10, 0, 2, 0, 20, 0, 0, 3, 30};
    for (std::size_t i = 0; i < 4; ++i) set(104 + 8 * i, pixdim[i]);
    for (std::size_t i = 0; i < 12; ++i) set(400 + 8 * i, rows[i]);
    bytes += stored<std::int16_t>({1, 2, -3, 4}, big);
  }
  template <class T>
  Nifti2& set(std::size_t at, T value) {
    bytes.replace(at, sizeof value, stored({value}, big));
    return *this;
  }
  /// The header of a pair, alone.
  std::string header() const {
    return Nifti2(*this).set<std::int64_t>(168, 0).bytes.replace(4, 2, "ni").substr(0, 544);
  }
};

inline const std::string four = stored<std::int16_t>({1, 2, -3, 4});

}  // namespace helicarm::volume
