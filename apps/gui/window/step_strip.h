// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QToolButton>
#include <QWidget>

#include "gui/controller/steps.h"

namespace helicarm::gui {

/// What the figure of a step's card is, with its unit.
QString definition_of(Phase phase);

/// One card of the strip: name, status (by colour, sign and word), number and reason.
class StepButton : public QToolButton {
  Q_OBJECT

 public:
  StepButton(Phase phase, QWidget* parent);
  void show_card(const StepCard& card);
  const StepCard& card() const { return card_; }
  /// The card's figure and reason as drawn, in lines. The reason may be elided: the step's page states it.
  struct Words {
    QStringList figure, why;
  };
  Words words() const;

 protected:
  void paintEvent(QPaintEvent* event) override;
  QSize sizeHint() const override;
  QSize minimumSizeHint() const override;

 private:
  StepCard card_;
};

/// The steps; a click, or Alt+1 to 7, opens one.
class StepStrip : public QWidget {
  Q_OBJECT

 public:
  explicit StepStrip(QWidget* parent = nullptr);
  void show_steps(const StepCards& cards);
  void choose(Phase phase);
  StepButton* button(Phase phase) const { return buttons_[std::size_t(phase)]; }

 signals:
  void chosen(helicarm::gui::Phase phase);

 private:
  std::array<StepButton*, phases.size()> buttons_;
};

}  // namespace helicarm::gui
