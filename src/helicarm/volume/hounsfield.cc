// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/hounsfield.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::volume {
namespace {

constexpr float least_span = 100;  // marrow and muscle in fat span this without any bone
constexpr float most_of_a_byte = 255;
constexpr float most_hu = 32767;  // of 16 bits; metal on a scanner's extended scale reaches 20000

bool is_mask(const Volume& volume, float least, float greatest) {
  if (least != 0 || greatest <= 0 || greatest > most_of_a_byte || std::floor(greatest) != greatest)
    return false;
  return std::ranges::all_of(volume.voxels, [&](float value) { return value == 0 || value == greatest; });
}

/// What values from 0 on probably are, and what to do.
std::string guess(float least, float greatest) {
  if (greatest <= 10) return "they may be attenuations (drr reads them as raw values) or a scaled image";
  if (greatest <= most_of_a_byte) return "they may be an image of 8 bits: export the CT itself";
  if (least <= 100 && greatest <= 6000)
    return "they may be HU + 1024: subtract that (of a TIFF stack: tiff_offset_hu, --tiff-offset -1024)";
  return "convert them to Hounsfield units";
}

}  // namespace

Expected<std::vector<Warning>> check_hounsfield(const Volume& volume, const std::string& origin) {
  if (volume.voxels.empty()) return {};
  const auto [least, greatest] = std::ranges::minmax(volume.voxels);
  if (is_mask(volume, least, greatest))
    return fail(
        Reason::bad_value,
        fmt::format("{}: holds only 0 and {:g}: it is a mask, no CT; give the CT it was drawn on as the "
                    "volume, and this as the model's mask",
                    origin, greatest));
  const bool narrow = greatest - least < least_span;
  if (least < 0 && !narrow && greatest <= most_hu) return {};
  const std::string why =
      least >= 0 ? "nothing is below 0, as air, fat and noise are; " + guess(least, greatest)
      : narrow
          ? fmt::format("they span less than {:g}", least_span)
          : fmt::format("a CT's end at {:g}, metal included: is their factor (in DICOM Rescale Slope) right?",
                        most_hu);
  return std::vector<Warning>{
      {Reason::not_hounsfield,
       fmt::format(
           "{}: values of {:g} to {:g} are hardly Hounsfield units: {}. What is computed from them is "
           "wrong if they are not",
           origin, least, greatest, why),
       {},
       {{"least", double(least)}, {"greatest", double(greatest)}}}};
}

}  // namespace helicarm::volume
