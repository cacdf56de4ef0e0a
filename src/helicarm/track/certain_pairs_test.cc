// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "helicarm/track/first_markers.h"

namespace helicarm::track {
namespace certain_pairs_test {

using Indices = std::vector<std::size_t>;

TEST(CertainPairs, PairWithoutRivalIsCertainByItsEvidence) {
  EXPECT_EQ(certain_pairs({{0, 0, -5}}, 3), Indices{0});
  EXPECT_EQ(certain_pairs({{0, 0, -2}}, 3), Indices{});
  EXPECT_EQ(certain_pairs({}, 3), Indices{});
}

TEST(CertainPairs, TwoPartnersAlmostAsGoodAreAmbiguous) {
  EXPECT_EQ(certain_pairs({{0, 0, -5}, {0, 1, -4}}, 3), Indices{});
  EXPECT_EQ(certain_pairs({{0, 0, -7}, {0, 1, -3}}, 3), Indices{0});
}

/// The rival's disc has a partner of its own: exchanged, one disc stays without.
TEST(CertainPairs, RivalWithAPartnerOfItsOwnIsNone) {
  EXPECT_EQ(certain_pairs({{0, 0, -5}, {0, 1, -4}, {1, 1, -5}}, 3), (Indices{0, 2}));
}

/// Both ways round are almost equally likely.
TEST(CertainPairs, ExchangedPairsAreAmbiguous) {
  EXPECT_EQ(certain_pairs({{0, 0, -5}, {0, 1, -4.5}, {1, 0, -4.5}, {1, 1, -5}}, 3), Indices{});
}

}  // namespace certain_pairs_test
}  // namespace helicarm::track
