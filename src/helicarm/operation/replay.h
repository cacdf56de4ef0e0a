// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/operation/session_records.h"

namespace helicarm::operation {

/// Guidance of a hand-held drill to a tunnel; s since the record began.
struct GuidanceSpan {
  std::string tunnel;
  double begun_s;
  std::optional<double> ended_s = {};  ///< nothing: not recorded, as by earlier versions
  std::string ended_by = {};           ///< word of session.log
};

struct ReplayReport {
  std::size_t records = 0;
  bool torn = false;      ///< the last record is incomplete: the program was killed while writing
  bool finished = false;  ///< the end of the operation is recorded
  std::string ended_by;   ///< code of the failure that ended it; empty: none did
  std::size_t exposures = 0;
  std::size_t images = 0;
  std::size_t results = 0;
  std::size_t registrations = 0;  ///< of the plan's models
  std::size_t hand_eyes = 0;
  std::size_t decisions = 0;            ///< on a hand-held drill
  std::vector<GuidanceSpan> guidances;  ///< of it
  std::size_t orders = 0;
  std::size_t confirmations = 0;
  std::size_t replans = 0;  ///< plans made again after a stop
  std::size_t outcomes = 0;
  std::size_t files = 0;                 ///< compared with their recorded digests
  std::vector<std::string> differences;  ///< what differs from the record, or from what it implies
  std::vector<std::string> notes;        ///< what is equal in the form of an earlier version alone

  /// Whether the record has its end and nothing differs.
  bool complete() const { return finished && !torn && differences.empty(); }
};

/// replay_differs where the record is not complete; else nothing.
std::optional<Failure> failure_of(const ReplayReport& report);

/// The report, with status and failure, as the program and the Python package state it.
Json to_json(const ReplayReport& report);

/// Whether the operation took the recorded image, as its poses say: what was measured by earlier images
/// ended. A refused one, without the pose of a tunnel's bone, changes nothing.
bool is_accepted(const record::Exposure& exposure, const OperationPlan& plan);

/// Called before each record with the number done; false stops the replay.
using GoOn = std::function<bool(std::size_t done, std::size_t all)>;

/// Recomputes an operation from its record; all must agree to the last bit:
/// - acquisition poses from the tracker samples, each case from the accepted images and their poses, its
/// result
///   from its files;
/// - the hand-eye calibration from the samples, each order from poses, measurement and the robot's joints,
/// each
///   confirmation and the end of its motion from the order, the closed loop and the outcome at a tunnel;
/// - decisions on a hand-held drill from the samples;
/// - every file by its recorded digest, also the images in the session's inbox.
/// Refuses as `read_session`; an empty record (bad_value); a stop by the callback (interrupted).
Expected<ReplayReport> replay(
    const std::filesystem::path& session, const GoOn& go_on = [](std::size_t, std::size_t) { return true; });

}  // namespace helicarm::operation
