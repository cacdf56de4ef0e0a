// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QFileSystemWatcher>
#include <QObject>
#include <QThreadPool>
#include <QTimer>
#include <functional>

#include "gui/controller/application_state.h"
#include "gui/controller/live.h"
#include "gui/controller/worker.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/earlier_versions.h"
#include "helicarm/operation/session_records.h"
#include "helicarm/registration/motion.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::gui {

struct Equipment;
struct MeasuredImages;
struct OpenedLandmarks;

/// The live data of the window at one time.
struct LiveState {
  double at_s = 0;  ///< monotonic
  std::vector<StatusIndicator> indicators;
  robot::RobotLinkStatus robot;
  guidance::Bone bone;                                   ///< reference bone of the tool
  std::optional<Expected<operation::ToolOverlay>> tool;  ///< empty before registration
  QString tunnel;                                        ///< tunnel of `aim`
  std::optional<Expected<operation::TunnelAim>> aim;     ///< empty without a tunnel
  std::optional<operation::Guidance> drill;              ///< in a person's hand, while it is guided
  std::optional<Failure> stale;  ///< why the displayed path can no longer be confirmed
};

/// A measurement of a recorded operation, and the registration of its models that stood at a moment.
struct RecordedMoment {
  std::filesystem::path case_folder;
  operation::OperationPlan plan;
  std::optional<operation::record::Registered> models = {};
  bool is_confirmed = false;  ///< that registration
};

/// Operations available to the window. Work runs in a separate thread; its results arrive as `changed`. Lives
/// in the interface thread; no member blocks.
class Controller : public QObject {
  Q_OBJECT

 public:
  explicit Controller(QObject* parent = nullptr);
  ~Controller() override;

  const ApplicationState& state() const { return state_; }

  /// Virtual devices in this program, over the real protocols through sockets; the plan takes the non-default
  /// `plan_fields` of `wished`. `by_ct`: the tunnels are lines in a CT of the knee, which is written beside
  /// `folder` (`rehearsal::with_ct_plan`), in place of picks.
  void open_virtual_or(const virtual_devices::VirtualDevicesOptions& options,
                       const operation::OperationPlan& wished, const std::filesystem::path& folder,
                       bool by_ct = false);
  /// The devices of a plan.
  void open_devices(const std::filesystem::path& plan, const receiver::ReceiverOptions& receiver,
                    const std::filesystem::path& folder);
  /// A case folder, without tracker and robot.
  /// `keeps_picks`: changed picks are kept beside case.json, and those kept are taken.
  void open_case(const std::filesystem::path& folder, bool keeps_picks = true);
  /// Opens the measurement, unless it is open, by the operation's plan, and registers its models as recorded:
  /// from the files of the session, and refused (replay_differs) where that gives another registration.
  void show_recorded(RecordedMoment moment);
  /// A moment before the first measurement: the recorded case, if one is open or being opened, is shown
  /// without a registration.
  void show_unregistered();
  /// Image files for looking, without a case.
  void open_images(const std::vector<std::filesystem::path>& files);
  /// Why opening another source or closing would lose something; empty if it would not.
  QString loss() const;

  /// For virtual devices opened from now on, never for real ones: tests on a busy machine set longer limits.
  void set_virtual_freshness(const operation::FreshnessLimits& limits) { freshness_ = limits; }

