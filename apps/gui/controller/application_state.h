// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/operation/operation.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/simulation/bone_meshes.h"

namespace helicarm::gui {

/// Where images come from.
enum class Source { none, virtual_or, devices, files };

/// The strip of steps, in the order in which they are taken.
enum class Phase { acquire, rectify, calibrate, plan, navigate, verify };
inline constexpr std::array phases{Phase::acquire, Phase::rectify,  Phase::calibrate,
                                   Phase::plan,    Phase::navigate, Phase::verify};

/// All that the window shows but for what is live. A value: the window only ever sees whole ones.
struct ApplicationState {
  Source source = Source::none;
  std::filesystem::path folder;    ///< of the session or the case
  std::vector<std::string> views;  ///< wanted, in order
  std::string next_view;           ///< the next image will be this one's
  Calibrator calibrator;
  std::shared_ptr<const simulation::BoneMeshes> bones;  ///< as they lay; known of a virtual room alone

  /// Images that came and, once measured, all that was found in them. Never null once there is a source.
  std::shared_ptr<const Result> result;
  bool measured = false;
  int measurements = 0;

  std::vector<std::string> check_points;     ///< on the bones, for the pointer
  std::map<std::string, double> touched_mm;  ///< how far off each was at its last touch

  std::vector<PlannedTunnel> tunnels;
  std::vector<Pick> picks;
  std::vector<Pick> offered_picks;  ///< those that came with the plan

  QString tour;  ///< what registering would do, in words
  std::optional<double> hand_eye_rms_mm;
  std::optional<RobotOrder> order;  ///< previewed, not yet carried out
  PathPreview path;
  bool tool_is_out = false;  ///< on its way to a tunnel or in it: it can be withdrawn
  std::map<std::string, TunnelOutcome> outcomes;

  std::optional<Phase> busy;  ///< what is being done
  std::string doing;          ///< in words
  std::map<Phase, Failure> refusals;
};

/// Picks of this point in this view, or nothing.
const Pick* pick_of(const ApplicationState& state, const std::string& point, const std::string& view);

/// The end and the view that still want a click, in order; nothing where all are picked.
struct WantedPick {
  std::string point;
  std::string view;
  Bone bone;
};
std::optional<WantedPick> next_pick(const ApplicationState& state);

}  // namespace helicarm::gui
