// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/live.h"

#include <QCoreApplication>
#include <algorithm>

#include "gui/controller/steps.h"

namespace helicarm::gui {
namespace {

QString live_tr(const char* text) { return QCoreApplication::translate("Live", text); }

std::optional<double> least_age(const std::vector<tracker::ToolState>& tools,
                                const std::vector<std::string>& names) {
  std::optional<double> least;
  for (const tracker::ToolState& tool : tools)
    if (tool.age_s && std::ranges::find(names, tool.name) != names.end())
      least = std::min(least.value_or(*tool.age_s), *tool.age_s);
  return least;
}

StatusIndicator marker_indicator(const QString& name, const std::optional<double>& age_s) {
  if (!age_s) return {name, Light::off, age_text(age_s), live_tr("no pose from the tracker yet"), {}};
  if (*age_s <= fresh_s) return {name, Light::green, age_text(age_s), {}, {}};
  return {name,
          *age_s <= late_s ? Light::amber : Light::red,
          age_text(age_s),
          live_tr("not visible, or tracker disconnected: a pose of this age is not used for motion"),
          {}};
}

QString words(std::string_view text) { return QString::fromUtf8(text.data(), qsizetype(text.size())); }

}  // namespace

QString age_text(const std::optional<double>& age_s) {
  if (!age_s) return live_tr("not visible");
  return *age_s < 1 ? live_tr("%1 ms").arg(*age_s * 1000, 0, 'f', 0) : live_tr("%1 s").arg(*age_s, 0, 'f', 1);
}

std::vector<StatusIndicator> tracker_indicators(const operation::TrackerPlan& plan,
                                                const std::vector<tracker::ToolState>& tools) {
  std::vector<std::string> facets;
  for (const tracker::Facet& facet : plan.facets) facets.push_back(facet.name);
  std::vector<StatusIndicator> indicators{marker_indicator(live_tr("calibrator"), least_age(tools, facets))};
  for (const auto& [bone, marker] : plan.markers)
    indicators.push_back(marker_indicator(QString::fromStdString(bone), least_age(tools, {marker})));
  indicators.push_back(marker_indicator(live_tr("tool"), least_age(tools, {plan.tool})));
  return indicators;
}

std::vector<StatusIndicator> recorded_indicators(const operation::TrackerPlan& plan,
                                                 const SessionState& then) {
  std::vector<StatusIndicator> indicators;
  const auto add = [&](const QString& name, const std::string& marker) {
    const auto looked_for = then.tracker_from.find(marker);
    if (looked_for == then.tracker_from.end()) return;
    const bool is_seen = looked_for->second.has_value();
    indicators.push_back({name,
                          is_seen ? Light::green : Light::off,
                          is_seen ? live_tr("seen") : live_tr("not seen"),
                          is_seen ? QString() : live_tr("the tracker did not see it at this moment"),
                          {}});
  };
  for (const auto& [bone, marker] : plan.markers) add(QString::fromStdString(bone), marker);
  add(live_tr("tool"), plan.tool);
  return indicators;
}

StatusIndicator robot_indicator(const robot::RobotLinkStatus& status) {
  StatusIndicator indicator{live_tr("robot"),
                            Light::off,
                            {},
                            status.why ? sentence_of(*status.why) : QString(),
                            StatusIndicator::Kind::robot};
  const QString age = age_text(status.state ? std::optional(status.age_s) : std::nullopt);
  switch (status.phase) {
    case robot::LinkPhase::disconnected:
    case robot::LinkPhase::stopped:
      indicator.light = Light::red;
      break;
    case robot::LinkPhase::idle:
      indicator.light = Light::amber;
      break;
    case robot::LinkPhase::ready:
    case robot::LinkPhase::starting:
    case robot::LinkPhase::moving:
      indicator.light = Light::green;
      break;
  }
  const QString phase =
      status.phase == robot::LinkPhase::idle ? live_tr("locked") : words(robot::name(status.phase));
  indicator.text = status.phase == robot::LinkPhase::disconnected ? phase : live_tr("%1, %2").arg(phase, age);
  if (status.phase == robot::LinkPhase::idle) indicator.why = live_tr("locked until a person unlocks it");
  return indicator;
}

StatusIndicator c_arm_indicator(const operation::CArmStatus& status, double now_s) {
  StatusIndicator indicator{live_tr("C-arm"), Light::off, live_tr("no image yet"),
                            live_tr("the C-arm connects when it has an image to send"),
                            StatusIndicator::Kind::c_arm};
  if (status.last_image_s)
    indicator = {indicator.name,
                 Light::green,
                 live_tr("%1 ago").arg(age_text(now_s - *status.last_image_s)),
                 {},
                 indicator.kind};
  if (status.broke_off) {
    indicator.light = Light::red;
    indicator.text = live_tr("disconnected");
    indicator.why = live_tr("a connection was lost or rejected before an image was sent");
  }
  if (status.refused) {
    indicator.light = Light::red;
    indicator.text = live_tr("refused");
    indicator.why = sentence_of(*status.refused);
  }
  return indicator;
}

}  // namespace helicarm::gui
