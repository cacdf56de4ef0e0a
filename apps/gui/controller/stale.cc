// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/stale.h"

#include <QCoreApplication>
#include <QStringList>
#include <algorithm>

#include <fmt/format.h>

#include "gui/controller/model_landmarks.h"
#include "gui/controller/pick_checks.h"
#include "gui/controller/steps.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {
namespace {

using case_registration::CaseRegistration;
using case_registration::RegisteredModel;

QString stale_tr(const char* text) { return QCoreApplication::translate("Stale", text); }

QString as_text(const std::string& words) { return QString::fromStdString(words); }

std::vector<pipeline::Pick> picks_named(const std::vector<pipeline::Pick>& picks, const std::string& point) {
  std::vector<pipeline::Pick> of_it;
  std::ranges::copy_if(picks, std::back_inserter(of_it),
                       [&](const auto& pick) { return pick.name == point; });
  return of_it;
}

/// The first landmark of the model's start that is picked elsewhere since the registration.
std::optional<std::string> moved_landmark(const ApplicationState& state, const RegisteredModel& model) {
  for (const registration::Landmark& landmark : model.used_landmarks)
    if (!are_same(picks_named(state.picks, landmark.name),
                  picks_named(state.registered_picks, landmark.name)))
      return landmark.name;
  return std::nullopt;
}

/// Why the models' poses are not those registered from the present inputs.
QString stale_models(const ApplicationState& state) {
  if (!state.registration) return {};
  for (std::size_t i = 0; i < state.registration->models.size(); ++i)
    if (const QString why = stale_model(state, i); !why.isEmpty()) return why;
  return {};
}

/// Whether a point of the result, or one picked in enough views, has other picks than those measured; the
/// first click of a point changes no figure.
bool has_other_picks(const ApplicationState& state) {
  if (are_same(state.picks, state.measured_picks)) return false;
  return std::ranges::any_of(state.measured_picks,
                             [&](const pipeline::Pick& pick) { return is_stale(state, pick.name); }) ||
         std::ranges::any_of(state.picks, [&](const pipeline::Pick& pick) {
           return is_picked(state.picks, state.views, pick.name) && is_stale(state, pick.name);
         });
}

}  // namespace

bool is_stale(const ApplicationState& state, const std::string& point) {
  return !are_same(picks_named(state.picks, point), picks_named(state.measured_picks, point));
}

bool is_moved(const ApplicationState& state, std::size_t model) {
  return state.nudged && state.nudged->model == model;
}

bool has_old_starts(const ApplicationState& state) {
  return state.at_starts && !state.registration &&
         !(are_same(state.picks, state.registered_picks) &&
           are_same(state.model_landmarks, state.registered_landmarks));
}

QString stale(const ApplicationState& state, Phase phase) {
  if (!state.changed_file.empty())
    return stale_tr("%1 has changed since it was read: F5 measures again")
        .arg(as_text(std::filesystem::path(state.changed_file).filename().string()));
  if (phase == Phase::acquire) return {};
  if (state.has_other_options) return stale_tr("the settings have changed since the measurement");
  if (!state.measured) return {};
  if (phase == Phase::rectify || phase == Phase::calibrate) return {};
  const QString models = stale_models(state);
  if (phase == Phase::registration) return models;
  if (has_other_picks(state) && phase != Phase::navigate)
    return stale_tr("the picks have changed since the measurement");
  const bool has_plan =
      state.registration && std::ranges::any_of(state.registration->models, [](const RegisteredModel& model) {
        return !model.points.empty();
      });
  return phase == Phase::plan && has_plan ? models : QString();
}

QString stale_model(const ApplicationState& state, std::size_t model) {
  if (const QString all = stale(state, Phase::calibrate); !all.isEmpty()) return all;
  const RegisteredModel& registered = state.registration->models[model];
  if (is_moved(state, model))
    return stale_tr("%1 is moved by hand and not registered there")
        .arg(as_text(registered.registration.name));
  if (const auto landmark = landmark_moved_in_model(state, model))
    return stale_tr("landmark %1 has been moved in the model: register the models again")
        .arg(as_text(*landmark));
  if (const auto landmark = moved_landmark(state, registered))
    return stale_tr("landmark %1 has changed: register the models again").arg(as_text(*landmark));
  return {};
}

