// SPDX-License-Identifier: Apache-2.0
#include "tracker_command.h"

#include <charconv>
#include <limits>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/tracker/ndi_server.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/sequence_stream.h"
#include "helicarm/devices/tracker/tracker_registry.h"
#include "helicarm/geometry/view_json.h"
#include "mount_command.h"
#include "stop_signal.h"
#include "tracker_send.h"

namespace helicarm::cli {
namespace {

/// Calls `report` each second until the time is over or the user interrupts.
template <class Notify>
void wait_telling(StopSignal& interrupt, std::optional<double> seconds, Notify notify) {
  const double until =
      seconds ? tracker::monotonic_seconds() + *seconds : std::numeric_limits<double>::infinity();
  while (true) {
    const double left = until - tracker::monotonic_seconds();
    if (left <= 0 || interrupt.wait(std::min(left, 1.0))) return;
    notify();
  }
}

Json json_of(const tracker::TrackerLinkStatus& link, const std::vector<tracker::ToolState>& tools) {
  Json json;
  json["state"] = code(link.state);
  json["trouble"] = link.trouble;
  json["counters"] = link.counters;
  json["tools"] = Json::array();
  for (const tracker::ToolState& tool : tools) {
    Json& one = json["tools"].emplace_back();
    one["name"] = tool.name;
    one["age_s"] = tool.age_s ? Json(*tool.age_s) : Json();
    one["rate_hz"] = tool.rate_hz;
    one["accepted"] = tool.accepted;
    one["rejected"] = tool.rejected;
    one["tracker_from_tool"] =
        tool.tracker_from_tool ? geometry::json_rows(tool.tracker_from_tool->matrix()) : Json();
  }
  return json;
}

std::string table_of(const tracker::TrackerLinkStatus& link, const std::vector<tracker::ToolState>& tools) {
  std::string table = fmt::format("{}  {}\n", code(link.state), link.trouble);
  for (const tracker::ToolState& tool : tools) {
    table +=
        fmt::format("  {:20} {:>9} {:6.1f} Hz {:9} accepted", tool.name,
                    tool.age_s ? fmt::format("{:.3f} s", *tool.age_s) : "never", tool.rate_hz, tool.accepted);
    for (const auto& [fault, count] : tool.rejected) table += fmt::format("  {} {}", fault, count);
    table += '\n';
  }
  return table;
}

Expected<void> check_tool(const std::vector<tracker::SequenceFrame>& frames,
                          const TrackerPivotArguments& arguments) {
  std::set<std::string> names;
  for (const tracker::SequenceFrame& frame : frames)
    for (const auto& [name, pose] : frame.poses) names.insert(name);
  if (names.contains(arguments.tool)) return {};
  return fail(Reason::bad_value, without_control_characters(fmt::format(
                                     "--tool: \"{}\" is not in {}, which holds {}", arguments.tool,
                                     arguments.file.string(), fmt::join(names, ", "))));
}

CommandResult replay_as_ndi(const TrackerReplayArguments& arguments,
                            const std::vector<tracker::SequenceFrame>& frames, Console& console) {
  std::set<std::string> names;
  for (const tracker::SequenceFrame& frame : frames)
    for (const auto& [name, pose] : frame.poses) names.insert(name);
  StopSignal interrupt;
  const auto server = tracker::NdiServer::start(
      {arguments.options.address, arguments.options.port, {names.begin(), names.end()}});
  if (!server) return tl::unexpected(server.error());
  if (!console.quiet)
    console.progress << fmt::format("{} frames at ndi:{}:{}\n", frames.size(), arguments.options.address,
                                    (*server)->port())
                     << std::flush;
  const std::jthread player([&](const std::stop_token& stop) {
    tracker::replay(
        frames, true, [&](const tracker::IgtlMessage& message) { (*server)->send(message); }, stop);
  });
  wait_telling(interrupt, arguments.seconds, [] {});
  if (console.json) console.out << to_text({{"counters", (*server)->counters()}}) << '\n';
  return {};
}

}  // namespace

Expected<tracker::TrackerAddress> tracker_address(const TrackerLinkArguments& arguments) {
  constexpr std::size_t ndi_prefix = 4;
  constexpr std::uint16_t ndi_port = 8765;
  tracker::TrackerAddress tracker = arguments.tracker;
  const std::string& peer = arguments.peer;
  const bool ndi = tracker::is_ndi(peer);
  tracker.address = peer;
  if (ndi) tracker.port = ndi_port;
  for (const std::string& definition : arguments.definitions) {
    const auto equals = definition.find('=');
    if (equals == 0 || equals == definition.npos || equals + 1 == definition.size())
      return fail(Reason::usage, fmt::format("--definition: \"{}\" is not NAME=FILE",
                                             without_control_characters(definition)));
    tracker.definitions[definition.substr(0, equals)] = definition.substr(equals + 1);
  }
  const auto colon = peer.rfind(':');
  if (colon == peer.npos || tracker::is_recording(peer) || (ndi && colon < ndi_prefix)) return tracker;
  int port = 0;
  const auto [end, error] = std::from_chars(peer.data() + colon + 1, peer.data() + peer.size(), port);
  if (error != std::errc() || end != peer.data() + peer.size() || port < 1 || port > 65535)
    return fail(Reason::usage, fmt::format("PEER: \"{}\" is not address:port with a port from 1 to 65535",
                                           without_control_characters(peer)));
  tracker.port = static_cast<std::uint16_t>(port);
  tracker.address = peer.substr(0, colon);
  return tracker;
}

CommandResult tracker_watch_command(const TrackerLinkArguments& arguments, Console& console) {
  const auto address = tracker_address(arguments);
  if (!address) return tl::unexpected(address.error());
  StopSignal interrupt;
  tracker::PoseBoard board;
  const auto source = tracker::open_tracker(*address, tracker::onto(board));
  if (!source) return tl::unexpected(source.error());
  const auto tools = [&] { return board.tools(tracker::monotonic_seconds()); };
  wait_telling(interrupt, arguments.seconds, [&] {
    if (!console.json && !console.quiet)
      console.progress << table_of((*source)->status(), tools()) << std::flush;
  });
  const tracker::TrackerLinkStatus link = (*source)->status();
  if (console.json)
    console.out << to_text(json_of(link, tools())) << '\n';
  else
    console.out << table_of(link, tools());
  return {};
}

CommandResult tracker_record_command(const TrackerLinkArguments& arguments, Console& console) {
  const auto address = tracker_address(arguments);
  if (!address) return tl::unexpected(address.error());
  StopSignal interrupt;
  std::mutex mutex;
  tracker::SequenceRecorder recorder;
  bool full = false;
  const auto source =
      tracker::open_tracker(*address, {[&](const tracker::IgtlMessage& message, double arrival_s) {
        tracker::SequenceFrame frame = tracker::frame_of(message, arrival_s);
        const std::lock_guard lock(mutex);
        if (!full && !recorder.take(std::move(frame))) full = true, interrupt.raise();
      }});
  if (!source) return tl::unexpected(source.error());
  wait_telling(interrupt, arguments.seconds, [] {});
  (*source)->stop();
  const std::vector<tracker::SequenceFrame>& frames = recorder.frames();
  if (full)
    console.progress << fmt::format("recording ended: limit of {} poses per file reached\n",
                                    recorder.most_poses())
                     << std::flush;
  if (frames.empty()) {
    const std::string trouble = (*source)->status().trouble;
    return fail(Reason::no_pose, fmt::format("{}: no pose received, no file written{}{}", arguments.peer,
                                             trouble.empty() ? "" : ": ", trouble));
  }
  if (auto written = tracker::write_sequence(arguments.file, frames); !written) return written;
  if (console.json)
    console.out << to_text({{"frames", frames.size()}}) << '\n';
  else if (!console.quiet)
    console.out << fmt::format("{} frames in {}\n", frames.size(), arguments.file.string());
  return {};
}

CommandResult tracker_replay_command(const TrackerReplayArguments& arguments, Console& console) {
  const auto frames = tracker::read_sequence(arguments.file);
  if (!frames) return tl::unexpected(frames.error());
  StopSignal interrupt;
  if (arguments.ndi) return replay_as_ndi(arguments, *frames, console);
  const auto server = tracker::IgtlServer::start(arguments.options);
  if (!server) return tl::unexpected(server.error());
  if (!console.quiet)
    console.progress << fmt::format("{} frames at {} port {}\n", frames->size(), arguments.options.address,
                                    (*server)->port())
                     << std::flush;
  const std::jthread player([&](const std::stop_token& stop) {
    tracker::replay(
        *frames, arguments.as_tracking,
        [&](const tracker::IgtlMessage& message) { (*server)->send(message); }, stop);
  });
  wait_telling(interrupt, arguments.seconds, [] {});
  const tracker::IgtlServerStatus status = (*server)->status();
  if (console.json)
    console.out << to_text({{"clients", status.clients}, {"counters", status.counters}}) << '\n';
  return {};
}

CommandResult tracker_pivot_command(const TrackerPivotArguments& arguments, Console& console) {
  const auto frames = tracker::read_sequence(arguments.file);
  if (!frames) return tl::unexpected(frames.error());
  if (auto known = check_tool(*frames, arguments); !known) return known;
  const tracker::GatedPoses poses = tracker::gated_poses(*frames, arguments.tool);
  const auto pivot = tracker::calibrate_pivot(poses.tracker_from_tool, arguments.options);
  if (!pivot) return tl::unexpected(pivot.error());
  if (console.json) {
    Json json;
    json["tip_in_tool"] = geometry::json_list(pivot->tip_in_tool);
    json["pivot_in_tracker"] = geometry::json_list(pivot->pivot_in_tracker);
    json["covariance_mm2"] = geometry::json_rows(pivot->covariance);
    json["rms_mm"] = pivot->rms_mm;
    json["turn_deg"] = pivot->turn_deg;
    json["used"] = pivot->used;
    json["outliers"] = pivot->outliers;
    json["rejected"] = poses.rejected;
    console.out << to_text(json) << '\n';
  } else {
    const Eigen::Vector3d sigma = pivot->covariance.diagonal().head<3>().cwiseSqrt();
    for (int axis = 0; axis < 3; ++axis)
      console.out << fmt::format("tip {} {:9.3f} +- {:.3f} mm\n", "xyz"[axis], pivot -> tip_in_tool[axis],
                                 sigma[axis]);
    console.out << fmt::format("rms {:.3f} mm over {} poses, {} outliers\n", pivot->rms_mm, pivot->used,
                               pivot->outliers);
  }
  return {};
}

void add_definitions(CLI::App* command, TrackerLinkArguments& a) {
  command->add_option(
      "--definition", a.definitions,
      "NAME=FILE.rom: definition of a passive tool of an NDI tracker, and the tool's name; repeated "
      "for each");
}

namespace {

void add_tracker_link(CLI::App* command, TrackerLinkArguments& a) {
  command
      ->add_option(
          "PEER", a.peer,
          "address:port of an OpenIGTLink server, ndi:ADDRESS[:PORT] of an NDI tracker (port 8765), or "
          "file:PATH of a recording")
      ->required();
  add_definitions(command, a);
  command->add_option("--seconds", a.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
  command->add_option("--rate", a.tracker.rate_hz, "Rate to request, Hz; default: 60")
      ->check(within(1, 1000));
  command->add_flag("--ask,!--no-ask", a.tracker.ask_for_tracking,
                    "Request tracking (STT_TDATA), which some servers require (default)");
}

}  // namespace

void add_tracker(CLI::App& app, Action& action) {
  auto* tracker = add_command(
      app, group::operation, "tracker",
      "Watch, record or play a tracker (OpenIGTLink, NDI); calibrate pointer and mount",
      "helicarm tracker watch 127.0.0.1:18944\n"
      "  helicarm tracker watch ndi:192.168.1.10 --definition femur=8700339.rom --definition "
      "tool=8700449.rom\n"
      "  helicarm tracker record 127.0.0.1:18944 poses.mha --seconds 20\n"
      "  helicarm tracker replay poses.mha --port 18944\n"
      "  helicarm tracker send my-case --port 18944\n"
      "  helicarm tracker pivot poses.mha --tool PointerToTracker\n"
      "  helicarm tracker calibrate-mount 127.0.0.1:18944 --facet calibrator --tip tip.json --touch "
      "P1,P1,P1,P4,P4,P4,P8,P8,P8,P11,P11,P11");
  tracker->require_subcommand(1);
  auto* watch = tracker->add_subcommand("watch", "Print the received poses of each tool");
  add_tracker_link(watch, arguments_of(watch, action, tracker_watch_command));

  auto* record = tracker->add_subcommand("record", "Record into a MetaImage sequence file");
  auto& recorded = arguments_of(record, action, tracker_record_command);
  add_tracker_link(record, recorded);
  record->add_option("FILE", recorded.file, "The file to write")->required();

  auto* replay = tracker->add_subcommand("replay", "Play a MetaImage sequence file as a tracker, repeatedly");
  auto& replayed = arguments_of(replay, action, tracker_replay_command);
  replay->add_option("FILE", replayed.file, "The file to play")->required();
  add_port(replay, "--port", replayed.options.port, "Port to listen on; 0: any free port");
  replay
      ->add_option("--address", replayed.options.address,
                   "Address to listen on; every host that reaches it may connect")
      ->capture_default_str();
  replay->add_option("--seconds", replayed.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
  replay->add_flag("--tdata", replayed.as_tracking, "Send TDATA on request instead of TRANSFORM to all");
  replay->add_flag("--ndi", replayed.ndi, "Play it as an NDI tracker in place of OpenIGTLink");

  auto* pivot = tracker->add_subcommand(
      "pivot", "Calibrate a pointer's tip from a recording of rotations about the tip");
  auto& turned = arguments_of(pivot, action, tracker_pivot_command);
  pivot->add_option("FILE", turned.file, "A MetaImage sequence file")->required();
  pivot->add_option("--tool", turned.tool, "The pointer's name in the file")->required();
  add_tracker_send(tracker, action);
  add_calibrate_mount(tracker, action);
}

}  // namespace helicarm::cli