  /// A case is measured again if they differ; the next measurement takes them.
  void set_options(const case_registration::RegisterOptions& options);
  void expect(const std::string& view);        ///< view of the next image
  void shoot(const std::string& view);         ///< with the virtual C-arm
  void touch(const std::string& check_point);  ///< with the pointer
  /// Also during a measurement with earlier picks, which is then repeated. Moves with the bone of its other
  /// picks.
  void pick(pipeline::Pick pick);
  bool takes_picks() const;
  void take_offered_picks();
  /// Changes how a point's picks are taken, in one view or all, and measures again.
  void set_snap(const std::string& point, pipeline::Snap snap, const std::string& view = {});
  /// Another point to pick, in a case of files. Refused if the name is empty or taken.
  void add_landmark(const std::string& name, std::optional<pipeline::BoneLabel> bone = {});
  /// Places landmarks in a model of a case, in its coordinates; those that it has are moved. Each is also a
  /// point to pick. Refused as `why_no_landmark`.
  void place_landmarks(std::size_t model, const std::vector<pipeline::PointInModel>& points);
  /// With its picks.
  void rename_landmark(std::size_t model, const std::string& from, const std::string& to);
  /// Its picks stay.
  void remove_landmark(std::size_t model, const std::string& name);
  bool takes_landmarks(std::size_t model) const;
  /// Asks no more for tunnels of which no end is picked; of files only.
  void leave_out_tunnels();
  /// Into case.json, with the landmarks placed in models.
  void save_picks();
  /// Removes a point's picks in all views, and the point if it is a landmark.
  void erase_picks(const std::string& point);
  void clear_picks();
  /// Of picks, points to pick, tunnels left out, models moved by hand and their registration.
  bool can_undo() const { return !earlier_.empty() && takes_picks(); }
  bool can_redo() const { return !later_.empty() && takes_picks(); }
  /// What is undone or repeated next; empty without one.
  QString undoes() const { return earlier_.empty() ? QString() : earlier_.back().what; }
  QString redoes() const { return later_.empty() ? QString() : later_.back().what; }
  void undo() { step_edits(earlier_, later_); }
  void redo() { step_edits(later_, earlier_); }
  void measure();
  /// Reads the case again if a file of it has changed.
  void measure_again();

  /// Registers the models of a measured case or operation, those moved or placed by hand from there.
  void register_models();
  /// After a person has compared the outlines with the bones: the tunnels of an operation's models guide the
  /// tool from then on.
  void confirm_registration();
  /// Shows the models where their search would begin, for `nudge` before the first registration.
  void place_models();
  /// Moves a model from its registered pose or its start, about its centre; its outlines follow as soon as
  /// they are computed. `continues`: as a part of the move before, for undo.
  /// A model moved earlier stays there before the first registration; after it, it returns to its
  /// registered pose.
  void nudge(std::size_t model, const registration::RigidStep& step, bool continues = false);
  /// Models moved or placed by hand return to their registered poses or their starts.
  void return_models();

  /// `shown`: the robot's status that this person sees. Refuses as `RobotLink::unlock`.
  void unlock(const std::string& who, const robot::RobotLinkStatus& shown);
  void register_robot();
  /// Guides a hand-held drill to a tunnel until `end_guidance`, or until `verify_drilled` has compared it
  /// with the tunnel. In a rehearsal a virtual person follows the guidance.
  void guide_drill(const std::string& tunnel);
  void verify_drilled();
  void end_guidance();
  void plan_order(const std::string& tunnel);
  /// Withdraws the displayed path, with a record, and shows the refusal; a new plan is required.
  void drop_plan(const Failure& why);
  void go();
  void withdraw();
  /// Stops the robot immediately, whatever else is in progress.
  void stop();
  /// Cancels the work in progress as soon as possible and discards its result.
  void cancel();

  /// Writes the report (HTML, PDF), result.json and other programs' formats into a folder; `exported` signals
  /// the end.
  void export_to(const std::filesystem::path& folder);

  void set_fault(const std::string& name, bool on);
  void move_bone(const std::string& bone, const Eigen::Vector3d& shift_mm);

  /// Fast: reads the newest poses, not the measurement.
  LiveState live() const;
  void follow(const std::string& tunnel) { followed_ = tunnel; }

 signals:
  void changed();
  void refused(helicarm::gui::Phase phase, const QString& why);
  void exported(const QString& folder);
  /// Undo or redo has changed a model's pose or registration alone.
  void models_stepped();
  /// What was done, or will be, in one sentence.
  void told(const QString& words);

 private:
  using Change = std::function<void(ApplicationState&)>;
  using Picks = std::vector<pipeline::Pick>;
  /// What a person has made, before or after the change `what`.
  struct Edit {
    QString what;
    Picks picks;
    std::vector<operation::OperationTunnel> tunnels;
    std::vector<std::string> landmarks;
    std::map<std::string, pipeline::BoneLabel> bones_of;
    std::shared_ptr<const case_registration::CaseRegistration> registration, at_starts;
    Picks registered_picks;
    std::optional<NudgedModel> nudged;
    ModelLandmarks model_landmarks, registered_landmarks;
    std::vector<operation::ModelStart> starts_by_hand;
    bool of_models = false;
  };

