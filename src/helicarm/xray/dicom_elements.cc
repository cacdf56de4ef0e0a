// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_elements.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/xray/dicom_tags.h"

namespace helicarm::xray {
namespace {

/// A value without the padding of DICOM: spaces, and zero bytes at its end.
std::string_view without_padding(std::string_view text) {
  const auto first = text.find_first_not_of(' ');
  if (first == std::string_view::npos) return {};
  const auto last = text.find_last_not_of(std::string_view(" \0", 2));
  return last == std::string_view::npos ? std::string_view{} : text.substr(first, last - first + 1);
}

std::optional<double> decimal(std::string_view text) {
  text = without_padding(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

std::string quote(std::string_view value) {
  std::string shown = "\"";
  for (char c : value.substr(0, 40)) shown += c >= ' ' && c <= '~' ? c : '?';
  return shown + (value.size() > 40 ? "...\"" : "\"");
}

void DicomElements::refuse(Reason reason, DicomTag tag, std::string_view problem) const {
  throw BadInput(reason, fmt::format("{}: {} ({:04X},{:04X}) {}", origin, tag.name, tag.number >> 16,
                                     tag.number & 0xFFFF, problem));
}

const DicomElement* DicomElements::find(DicomTag tag) const {
  const auto found = std::ranges::lower_bound(elements, tag.number, {}, &DicomElement::tag);
  return found != elements.end() && found->tag == tag.number ? &*found : nullptr;
}

std::string_view DicomElements::text(DicomTag tag) const {
  const DicomElement* element = find(tag);
  return element ? without_padding(element->value) : std::string_view{};
}

std::optional<std::vector<double>> DicomElements::numbers(DicomTag tag, std::size_t count, double low,
                                                          double high) const {
  const std::string_view all = text(tag);
  if (all.empty()) return std::nullopt;
  std::vector<double> values;
  for (std::size_t start = 0; start <= all.size() && values.size() <= count;) {
    const std::size_t end = std::min(all.find('\\', start), all.size());
    const auto value = decimal(all.substr(start, end - start));
    if (!value || *value < low || *value > high) break;
    values.push_back(*value);
    start = end + 1;
    if (end == all.size() && values.size() == count) return values;
  }
  refuse(Reason::bad_value, tag,
         fmt::format("is {}, must be {} of {} to {}", quote(all),
                     count == 1 ? "one number" : fmt::format("{} numbers", count), low, high));
}

std::size_t DicomElements::count(DicomTag tag) const {
  const std::string_view all = text(tag);
  return all.empty() ? 0 : 1 + static_cast<std::size_t>(std::ranges::count(all, '\\'));
}

std::optional<std::uint16_t> DicomElements::word(DicomTag tag, std::string_view vr) const {
  const DicomElement* element = find(tag);
  if (!element) return std::nullopt;
  const std::string_view stated_vr(element->vr.data(), 2);
  if (stated_vr != "  " && stated_vr != "UN" && stated_vr != vr)
    refuse(Reason::bad_value, tag, fmt::format("has the VR {}, must be {}", stated_vr, vr));
  if (element->value.size() != 2)
    refuse(Reason::bad_value, tag, fmt::format("has {} bytes, must have 2", element->value.size()));
  const auto* bytes = reinterpret_cast<const unsigned char*>(element->value.data());
  return static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8);
}

}  // namespace helicarm::xray
