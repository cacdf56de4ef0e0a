// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/guidance_gate.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/operation/hand_eye_test.h"

namespace helicarm::operation {
namespace guidance_gate_test {

using Eigen::Vector3d;
using geometry::RigidTransform;

/// Sequences of random events; the environment's HELICARM_SEQUENCES replaces it (`./test --full`: 100,000).
constexpr int usual_sequences = 400;
constexpr int events_per_sequence = 40;
constexpr double step_mm = 0.4;  // motions; their sums do not come near the limit of 1 mm
const RigidTransform tracker_from_femur{geometry::rotation_from_euler(0.4, -0.3, 1.2), {-50, 0, 880}};
const Vector3d entry(30, 5, -20), leave(30, 5, 20);

OperationPlan plan_of_two_tunnels() {
  OperationPlan plan;
  plan.drill = HandDrill{{0, -140, 20}, {0, -20, 20}, 0.1};
  OperationTunnel planned{"planned", "femur", "from", "to"};
  planned.of_model =
      pipeline::ModelLine{.name = "planned", .model = "femur", .line = "planned", .diameter_mm = {}};
  plan.tunnels = {planned, {"picked", "femur", "FS", "FE"}};
  return plan;
}

/// Both tunnels along one line.
pipeline::Result located() {
  pipeline::Result result;
  const auto place = [](const Vector3d& at) {
    guidance::PointInFrames frames;
    frames.in_bones["femur"].propagated = {at, 0.01 * Eigen::Matrix3d::Identity(), {}, {}};
    return frames;
  };
  for (const auto& [name, at] : {std::pair("FS", entry), {"FE", leave}})
    result.points.push_back({name, localization::PointSource::pick, "femur", {}, place(at), 0, {}});
  for (const auto& [name, at] : {std::pair("from", entry), {"to", leave}}) {
    pipeline::ModelPoint point;
    point.model = "femur";
    point.name = name;
    point.place = place(at);
    result.model_points.push_back(point);
  }
  return result;
}

/// Bone, tool and robot at a virtual time, seen without noise.
class Scene {
 public:
  Scene() { wait(1); }
  void wait(double seconds) {
    now_s_ += seconds;
    constexpr int samples = 12;
    constexpr double period_s = 1.0 / 60;
    for (int i = samples - 1; i >= 0; --i) {
      const double time_s = now_s_ - i * period_s;
      // Poses that are the same to the last bit are those of a frozen tracker.
      const RigidTransform noise{Eigen::Matrix3d::Identity(), Vector3d(1e-6 * (++samples_ % 7), 0, 0)};
      tracker::IgtlTracking seen{{{"tool", 1, (noise * tracker_from_tool()).matrix()}}};
      if (is_seen) seen.tools.push_back({"femur", 1, (noise * femur()).matrix()});
      board.take({"tracker", tracker::stamp_from_seconds(1.7e9 + time_s), seen}, time_s);
      track.take(time_s, base_from_tcp_, time_s);
    }
  }
  RigidTransform femur() const {
    return {tracker_from_femur.rotation, tracker_from_femur.translation + Vector3d(step_mm * steps, 0, 0)};
  }
  RigidTransform tracker_from_tool() const { return tracker_from_tcp_ * marker_from_tcp_.inverse(); }
  double now_s() const { return now_s_; }
  PlanWatch watch(const OperationPlan& plan) const {
    return {plan.limits, plan.tracker,
            PlanBasis{now_s_,
                      "femur",
                      femur(),
                      {entry, leave},
                      marker_from_tcp_,
                      tracker_from_tcp_ * base_from_tcp_.inverse(),
                      base_from_tcp_}};
  }
  /// The drill's tip on the tunnels' axis, halfway.
  PoseWindow drill_on_axis(const OperationPlan& plan) const {
    PoseWindow window{now_s_ - 0.25, 0.25, {}};
    const RigidTransform tip = femur() * RigidTransform{Eigen::Matrix3d::Identity(), (entry + leave) / 2};
    for (int i = 14; i >= 0; --i) {
      const double time_s = now_s_ - i / 30.0;
      if (is_seen) window.samples["femur"].push_back({time_s, 0, time_s, femur()});
      window.samples["tool"].push_back(
          {time_s, 0, time_s, tip * tracked_tool(*plan.drill).marker_from_tip.inverse()});
    }
    return window;
  }

  tracker::PoseBoard board;
  robot::ToolTrack track;
  bool is_seen = true;
  int steps = 0;  ///< of the femur's motion

