// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QToolButton>
#include <QWidget>
#include <memory>
#include <vector>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {

/// The poses that a refused registration found, to choose from: an image of each, with the model's outline
/// over every view.
class PoseImages : public QWidget {
  Q_OBJECT

 public:
  explicit PoseImages(QWidget* parent = nullptr);

  /// Of this model; hidden unless it is refused and has alternatives.
  void show_model(const std::shared_ptr<const case_registration::CaseRegistration>& registration,
                  std::size_t model);
  /// The displayed one: 0 is the registration's, then its alternatives; nothing: another one.
  void mark(std::optional<std::size_t> pose);

 signals:
  void chosen(std::size_t pose);

 private:
  std::shared_ptr<const case_registration::CaseRegistration> shown_;
  std::size_t model_ = 0;
  std::vector<QToolButton*> buttons_;
};

}  // namespace helicarm::gui
