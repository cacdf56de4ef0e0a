// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/steps.h"

#include <QCoreApplication>
#include <algorithm>
#include <cmath>

#include "gui/controller/controller.h"
#include "gui/controller/stale.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::gui {
namespace {

QString tr(const char* text) { return QCoreApplication::translate("Steps", text); }

QString text(const std::string& words) { return QString::fromStdString(words); }

/// Warnings of the result for this phase, of this view or of all.
QString doubts(const std::vector<Warning>& warnings) {
  if (warnings.empty()) return {};
  const QString first = sentence_of(warnings.front());
  return warnings.size() == 1 ? first : tr("%1 (and %2 more)").arg(first).arg(warnings.size() - 1);
}

std::vector<Warning> warnings_of(const ApplicationState& state, Phase phase) {
  std::vector<Warning> of_it;
  for (const pipeline::Finding& warning : state.result->warnings)
    if (phase_of(warning.stage) == phase) of_it.push_back(warning);
  return of_it;
}

void settle(StepCard& card, const QString& warning, const std::vector<Warning>& all = {}) {
  if (all.size() > 1)
    for (const Warning& each : all) card.all << sentence_of(each);
  card.status = warning.isEmpty() ? StepStatus::good : StepStatus::warning;
  card.why = warning;
}

void doubt(StepCard& card, const std::vector<Warning>& warnings) { settle(card, doubts(warnings), warnings); }

void acquire(StepCard& card, const ApplicationState& state) {
  const auto& views = state.result->views;
  const auto come = std::ranges::count_if(
      views, [](const pipeline::ViewResult& view) { return view.xray_image != nullptr; });
  if (state.source == Source::images) {
    card.figure = come == 1 ? tr("1 X-ray image") : tr("%1 X-ray images").arg(come);
    return settle(card, {});
  }
  card.figure = tr("%1 of %2 X-ray images").arg(come).arg(state.views.size());
  if (come == std::ssize(state.views)) return doubt(card, warnings_of(state, Phase::acquire));
  card.why = tr("%1 is next").arg(text(state.next_view));
}

void rectify(StepCard& card, const ApplicationState& state) {
  double worst = 0;
  bool bent = false;
  for (const pipeline::ViewResult& view : state.result->views) {
    if (!view.rectification) return;
    const rectification::Rectification& done = *view.rectification;
    bent = bent || !done.map.is_identity();
    worst = std::max(worst, done.map.residual_rms_px);
  }
  card.figure = bent                    ? tr("residual %1 px rms").arg(worst, 0, 'f', 3)
                : state.cameras.empty() ? tr("flat panel")
                                        : tr("taken as undistorted");
  doubt(card, warnings_of(state, Phase::rectify));
}

void calibrate(StepCard& card, const ApplicationState& state) {
  if (!state.cameras.empty() && state.measured) {
    card.figure = tr("cameras given");
    return doubt(card, warnings_of(state, Phase::calibrate));
  }
  int used = 0;
  std::size_t balls = 0;
  for (const pipeline::ViewResult& view : state.result->views) {
    if (!view.calibrated || !view.found) return;
    used += static_cast<int>(std::ranges::count(view.found->fiducials, fiducials::FiducialStatus::used,
                                                &fiducials::Fiducial::status));
    balls += view.found->fiducials.size();
  }
  card.figure =
      tr("FRE %1 mm, %2/%3").arg(state.result->accuracy.fre_mm.mean, 0, 'f', 3).arg(used).arg(balls);
  doubt(card, warnings_of(state, Phase::calibrate));
}

void plan(StepCard& card, const ApplicationState& state) {
  auto wanted = next_pick(state);
  if (!wanted) wanted = next_landmark(state);
  if (wanted && wanted->failed) {
    card.status = StepStatus::warning;
    card.figure = tr("failed pick %1").arg(text(wanted->point));
    card.why = sentence_of(*wanted->failed);
    return;
  }
  if (wanted) {
    card.why = tr("click %1 in %2").arg(text(wanted->point), text(wanted->view));
    return;
  }
  std::vector<double> errors_mm;
  if (state.registration)
    for (const case_registration::RegisteredModel& model : state.registration->models)
      if (!model.registration.failure)
        for (const case_registration::RegisteredPoint& point : model.points)
          errors_mm.push_back(localization::length_at_95(point.place.covariance_in_calibrator));
  for (const pipeline::PointResult& point : state.result->points) {
    if (point.source != localization::PointSource::pick) continue;
    if (point.reason) {
      card.status = StepStatus::refused;
      card.why = text(point.name + ": ") + sentence_of(*point.reason);
      return;
    }
    if (point.place) errors_mm.push_back(localization::length_at_95(point.place->covariance_in_calibrator));
  }
  if (errors_mm.empty()) {
    card.why = !state.picks.empty()                      ? tr("not measured yet")
               : state.has_models && !state.registration ? state.is_replayed
                                                               ? tr("no model is registered at this moment")
                                                               : tr("register the models (Alt+7)")
                                                         : tr("add a landmark to locate a point");
    return;
  }
  card.figure = largest_error_words(errors_mm);
  doubt(card, warnings_of(state, Phase::plan));
  if (state.failed_picks.empty()) return;
  card.status = StepStatus::warning;
  card.why = tr("%1: %2").arg(text(state.failed_picks.front().pick.name),
                              sentence_of(state.failed_picks.front().why));
}

void navigate(StepCard& card, const ApplicationState& state) {
  if (state.source == Source::files && !state.hand_eye_rms_mm && !state.drill) {  // neither, of a replay
    card.why =
        state.is_replayed ? tr("no robot is registered at this moment") : tr("images from files: no robot");
    return;
  }
  if (state.drill) {
    card.why = !state.is_replayed ? tr("guide the drill to a tunnel")
               : state.is_guided  ? tr("the drill is guided at this moment")
                                  : tr("no drill is guided at this moment");
  } else if (!state.hand_eye_rms_mm) {
    card.why = tr("unlock the robot, then register it");
    return;
  } else {
    card.figure = tr("registered, %1 mm rms").arg(*state.hand_eye_rms_mm, 0, 'f', 2);
  }
  if (state.order) card.why = tr("%1: inspect the path, then confirm").arg(text(state.order->name));
  if (state.outcomes.empty()) return;
  double worst = 0;
  for (const auto& [name, outcome] : state.outcomes)
    worst = std::max(worst, outcome.loop.empty()
                                ? std::max(outcome.start.distance_mm(), outcome.end.distance_mm())
                                : outcome.loop.back().distance_mm);
  card.figure = tr("%1 of %2 tunnels, %3 mm")
                    .arg(state.outcomes.size())
                    .arg(state.tunnels.size())
                    .arg(worst, 0, 'f', 2);
  if (state.outcomes.size() == state.tunnels.size()) settle(card, {});
}

void warn_off_plan(StepCard& card, double distance_mm) {
  if (distance_mm <= guidance::most_off_plan_mm) return;
  card.status = StepStatus::warning;
  card.why = tr("more than %1 mm off the plan").arg(guidance::most_off_plan_mm);
}

/// Tunnels of which the case states the tool's line and the result gives no distance.
QStringList not_verified(const ApplicationState& state) {
  QStringList lacking;
  for (const std::string& tunnel : state.tool_lines)
    if (std::ranges::find(state.result->verifications, tunnel, &guidance::Verification::name) ==
        state.result->verifications.end())
      lacking << text(tunnel);
  return lacking;
}

/// The tool lines of a case, compared with their tunnels in the images alone.
void verify_images(StepCard& card, const ApplicationState& state) {
  const pipeline::Result& result = *state.result;
  double worst = 0;
  int ends = 0;
  for (const guidance::Verification& line : result.verifications)
    for (const auto& end : {line.start, line.end})
      if (end) {
        worst = std::max(worst, end->distance_mm);
        ++ends;
      }
  if (ends == 0) return;
  const int all = 2 * int(result.verifications.size());
  card.figure = ends == all ? tr("%1 mm, %2 ends").arg(worst, 0, 'f', 2).arg(ends)
                            : tr("%1 mm, %2 of %3 ends").arg(worst, 0, 'f', 2).arg(ends).arg(all);
  settle(card, {});
  if (ends < all) {
    card.status = StepStatus::warning;
    card.why = tr("an end is not located");
  }
  if (const QStringList lacking = not_verified(state); !lacking.isEmpty()) {
    card.status = StepStatus::warning;
    card.why = tr("%1: not compared, its ends are not located").arg(lacking.join(", "));
  }
  warn_off_plan(card, worst);
}

void verify(StepCard& card, const ApplicationState& state) {
  if (state.outcomes.empty()) {
    if (state.is_replayed) return;
    verify_images(card, state);
    if (card.status != StepStatus::waiting) return;
    if (!is_exported(state)) {
      if (state.source != Source::files && !state.exported) return;
      card.why = state.exported ? tr("changed since the export") : tr("export the results (Ctrl+E)");
      return;
    }
    card.figure = tr("exported at %1").arg(state.exported->at);
    settle(card, state.exported->lacks.isEmpty() ? QString()
                                                 : tr("without: %1").arg(state.exported->lacks.join("; ")));
    if (card.why.isEmpty()) card.why = text(state.exported->folder.string());
    return;
  }
  double worst = 0, expected = 0;
  for (const auto& [name, outcome] : state.outcomes)
    for (const operation::EndMiss& end : {outcome.start, outcome.end})
      if (end.distance_mm() >= worst) worst = end.distance_mm(), expected = end.predicted_mm();
  card.figure = tr("%1 mm (predicted %2)").arg(worst, 0, 'f', 2).arg(expected, 0, 'f', 2);
  if (state.outcomes.size() == state.tunnels.size()) settle(card, {});
  warn_off_plan(card, worst);
  for (const auto& [name, outcome] : state.outcomes)
    if (const auto depth = outcome.depth())
      if (const auto off = depth->why_off(name)) {
        card.status = StepStatus::warning;
        card.why = sentence_of(*off);
      }
}

void registered(StepCard& card, const ApplicationState& state) {
  if (!state.registration) {
    card.why = state.is_replayed          ? tr("no model is registered at this moment")
               : has_poses_by_hand(state) ? tr("register the moved model from here")
                                          : tr("register the models");
    return;
  }
  std::vector<double> errors_mm;
  std::vector<Warning> warnings;
  for (const case_registration::RegisteredModel& model : state.registration->models) {
    const registration::Registration& found = model.registration;
    if (found.failure) {
      card.status = StepStatus::refused;
      card.why = sentence_of(*found.failure);
      return;
    }
    if (model.points.empty())
      errors_mm.push_back(localization::length_at_95(found.covariance.bottomRightCorner<3, 3>()));
    for (const case_registration::RegisteredPoint& point : model.points)
      errors_mm.push_back(localization::length_at_95(point.place.covariance_in_calibrator));
    warnings.insert(warnings.end(), found.warnings.begin(), found.warnings.end());
  }
  card.figure = largest_error_words(errors_mm);
  doubt(card, warnings);
  if (!awaits_confirmation(state)) return;
  card.status = StepStatus::waiting;
  card.why = tr("compare the outlines with the bones, then confirm");
}

}  // namespace