 private:
  double now_s_ = 100;
  int samples_ = 0;
  RigidTransform base_from_tcp_{geometry::rotation_from_euler(0.1, 0.2, 0.3), {200, -300, 400}};
  RigidTransform marker_from_tcp_{geometry::rotation_from_euler(0, 0.1, 0), {3, -2, 150}};
  RigidTransform tracker_from_tcp_ = exact_hand_eye().tracker_from_base * base_from_tcp_;
};

/// What happened, and by it alone what may move: the rule, told from the end.
struct History {
  struct Plan {
    robot::RobotOrder order;
    double time_s;
    int steps;
    int confirmation;  ///< number of the registration's confirmation that it was made by
    bool is_stale = false;
  };
  struct Guide {
    int steps, confirmation;
    bool is_stale = false;
  };

  int registrations = 0;
  int confirmed = 0;     ///< number of the registration that is confirmed
  bool present = false;  ///< the last registration is of the present images
  bool refused = false;
  std::map<std::string, Plan> plans;
  std::map<std::string, Guide> guides;

  bool is_registered() const { return present && !refused && confirmed == registrations; }
  static bool moved(int from, int to) { return std::abs(to - from) * step_mm > PlanLimits().distance_mm; }
  bool may_move(const std::string& tunnel, const robot::RobotOrder& order, const Scene& scene) {
    const auto plan = plans.find(tunnel);
    if (plan == plans.end() || plan->second.order.start != order.start || plan->second.is_stale) return false;
    if (tunnel == "planned" && (!is_registered() || plan->second.confirmation != confirmed)) return false;
    const bool is_old = scene.now_s() - plan->second.time_s > PlanLimits().age_s;
    if (!is_old && !scene.is_seen) return false;  // no pose: not known to be stale
    plan->second.is_stale = is_old || moved(plan->second.steps, scene.steps);
    return !plan->second.is_stale;
  }
};

class Sequence {
 public:
  explicit Sequence(std::uint64_t number) : random_(number, 43) {}

  void run() {
    for (int event = 0; event < events_per_sequence && !testing::Test::HasFailure(); ++event) next();
  }
  int motions = 0, guided = 0, refusals = 0;

 private:
  int drawn(int count) { return std::min(int(random_.uniform() * count), count - 1); }
  const OperationTunnel& tunnel() { return plan_.tunnels[std::size_t(drawn(2))]; }

