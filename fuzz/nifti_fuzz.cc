// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include "helicarm/volume/read_volume.h"
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {
namespace {

template <class T>
void set(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// 2 x 1 x 2 voxels of 16 bits, positioned by the sform (1), the qform (2) or neither (0).
std::string volume_file(int form) {
  std::string bytes(352, '\0');
  set<std::int32_t>(bytes, 0, 348);
  for (const auto& [at, value] : {std::pair{40, 3}, {42, 2}, {44, 1}, {46, 2}, {70, 4}, {72, 16}})
    set(bytes, std::size_t(at), static_cast<std::int16_t>(value));
  set<std::int16_t>(bytes, 254, form == 1);
  set<std::int16_t>(bytes, 252, form == 2);
  for (const auto& [at, value] : {std::pair{80, 1.F},
                                  {84, 2.F},
                                  {88, 3.F},
                                  {108, 352.F},
                                  {112, 2.F},
                                  {116, -1000.F},
                                  {260, 0.5F},
                                  {268, 7.F},
                                  {280, 1.F},
                                  {292, 10.F},
                                  {300, 2.F},
                                  {320, 3.F}})
    set(bytes, std::size_t(at), value);
  bytes.replace(344, 4, std::string("n+1\0", 4));
  return bytes + voxels16(4);
}

/// The same in the second version.
std::string second_version(int form) {
  std::string bytes(544, '\0');
  set<std::int32_t>(bytes, 0, 540);
  bytes.replace(4, 8, std::string("n+2\0\r\n\x1a\n", 8));
  set<std::int16_t>(bytes, 12, 4);
  set<std::int16_t>(bytes, 14, 16);
  for (const auto& [at, value] : {std::pair{16, 3}, {24, 2}, {32, 1}, {40, 2}, {168, 544}})
    set<std::int64_t>(bytes, std::size_t(at), value);
  set<std::int32_t>(bytes, 348, form == 1);
  set<std::int32_t>(bytes, 344, form == 2);
  for (const auto& [at, value] : {std::pair{112, 1.},
                                  {120, 2.},
                                  {128, 3.},
                                  {176, 2.},
                                  {360, 0.5},
                                  {376, 7.},
                                  {400, 1.},
                                  {424, 10.},
                                  {440, 2.},
                                  {480, 3.}})
    set(bytes, std::size_t(at), value);
  return bytes + voxels16(4);
}

/// The header of a pair, whose voxels `run` puts beside it.
std::string header_of(std::string file, bool second) {
  file[second ? 5 : 345] = 'i';
  second ? set<std::int64_t>(file, 168, 0) : set<float>(file, 108, 0);
  return file;
}

}  // namespace

void run(std::string_view bytes) {
  // Half of the inputs are compressed here: mutated compressed bytes rarely decompress.
  const unsigned choice = Choices(bytes).byte();
  const std::string file = choice % 2 == 1 ? gzipped(std::string(bytes)) : std::string(bytes);
  if (choice % 4 < 2) return run_volume(file);
  put_file("pair.img", voxels16(4));
  check_volume(volume::read_volume(put_file("pair.hdr", file)));
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  for (const int form : {0, 1, 2})
    for (const char packed : {'\0', '\1'}) {
      all.push_back(packed + volume_file(form));
      all.push_back(packed + second_version(form));
    }
  for (const char packed : {'\2', '\3'}) {
    all.push_back(packed + header_of(volume_file(1), false));
    all.push_back(packed + header_of(second_version(1), true));
  }
  all.push_back('\0' + gzipped(volume_file(1)));
  return all;
}

}  // namespace helicarm::fuzz
