// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/volume/declared.h"
#include "helicarm/volume/read_volume.h"

namespace helicarm::volume {
namespace {

/// What a file's name says of a pair.
struct PairName {
  std::string stem;
  bool is_header, capitals;
};

std::optional<PairName> pair_name(const std::filesystem::path& path) {
  std::string name = path.filename().string();
  if (small_letters(name).ends_with(".gz")) name.resize(name.size() - 3);
  const std::string small = small_letters(name);
  if (!small.ends_with(".hdr") && !small.ends_with(".img")) return std::nullopt;
  return PairName{name.substr(0, name.size() - 4), small.ends_with(".hdr"), name.back() < 'a'};
}

}  // namespace

bool is_named_as_voxels(const std::filesystem::path& path) {
  const auto name = pair_name(path);
  return name && !name->is_header;
}

Expected<std::optional<std::filesystem::path>> other_of_pair(const std::filesystem::path& path) {
  const auto name = pair_name(path);
  if (!name) return std::nullopt;
  const char* ending = name->is_header ? name->capitals ? ".IMG" : ".img" : name->capitals ? ".HDR" : ".hdr";
  const std::filesystem::path plain = path.parent_path() / (name->stem + ending);
  const std::filesystem::path packed = plain.string() + (name->capitals ? ".GZ" : ".gz");
  std::error_code error;
  const bool has_plain = std::filesystem::exists(plain, error),
             has_packed = std::filesystem::exists(packed, error);
  const char* role = name->is_header ? "the header of a NIfTI pair" : "taken as the voxels of a NIfTI pair";
  if (has_plain && has_packed)
    return fail(Reason::name_clash,
                fmt::format("{}: is {}, but both {} and {} lie beside it: remove one of them", path.string(),
                            role, plain.filename().string(), packed.filename().string()));
  if (!has_plain && !has_packed)
    return fail(Reason::missing_file,
                fmt::format("{}: is {}; its other file, {} or {}, is missing", path.string(), role,
                            plain.filename().string(), packed.filename().string()));
  return has_plain ? plain : packed;
}

}  // namespace helicarm::volume
