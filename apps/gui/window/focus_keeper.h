// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QPointer>
#include <QWidget>

namespace helicarm::gui {

/// Returns the keyboard focus to a control that lost it because it was disabled or hidden, and not by the
/// user.
class FocusKeeper : public QObject {
  Q_OBJECT

 public:
  explicit FocusKeeper(QWidget* window);

  /// After a change of state: focus of the control that lost it, or, if that is hidden in `pages`, of the
  /// first control of its present page.
  void restore(QWidget* page);

 private:
  QWidget* window_;
  QPointer<QWidget> lost_;
};

}  // namespace helicarm::gui
