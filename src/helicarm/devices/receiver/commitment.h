// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/devices/receiver/inbox.h"

/// Storage Commitment Push Model (PS3.4, annex J): a peer asks (N-ACTION) whether its images are stored, and
/// is told (N-EVENT-REPORT). Data sets are implicit, little endian.
namespace helicarm::receiver {

inline constexpr std::string_view commitment_class = "1.2.840.10008.1.20.1";
inline constexpr std::string_view commitment_instance = "1.2.840.10008.1.20.1.1";
inline constexpr std::size_t most_references = 4096;

struct Reference {
  std::string sop_class;
  std::string sop_instance;
};

struct CommitmentRequest {
  std::string transaction;  ///< UID
  std::vector<Reference> references;
};

/// Refuses (bad_value, truncated) a data set without transaction or references, with an invalid UID, or with
/// more than `most_references`.
Expected<CommitmentRequest> read_commitment_request(std::string_view data_set);

/// PS3.3, table C.14-1.
enum class CommitmentFailure : std::uint16_t {
  processing_failure = 0x0110,
  no_such_instance = 0x0112,
  class_instance_conflict = 0x0119
};

struct CommitmentReport {
  struct Failed {
    Reference reference;
    CommitmentFailure reason;
  };
  std::string transaction;
  std::vector<Reference> committed;
  std::vector<Failed> failed;
  std::uint16_t event() const { return failed.empty() ? 1 : 2; }
};

/// Committed is what the inbox holds: it stores an image by a rename of a synced file.
CommitmentReport commit(const CommitmentRequest& request, const Inbox& inbox);

/// Data set of the N-EVENT-REPORT.
std::string write_commitment_report(const CommitmentReport& report);

/// Where a peer that does not keep its association open listens for reports.
struct ReportPeer {
  std::string title;
  std::string address;  ///< numeric
  std::uint16_t port = 104;
};

/// "TITLE=ADDRESS:PORT". Refuses usage.
Expected<ReportPeer> read_report_peer(std::string_view text);

}  // namespace helicarm::receiver
