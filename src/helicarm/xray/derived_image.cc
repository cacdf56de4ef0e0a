// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/derived_image.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/xray/read_dicom.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace {

/// Number of a key, from 1 in the order of first occurrence.
std::size_t number_of(std::vector<std::string>& known, const std::string& key) {
  const auto found = std::ranges::find(known, key);
  const auto number = std::size_t(found - known.begin()) + 1;
  if (found == known.end()) known.push_back(key);
  return number;
}

}  // namespace

DerivedImage derived_image(const XrayImage& source, const image::Image<float>& pixels,
                           std::string description) {
  DerivedImage image;
  const auto range = std::clamp(std::lround(double(source.highest) - source.lowest), 1l, 65535l);
  image.bits_stored = std::max(8, static_cast<int>(std::bit_width(static_cast<unsigned>(range))));
  image.pixels = image::Image<std::uint16_t>(pixels.width(), pixels.height());
  std::ranges::transform(pixels.pixels(), image.pixels.pixels().begin(), [&](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(double(value) - source.lowest), 0l, range));
  });
  image.acquisition = source.acquisition;
  image.derivation = image.series_description = std::move(description);
  const Acquisition& a = source.acquisition;
  if (!a.uid_key.empty()) image.source_instance_uid = uid_of(a.uid_key);
  const std::string content =
      text_key(fmt::format("{} {} {}", a.uid_key, image.derivation, image_key(pixels)));
  image.instance_uid = uid_of(content);
  image.series_uid = uid_of(text_key(content + " series"));
  image.study_uid = uid_of(a.study_key.empty() ? text_key(content + " study") : a.study_key);
  return image;
}

DerivedImage DeIdentification::operator()(const XrayImage& source) {
  DerivedImage image = derived_image(source, source.pixels, "de-identified");
  image.acquisition.acquired.reset();
  image.acquisition.technique.clear();
  const Acquisition& a = source.acquisition;
  image.patient_id = fmt::format("ANON{}", number_of(patients_, a.patient_key));
  // A file without a UID shares none with another.
  const std::string key = a.uid_key.empty() ? a.instance_key : a.uid_key;
  image.study_uid = uid_of(a.study_key.empty() ? text_key(key + " study") : a.study_key);
  image.series_uid = uid_of(text_key(key + " series"));
  image.instance_uid = uid_of(key);
  image.source_instance_uid.clear();
  return image;
}

}  // namespace helicarm::xray
