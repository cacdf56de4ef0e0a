// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/live.h"

#include <QCoreApplication>
#include <algorithm>

#include "gui/controller/steps.h"

namespace helicarm::gui {
namespace {

QString tr(const char* text) { return QCoreApplication::translate("Live", text); }

std::optional<double> least_age(const std::vector<ToolState>& tools, const std::vector<std::string>& names) {
  std::optional<double> least;
  for (const ToolState& tool : tools)
    if (tool.age_s && std::ranges::find(names, tool.name) != names.end())
      least = std::min(least.value_or(*tool.age_s), *tool.age_s);
  return least;
}

Lamp marker_lamp(const QString& name, const std::optional<double>& age_s) {
  if (!age_s) return {name, Light::off, age_text(age_s), tr("no pose from the tracker yet")};
  if (*age_s <= fresh_s) return {name, Light::green, age_text(age_s), {}};
  return {name, *age_s <= late_s ? Light::amber : Light::red, age_text(age_s),
          tr("not visible, or tracker disconnected: a pose of this age is not used for motion")};
}

QString words(std::string_view text) { return QString::fromUtf8(text.data(), qsizetype(text.size())); }

}  // namespace

QString age_text(const std::optional<double>& age_s) {
  if (!age_s) return tr("not visible");
  return *age_s < 1 ? tr("%1 ms").arg(*age_s * 1000, 0, 'f', 0) : tr("%1 s").arg(*age_s, 0, 'f', 1);
}

std::vector<Lamp> tracker_lamps(const TrackerPlan& plan, const std::vector<ToolState>& tools) {
  std::vector<std::string> facets;
  for (const Facet& facet : plan.facets) facets.push_back(facet.name);
  return {marker_lamp(tr("calibrator"), least_age(tools, facets)),
          marker_lamp(tr("femur"), least_age(tools, {plan.femur})),
          marker_lamp(tr("tibia"), least_age(tools, {plan.tibia})),
          marker_lamp(tr("tool"), least_age(tools, {plan.tool}))};
}

Lamp robot_lamp(const RobotLinkStatus& status) {
  Lamp lamp{tr("robot"), Light::off, {}, status.why ? sentence_of(*status.why) : QString()};
  const QString age = age_text(status.state ? std::optional(status.age_s) : std::nullopt);
  switch (status.phase) {
    case LinkPhase::disconnected:
    case LinkPhase::stopped:
      lamp.light = Light::red;
      break;
    case LinkPhase::idle:
      lamp.light = Light::amber;
      break;
    case LinkPhase::ready:
    case LinkPhase::starting:
    case LinkPhase::moving:
      lamp.light = Light::green;
      break;
  }
  const QString phase = status.phase == LinkPhase::idle ? tr("locked") : words(name(status.phase));
  lamp.text = status.phase == LinkPhase::disconnected ? phase : tr("%1, %2").arg(phase, age);
  if (status.phase == LinkPhase::idle) lamp.why = tr("locked until a person unlocks it");
  return lamp;
}

Lamp c_arm_lamp(const CArmStatus& status, double now_s) {
  Lamp lamp{tr("C-arm"), Light::off, tr("no image yet"), tr("it connects when it has an image")};
  if (status.last_image_s)
    lamp = {lamp.name, Light::green, tr("%1 ago").arg(age_text(now_s - *status.last_image_s)), {}};
  if (status.broke_off) {
    lamp.light = Light::red;
    lamp.text = tr("disconnected");
    lamp.why = tr("a connection was lost or rejected before an image was sent");
  }
  if (status.refused) {
    lamp.light = Light::red;
    lamp.text = tr("refused");
    lamp.why = sentence_of(*status.refused);
  }
  return lamp;
}

}  // namespace helicarm::gui
