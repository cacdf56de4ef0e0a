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
  std::string filled, rest = name;
  for (std::smatch match; std::regex_search(rest, match, forms); rest = match.suffix())
    filled +=
        match.prefix().str() + fmt::format("{:0{}}", number, match[1].matched ? std::stoi(match[1]) : 1);
  if (filled.empty() || rest.find(placeholder) != std::string::npos)
    throw BadInput(Reason::bad_value, fmt::format("views: \"image\": \"{}\": write {{frame}} or, for leading "
                                                  "zeros, {{frame:03d}}",
                                                  name));
  return filled + rest;
}

}  // namespace

bool is_numbered(const CaseView& view) {
  return view.image.filename().string().find(placeholder) != std::string::npos;
}

bool is_sequence(const Case& the_case) { return std::ranges::any_of(the_case.views, is_numbered); }

Expected<CaseView> at_number(CaseView view, int number) {
  return guarded([&] {
    if (is_numbered(view))
      view.image.replace_filename(numbered(view.image.filename().string(), number));
    else
      view.frame = number;
    return std::move(view);
  });
}

Expected<Case> at_frame(Case the_case, int frame) {
  return guarded([&] {
    for (CaseView& view : the_case.views)
      view = value_or_throw(at_number(std::move(view), frame + view.frame_offset.value_or(0)));
    return std::move(the_case);
  });
}

}  // namespace helicarm::pipeline