Phase phase_of(pipeline::Stage stage) {
  switch (stage) {
    case pipeline::Stage::read:
      return Phase::acquire;
    case pipeline::Stage::rectify:
      return Phase::rectify;
    case pipeline::Stage::label:
    case pipeline::Stage::calibrate:
      return Phase::calibrate;
    case pipeline::Stage::locate:
      return Phase::plan;
    case pipeline::Stage::registration:
      return Phase::registration;
  }
  return Phase::acquire;
}

QString largest_error_words(const std::vector<double>& errors_95_mm) {
  double largest = 0;
  bool all_known = true;
  for (const double error : errors_95_mm) {
    all_known = all_known && std::isfinite(error);
    if (std::isfinite(error)) largest = std::max(largest, error);
  }
  if (largest <= 0) return tr("errors not known");
  return (all_known ? tr("within %1 mm (95 %)") : tr("within %1 mm (95 %), others not known"))
      .arg(largest, 0, 'f', 2);
}

QString sentence_of(const Failure& failure) {
  QString view = text(failure.view);
  if (!view.isEmpty()) view += ": ";
  const auto code_of = code(failure.reason);
  return QString("%1%2 (%3)")
      .arg(view, text(failure.message),
           QString::fromUtf8(code_of.data(), static_cast<qsizetype>(code_of.size())));
}

