// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/earlier_versions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/operation/models.h"
#include "helicarm/operation/replay.h"
#include "helicarm/xray/digest.h"

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

std::string digest_of(const case_registration::CaseRegistration& made) {
  return xray::digest(to_text(recorded(made)));
}

TEST(RegisteredEarlier, AnEqualOnlyInThatFormIsNoted) {
  const auto present = unexplained({small, not_explained});
  const auto earlier = as_recorded(present, digest_of(with(Decision::warn, {small})));
  ASSERT_TRUE(earlier);
  EXPECT_FALSE(earlier->registration.models[0].registration.not_explained);
  ASSERT_TRUE(earlier->note);
  EXPECT_THAT(*earlier->note, testing::HasSubstr("without the part of femur"));
  EXPECT_THAT(*earlier->note, testing::HasSubstr("nothing else differs"));
  const auto now = as_recorded(present, digest_of(present));
  ASSERT_TRUE(now);
  EXPECT_FALSE(now->note);
  EXPECT_TRUE(now->registration.models[0].registration.not_explained);
  EXPECT_FALSE(as_recorded(present, digest_of(with(Decision::accept, {}))));
}

TEST(ReplayReports, StateNotesBesideDifferences) {
  ReplayReport report;
  report.finished = true;
  report.notes = {"record 7: as earlier versions recorded it"};
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(to_json(report).at("notes"), Json(report.notes));
  EXPECT_EQ(to_json(report).at("differences"), Json::array());
}

}  // namespace earlier_versions_test
}  // namespace helicarm::operation
