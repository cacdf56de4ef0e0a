// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <QStringList>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gui/controller/unsaved_landmarks.h"
#include "helicarm/operation/operation.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/registration/motion.h"
#include "helicarm/simulation/bone_meshes.h"

namespace helicarm::case_registration {
struct CaseRegistration;
}

namespace helicarm::gui {

/// Where images come from: `files` is a case, `images` are image files without one, for looking.
enum class Source { none, virtual_or, devices, files, images };

/// The file of a view's image.
struct ViewFile {
  std::filesystem::path file;
  int frames = 1;
  int frame = 1;  ///< 1-based, of the view
};

/// The steps in their order; the registration, of a case with models, is shown before the plan.
enum class Phase { acquire, rectify, calibrate, plan, navigate, verify, registration };
inline constexpr std::array phases{Phase::acquire,  Phase::rectify, Phase::calibrate,   Phase::plan,
                                   Phase::navigate, Phase::verify,  Phase::registration};

/// A model at a pose tried by hand.
struct NudgedModel {
  std::size_t model = 0;                                           ///< among `movable_models`
  registration::RigidStep step = registration::RigidStep::Zero();  ///< from its pose there
  geometry::RigidTransform world_from_model;
  std::vector<std::vector<Eigen::Vector2d>> outlines;  ///< per view, rectified px
};

/// A pick of which its view shows no image, and why.
struct FailedPick {
  pipeline::Pick pick;
  Failure why;
};

/// What was written into a folder.
struct ExportRecord {
  std::filesystem::path folder;
  QString at;         ///< time of day
  QStringList lacks;  ///< `lacks_of_export`
  std::shared_ptr<const pipeline::Result> result;
  std::shared_ptr<const case_registration::CaseRegistration> registration;
  std::vector<pipeline::Pick> picks;
};

/// The state shown by the window, except live data. A value: the window receives complete states only.
struct ApplicationState {
  Source source = Source::none;
  std::filesystem::path folder;          ///< of the session or the case
  std::filesystem::path asked_for = {};  ///< opened last, or refused
  std::vector<std::string> views;        ///< required views, in order
  std::vector<ViewFile> files;           ///< of the views; empty in an operation
  std::string next_view;                 ///< view of the next image
  phantom::Calibrator calibrator;        ///< without balls where `cameras` are given
  /// Of other programs, the file of each view: nothing is calibrated, and the world is theirs. Empty: none.
  std::vector<std::filesystem::path> cameras = {};
  std::shared_ptr<const simulation::BoneMeshes> bones;  ///< at the acquisition; simulation only

  /// Images received and, after the measurement, their detections. Never null once a source is open.
  std::shared_ptr<const pipeline::Result> result;
  bool measured = false;
  int measurements = 0;

  std::vector<std::string> check_points;     ///< on the bones, for the pointer
  std::map<std::string, double> touched_mm;  ///< deviation at the last touch

  std::vector<operation::OperationTunnel> tunnels;
  std::vector<std::string> tool_lines = {};             ///< tunnels of which the case states the tool's line
  std::vector<std::string> landmarks;                   ///< other points to pick; of files only
  std::map<std::string, pipeline::BoneLabel> bones_of;  ///< of landmarks that are not picked yet
  std::vector<pipeline::Pick> picks;
  std::vector<pipeline::Pick> measured_picks = {};        ///< those of `result`
  std::vector<FailedPick> failed_picks = {};              ///< of `picks`
  std::string changed_file = {};                          ///< of the case, on disk since it was read
  bool has_other_options = false;                         ///< than those of the measurement
  std::optional<std::filesystem::path> case_folder = {};  ///< where picks are kept; not of replays
  bool has_unsaved_picks = false;                         ///< not in the case.json of `case_folder`
  std::optional<Failure> picks_not_kept = {};             ///< why changed picks are not kept or saved
  std::vector<pipeline::Pick> offered_picks;              ///< picks of the plan

