// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/earlier_versions.h"

#include <gtest/gtest.h>

#include "helicarm/operation/models.h"

namespace helicarm::operation {
namespace earlier_versions_test {

using registration::Decision;

const Warning small{Reason::uncertain, "femur: 2.1 mm", {}, {{"error_mm", 2.1}}};
const Warning not_explained{Reason::wrong_model, "femur: a part", {}, {{"agreement_elsewhere", 0.8}}};
const Warning planned_in_it{Reason::wrong_model, "femur: planned", {}, {{"points", 2}, {"tunnels", 1}}};

case_registration::CaseRegistration with(Decision decision, const std::vector<Warning>& warnings,
                                         const std::optional<Failure>& failure = {}) {
  case_registration::CaseRegistration made;
  registration::Registration& found = made.models.emplace_back().registration;
  found.name = "femur";
  found.covariance.setIdentity();
  found.decision = decision;
  found.warnings = warnings;
  found.failure = failure;
  return made;
}

case_registration::CaseRegistration unexplained(const std::vector<Warning>& warnings,
                                                const std::optional<Failure>& failure = {}) {
  auto made = with(failure ? Decision::refuse : Decision::warn, warnings, failure);
  made.models[0].registration.not_explained.emplace();
  return made;
}

Json earlier(const case_registration::CaseRegistration& present) {
  return recorded(as_registered_earlier(present));
}

TEST(RegisteredEarlier, KnewNoPartThatIsNotExplained) {
  EXPECT_EQ(earlier(unexplained({not_explained})), recorded(with(Decision::accept, {})));
  EXPECT_EQ(earlier(unexplained({small, not_explained})), recorded(with(Decision::warn, {small})));
}

TEST(RegisteredEarlier, AcceptedWhatIsPlannedThere) {
  EXPECT_EQ(earlier(unexplained({not_explained}, planned_in_it)), recorded(with(Decision::accept, {})));
  EXPECT_EQ(earlier(unexplained({not_explained, planned_in_it})), recorded(with(Decision::accept, {})));
}

TEST(RegisteredEarlier, OtherFindingsRemain) {
  const Failure breach{Reason::tunnel_breach, "femur: the wall leaves the bone"};
  EXPECT_EQ(earlier(unexplained({not_explained}, breach)), recorded(with(Decision::refuse, {}, breach)));
  const auto refused = with(Decision::refuse, {}, planned_in_it);  // by no such part
  EXPECT_EQ(earlier(refused), recorded(refused));
}

}  // namespace earlier_versions_test
}  // namespace helicarm::operation
