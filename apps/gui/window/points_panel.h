// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QTableWidget>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// A point in a view: its click, raw px, with the residual of the located point, px; or why it is none.
struct PointInView {
  enum class State { none, picked, failed, out_of_date, located };
  State state = State::none;
  Eigen::Vector2d raw = Eigen::Vector2d::Zero();
  std::optional<double> residual_px = {};  ///< rectified; of a located point
  QString why_failed = {};
};

/// `point` in each view of the state.
std::vector<PointInView> point_in_views(const ApplicationState& state, const std::string& point);

/// The points to pick by the views, or frames, in which they are picked.
class PointsPanel : public QTableWidget {
  Q_OBJECT

 public:
  explicit PointsPanel(QWidget* parent = nullptr);
  void show_state(const ApplicationState& state);

 signals:
  /// A cell is chosen: this point in this view.
  void wanted(const QString& point, std::size_t view);

 private:
  void choose(int row, int column);
};

}  // namespace helicarm::gui
