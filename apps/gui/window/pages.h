// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QCheckBox>
#include <QComboBox>
#include <QLabel>
#include <QPushButton>

#include "gui/controller/controller.h"
#include "gui/controller/steps.h"
#include "gui/scene/tre_slice.h"
#include "gui/window/drill_target.h"
#include "gui/window/hold_button.h"
#include "gui/window/page_table.h"
#include "gui/xray/layers.h"
#include "helicarm/report/table.h"

namespace helicarm::gui {

/// The actions of each step, one page per step. Pages use the controller and hold no state of their own.
class Page : public QWidget {
  Q_OBJECT

 public:
  Page(const QString& lead, Controller& controller, QWidget* parent);
  virtual void show_state(const ApplicationState& state) = 0;
  /// What the step's card has no room for: why it is out of date or refused, and all its warnings. Not what
  /// the page says itself, nor while new picks are measured: the controls stay where they are.
  void show_card(const StepCard& card, const ApplicationState& state);

 protected:
  /// As high as its texts need at its width: a scroll area does not ask for that.
  bool event(QEvent* event) override;
  QPushButton* add_button(const QString& text, const char* name, std::function<void()> act);
  HoldButton* add_hold(const QString& text, const char* name, std::function<void()> act);
  /// Below the controls, which stay where they are when it is told.
  void tell_why_last();
  PageTable* add_table(const report::Table& content, const char* name);

  Controller& controller_;

 private:
  QLabel* why_;
};

class AcquirePage : public Page {
  Q_OBJECT

 public:
  AcquirePage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;

 signals:
  void rehearsal_wanted();
  void folder_wanted();
  void tour_wanted();
  void new_case_wanted();

 private:
  QWidget* ways_in_;
  QPushButton* new_case_;
  std::vector<std::string> views_;
  QWidget* acquisitions_;
  QLabel *where_, *refused_;
};

/// Results of rectification by view, and the displayed layer of the image.
class RectifyPage : public Page {
  Q_OBJECT

 public:
  RectifyPage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;

 signals:
  void layer_wanted(helicarm::gui::Layer layer);

 private:
  PageTable* table_;
};

class CalibratePage : public Page {
  Q_OBJECT

 public:
  CalibratePage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;

 private:
  PageTable *views_, *balls_;
};

/// Position of the slice through the map of the predicted error.
struct TreCut {
  SliceAxis axis;
  double from_middle_mm;  ///< of the calibrator
};
/// Extent of the map from the calibrator's centre.
inline constexpr double tre_half_mm = 80;

class PlanPage : public Page {
  Q_OBJECT

 public:
  PlanPage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;
  /// The end that the next click places: the next missing one, or the one chosen in the table.
  std::optional<WantedPick> target() const;
  bool snaps() const { return snap_->isChecked(); }
  /// How clicks are taken where no end is chosen in the table.
  bool snaps_new_clicks() const { return snaps_new_; }
  /// Selects a point in the table, if it can be clicked.
  void choose(const QString& point);
  /// Deselects an end chosen in the table once it is placed in every view.
  void placed(const std::string& point);

 signals:
  void map_wanted(std::optional<helicarm::gui::TreCut> cut);
  void target_changed();

 protected:
  bool eventFilter(QObject* watched, QEvent* event) override;

 private:
  void delete_chosen();
  void add_landmark_row();
  void add_map();
  void show_map(const ApplicationState& state);
  void tell_next();
  QString next_words() const;
  void show_snap();
  void show_unsaved(const ApplicationState& state);
  void take_as_clicked();

  QLabel *next_, *of_models_;
  PageTable *ends_, *tunnels_;
  std::size_t clickable_ = 0;  ///< rows of `ends_`, the first ones
  QCheckBox* snap_;
  bool snaps_new_ = true;
  QPushButton* take_;
  QPushButton* offered_;
  QPushButton *delete_, *clear_, *no_tunnels_;
  QWidget* landmark_row_;
  QLabel* unsaved_;
  std::optional<std::string> chosen_;
  std::size_t placed_of_chosen_ = 0;
};

class NavigatePage : public Page {
  Q_OBJECT

 public:
  NavigatePage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;
  void show_live(const LiveState& live);

 private:
  void allow();
  void tell();
  QString next_step() const;
  QString where_the_tool_is() const;
  QString next_by_hand() const;
  QString what_lacks() const;
  void add_drill();
  bool is_held() const;
  /// Nothing without tunnels.
  const operation::OperationTunnel* chosen() const;

  QLabel* says_;
  QComboBox* tunnel_;
  HoldButton *unlock_, *register_, *go_, *withdraw_;
  QPushButton *plan_, *guide_, *verify_, *end_;
  DrillTarget* target_;
  robot::LinkPhase phase_ = robot::LinkPhase::disconnected;
  std::optional<Failure> why_;
  robot::RobotLinkStatus shown_;             ///< as the words say
  std::optional<operation::TunnelAim> aim_;  ///< of the tool, in tenths of a millimetre
};

class VerifyPage : public Page {
  Q_OBJECT

 public:
  VerifyPage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;

 signals:
  void report_wanted();

 private:
  PageTable* table_;
  QLabel *depths_, *lacks_, *exported_;
};

}  // namespace helicarm::gui
