// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <filesystem>
#include <variant>

#include "helicarm/operation/case_of.h"
#include "helicarm/operation/freehand.h"
#include "helicarm/operation/orders.h"
#include "helicarm/operation/session_log.h"

/// What an operation records in session.log (docs/formats.md): a type for each kind, which
/// session_record_descriptions.h describes once for reader, writer and schema.
namespace helicarm::operation {
namespace record {

struct Session {
  static constexpr const char* kind = "session";
  static constexpr const char* help = "the record begins";
  std::string format, version;
};

struct Plan {
  static constexpr const char* kind = "plan";
  static constexpr const char* help = "the [plan](#planjson)";
  OperationPlan plan;
};

struct Models {
  static constexpr const char* kind = "models";
  static constexpr const char* help = "files of its models, copied into the session";
  std::string folder;
  Digests files;
};

struct Exposure {
  static constexpr const char* kind = "exposure";
  static constexpr const char* help =
      "an image, the tracker's samples about it and the poses computed from them";
  std::string view;
  std::string picture;                   ///< digest of the image
  std::optional<std::string> inbox;      ///< folder in the session in which it was received
  std::optional<double> held_s;          ///< delay beyond that of the fastest image
  PoseWindow window;                     ///< the tracker's samples
  std::optional<guidance::Poses> poses;  ///< computed from them; nothing: refused
};

struct Refused {
  static constexpr const char* kind = "refused";
  static constexpr const char* help = "an image that is not used, or no longer";
  std::string view;
  std::optional<std::string> picture;  ///< nothing: an earlier image, which turned out to be delayed
  std::string why;
  std::map<std::string, double> figures;
};

struct Touched {
  static constexpr const char* kind = "touched";
  static constexpr const char* help = "a check point touched with the pointer";
  std::string check_point;
  PoseWindow window;
  Eigen::Vector3d in_bone;  ///< mm
};

struct CaseBegun {
  static constexpr const char* kind = "case";
  static constexpr const char* help = "a measurement or a verification begins";
  std::string folder;
  Json case_json;  ///< case.json
  Digests files;
  std::string verifies;  ///< the tunnel whose verification it is; empty: a measurement
};

struct Measured {
  static constexpr const char* kind = "result";
  static constexpr const char* help = "its result";
  std::string folder;
  std::string digest;  ///< of the result without its timing
  Digests files;
};

struct Registered {
  static constexpr const char* kind = "registered";
  static constexpr const char* help = "the registration of the plan's models";
  std::string folder;
  std::string digest;
  Digests files;
  std::vector<ModelStart> starts = {};
};

struct RegistrationConfirmed {
  static constexpr const char* kind = "registration_confirmed";
  static constexpr const char* help = "a person confirmed it";
  std::string digest;
  std::string by;
};

/// For what the tracker was looked at.
enum class Look { plan, hand_eye, correct, verify, withdraw, guide };

struct Poses {
  static constexpr const char* kind = "poses";
  static constexpr const char* help = "the tracker was looked at";
  Look why;
  PoseWindow window;
};

struct Tour {
  static constexpr const char* kind = "tour";
  static constexpr const char* help = "the hand-eye calibration begins";
  geometry::RigidTransform base_from_tcp;  ///< before the moves of the hand-eye calibration
};

struct HandEye {
  static constexpr const char* kind = "hand_eye";
  static constexpr const char* help = "its pairs and estimate";
  std::vector<tracker::HandEyePair> pairs;
  tracker::HandEye found;
};

struct Withdraw {
  static constexpr const char* kind = "withdraw";
  static constexpr const char* help = "the tool leaves a tunnel";
  std::string digest;  ///< of the order that the tool leaves
  Withdrawal from;
};

struct Robot {
  static constexpr const char* kind = "robot";
  static constexpr const char* help = "where the order that follows begins";
  robot::Joints joints;  ///< rad, before the order that follows
};

/// Its text is what a person confirms.
struct Order {
  static constexpr const char* kind = "order";
  static constexpr const char* help = "a [robot order](#robot-orders)";
  static Order of(const robot::RobotOrder& order) { return {robot::to_json(order), order}; }
  Json text;
  robot::RobotOrder order;
};

struct Preview {
  static constexpr const char* kind = "preview";
  static constexpr const char* help = "the images of its path";
  std::string order;
  Digests files;
};

struct Confirmed {
  static constexpr const char* kind = "confirmed";
  static constexpr const char* help = "a person confirmed an order";
  std::string order;
  std::string digest;
  std::string by;
  bool operator==(const Confirmed&) const = default;
};

struct CarriedOut {
  static constexpr const char* kind = "carried_out";
  static constexpr const char* help = "its motion has ended: the content of `confirmed`";
  Confirmed confirmed;
};

struct Halted {
  static constexpr const char* kind = "halted";
  static constexpr const char* help = "an order was refused or did not complete";
  std::string order;
  std::string why, message;
  std::map<std::string, double> figures;
};

struct Replanned {
  static constexpr const char* kind = "replanned";
  static constexpr const char* help = "an order is planned again after a stop";
  std::string order;
  int number = 0;
  std::string why;
  std::string by;
};

struct Navigated {
  static constexpr const char* kind = "navigated";
  static constexpr const char* help = "the tool is at its target";
  std::string tunnel;
  std::vector<robot::Miss> loop;
};

struct Guide {
  static constexpr const char* kind = "guide";
  static constexpr const char* help = "guidance of a hand-held drill begins";
  std::string tunnel;
  double oldest_pose_s = 0;
  PoseWindow window;
};

struct Guided {
  static constexpr const char* kind = "guided";
  static constexpr const char* help = "a new decision on the drill";
  std::string tunnel;
  PoseWindow window;
  Guidance guidance;
};

/// What ended the guidance of a drill. new_plan: images, measurement or registration are others now.
/// check_point: one of its bone was refused.
enum class GuidanceEndedBy { verified, person, plan_stale, new_guidance, new_plan, operation, check_point };
std::string_view word_of(GuidanceEndedBy by);

struct GuidanceEnded {
  static constexpr const char* kind = "guidance_ended";
  static constexpr const char* help = "the guidance of a hand-held drill has ended";
  std::string tunnel;
  GuidanceEndedBy by = GuidanceEndedBy::verified;
};

struct Outcome {
  static constexpr const char* kind = "outcome";
  static constexpr const char* help = "the error at a tunnel";
  std::string tunnel;
  EndMiss start, end;
  std::optional<guidance::TipDepth> depth = {};  ///< of a hand-held drill
};

struct End {
  static constexpr const char* kind = "end";
  static constexpr const char* help =
      "the operation ended; a log without it is not complete: the program was killed, or lines were removed";
  std::optional<std::string> why, message;
};

/// The kinds that a reader names to leave them out: a new one must be taken or named.
template <class Kind, class... Kinds>
concept OneOf = (std::same_as<Kind, Kinds> || ...);

}  // namespace record

using Record =
    std::variant<record::Session, record::Plan, record::Models, record::Exposure, record::Refused,
                 record::Touched, record::CaseBegun, record::Measured, record::Registered,
                 record::RegistrationConfirmed, record::Poses, record::Tour, record::HandEye,
                 record::Withdraw, record::Robot, record::Order, record::Preview, record::Confirmed,
                 record::CarriedOut, record::Halted, record::Replanned, record::Navigated, record::Guide,
                 record::Guided, record::GuidanceEnded, record::Outcome, record::End>;

std::string_view kind_of(const Record& record);
Json content_of(const Record& record);

/// A record of this or an earlier version. `session`: its folder, where the plan's models lie. Fails as
/// JsonReader, with unsupported for a kind of no version, and with bad_value for a figure that is not that of
/// the others.
Expected<Record> record_from(const SessionRecord& record, const std::filesystem::path& session);

/// JSON Schema of the contents, by kind.
Json session_schema();

}  // namespace helicarm::operation
