// SPDX-License-Identifier: Apache-2.0
#include "gui/window/registration_reasons.h"

#include <QCoreApplication>
#include <QStringList>
#include <algorithm>
#include <vector>

#include "gui/controller/model_landmarks.h"
#include "gui/controller/steps.h"
#include "gui/xray/text.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/registration/landmarks.h"

namespace helicarm::gui {
namespace {

using case_registration::RegisteredModel;

QString reason_tr(const char* words) { return QCoreApplication::translate("Reasons", words); }

/// Whether its search begins somewhere where it is not placed by hand.
bool has_start(const ApplicationState& state, std::size_t model) {
  if (model >= state.models.size()) return false;
  return state.models[model].world_from_model || state.models[model].landmarks ||
         count_usable(of_model(state.model_landmarks, model), state.picks) >= registration::least_landmarks;
}

/// Of a model that is refused from a pose set by hand; empty of others.
QString without_placing(const ApplicationState& state, std::size_t model) {
  const registration::Registration& found = state.registration->models[model].registration;
  const bool is_by_hand = std::ranges::find(state.starts_by_hand, found.name,
                                            &operation::ModelStart::model) != state.starts_by_hand.end();
  if (!is_by_hand || !found.failure) return {};
  return (has_start(state, model)
              ? reason_tr("%1 was searched for from the pose set by hand. \"Register models\" forgets that "
                          "pose and begins at the start that is stated.")
              : reason_tr("%1 was searched for from the pose set by hand. \"Register models\" forgets that "
                          "pose and searches everywhere, in every orientation."))
      .arg(text(found.name));
}

}  // namespace

QString reasons_of(const ApplicationState& state) {
  QStringList lines;
  bool is_doubtful = false;
  for (std::size_t i = 0; i < state.registration->models.size(); ++i) {
    const RegisteredModel& model = state.registration->models[i];
    const registration::Registration& found = model.registration;
    std::vector<double> errors_mm;
    for (const case_registration::RegisteredPoint& point : model.points)
      errors_mm.push_back(localization::length_at_95(point.place.covariance_in_calibrator));
    QString line = QString("%1: %2").arg(text(found.name), text(registration::word(found.decision)));
    if (!found.failure && !model.points.empty())
      line += reason_tr(", its plan's points: %1").arg(largest_error_words(errors_mm));
    lines << line;
    is_doubtful = is_doubtful || found.decision != registration::Decision::accept;
    if (found.failure) lines << sentence_of(*found.failure);
    for (const auto* list : {&found.warnings, &found.notes})
      for (const Warning& each : *list) lines << sentence_of(each);
    if (const QString words = without_placing(state, i); !words.isEmpty()) lines << words;
  }
  if (is_doubtful)
    lines << reason_tr(
        "What would help: move the model by hand until its outline follows the bone, then register from "
        "here; pick landmarks of it; add a view from another side.");
  return lines.join("\n");
}

}  // namespace helicarm::gui
