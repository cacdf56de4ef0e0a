// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QFrame>
#include <QLabel>
#include <QPointer>
#include <QPushButton>
#include <vector>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// What the tour shows at one step.
struct TourStep {
  Phase phase;
  QWidget* about;  ///< is outlined
  QString title, words;
};

/// A walk through the window in steps: a sentence or two about the part that is outlined.
class Tour : public QWidget {
  Q_OBJECT

 public:
  explicit Tour(QWidget* window);

  void begin(std::vector<TourStep> steps);
  void end();
  bool is_running() const { return step_ < steps_.size(); }
  std::size_t step() const { return step_; }
  const QFrame& outline() const { return *outline_; }

 signals:
  void phase_wanted(helicarm::gui::Phase phase);
  void ended();

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void go_to(std::size_t step);
  void place_outline();

  QWidget* window_;
  QFrame* outline_;
  QLabel *title_, *words_;
  QPushButton *back_, *next_;
  std::vector<TourStep> steps_;
  std::size_t step_ = 0;
};

}  // namespace helicarm::gui
