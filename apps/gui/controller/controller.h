// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QObject>
#include <QThreadPool>
#include <QTimer>
#include <functional>

#include "gui/controller/application_state.h"
#include "gui/controller/live.h"
#include "gui/controller/worker.h"
#include "helicarm/operation/connections.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::gui {

struct Equipment;

/// The live part of the window at one moment.
struct LiveState {
  double at_s = 0;  ///< monotonic
  std::vector<Lamp> lamps;
  RobotLinkStatus robot;
  Bone bone = Bone::femur;                    ///< against which the tool is seen
  std::optional<Expected<ToolOverlay>> tool;  ///< nothing before the robot is registered
  QString tunnel;                             ///< that is followed
  std::optional<Expected<TunnelAim>> aim;     ///< nothing before a tunnel is followed
  std::optional<Failure> stale;               ///< why the path on show is no longer to be confirmed
};

/// Everything the window can ask for. Work goes on in a thread of its own; what came of it arrives as
/// `changed`. Lives in the interface's thread; no member waits.
class Controller : public QObject {
  Q_OBJECT

 public:
  explicit Controller(QObject* parent = nullptr);
  ~Controller() override;

  const ApplicationState& state() const { return state_; }

  /// A virtual operating room in this program, over its real protocols through sockets; its plan has those
  /// `plan_fields` of `wished` that are not as usual.
  void open_virtual_or(const virtual_devices::VirtualDevicesOptions& options, const OperationPlan& wished,
                       const std::filesystem::path& folder);
  /// The devices of a plan.
  void open_devices(const std::filesystem::path& plan, const ReceiverOptions& receiver,
                    const std::filesystem::path& folder);
  /// A case folder, or X-rays without tracker and robot.
  void open_case(const std::filesystem::path& folder);
  void open_images(const std::vector<std::filesystem::path>& images);

  /// For virtual rooms opened from now on, never for real devices: a test on a busy machine sets longer ones.
  void set_virtual_freshness(const FreshnessLimits& limits) { freshness_ = limits; }

  /// For the next measurement.
  void set_options(const RunOptions& options);
  void expect(const std::string& view);        ///< the next image is this view's
  void shoot(const std::string& view);         ///< in the virtual room
  void touch(const std::string& check_point);  ///< with the pointer
  /// Also while an earlier pick is being measured; then measures again.
  void pick(Pick pick);
  bool takes_picks() const;
  void take_offered_picks();
  void clear_picks();
  void measure();

  void unlock(const std::string& who);
  void register_robot();
  void plan_tunnel(const std::string& tunnel);
  /// The path on show is taken away, on record, and the refusal shown: it must be planned again.
  void drop_plan(const Failure& why);
  void go();
  void withdraw();
  /// Stops the robot, at once and whatever else goes on.
  void stop();
  /// Ends what is being done as soon as it can end; nothing of it is kept.
  void cancel();

  /// Report (HTML, PDF), result.json and other programs' formats into a folder; `exported` tells the end.
  void export_to(const std::filesystem::path& folder);

  void set_fault(const std::string& name, bool on);
  void move_bone(const std::string& bone, const Eigen::Vector3d& shift_mm);

  /// Cheap: the newest poses, not what is measured.
  LiveState live() const;
  void follow(const std::string& tunnel) { followed_ = tunnel; }

 signals:
  void changed();
  void refused(helicarm::gui::Phase phase, const QString& why);
  void exported(const QString& folder);

 private:
  using Change = std::function<void(ApplicationState&)>;

  void begin(Phase phase, std::string doing, std::function<Change()> work);
  void open(Source source, const std::filesystem::path& folder, std::string doing,
            std::function<Change(Equipment&)> work);
  void start_operation(Equipment& equipment, OperationPlan plan, const std::filesystem::path& folder);
  /// From any thread: a change while the work goes on.
  void meanwhile(Change change);
  void take_waiting_image();
  void picks_changed(bool measurable);
  bool is_whole(const std::string& point) const;
  Change measured(Equipment& equipment, const std::vector<Pick>& picks);
  static Change with_plan(const OperationPlan& plan, const Json& offered);
  Change with_case(Case given, Equipment& equipment);
  Change came(std::vector<ViewResult> images);

  ApplicationState state_;
  std::shared_ptr<Equipment> equipment_;
  std::optional<LiveTool> live_tool_;
  std::optional<PlanWatch> plan_watch_;  ///< of the path on show
  std::string followed_;
  bool picks_came_ = false;  ///< while it measured
  RunOptions options_;
  FreshnessLimits freshness_;
  QTimer images_;
  QThreadPool errands_;  ///< what must not wait for the worker: the stop above all
  Worker worker_;        ///< last: its jobs use all the others
};

}  // namespace helicarm::gui
