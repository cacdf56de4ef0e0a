// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/admission.h"

#include <set>
#include <vector>

#include <gtest/gtest.h>

namespace helicarm::receiver {
namespace {

class AdmissionOfPeers : public testing::Test {
 protected:
  std::optional<Admission::Id> connect(const std::string& address) {
    const int number = ++connected_;
    return admission_.connect(
        address, [this, number] { evicted_.push_back(number); }, at());
  }
  Admission::Id associated(const std::string& address) {
    const Admission::Id id = connect(address).value();
    EXPECT_TRUE(admission_.associate(id, at()));
    return id;
  }
  Admission::Clock::time_point at() const {
    return Admission::Clock::time_point(std::chrono::hours(1)) +
           std::chrono::duration_cast<Admission::Clock::duration>(std::chrono::duration<double>(now_s_));
  }

  // 4 associations, 2 per address; 8 connections, 4 per address.
  Admission admission_{{.associations = 4, .of_address = 2, .connections = 2, .spared_s = 2}};
  double now_s_ = 0;
  int connected_ = 0;
  std::vector<int> evicted_;  ///< connections, counted from 1
};

TEST_F(AdmissionOfPeers, OldestSilentConnectionOfAFullAddressIsReplaced) {
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(connect("a"));
  EXPECT_TRUE(connect("b"));
  EXPECT_TRUE(evicted_.empty());
  EXPECT_TRUE(connect("a"));
  EXPECT_TRUE(connect("a"));
  EXPECT_EQ(evicted_, (std::vector{1, 2}));
}

TEST_F(AdmissionOfPeers, OldestSilentConnectionOfAllIsReplacedForAnotherAddress) {
  for (const char* address : {"a", "b", "c", "d", "e", "f", "g", "h"}) EXPECT_TRUE(connect(address));
  EXPECT_TRUE(connect("i"));
  EXPECT_EQ(evicted_, std::vector{1});
}

TEST_F(AdmissionOfPeers, ConnectionIsRejectedIfAllOthersAreAssociated) {
  Admission full({.associations = 2, .of_address = 2, .connections = 1, .spared_s = 2});
  for (int i = 0; i < 2; ++i) {
    const auto id = full.connect(
        "a", [] { FAIL(); }, at());
    EXPECT_TRUE(full.associate(id.value(), at()));
  }
  EXPECT_FALSE(full.connect(
      "b", [] {}, at()));
}

TEST_F(AdmissionOfPeers, AssociationsAboveTheLimitPerAddressAreRejected) {
  associated("a"), associated("a");
  now_s_ = 1.9;
  EXPECT_FALSE(admission_.associate(connect("a").value(), at()));
  associated("b");
  EXPECT_TRUE(evicted_.empty());
}

TEST_F(AdmissionOfPeers, AssociationLongestWithoutAnImageIsReplaced) {
  associated("a");
  now_s_ = 1;
  associated("a");
  now_s_ = 3.5;
  associated("a");
  EXPECT_EQ(evicted_, std::vector{1});
  associated("a");
  EXPECT_EQ(evicted_, (std::vector{1, 2}));
  EXPECT_FALSE(admission_.associate(connect("a").value(), at()));
}

TEST_F(AdmissionOfPeers, AssociationReceivingAnImageIsNeverClosed) {
  const Admission::Id sender = associated("a");
  associated("a");
  admission_.image_begins(sender);
  now_s_ = 100;
  associated("a");
  EXPECT_EQ(evicted_, std::vector{2});
  now_s_ = 101;
  admission_.image_ends(sender, at());
  EXPECT_FALSE(admission_.associate(connect("a").value(), at()));
  now_s_ = 102;
  associated("a");
  EXPECT_EQ(evicted_, (std::vector{2, 3}));
  now_s_ = 103;
  associated("a");
  EXPECT_EQ(evicted_, (std::vector{2, 3, 1}));
}

TEST_F(AdmissionOfPeers, LeavingFreesASlot) {
  const Admission::Id first = associated("a");
  associated("a");
  admission_.leave(first);
  associated("a");
  EXPECT_TRUE(evicted_.empty());
}

TEST_F(AdmissionOfPeers, EvictedConnectionMayStillLeaveAndAssociate) {
  const Admission::Id first = associated("a");
  associated("a");
  now_s_ = 3;
  associated("a");
  ASSERT_EQ(evicted_, std::vector{1});
  admission_.image_begins(first);
  EXPECT_FALSE(admission_.associate(first, at()));
  admission_.leave(first);
  EXPECT_EQ(evicted_, std::vector{1});
}

TEST_F(AdmissionOfPeers, FloodOfSilentConnectionsLeavesAssociationsAlone) {
  const Admission::Id c_arm = associated("c_arm");
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(connect("flood"));
  EXPECT_EQ(evicted_.size(), 996u);
  EXPECT_EQ(std::set<int>(evicted_.begin(), evicted_.end()).count(1), 0u);
  admission_.image_begins(c_arm);
  now_s_ = 1000;
  for (int i = 0; i < 1000; ++i)
    if (const auto id = connect("flood")) admission_.associate(*id, at());
  EXPECT_EQ(std::set<int>(evicted_.begin(), evicted_.end()).count(1), 0u);
}

}  // namespace
}  // namespace helicarm::receiver
