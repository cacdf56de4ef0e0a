// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/model_sequence.h"

#include <chrono>
#include <future>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/pipeline/case_frames.h"
#include "helicarm/track/body_series.h"
#include "helicarm/track/growing_table.h"
#include "helicarm/track/image_keys.h"
#include "helicarm/track/repeated_images.h"
#include "helicarm/track/rows.h"
#include "helicarm/track/sequence_images.h"
#include "helicarm/xray/digest.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;
using case_registration::CaseFollower;
using case_registration::RegisteredFrame;
using registration::Registration;

std::vector<SequenceView> views_of(const pipeline::Case& the_case) {
  std::vector<SequenceView> views;
  for (const pipeline::CaseView& images : the_case.views) {
    SequenceView& view = views.emplace_back(SequenceView{images, images.frame_offset.value_or(0), {}});
    if (images.camera) view.image_size = value_or_throw(exchange::import_matrix(*images.camera)).image_size;
  }
  return views;
}

/// A text that two sequences share only if they are the same.
std::string identity_of(const pipeline::Case& the_case, const case_registration::FrameRange& range,
                        const case_registration::RegisterOptions& options, const CaseFollower& follower) {
  std::string text =
      fmt::format("{} {} {} {} {} {} {}", range.first, range.last, range.step, options.search.shift_mm,
                  options.search.turn_deg, options.run.motion_sigma_mm, options.run.max_error_mm.value_or(0));
  for (const SequenceView& view : views_of(the_case))
    text +=
        fmt::format("\n{} {} {}", view.images.name, view.images.image.filename().string(), view.frame_offset);
  for (const pipeline::CaseModel& model : the_case.models)
    text += "\n" + model.name + pipeline::to_json(model, the_case.folder).dump();
  return xray::digest(text + follower.identity());
}

std::string first_line(const std::string& identity) {
  return Json{{"format", "helicarm-frames/1"}, {"identity", identity}}.dump() + "\n";
}

/// The frames that an interrupted run left in the folder.
std::vector<RegisteredFrame> kept_frames(const fs::path& folder, const std::string& identity,
                                         const std::vector<std::string>& names,
                                         const std::vector<int>& numbers) {
  constexpr std::uintmax_t most_bytes = std::uintmax_t(1) << 30;
  std::error_code ignored;
  const fs::path file = folder / "frames.jsonl";
  if (!fs::exists(file, ignored)) return {};
  const std::string text = value_or_throw(read_file(file, most_bytes)), first = first_line(identity);
  if (text.find('\n') == text.npos) return {};
  if (!text.starts_with(first))
    throw BadInput(
        Reason::bad_value,
        fmt::format("--resume: {} holds frames of another sequence, case or range of frames, or of "
                    "other options: run without --resume, or with another --out",
                    folder.string()));
  return frames_from(text.substr(first.size()), names, numbers);
}

/// The frame's line of frames.jsonl with the digests of its images.
std::string line_with_keys(const RegisteredFrame& frame, const ImageKeys& keys) {
  return frame_line(frame).insert(1, fmt::format("\"images\":{},", Json(keys).dump()));
}

/// Digests of the images of the frames in the folder; fewer where an earlier version wrote them.
std::vector<ImageKeys> kept_keys(const fs::path& folder, std::size_t frames) {
  constexpr std::uintmax_t most_bytes = std::uintmax_t(1) << 30;
  std::vector<ImageKeys> keys;
  const auto text = read_file(folder / "frames.jsonl", most_bytes);
  for (std::size_t at = text ? text->find('\n') : std::string::npos;
       at != std::string::npos && keys.size() < frames;) {
    const std::size_t end = text->find('\n', at + 1);
    if (end == std::string::npos) break;
    const auto json = parse_json(std::string_view(*text).substr(at + 1, end - at - 1), "frames.jsonl");
    if (!json || !json->is_object() || !json->contains("images") || !(*json)["images"].is_array()) break;
    ImageKeys& of_frame = keys.emplace_back();
    for (const Json& key : (*json)["images"])
      of_frame.push_back(key.is_string() ? key.get<std::string>() : "");
    at = end;
  }
  return keys;
}

/// The error of the model's size is one in all frames.
FramePose pose_of(const Registration& model) {
  if (!model.by_scale.allFinite()) return {model.world_from_model, model.covariance};
  return {model.world_from_model, model.covariance - model.by_scale * model.by_scale.transpose(),
          model.by_scale};
}

bool has_pose(const Registration& model) { return !model.failure && model.is_determined(); }

/// What a frame's registration says, without its pose.
TrackedBody body_of(const Registration& model) {
  TrackedBody body;
  body.markers.reset();
  body.decision = PoseDecision(int(model.decision));
  if (model.failure)
    body.reason = model.failure->reason;
  else if (!model.warnings.empty())
    body.reason = model.warnings.front().reason;
  return body;
}

/// A frame with an image that is not of its moment.
RegisteredFrame refused_frame(const std::vector<std::string>& models, const std::vector<std::string>& views,
                              int frame, const RepeatedImage& repeated) {
  RegisteredFrame made{frame, {}};
  for (const std::string& model : models) {
    Registration& refused = made.models.emplace_back();
    refused.name = model;
    refused.failure = Failure{repeated.reason(), repeated_text(views, frame, repeated), views[repeated.view]};
  }
  return made;
}

/// Rows of the frames so far; those of the whole sequence replace them at its end.
struct ModelTables {
  GrowingTable frames, poses, bodies;

