// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/pdu.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/devices/receiver/negotiation.h"
#include "helicarm/devices/receiver/peer.h"

namespace helicarm::receiver::dicom {
namespace {

TEST(AssociationRequest, ReportsTitlesContextsAndLargestPdu) {
  const auto request = read_association_request(peer::Request().body()).value();
  EXPECT_EQ(request.called, "HELICARM");
  EXPECT_EQ(request.calling, "C_ARM");
  EXPECT_EQ(request.most_pdu_bytes, 16384u);
  ASSERT_EQ(request.contexts.size(), 2u);
  EXPECT_EQ(request.contexts[1].id, 3);
  EXPECT_EQ(request.contexts[1].abstract_syntax, xa_class);
  EXPECT_THAT(request.contexts[1].transfer_syntaxes, testing::ElementsAre(explicit_syntax));
}

TEST(AssociationRequest, EveryTruncationIsTruncatedOrOmitsAnItem) {
  const std::string whole = peer::Request().body();
  const auto uncut = read_association_request(whole).value();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const auto cut = read_association_request(whole.substr(0, length));
    if (cut) {
      EXPECT_TRUE(cut->contexts.size() < uncut.contexts.size() || cut->most_pdu_bytes == 0) << length;
    }
  }
}

TEST(AssociationRequest, ItemLongerThanItsPduIsTruncated) {
  peer::Request request;
  request.contexts = std::string("\x20\0\xFF\xFF\1\0\0\0", 8);
  EXPECT_EQ(read_association_request(request.body()).error().reason, Reason::truncated);
}

TEST(AssociationRequest, EvenOrRepeatedContextIsRefused) {
  peer::Request even, repeated;
  even.contexts = peer::context(2, xa_class);
  repeated.contexts = peer::context(1, xa_class) + peer::context(1, verification_class);
  EXPECT_EQ(read_association_request(even.body()).error().reason, Reason::bad_value);
  EXPECT_EQ(read_association_request(repeated.body()).error().reason, Reason::bad_value);
}

TEST(AssociationRequest, ThreeHundredContextsAreRefused) {
  peer::Request request;
  request.contexts.clear();
  for (int i = 0; i < 300; ++i) request.contexts += peer::context((2 * i + 1) & 0xFF, xa_class);
  EXPECT_FALSE(read_association_request(request.body()));
}

TEST(AssociationRequest, TitleWithControlCharactersIsRefused) {
  peer::Request request;
  request.calling = peer::padded("A\nB");
  EXPECT_EQ(read_association_request(request.body()).error().reason, Reason::bad_value);
}

TEST(AssociationRequest, MutationsNeverCrash) {
  const std::string whole = peer::Request().body();
  RandomStream random(1, 1);
  for (int trial = 0; trial < 20000; ++trial) {
    std::string changed = whole;
    for (int i = 0; i < 4; ++i)
      changed[random.index(static_cast<std::uint32_t>(whole.size()))] = static_cast<char>(random.bits());
    if (const auto request = read_association_request(changed)) {
      EXPECT_LE(request->contexts.size(), 128u);
    }
  }
}

TEST(Fragments, LengthBeyondThePduIsTruncated) {
  EXPECT_EQ(read_fragments(BigEndianWriter().put<std::uint32_t>(100).put("ab").bytes()).error().reason,
            Reason::truncated);
}

TEST(Fragments, FragmentWithoutItsHeaderIsRefused) {
  EXPECT_EQ(read_fragments(BigEndianWriter().put<std::uint32_t>(1).put("a").bytes()).error().reason,
            Reason::bad_value);
}

TEST(Fragments, SeveralInOnePduAreReported) {
  const std::string body = peer::fragment(1, 1, "abc") + peer::fragment(1, 3, "d");
  const auto fragments = read_fragments(body).value();
  ASSERT_EQ(fragments.size(), 2u);
  EXPECT_EQ(fragments[0].bytes, "abc");
  EXPECT_FALSE(fragments[0].last);
  EXPECT_TRUE(fragments[1].last && fragments[1].command);
}

TEST(Uid, UidIsNumbersAndPoints) {
  EXPECT_TRUE(is_uid("1.2.840"));
  for (const char* bad : {"", ".", "..", "1..2", "1.", ".1", "../../tmp/x", "1.2a"})
    EXPECT_FALSE(is_uid(bad)) << bad;
  EXPECT_FALSE(is_uid(std::string(65, '1')));
}

AssociationRequest request(const peer::Request& request) {
  return read_association_request(request.body()).value();
}

TEST(Negotiation, AcceptsEchoAndXrays) {
  const auto answers = negotiate(request({}), {}).value();
  EXPECT_EQ(answers[0].result, ContextResult::accepted);
  EXPECT_EQ(answers[1].result, ContextResult::accepted);
  EXPECT_EQ(answers[1].transfer_syntax, explicit_syntax);
}

TEST(Negotiation, RefusesTheContextOfOtherObjects) {
  peer::Request given;
  given.contexts = peer::context(1, "1.2.840.10008.5.1.4.1.1.2") + peer::context(3, xa_class, "1.2.3.4");
  const auto answers = negotiate(request(given), {}).value();
  EXPECT_EQ(answers[0].result, ContextResult::abstract_syntax_unknown);
  EXPECT_EQ(answers[1].result, ContextResult::transfer_syntaxes_unknown);
}

struct Rejected {
  const char* name;
  peer::Request request;
  int source, reason;
};

TEST(Negotiation, RejectsWithTheCodeOfTheCause) {
  const peer::Request good;
  peer::Request version = good, called = good, calling = good, application = good, tiny = good, empty = good;
  version.version = 2;
  called.called = peer::padded("ANOTHER");
  calling.calling = peer::padded("STRANGER");
  application.application = "1.2.3";
  tiny.most_pdu_bytes = 1;
  empty.contexts.clear();
  for (const auto& [name, given, source, reason] :
       {Rejected{"version", version, 2, 2}, Rejected{"called", called, 1, 7},
        Rejected{"calling", calling, 1, 3}, Rejected{"application", application, 1, 2},
        Rejected{"tiny PDU", tiny, 1, 1}, Rejected{"no context", empty, 1, 1}}) {
    NegotiationOptions options;
    options.peers = {"C_ARM"};
    const auto answers = negotiate(request(given), options);
    ASSERT_FALSE(answers) << name;
    EXPECT_EQ(answers.error().source, source) << name;
    EXPECT_EQ(answers.error().reason, reason) << name;
  }
}

}  // namespace
}  // namespace helicarm::receiver::dicom