  void next() {
    switch (drawn(12)) {
      case 0:
        return forget();
      case 1:
        return register_models(false);
      case 2:
        return register_models(random_.uniform() < 0.3);
      case 3:
      case 4:
        return confirm();
      case 5:
        return plan(tunnel());
      case 6:
      case 7:
        return go(tunnel());
      case 8:
        scene_.steps += drawn(7) - 3;
        return scene_.wait(0.5);
      case 9:
        return scene_.wait(0.5 + 13 * drawn(3));
      case 10:
        scene_.is_seen = random_.uniform() < 0.8;
        return scene_.wait(0.5);
      default:
        return drill(tunnel());
    }
  }
  /// Images, picks or the measurement.
  void forget() {
    gate_.forget_registration(plan_.tunnels);
    told_.present = false;
    told_.plans.erase("planned");
    told_.guides.erase("planned");
  }
  void register_models(bool is_refused) {
    constexpr std::array reasons{Reason::wrong_model, Reason::tunnel_breach, Reason::uncertain,
                                 Reason::registration_ambiguous, Reason::out_of_capture};
    forget();
    std::optional<Failure> refusal;
    if (is_refused) refusal = Failure{reasons[std::size_t(drawn(int(reasons.size())))], "refused"};
    gate_.registered(refusal);
    ++told_.registrations;
    told_.present = true;
    told_.refused = is_refused;
  }
  void confirm() {
    const bool may = told_.present && !told_.refused;
    EXPECT_EQ(gate_.confirm().has_value(), may);
    if (may) told_.confirmed = told_.registrations;
  }
  bool may_be_planned(const OperationTunnel& tunnel) const {
    return !tunnel.of_model || told_.is_registered();
  }
  void plan(const OperationTunnel& tunnel) {
    const auto may = gate_.check_registered(tunnel);
    EXPECT_EQ(may.has_value(), may_be_planned(tunnel)) << tunnel.name;
    if (!may || !scene_.is_seen) return;
    robot::RobotOrder order;
    order.name = tunnel.name;
    order.start[0] = ++orders_ * 1e-3;
    gate_.plan(tunnel.name, {to_text(robot::to_json(order)), {}, scene_.watch(plan_)});
    told_.plans[tunnel.name] = {order, scene_.now_s(), scene_.steps, told_.confirmed};
    given_[tunnel.name].push_back(order);
  }
  /// The last order to the tunnel, or now and then an earlier one.
  void go(const OperationTunnel& tunnel) {
    const auto& given = given_[tunnel.name];
    if (given.empty()) return;
    const robot::RobotOrder& order =
        random_.uniform() < 0.8 ? given.back() : given[std::size_t(drawn(int(given.size())))];
    const bool may = told_.may_move(tunnel.name, order, scene_);
    const auto moves = gate_.may_move(order, tunnel, scene_.board, scene_.track, scene_.now_s());
    EXPECT_EQ(moves.has_value(), may) << tunnel.name << (moves ? "" : ": " + moves.error().message);
    ++(moves ? motions : refusals);
  }
  void drill(const OperationTunnel& tunnel) {
    if (!gate_.guide() || random_.uniform() < 0.3) begin_guidance(tunnel);
    EXPECT_EQ(gate_.guide().has_value(), !told_.guides.empty());
    if (!gate_.guide()) return;
    ASSERT_EQ(told_.guides.count(gate_.guide()->tunnel().name), 1U) << "guided without a right to it";
    History::Guide& told = told_.guides.at(gate_.guide()->tunnel().name);
    const Guidance now = gate_.guidance(scene_.drill_on_axis(plan_));
    if (gate_.is_new(now)) gate_.shown(now);
    told.is_stale = told.is_stale || (scene_.is_seen && History::moved(told.steps, scene_.steps));
    const bool may = scene_.is_seen && !told.is_stale &&
                     (gate_.guide()->tunnel().name == "picked" || told.confirmation == told_.confirmed);
    EXPECT_EQ(now.decision() == "on_target", may) << now.decision();
    ++(may ? guided : refusals);
  }
  void begin_guidance(const OperationTunnel& tunnel) {
    gate_.end_guidance();
    told_.guides.clear();
    const auto may = gate_.check_registered(tunnel);
    EXPECT_EQ(may.has_value(), may_be_planned(tunnel)) << tunnel.name;
    if (!may || !scene_.is_seen) return;
    guidance::Poses basis;
    basis.tracker_from_bone["femur"] = scene_.femur();
    basis.tracker_from_tool = scene_.tracker_from_tool();
    gate_.guide(FreehandGuide::begin(plan_, LiveTool(plan_, located(), {}, tracked_tool(*plan_.drill)),
                                     tunnel.name, basis, 0.1)
                    .value());
    told_.guides[tunnel.name] = {scene_.steps, told_.confirmed};
  }

  RandomStream random_;
  const OperationPlan plan_ = plan_of_two_tunnels();
  Scene scene_;
  GuidanceGate gate_;
  History told_;
  std::map<std::string, std::vector<robot::RobotOrder>> given_;
  int orders_ = 0;
};

TEST(GuidanceGate, NothingMovesOnAStaleOrRefusedRegistrationInAnySequenceOfEvents) {
  const char* wanted = std::getenv("HELICARM_SEQUENCES");
  const int sequences = wanted ? std::atoi(wanted) : usual_sequences;
  long motions = 0, guided = 0, refusals = 0;
  for (int number = 0; number < sequences; ++number) {
    SCOPED_TRACE(number);
    Sequence sequence{std::uint64_t(number)};
    sequence.run();
    motions += sequence.motions, guided += sequence.guided, refusals += sequence.refusals;
    if (HasFailure()) return;
  }
  EXPECT_GT(motions, sequences / 2);  // that something moved at all
  EXPECT_GT(guided, sequences / 2);
  EXPECT_GT(refusals, sequences / 2);
  std::printf("%d sequences of %d events: %ld motions, %ld times on target, %ld refusals\n", sequences,
              events_per_sequence, motions, guided, refusals);
}

TEST(GuidanceGate, ARefusedRegistrationCannotBeConfirmed) {
  GuidanceGate gate;
  EXPECT_EQ(gate.confirm().error().reason, Reason::usage);
  gate.registered(Failure{Reason::wrong_model, "another bone"});
  EXPECT_EQ(gate.confirm().error().reason, Reason::wrong_model);
  EXPECT_FALSE(gate.is_confirmed());
}

}  // namespace guidance_gate_test
}  // namespace helicarm::operation
