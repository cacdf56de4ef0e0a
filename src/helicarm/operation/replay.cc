// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/replay.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/earlier_versions.h"
#include "helicarm/operation/models.h"
#include "helicarm/operation/replay_orders.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

constexpr std::uintmax_t most_image_bytes = std::uintmax_t{256} << 20;
constexpr std::uintmax_t most_listed_bytes = std::uintmax_t{1} << 31;  // of a model's volume
class Replay {
 public:
  Replay(std::filesystem::path session, double begun_s)
      : session_(std::move(session)),
        begun_s_(begun_s),
        orders_([this](const std::string& origin, const std::string& difference) {
          differ(origin, difference);
        }) {}

  void take(const SessionRecord& written) {
    const std::string origin = fmt::format("record {}", written.number);
    now_s_ = std::max(now_s_, written.time_s - begun_s_);  // the clock may be set back
    if (report.finished) differ(origin, "a record after the end of the operation");
    const auto record = record_from(written, session_);
    if (!record) return report.differences.push_back(record.error().message);
    std::visit([&](const auto& one) { take(one, origin); }, *record);
    orders_.follow(*record, {origin, plan_, result_, newest_});
    report.orders = orders_.orders;
    report.confirmations = orders_.confirmations;
    report.outcomes = orders_.outcomes;
    report.replans = orders_.replans;
  }

  /// A record that cannot be read differs from those that an operation writes.
  void take_whole(const SessionRecord& record) {
    const std::string origin = fmt::format("record {}", record.number);
    try {
      take(record);
    } catch (const Json::exception&) {
      differ(origin, "a key that its case requires is missing");
    } catch (const BadInput& error) {
      differ(origin, error.failure().message);
    }
  }

  /// The listed files by their digests; after the last record.
  void compare_files() {
    for (const auto& [file, listed] : files_) {
      ++report.files;
      const auto path = path_inside(session_, file);
      const auto bytes = path ? read_file(*path, most_listed_bytes) : tl::unexpected<Failure>(path.error());
      if (!bytes)
        differ(listed.origin, fmt::format("{} is missing or cannot be read", file));
      else if (xray::digest(*bytes) != listed.digest)
        differ(listed.origin, fmt::format("{} was changed", file));
    }
  }

  ReplayReport report;

 private:
  struct ListedFile {
    std::string digest;
    std::string origin;
  };

  void differ(const std::string& origin, const std::string& difference) {
    report.differences.push_back(origin + ": " + difference);
  }
  void note(const std::string& origin, const std::string& note) {
    report.notes.push_back(origin + ": " + note);
  }
  void compare(const Json& then, const Json& now, const std::string& origin, const char* what) {
    if (then != now)
      differ(origin, fmt::format("the {} differs from the recorded value on recomputation{}", what,
                                 differing_fields(then, now)));
  }

  /// Of orders (`OrderReplay`), or of nothing that can be derived.
  template <record::OneOf<record::Session, record::Poses, record::Tour, record::Withdraw, record::Robot,
                          record::Order, record::Confirmed, record::CarriedOut, record::Halted,
                          record::Replanned, record::Navigated>
                Other>
  void take(const Other&, const std::string&) {}

  void take(const record::Plan& record, const std::string&) { plan_ = record.plan; }
  void take(const record::HandEye&, const std::string&) { ++report.hand_eyes; }
  void take(const record::Models& models, const std::string& origin) {
    list_files(models.files, models.folder, origin);
  }
  void take(const record::Preview& preview, const std::string& origin) {
    list_files(preview.files, {}, origin);
  }

  void take(const record::Exposure& then, const std::string& origin) {
    ++report.exposures;
    const auto poses = poses_of_exposure(then.window, plan_.tracker);
    record::Exposure now = then;
    now.poses = poses ? std::optional(*poses) : std::nullopt;
    compare(content_of(then), content_of(now), origin, "pose");
    if (then.inbox && !received(*then.inbox).contains(then.picture))
      differ(origin, fmt::format("{}: the image of {} is missing or was changed", *then.inbox, then.view));
    if (!is_accepted(now, plan_)) return;
    views_[then.view] = {then.view, {}, then.picture, *poses};
    forget_measurement();
  }

