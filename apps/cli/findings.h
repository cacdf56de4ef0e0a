// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <ranges>
#include <string_view>

#include "command.h"

namespace helicarm::cli {

/// "helicarm: KIND: CODE: VIEW: MESSAGE" on the progress stream, with the number of `more` of its kind;
/// nothing with --quiet.
void print_finding(std::string_view kind, const Failure& finding, Console& console, std::size_t more = 0);

/// Warnings, a line each.
template <std::ranges::range Warnings>
void print_warnings(const Warnings& warnings, Console& console) {
  for (const Warning& warning : warnings) print_finding("warning", warning, console);
}

/// Notes: of each kind the first, with the number of further ones.
template <std::ranges::range Notes>
void print_notes(const Notes& notes, Console& console) {
  std::map<Reason, std::size_t> count;
  for (const Warning& note : notes) ++count[note.reason];
  for (const Warning& note : notes)
    if (const auto of_kind = count.extract(note.reason))
      print_finding("note", note, console, of_kind.mapped() - 1);
}

}  // namespace helicarm::cli
