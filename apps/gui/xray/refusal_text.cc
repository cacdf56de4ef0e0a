// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/refusal_text.h"

#include <QObject>
#include <QStringList>
#include <algorithm>

#include "gui/xray/text.h"
#include "helicarm/pipeline/diagnosis/advice.h"

namespace helicarm::gui {
namespace {

QString details_of(const pipeline::Result& result) {
  QStringList lines;
  const pipeline::Advice advice = pipeline::advice_for(result);
  if (!advice.causes.empty()) lines << QObject::tr("Likely causes, in order:");
  for (std::size_t i = 0; i < advice.causes.size(); ++i)
    lines << QString("%1. %2").arg(i + 1).arg(text(advice.causes[i]));
  if (!advice.next.empty()) lines << QObject::tr("Next: %1.").arg(text(advice.next));
  QStringList figures;
  for (const auto& [name, value] : result.failure->figures)
    figures << QString("%1 = %2").arg(text(name)).arg(value, 0, 'g', 6);
  if (!figures.isEmpty()) lines << QObject::tr("Figures: %1").arg(figures.join(", "));
  return lines.join('\n');
}

}  // namespace

std::optional<RefusalText> refusal_of(const pipeline::Result& result, std::size_t view) {
  if (!result.failure) return std::nullopt;
  const Failure& failure = *result.failure;
  const auto concerned = std::ranges::find(result.views, failure.view, &pipeline::ViewResult::name);
  const auto shown_in = concerned == result.views.end() ? 0 : std::size_t(concerned - result.views.begin());
  if (view != shown_in) return std::nullopt;
  return RefusalText{QObject::tr("Refused: %1 (%2)").arg(text(failure.message), text(code(failure.reason))),
                     details_of(result)};
}

}  // namespace helicarm::gui