  /// An earlier image that turned out to be delayed has no digest.
  void take(const record::Refused& refused, const std::string&) {
    if (refused.picture) return;
    views_.erase(refused.view);
    forget_measurement();
  }

  /// Digests of all files of an inbox.
  const std::set<std::string>& received(const std::string& inbox) {
    auto [entry, is_new] = inboxes_.try_emplace(inbox);
    std::error_code ec;
    if (is_new)
      for (const auto& file :
           std::filesystem::directory_iterator(value_or_throw(path_inside(session_, inbox)), ec))
        if (const auto bytes = read_file(file.path(), most_image_bytes))
          entry->second.insert(xray::digest(*bytes));
    return entry->second;
  }

  void take(const record::End& end, const std::string&) {
    report.finished = true;
    report.ended_by = end.why.value_or("");
  }

  /// In this folder of the session; a later preview replaces an earlier one's.
  void list_files(const Digests& files, const std::string& folder, const std::string& origin) {
    for (const auto& [name, digest] : files)
      files_.insert_or_assign(folder.empty() ? name : folder + "/" + name, ListedFile{digest, origin});
  }

  void take(const record::Touched& then, const std::string& origin) {
    const auto check = std::ranges::find(plan_.check_points, then.check_point, &PlannedCheck::name);
    if (check == plan_.check_points.end()) return differ(origin, "its check point is not in the plan");
    const Eigen::Vector3d tip = value_or_throw(touched_in_bone(then.window, plan_.tracker, check->bone));
    compare(content_of(then), content_of(record::Touched{then.check_point, then.window, tip}), origin,
            "touched point");
  }

  /// The case must equal the recorded one, which holds the accepted images with their poses.
  void take(const record::CaseBegun& record, const std::string& origin) {
    const std::string& folder = record.folder;
    list_files(record.files, folder, origin);
    const Json& recorded = record.case_json;
    const std::string name = folder + "/case.json";
    if (const auto now = read_json(value_or_throw(path_inside(session_, name))); now && *now != recorded)
      differ(origin, fmt::format("{} was changed{}", name, differing_fields(recorded, *now)));
    for (const auto& [view, image] : views_) {
      ++report.images;
      const std::string file = fmt::format("{}.dcm", view);
      const auto listed = record.files.find(file);
      if (listed == record.files.end() || listed->second != image.digest)
        differ(origin, fmt::format("{}/{} is not the recorded image", folder, file));
    }
    derived_.reset();
    const auto derived = guarded([&] {
      return derived_case(recorded, record.verifies, value_or_throw(path_inside(session_, folder)));
    });
    if (!derived) return differ(origin, fmt::format("{}: {}", name, derived.error().message));
    earlier_ = is_of_earlier_version(recorded);
    if (earlier_)
      note(origin, fmt::format("{} is of helicarm-case/1: it and its result are compared by the keys they "
                               "hold, numbers to 1e-9",
                               name));
    derived_ = earlier_ ? as_read_earlier(*derived) : *derived;
    const Json now_written = pipeline::to_json(*derived);
    compare(case_in_present_form(recorded, now_written, plan_), now_written, origin, "case");
  }

  /// From the records before it; the picks are the user's.
  pipeline::Case derived_case(const Json& recorded, const std::string& name,
                              const std::filesystem::path& folder) {
    OperationPlan plan = plan_;
    plan.picks = value_or_throw(picks_of(plan_, recorded.at("picks"), "case.json"));
    const PlanFiles files = value_or_throw(files_of_case(plan_, folder));
    std::vector<CaseImage> images;
    for (const std::string& view : plan_.views)
      if (const auto taken = views_.find(view); taken != views_.end()) images.push_back(taken->second);
    guidance::Poses now;
    std::vector<guidance::ToolLine> lines;
    model_lines_.clear();
    const auto look = orders_.take_verify_look();
    verifies_ = !name.empty();
    if (verifies_) {
      if (!look) throw BadInput(Reason::bad_value, "the poses of its verification are not recorded");
      now = value_or_throw(poses_now(*look, plan_.tracker));
      const auto tunnel = std::ranges::find(plan_.tunnels, name, &OperationTunnel::name);
      const auto tool = orders_.tool(plan_);
      if (tunnel == plan_.tunnels.end() || !tool || images.empty())
        throw BadInput(Reason::bad_value, "its tool line is of no tunnel of the plan, or of no tool");
      (tunnel->of_model ? model_lines_ : lines)
          .push_back(value_or_throw(
              tool_line(name, tunnel->bone, images.front().poses, now, tool->marker_from_tip)));
    }
    return value_or_throw(operation_case(folder, plan, files, images, now, lines));
  }