  ModelTables(const fs::path& folder, const std::string& identity)
      : frames(folder / "frames.jsonl", first_line(identity)),
        poses(folder / "registration.csv", case_registration::poses_header()),
        bodies(folder / "bodies.csv", bodies_header()) {}

  void add(const RegisteredFrame& frame, const RegisteredFrame& first,
           const std::vector<Eigen::Vector3d>& centres, const ImageKeys& keys) {
    std::string rows;
    for (std::size_t i = 0; i < frame.models.size(); ++i) {
      const Registration& model = frame.models[i];
      TrackedBody body = body_of(model);
      if (has_pose(model) && has_pose(first.models[i]))
        against_first(body, pose_of(model), centres[i], pose_of(first.models[i]), &frame == &first);
      rows += body_row(frame.frame, csv_field(model.name), body);
    }
    bodies.add(rows);
    poses.add(case_registration::poses_rows(frame));
    frames.add(line_with_keys(frame, keys));
  }
};

}  // namespace

void estimate_motion(ModelSequence& sequence, const std::vector<Eigen::Vector3d>& centres_in_model) {
  const std::vector<double> times(sequence.frames.begin(), sequence.frames.end());
  for (std::size_t i = 0; i < sequence.names.size(); ++i) {
    BodySequence& body = sequence.bodies.emplace_back();
    std::vector<std::optional<FramePose>> poses;
    for (const RegisteredFrame& frame : sequence.registered) {
      const Registration& model = frame.models[i];
      body.frames.push_back(body_of(model));
      poses.push_back(has_pose(model) ? std::optional(pose_of(model)) : std::nullopt);
    }
    body.smoothed.resize(body.frames.size());
    for (std::size_t f = 0; f < body.frames.size(); ++f) {
      body.smoothed[f].markers.reset();
      body.smoothed[f].reason = body.frames[f].reason;
    }
    take_motion(body, poses, smooth_poses(times, poses, centres_in_model[i], NoiseScale::by_data),
                centres_in_model[i]);
  }
  sequence.relative = relative_motions(sequence.bodies);
}

Expected<ModelSequence> follow_models(const pipeline::Case& the_case,
                                      const case_registration::FrameRange& range,
                                      const case_registration::RegisterOptions& options,
                                      const FollowOptions& follow,
                                      const std::function<void(double share)>& on_frame,
                                      const case_registration::Progress& progress) {
  return guarded([&] {
    if (follow.resume && !follow.out)
      throw BadInput(Reason::usage, "resume: the folder of the interrupted run is not given");
    ModelSequence sequence;
    sequence.frames = range.numbers();
    for (const pipeline::CaseModel& model : the_case.models) sequence.names.push_back(model.name);
    const SequenceImages images = value_or_throw(SequenceImages::open(views_of(the_case), range));
    CaseFollower follower = value_or_throw(
        CaseFollower::begin(value_or_throw(pipeline::at_frame(the_case, range.first)), options, progress));
    sequence.warnings = images.warnings();
    sequence.warnings.insert(sequence.warnings.end(), follower.warnings().begin(), follower.warnings().end());
    const auto begun = std::chrono::steady_clock::now();
    const std::vector<Eigen::Vector3d> centres = follower.centres();
    const std::string identity = identity_of(the_case, range, options, follower);
    std::vector<RegisteredFrame> kept;
    std::vector<ImageKeys> keys;
    std::vector<std::string> view_names;
    for (const pipeline::CaseView& view : the_case.views) view_names.push_back(view.name);
    std::optional<ModelTables> tables;
    if (follow.out) {
      if (follow.resume) kept = kept_frames(*follow.out, identity, sequence.names, sequence.frames);
      if (!kept.empty()) keys = kept_keys(*follow.out, kept.size());
      std::error_code ignored;
      fs::create_directories(*follow.out, ignored);
      tables.emplace(*follow.out, identity);
    }
    sequence.registered.reserve(sequence.frames.size());
    RepeatedImages repeated;
    // The next frame's images are read while this one's are registered.
    std::future<Expected<std::vector<xray::XrayImage>>> ahead;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i) {
      const auto now = value_or_throw(ahead.valid() ? ahead.get() : images.at(sequence.frames[i]));
      if (i + 1 < sequence.frames.size())
        ahead = std::async(std::launch::async,
                           [&images, next = sequence.frames[i + 1]] { return images.at(next); });
      const ImageKeys now_keys = keys_of(now);
      const std::string changed = i >= kept.size()
                                      ? ""
                                      : changed_image(sequence.frames[i], view_names,
                                                      i < keys.size() ? keys[i] : ImageKeys{}, now_keys);
      if (!changed.empty()) {
        kept.resize(i);
        if (follow.on_note) follow.on_note(changed);
      }
      const auto of_others = repeated.among(sequence.frames[i], now);
      std::optional<RegisteredFrame> known;
      if (i < kept.size())
        known = std::move(kept[i]);
      else if (!of_others.empty())
        known = refused_frame(sequence.names, view_names, sequence.frames[i], of_others.front());
      if (known) {
        follower.take(*known);
        sequence.registered.push_back(*std::move(known));
      } else {
        sequence.registered.push_back(value_or_throw(follower.next(sequence.frames[i], now)));
      }
      if (tables) tables->add(sequence.registered.back(), sequence.registered.front(), centres, now_keys);
      if (on_frame) on_frame(double(i + 1) / double(sequence.frames.size()));
    }
    estimate_motion(sequence, centres);
    sequence.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return sequence;
  });
}

}  // namespace helicarm::track