  bool has_models = false;  ///< the case names models to be registered
  std::shared_ptr<const case_registration::CaseRegistration> registration = {};
  /// The models where their search would begin, to be moved before the first registration.
  std::shared_ptr<const case_registration::CaseRegistration> at_starts = {};
  std::optional<NudgedModel> nudged = {};
  /// Of the registration; before the first one, of the models that stand in `at_starts` where they were
  /// placed.
  std::vector<operation::ModelStart> starts_by_hand = {};
  std::vector<pipeline::Pick> registered_picks =
      {};                     ///< at the registration; before the first, of `at_starts`
  bool is_confirmed = false;  ///< the registration, of an operation: a person compared the outlines
  std::vector<pipeline::CaseModel> models = {};  ///< of the case, or of the operation's plan
  ModelLandmarks model_landmarks = {};           ///< placed; at first those of the case
  ModelLandmarks planned_points = {};            ///< of the models' plans
  ModelLandmarks case_landmarks = {};            ///< of the case as it was read
  ModelLandmarks saved_landmarks = {};           ///< of case.json
  ModelLandmarks registered_landmarks = {};      ///< as `registered_picks`

  std::optional<operation::HandDrill> drill = {};  ///< held by a person; the plan has no robot then
  double stand_off_mm = robot::ApproachOptions().stand_off_mm;  ///< before a tunnel

  QString tour;      ///< description of the registration moves
  QString way = {};  ///< of the moves of `order`
  std::optional<double> hand_eye_rms_mm;
  std::optional<robot::RobotOrder> order;  ///< previewed, not yet carried out
  operation::PathPreview path;
  bool is_replayed = false;  ///< a moment of a recorded operation
  bool is_guided = false;    ///< at that moment, the drill
  bool tool_is_out = false;  ///< moving to a tunnel or in it; can be withdrawn
  bool has_arrived = false;  ///< the tool is in the tunnel `bound_for`
  std::string bound_for = {};
  std::map<std::string, operation::TunnelOutcome> outcomes;

  std::optional<ExportRecord> exported = {};

  std::optional<Phase> busy;  ///< step in progress
  std::string doing;          ///< description of the work in progress
  std::map<Phase, Failure> refusals;
};

/// Whether devices, real or virtual ones, carry out an operation.
bool is_operation(const ApplicationState& state);

/// Whether the models of an operation are registered, none refused, and their outlines are not compared yet.
bool awaits_confirmation(const ApplicationState& state);

/// Whether there are models and a measurement that was not refused, to which they can be registered.
bool can_register(const ApplicationState& state);

/// The registered models, else those at their starts: what can be moved by hand. Null if there are none.
std::shared_ptr<const case_registration::CaseRegistration> movable_models(const ApplicationState& state);

/// The first view without an image, else the first one.
std::string missing_view(const ApplicationState& state);

/// Whether this model was placed by hand before the first registration, and left there.
bool is_placed(const ApplicationState& state, std::size_t model);

/// Whether a model is moved or placed by hand, to be registered from there.
bool has_poses_by_hand(const ApplicationState& state);

/// Picks of this point in this view, or null.
const pipeline::Pick* pick_of(const ApplicationState& state, const std::string& point,
                              const std::string& view);

/// Why this pick has failed; null if it has not, or is not made.
const Failure* failure_of(const ApplicationState& state, const std::string& point, const std::string& view);

/// Two views locate a point; it may be picked in more.
bool is_picked(const std::vector<pipeline::Pick>& picks, const std::vector<std::string>& views,
               const std::string& point);

/// The next end and view to pick, in order; empty if all are picked.
struct WantedPick {
  std::string point;
  std::string view;
  std::optional<guidance::Bone> bone;
  std::optional<Failure> failed = {};  ///< why an earlier click in this view is no pick
};
/// Whether the model of the tunnel, if it has one, is registered, confirmed and where it was registered.
bool may_guide(const ApplicationState& state, const operation::OperationTunnel& tunnel);
/// Both ends; none of a tunnel of a model's plan.
std::vector<std::string> ends_to_pick(const operation::OperationTunnel& tunnel);
/// An end of a tunnel, in any view.
WantedPick wanted_end(const operation::OperationTunnel& tunnel, const std::string& end);
std::optional<WantedPick> next_pick(const ApplicationState& state);
/// The next landmark and view to pick.
std::optional<WantedPick> next_landmark(const ApplicationState& state);
/// Whether no end of the tunnel is picked.
bool is_unpicked(const ApplicationState& state, const operation::OperationTunnel& tunnel);
/// What a point lies on; nothing if it is not stated.
std::optional<pipeline::BoneLabel> bone_of(const ApplicationState& state, const std::string& point);
/// Adds the points that are picked and are no tunnel's end to the landmarks.
void complete_landmarks(ApplicationState& state);

}  // namespace helicarm::gui
