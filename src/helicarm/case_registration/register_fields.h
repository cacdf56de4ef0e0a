// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/field.h"
#include "helicarm/pipeline/run_fields.h"

namespace helicarm::case_registration {

/// Options of a registration besides those of a run.
inline constexpr std::array<Field<SearchRange>, 2> search_fields{
    bound<&SearchRange::shift_mm>({.name = "search_mm",
                                   .label = "Search about a model's start",
                                   .flag = "--search-mm",
                                   .unit = "mm",
                                   .range = {0, 100},
                                   .help = "Models: search about the start, mm per axis"}),
    bound<&SearchRange::turn_deg>({.name = "search_deg",
                                   .label = "Search about a model's start, rotation",
                                   .flag = "--search-deg",
                                   .unit = "deg",
                                   .range = {0, 180},
                                   .help = "Models: search about the start, degrees per axis"})};

/// Whether two registrations may differ by their options alone.
inline bool give_the_same(const RegisterOptions& a, const RegisterOptions& b) {
  return pipeline::give_the_same(a.run, b.run) && a.search == b.search;
}

}  // namespace helicarm::case_registration
