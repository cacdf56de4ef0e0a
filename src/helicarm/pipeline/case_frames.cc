// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case_frames.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

namespace helicarm::pipeline {
namespace {

constexpr std::string_view placeholder = "{frame";

std::string numbered(const std::string& name, int number) {
  static const std::regex forms(R"(\{frame(?::0([1-9])d)?\})");
  std::string made, rest = name;
  for (std::smatch match; std::regex_search(rest, match, forms); rest = match.suffix())
    made += match.prefix().str() + fmt::format("{:0{}}", number, match[1].matched ? std::stoi(match[1]) : 1);
  if (made.empty() || rest.find(placeholder) != std::string::npos)
    throw BadInput(Reason::bad_value, fmt::format("views: \"image\": \"{}\": write {{frame}} or, for leading "
                                                  "zeros, {{frame:03d}}",
                                                  name));
  return made + rest;
}

}  // namespace

bool is_numbered(const CaseView& view) {
  return view.image.filename().string().find(placeholder) != std::string::npos;
}

bool is_sequence(const Case& given) { return std::ranges::any_of(given.views, is_numbered); }

Expected<CaseView> at_number(CaseView view, int number) {
  return guarded([&] {
    if (is_numbered(view))
      view.image.replace_filename(numbered(view.image.filename().string(), number));
    else
      view.frame = number;
    return std::move(view);
  });
}

Expected<Case> at_frame(Case given, int frame) {
  return guarded([&] {
    for (CaseView& view : given.views)
      view = value_or_throw(at_number(std::move(view), frame + view.frame_offset.value_or(0)));
    return std::move(given);
  });
}

}  // namespace helicarm::pipeline