  void begin(Phase phase, std::string doing, std::function<Change()> work);
  void finish(Phase phase, const Expected<Change>& done);
  /// What the operation holds after work that failed: it may have forgotten what it held `before`, which is
  /// shown. `order`: the displayed one.
  Change held_after(const Equipment& equipment, const MeasuredImages& before,
                    const std::optional<robot::RobotOrder>& order);
  void open(Source source, const std::filesystem::path& folder, std::string doing,
            std::function<Change(Equipment&)> work);
  void start_operation(Equipment& equipment, operation::OperationPlan plan,
                       const std::filesystem::path& folder);
  /// From any thread: a state change during the work.
  void meanwhile(Change change);
  /// From any thread: what the work in progress does now, unless it is being cancelled.
  void show_step(const std::string& step);
  void take_waiting_image();
  void change_picks(Picks picks, bool measurable, const QString& what);
  Edit edit_named(const QString& what) const;
  /// `of_models`: nothing but their poses changes.
  void remember_edit(const QString& what, bool of_models = false);
  /// Neither registrations to other calibrated views nor moves from them are returned to.
  void forget_registrations();
  void step_edits(std::vector<Edit>& from, std::vector<Edit>& to);
  void picks_changed(bool measurable);
  bool has_all_images() const;
  Change measured(Equipment& equipment, const std::vector<pipeline::Pick>& picks);
  /// `models`: those of the session, into which it was copied.
  static Change with_plan(const operation::OperationPlan& plan,
                          const std::vector<pipeline::CaseModel>& models,
                          const std::vector<pipeline::Pick>& offered);
  Change with_case(pipeline::Case the_case, Equipment& equipment, std::optional<Picks> unsaved = {});
  void keep_unsaved_picks();
  void take_landmarks(const OpenedLandmarks& opened);
  void landmarks_changed();
  void keep_landmarks();
  /// A sentence for each model that changed.
  Expected<QStringList> save_landmarks();
  void watch_files_of(const std::filesystem::path& case_folder);
  void watch_no_files();
  void leave_where_placed();
  /// The starts of models that are not placed by hand follow picks and landmarks.
  void forget_old_starts();
  /// The moved model, and those left where they were placed before their outlines were there.
  void outline_nudged();
  std::optional<NudgedModel> not_outlined() const;
  void take_outlines(const NudgedModel& of, const std::vector<std::vector<Eigen::Vector2d>>& outlines);
  void register_in_operation();
  void open_recorded();
  /// Shows the registration that stood at the recorded moment.
  void follow_record();
  void register_as_recorded();
  std::vector<operation::ModelStart> starts_by_hand() const;
  /// Null for a tunnel that is not known and, told then, for one of a model while a model is moved by hand.
  const operation::OperationTunnel* tunnel_not_moved(const std::string& name);
  std::optional<operation::TunnelOutcome> verified(Equipment& equipment, const std::string& tunnel);
  /// `images`: of all views, or why the new one was refused.
  Change came(const Expected<std::vector<pipeline::ViewResult>>& images);

  ApplicationState state_;
  std::shared_ptr<Equipment> equipment_;
  std::optional<operation::LiveTool> live_tool_;
  std::optional<operation::PlanWatch> plan_watch_;  ///< of the displayed path
  std::string followed_;
  std::vector<Edit> earlier_, later_;  ///< for undo and redo, the last is the next
  bool outlining_ = false;             ///< of a model moved by hand
  std::optional<RecordedMoment> recorded_;
  bool opens_recorded_ = false;      ///< the source asked for, at `recorded_`
  bool registers_recorded_ = false;  ///< until cancelled
  struct {
    std::string digest;  ///< of the record
    Expected<std::shared_ptr<const operation::RecordedRegistration>> done = nullptr;
  } as_recorded_;                      ///< registered last
  bool measures_again_ = false;        ///< after the work in progress
  std::function<void()> next_source_;  ///< opened as soon as the work in progress has ended
  case_registration::RegisterOptions options_;
  std::optional<operation::FreshnessLimits> freshness_;
  QTimer images_;
  QFileSystemWatcher files_;  ///< of the case
  QStringList watched_;       ///< by `files_`, which forgets a file that is replaced
  QThreadPool faults_;        ///< of the virtual devices
  QThreadPool stops_;         ///< of the robot; they wait for no other task
  Worker worker_;             ///< last: its jobs use all other members
};

}  // namespace helicarm::gui