  void take(const record::Measured& record, const std::string& origin) {
    ++report.results;
    const std::string& folder = record.folder;
    list_files(record.files, folder, origin);
    const std::filesystem::path inside = value_or_throw(path_inside(session_, folder));
    if (!derived_) return differ(origin, fmt::format("{}: its case does not follow from the record", folder));
    const auto measured = measure_by_plan(*derived_, plan_, measurement_);
    if (!measured) return differ(origin, measured.error().message);
    measurement_ = *measured;
    newest_ = *measured;
    if (!verifies_) {
      registration_.reset(), is_confirmed_ = false;
      measured_ = derived_;
    }
    if (is_confirmed_ && !newest_->failure)
      newest_ = value_or_throw(with_registration(*newest_, *registration_, plan_, *derived_, model_lines_));
    if (!verifies_) result_ = without_models_ = newest_;
    const auto then = read_json(inside / "result.json");
    if (!then) return differ(origin, then.error().message);
    if (const auto tool = orders_.tool(plan_); verifies_ && tool && states_depth(*then))
      add_depths(plan_, *tool, *newest_);
    Json now = without_timing(pipeline::to_json(*newest_));
    if (earlier_) now = in_keys_of(*then, now);
    if (record.digest != digest_of(now))
      differ(origin, fmt::format("{}: the result differs from the recorded one on recomputation", folder));
    if (const Json written = without_timing(*then); written != now)
      differ(origin, fmt::format("{}/result.json differs from the recomputed result{}", folder,
                                 differing_fields(written, now)));
  }

  void forget_measurement() {
    measurement_.reset();
    registration_.reset();
    is_confirmed_ = false;
    result_.reset();
    without_models_.reset();
    newest_.reset();
  }

  /// From the model files, images and picks before it.
  void take(const record::Registered& record, const std::string& origin) {
    ++report.registrations;
    list_files(record.files, record.folder, origin);
    registration_.reset(), is_confirmed_ = false;
    result_ = without_models_;
    if (!measured_ || !measurement_) return differ(origin, "a registration without a measurement");
    auto now = register_models(plan_, *measured_, *measurement_, {}, record.starts);
    if (!now) return differ(origin, now.error().message);
    registered_digest_ = record.digest;
    if (auto as_then = as_recorded(*now, record.digest)) {
      registration_ = std::move(as_then->registration);
      if (as_then->note) note(origin, *as_then->note);
      return;
    }
    registration_ = *std::move(now);
    differ(origin, "the registration differs from the recorded one on recomputation");
  }

  /// Before it no tunnel of a model is known to the records that follow.
  void take(const record::RegistrationConfirmed& record, const std::string& origin) {
    if (!registration_ || registration_->refused() || !result_ || record.digest != registered_digest_)
      return differ(origin, "the confirmation is of no registration, or of one that was refused");
    is_confirmed_ = true;
    result_ = newest_ =
        value_or_throw(with_registration(*without_models_, *registration_, plan_, *measured_));
  }

  void take(const record::Guide& record, const std::string& origin) {
    guide_.reset();
    if (!plan_.drill || !result_) return differ(origin, "guidance without a drill or a measurement");
    const auto begun = guarded([&] {
      return value_or_throw(FreehandGuide::begin(
          plan_, LiveTool(plan_, *result_, {}, tracked_tool(*plan_.drill)), record.tunnel,
          value_or_throw(poses_now(record.window, plan_.tracker)), record.oldest_pose_s));
    });
    if (!begun) return;  // the operation refused it as well and recorded no decision
    guide_ = *begun;
    decision_.clear();
    is_verified_ = false;
    report.guidances.push_back({record.tunnel, now_s_});
  }

