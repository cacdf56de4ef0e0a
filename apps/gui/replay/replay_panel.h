// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QElapsedTimer>
#include <QTimer>
#include <QWidget>
#include <filesystem>
#include <optional>
#include <thread>

#include "gui/replay/timeline.h"
#include "helicarm/operation/replay.h"

class QComboBox;
class QLabel;
class QListWidget;
class QPlainTextEdit;
class QProgressBar;
class QPushButton;
class QSlider;

namespace helicarm::gui {

/// What a recomputation found, in sentences.
QString verdict_of(const Expected<operation::ReplayReport>& report);

/// Steps through an operation's record: J and comma back, L and period forward, K plays and pauses. The space
/// bar stays reserved for stopping the robot.
class ReplayPanel : public QWidget {
  Q_OBJECT

 public:
  explicit ReplayPanel(QWidget* parent = nullptr);
  /// Stops a running verification, which may take as long as one measurement.
  ~ReplayPanel() override = default;

  /// Shows a session's record from its first moment. Refuses as `read_timeline`; the previous one then stays.
  Expected<void> open(const std::filesystem::path& session);

  const std::optional<Timeline>& timeline() const { return timeline_; }
  int moment() const { return moment_; }
  /// Of the operation after that moment. Refuses as `state_at`, and (usage) while no session is open.
  const Expected<SessionState>& state() const { return state_; }
  bool is_playing() const { return clock_.isActive(); }
  QString verdict() const;

 public Q_SLOTS:  // NOLINT(readability-redundant-access-specifiers): for moc
  void set_moment(int index);
  void step(int by);
  void set_playing(bool playing);
  /// Recomputes the operation in the background; `verified` signals the end.
  void verify();

 Q_SIGNALS:
  void moment_changed(int index);
  /// Whether all values were reproduced bit for bit.
  void verified(bool same);

 private:
  void build();
  void bind_keys();
  void advance();
  void show_moment(int index);
  void show_verdict(const Expected<operation::ReplayReport>& report);

  std::optional<Timeline> timeline_;
  int moment_ = -1;
  Expected<SessionState> state_ = fail(Reason::usage, "no session is open");
  QTimer clock_;
  QElapsedTimer since_;
  double seconds_ = 0;
  QLabel* about_;
  QListWidget* list_;
  QPlainTextEdit* detail_;
  QSlider* slider_;
  QLabel* time_;
  QPushButton *back_, *play_, *forward_, *verify_;
  QComboBox* speed_;
  QProgressBar* progress_;
  QLabel* verdict_;
  std::jthread worker_;  ///< last: ends before the members that it notifies
};

}  // namespace helicarm::gui