bool is_cancelled(Phase phase, const Failure& refusal) {
  return refusal.reason == Reason::interrupted && phase != Phase::navigate;
}

StepCards steps_of(const ApplicationState& state) {
  StepCards cards;
  const std::array names{tr("Acquire"),  tr("Rectify"), tr("Calibrate"), tr("Plan"),
                         tr("Navigate"), tr("Verify"),  tr("Register")};
  using Judge = void (*)(StepCard&, const ApplicationState&);
  constexpr std::array<Judge, phases.size()> judges{acquire,  rectify, calibrate, plan,
                                                    navigate, verify,  registered};
  for (std::size_t i = 0; i < cards.size(); ++i) {
    StepCard& card = cards[i];
    card.phase = phases[i];
    card.name = names[i];
    card.is_offered = card.phase != Phase::registration || state.has_models;
    const bool possible = i < 3 || state.measured;
    if (state.result && possible) judges[i](card, state);
    if (state.source == Source::images && i > 0) card.why = tr("needs a case");
    const QString changed = state.result && possible ? stale(state, card.phase) : QString();
    card.out_of_date = changed;
    if (!changed.isEmpty() && (card.status != StepStatus::waiting || state.refusals.contains(card.phase))) {
      card.status = StepStatus::stale;
      card.figure.clear();
      card.why = changed;
    }
    if (const auto refusal = state.refusals.find(card.phase); refusal != state.refusals.end()) {
      if (is_cancelled(card.phase, refusal->second)) {
        if (card.status == StepStatus::waiting) card.why = tr("cancelled");
      } else if (changed.isEmpty()) {
        card.status = StepStatus::refused;
        card.why = sentence_of(refusal->second);
      }
    }
    if (state.busy == card.phase) {
      card.status = StepStatus::running;
      card.why = text(state.doing);
    }
  }
  return cards;
}

StepCards with_devices(StepCards cards, const ApplicationState& state, const LiveState& live) {
  const auto warn = [&](Phase phase, const StatusIndicator& of) {
    StepCard& card = cards[std::size_t(phase)];
    if (card.status == StepStatus::refused || card.status == StepStatus::running) return;
    card.status = StepStatus::warning;
    card.why = QString("%1: %2").arg(of.name, of.why);
  };
  for (const StatusIndicator& indicator : live.indicators) {
    if (indicator.light != Light::red) continue;
    if (indicator.kind == StatusIndicator::Kind::c_arm)
      warn(Phase::acquire, indicator);
    else if (indicator.kind == StatusIndicator::Kind::marker && !state.measured)
      warn(Phase::acquire, indicator);
    else if (state.measured)
      warn(Phase::navigate, indicator);
  }
  return cards;
}

}  // namespace helicarm::gui
