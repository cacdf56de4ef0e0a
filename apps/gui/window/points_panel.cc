// SPDX-License-Identifier: Apache-2.0
#include "gui/window/points_panel.h"

#include <QHeaderView>
#include <QSignalBlocker>
#include <algorithm>

#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/window/style.h"
#include "gui/xray/text.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::gui {
namespace {

constexpr int before_views = 2;  // columns

std::vector<std::string> points_of(const ApplicationState& state) {
  std::vector<std::string> points;
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    for (const std::string& end : ends_to_pick(tunnel)) points.push_back(end);
  points.insert(points.end(), state.landmarks.begin(), state.landmarks.end());
  return points;
}

const pipeline::PointResult* located(const ApplicationState& state, const std::string& point) {
  if (!state.result || is_stale(state, point) || !stale(state, Phase::calibrate).isEmpty()) return nullptr;
  const auto found = std::ranges::find(state.result->points, point, &pipeline::PointResult::name);
  return found != state.result->points.end() && found->place ? &*found : nullptr;
}

QString words_of(const PointInView& seen) {
  const QString at = QString("%1, %2").arg(seen.raw.x(), 0, 'f', 1).arg(seen.raw.y(), 0, 'f', 1);
  switch (seen.state) {
    case PointInView::State::none:
      return "–";
    case PointInView::State::failed:
      return PointsPanel::tr("%1: no pick").arg(at);
    case PointInView::State::out_of_date:
      return PointsPanel::tr("%1, not measured").arg(at);
    case PointInView::State::picked:
      return at;
    case PointInView::State::located:
      break;
  }
  return PointsPanel::tr("%1; %2 px").arg(at).arg(*seen.residual_px, 0, 'f', 2);
}

}  // namespace

std::vector<PointInView> point_in_views(const ApplicationState& state, const std::string& point) {
  std::vector<PointInView> in_views(state.views.size());
  const pipeline::PointResult* found = located(state, point);
  for (std::size_t i = 0; i < in_views.size(); ++i) {
    const pipeline::Pick* pick = pick_of(state, point, state.views[i]);
    if (pick == nullptr) continue;
    PointInView& seen = in_views[i];
    seen.raw = pick->uv_raw;
    if (const Failure* failed = failure_of(state, point, state.views[i])) {
      seen.state = PointInView::State::failed;
      seen.why_failed = sentence_of(*failed);
      continue;
    }
    const bool is_complete = is_picked(state.picks, state.views, point);
    const bool is_new = is_complete && is_stale(state, point);
    seen.state = is_new ? PointInView::State::out_of_date : PointInView::State::picked;
    if (found == nullptr || i >= found->seen.size() || !found->seen[i]) continue;
    const auto& calibrated = state.result->views[i].calibrated;
    if (!calibrated) continue;
    seen.state = PointInView::State::located;
    seen.raw = found->seen[i]->uv_raw;  // where a snapped click found the ball
    seen.residual_px = (calibrated->view.project(found->place->in_calibrator) - found->seen[i]->uv).norm();
  }
  return in_views;
}

PointsPanel::PointsPanel(QWidget* parent) : QTableWidget(parent) {
  setObjectName("pointTable");
  setAccessibleName(tr("Points by views"));
  setEditTriggers(QAbstractItemView::NoEditTriggers);
  setTabKeyNavigation(false);
  verticalHeader()->hide();
  horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  connect(this, &QTableWidget::cellClicked, this, &PointsPanel::choose);
  connect(this, &QTableWidget::cellActivated, this, &PointsPanel::choose);
}

void PointsPanel::choose(int row, int column) {
  if (column >= before_views) emit wanted(item(row, 0)->text(), std::size_t(column - before_views));
}

void PointsPanel::show_state(const ApplicationState& state) {
  const QSignalBlocker quiet(this);
  const std::vector<std::string> points = points_of(state);
  QStringList titles{tr("Point"), tr("±95 %, mm")};
  for (std::size_t i = 0; i < state.views.size(); ++i) {
    const bool is_frame = i < state.files.size() && state.files[i].frames > 1;
    titles << (is_frame ? tr("%1, frame %2").arg(text(state.views[i])).arg(state.files[i].frame)
                        : text(state.views[i]));
  }
  setColumnCount(int(titles.size()));
  setHorizontalHeaderLabels(titles);
  for (int column = 0; column < columnCount(); ++column)
    horizontalHeaderItem(column)->setToolTip(
        column == 0 ? tr("Name of the point that is to be picked")
        : column == 1
            ? tr("95 % of the errors of the located point are smaller, mm")
            : tr("Raw pixel of the pick in this view, and the distance of the located point's image "
                 "from it in rectified px"));
  setRowCount(int(points.size()));
  for (int row = 0; row < rowCount(); ++row) {
    const std::string& point = points[std::size_t(row)];
    const pipeline::PointResult* found = located(state, point);
    const auto put = [&](int column, const QString& words, const QString& tip = {}, bool is_bad = false) {
      auto* cell = new QTableWidgetItem(words);
      cell->setToolTip(tip);
      if (is_bad) cell->setForeground(style::colours().red);
      setItem(row, column, cell);
    };
    put(0, text(point));
    put(1, found ? fixed(localization::length_at_95(found->place->covariance_in_calibrator), 2) : "–");
    const std::vector<PointInView> seen = point_in_views(state, point);
    for (std::size_t i = 0; i < seen.size(); ++i)
      put(before_views + int(i), words_of(seen[i]), seen[i].why_failed,
          seen[i].state == PointInView::State::failed);
  }
}

}  // namespace helicarm::gui
