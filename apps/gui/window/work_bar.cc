// SPDX-License-Identifier: Apache-2.0
#include "gui/window/work_bar.h"

#include <algorithm>
#include <cmath>

#include "helicarm/case_registration/progress.h"

namespace helicarm::gui {

WorkBar::WorkBar(QWidget* parent) : QProgressBar(parent) {
  setObjectName("work");
  setAccessibleName(tr("Share of the work that is done"));
  setRange(0, 0);
}

void WorkBar::show_work(const std::optional<std::string>& doing) {
  if (!doing) return setRange(0, 0);
  const auto share = case_registration::share_in(*doing);
  if (!share) return;  // a step of the same work
  const int percent = int(std::lround(100 * *share));
  const int before = maximum() > 0 ? value() : 0;
  setRange(0, 100);
  setValue(std::max(before, percent));
}

}  // namespace helicarm::gui
