// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_marks.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/detection/find_crosses.h"
#include "helicarm/detection/find_dots.h"

namespace helicarm::detection {
namespace {

std::vector<Dot> marks_of(const xray::XrayImage& xray_image, bool crosses, Polarity polarity) {
  if (crosses) {
    CrossOptions options;
    options.polarity = polarity;
    return find_crosses(xray_image, options);
  }
  DotOptions options;
  options.polarity = polarity;
  return find_clear_dots(xray_image, options);
}

}  // namespace

Expected<MarkKind> mark_kind(std::string_view word) {
  const auto found = std::ranges::find(mark_words, word);
  if (found == mark_words.end())
    return fail(Reason::usage, fmt::format("kind: \"{}\" is none of: {}", word, fmt::join(mark_words, ", ")));
  return MarkKind(found - mark_words.begin());
}

std::vector<Dot> find_marks(const xray::XrayImage& xray_image, MarkKind kind) {
  if (kind == MarkKind::holes) return marks_of(xray_image, false, Polarity::bright);
  auto dark = marks_of(xray_image, kind == MarkKind::crosses, Polarity::dark);
  auto bright = marks_of(xray_image, kind == MarkKind::crosses, Polarity::bright);
  return dark.size() >= bright.size() ? dark : bright;
}

}  // namespace helicarm::detection