CaseRegistration present_registration(const ApplicationState& state) {
  CaseRegistration registration = *state.registration;
  for (std::size_t i = 0; i < registration.models.size(); ++i) {
    const QString why = stale_model(state, i);
    if (why.isEmpty()) continue;
    RegisteredModel& model = registration.models[i];
    std::string words = fmt::format("{}: {}", model.registration.name, why.toStdString());
    if (is_moved(state, i))
      words = fmt::format(
          "{}: moved by hand since its registration; register it from there, or set its shifts and turns to "
          "0",
          model.registration.name);
    model.registration.failure = Failure{Reason::plan_stale, std::move(words), {}, {}};
    model.registration.decision = registration::Decision::refuse;
    model.points.clear();
    model.tunnels.clear();
    model.tunnel_ends.clear();
    model.bone_checks.clear();
    model.tunnel_slices.clear();
  }
  return registration;
}

std::shared_ptr<const pipeline::Result> present_result(const ApplicationState& state) {
  if (!state.result) return nullptr;
  if (!stale(state, Phase::calibrate).isEmpty()) {
    auto images = std::make_shared<pipeline::Result>();
    for (const pipeline::ViewResult& view : state.result->views) {
      images->views.emplace_back().name = view.name;
      images->views.back().xray_image = view.xray_image;
    }
    return images;
  }
  if (!has_other_picks(state)) return state.result;
  auto present = std::make_shared<pipeline::Result>(*state.result);
  const auto is_old = [&](std::size_t point) { return is_stale(state, present->points[point].name); };
  for (std::size_t i = present->tunnel_ends.size(); i-- > 0;) {
    const auto [start, end] = present->tunnel_ends[i];
    if (!is_old(start) && !is_old(end)) continue;
    present->tunnel_ends.erase(present->tunnel_ends.begin() + std::ptrdiff_t(i));
    if (i >= present->tunnels.size()) continue;
    std::erase_if(present->verifications,
                  [&](const guidance::Verification& line) { return line.name == present->tunnels[i].name; });
    present->tunnels.erase(present->tunnels.begin() + std::ptrdiff_t(i));
  }
  for (pipeline::PointResult& point : present->points)
    if (point.source == localization::PointSource::pick && is_stale(state, point.name))
      point = {point.name, point.source, point.moves_with, {}, {}, 0, {}};
  return present;
}

namespace {

QString lack_of(const ApplicationState& state, const std::string& point) {
  const QString name = as_text(point);
  for (const FailedPick& failed : state.failed_picks)
    if (failed.pick.name == point) return stale_tr("%1: %2").arg(name, sentence_of(failed.why));
  QStringList views;
  for (const std::string& view : state.views)
    if (pick_of(state, point, view) != nullptr) views << as_text(view);
  if (views.isEmpty()) return stale_tr("%1 is not picked").arg(name);
  if (!is_picked(state.picks, state.views, point))
    return stale_tr("%1 is picked in %2 only").arg(name, views.join(", "));
  if (is_stale(state, point)) return stale_tr("%1 is not measured with its present picks").arg(name);
  const auto found = std::ranges::find(state.result->points, point, &pipeline::PointResult::name);
  if (found == state.result->points.end()) return stale_tr("%1 is not located").arg(name);
  if (found->reason) return stale_tr("%1 is not located: %2").arg(name, sentence_of(*found->reason));
  return {};
}

}  // namespace

QStringList lacks_of_export(const ApplicationState& state) {
  QStringList lacks;
  if (!state.measured) return lacks;
  if (const QString all = stale(state, Phase::calibrate); !all.isEmpty())
    return {stale_tr("%1; nothing is exported until it is measured again (F5)").arg(all)};
  std::vector<std::string> points;
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    for (const std::string& end : ends_to_pick(tunnel)) points.push_back(end);
  points.insert(points.end(), state.landmarks.begin(), state.landmarks.end());
  for (const std::string& point : points)
    if (const QString lack = lack_of(state, point); !lack.isEmpty()) lacks << lack;
  const auto is_located = [](const pipeline::PointResult& point) { return point.place.has_value(); };
  if (!state.cameras.empty() && std::ranges::any_of(state.result->points, is_located))
    lacks << stale_tr("the located points: helicarm locate writes those of given cameras");
  if (state.has_models && !state.registration) lacks << stale_tr("the models are not registered");
  if (awaits_confirmation(state)) lacks << stale_tr("the registration of the models is not confirmed");
  if (state.registration)
    for (const RegisteredModel& model : present_registration(state).models)
      if (model.registration.failure) lacks << sentence_of(*model.registration.failure);
  if (state.result->failure)
    lacks << stale_tr("the measurement is refused, so that the report and result.json are written alone: %1")
                 .arg(sentence_of(*state.result->failure));
  return lacks;
}

bool is_exported(const ApplicationState& state) {
  return state.exported && state.exported->result == state.result &&
         state.exported->registration == state.registration && !state.nudged && !state.has_other_options &&
         state.changed_file.empty() && are_same(state.exported->picks, state.picks);
}

}  // namespace helicarm::gui
