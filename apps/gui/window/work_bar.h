// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QProgressBar>
#include <optional>
#include <string>

namespace helicarm::gui {

/// The share of the work in progress that is done, from where one is stated; before, that it goes on.
class WorkBar : public QProgressBar {
  Q_OBJECT

 public:
  explicit WorkBar(QWidget* parent = nullptr);
  /// What is being done, as words of `case_registration::progress_in_words`; nothing: the work has ended.
  void show_work(const std::optional<std::string>& doing);
};

}  // namespace helicarm::gui