  void take(const record::Guided& then, const std::string& origin) {
    ++report.decisions;
    if (!guide_) return differ(origin, "a decision before guidance began");
    if (!result_) return differ(origin, "a decision on images that had been replaced");
    GuidanceForm form{.states_causes = !then.guidance.aim || then.guidance.aim->errors};
    const auto now = [&] {
      return content_of(record::Guided{then.tunnel, then.window, guide_->at(then.window, form)});
    };
    const Json recorded = content_of(then), at_present = now();
    form.counts_poses = false;
    if (recorded != at_present && recorded == now())
      note(origin,
           "the decision is as earlier versions made it: on too few poses for a mean and its scatter");
    else
      compare(recorded, at_present, origin, "decision");
    decision_ = then.guidance.decision();
  }

  void take(const record::Outcome& outcome, const std::string&) {
    if (guide_ && guide_->tunnel().name == outcome.tunnel) is_verified_ = true;
  }

  void take(const record::GuidanceEnded& ended, const std::string& origin) {
    using enum record::GuidanceEndedBy;
    if (!guide_ || guide_->tunnel().name != ended.tunnel)
      return differ(origin, fmt::format("the end of a guidance to {} that had not begun", ended.tunnel));
    if (ended.by == verified && !is_verified_)
      differ(origin, fmt::format("{}: ended as verified without an outcome", ended.tunnel));
    if (ended.by == plan_stale && decision_ != code(Reason::plan_stale))
      differ(origin, fmt::format("{}: ended as plan_stale without that decision", ended.tunnel));
    guide_.reset();
    report.guidances.back().ended_s = now_s_;
    report.guidances.back().ended_by = record::word_of(ended.by);
  }

  std::map<std::string, ListedFile> files_;
  std::filesystem::path session_;
  double begun_s_, now_s_ = 0;
  OperationPlan plan_;
  std::optional<pipeline::Result> result_;          ///< of the last measurement
  std::optional<pipeline::Result> without_models_;  ///< the same before the registration was confirmed
  std::optional<pipeline::Result> newest_;          ///< also of a verification
  bool earlier_ = false;                            ///< the last case is of an earlier version
  bool verifies_ = false;                           ///< the last case is that of a verification
  std::optional<FreehandGuide> guide_;
  std::string decision_;                         ///< its last one
  bool is_verified_ = false;                     ///< an outcome at its tunnel since it began
  std::optional<pipeline::Case> derived_;        ///< of the last case record
  std::optional<pipeline::Result> measurement_;  ///< of the accepted images
  std::optional<pipeline::Case> measured_;       ///< of the last measurement
  std::optional<case_registration::CaseRegistration> registration_;
  std::string registered_digest_;
  bool is_confirmed_ = false;                    ///< the registration
  std::vector<guidance::ToolLine> model_lines_;  ///< of the last case, to tunnels of models
  OrderReplay orders_;
  std::map<std::string, CaseImage> views_;  ///< the accepted images, without their paths
  std::map<std::string, std::set<std::string>> inboxes_;
};

}  // namespace

bool is_accepted(const record::Exposure& exposure, const OperationPlan& plan) {
  return exposure.poses && std::ranges::all_of(plan.tunnels, [&](const OperationTunnel& tunnel) {
           return exposure.poses->tracker_from(tunnel.bone).has_value();
         });
}

Expected<ReplayReport> replay(const std::filesystem::path& session, const GoOn& go_on) {
  return guarded([&] {
    const SessionHistory history = value_or_throw(read_session(session / "session.log"));
    if (history.records.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: the record is empty", session.string()));
    Replay replay(session, history.records.front().time_s);
    replay.report.records = history.records.size();
    replay.report.torn = history.torn;
    for (const SessionRecord& record : history.records) {
      if (!go_on(record.number, history.records.size()))
        throw BadInput(Reason::interrupted,
                       fmt::format("{}: stopped at record {}", session.string(), record.number));
      replay.take_whole(record);
    }
    replay.compare_files();
    return replay.report;
  });
}

}  // namespace helicarm::operation
