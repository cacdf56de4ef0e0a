// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/operation/plan.h"

/// Records of operations that earlier versions made, with helicarm-case/1.
namespace helicarm::operation {

bool is_of_earlier_version(const Json& recorded_case);

/// The case of an operation of an earlier version in the present form; `present` has its format and bones.
Json case_in_present_form(const Json& recorded, const Json& present, const OperationPlan& plan);

/// Earlier versions made every pose that they read a rotation again, which changes last bits.
pipeline::Case as_read_earlier(pipeline::Case the_case);

/// What an earlier version wrote of a result too: the keys of `then`, and its numbers where only rounding,
/// which the compiler decides, differs.
Json in_keys_of(const Json& then, const Json& now);

/// Earlier versions did not know which part of a model its pose leaves unexplained.
case_registration::CaseRegistration as_registered_earlier(case_registration::CaseRegistration registration);

/// A registration in the form in which it was recorded.
struct RecordedRegistration {
  case_registration::CaseRegistration registration;
  /// In which form of earlier versions alone it equals the record, and that nothing else differs; nothing:
  /// as it is registered now.
  std::optional<std::string> note = {};
};

/// The registration, or what an earlier version made of it, whose record has this digest; nothing where the
/// recorded one is another.
std::optional<RecordedRegistration> as_recorded(case_registration::CaseRegistration registration,
                                                const std::string& digest);

/// Earlier versions did not state how deep a verified drill was.
bool states_depth(const Json& result);

}  // namespace helicarm::operation
