// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <utility>

#include "gui/window/pages.h"
#include "gui/window/pose_box.h"
#include "gui/window/pose_images.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {

/// Registration of the case's models: decisions and figures, and moving a model by hand to start from there.
class RegisterPage : public Page {
  Q_OBJECT

 public:
  RegisterPage(Controller& controller, QWidget* parent);
  void show_state(const ApplicationState& state) override;
  /// The chosen model, where it can be moved by hand.
  std::optional<std::size_t> movable() const;

 signals:
  /// Another model is chosen, or none can be moved.
  void held_changed();
  /// Of the CT of a model.
  void slices_wanted(std::size_t model);
  void landmarks_wanted(std::size_t model);

 protected:
  void resizeEvent(QResizeEvent* event) override;

 private:
  void add_hand();
  void show_slices();
  /// The one chosen, before a registration in the table; else the first.
  std::size_t chosen_model() const;
  void allow_landmarks(const ApplicationState& state);
  /// The field's part of the chosen model's step from its registered pose or its start.
  void nudge(std::size_t field, double value);
  /// Ends the move of another model: before the first registration it stays, after it it returns.
  void choose();
  /// To one of the chosen model's pose images.
  void move_to(std::size_t pose);
  void show_pose_images(const ApplicationState& state);
  void list_models(const ApplicationState& state);
  void show_hand(const ApplicationState& state);
  QString words_of(const ApplicationState& state) const;

  QPushButton *register_, *from_here_, *place_, *ct_, *in_model_, *confirm_;
  QLabel* says_;
  PageTable *models_, *tunnels_, *points_, *measures_;
  QLabel* slices_;  ///< of the selected tunnel, or the first
  std::vector<case_registration::RegisteredModel> listed_;
  std::pair<int, int> drawn_{-1, 0};  ///< row, and width of the page, of the slices that are shown
  PoseImages* pose_images_;
  QWidget* hand_;
  QComboBox* model_;
  std::array<PoseBox*, 6> by_{};  ///< mm, then degrees
  std::shared_ptr<const case_registration::CaseRegistration> shown_;
};

}  // namespace helicarm::gui
