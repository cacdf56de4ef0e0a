// SPDX-License-Identifier: Apache-2.0
// The window's log: what was done and refused, and each step's figures, with the time; to be copied.
#include <QApplication>
#include <QClipboard>
#include <QDockWidget>
#include <QHBoxLayout>
#include <QPushButton>
#include <QTime>

#include "gui/window/main_window.h"

namespace helicarm::gui {

void MainWindow::build_log() {
  log_dock_ = new QDockWidget(tr("Log"), this);
  log_dock_->setObjectName("logDock");
  auto* whole = new QWidget;
  auto* row = new QHBoxLayout(whole);
  log_ = new QPlainTextEdit;
  log_->setObjectName("log");
  log_->setAccessibleName(tr("Log"));
  log_->setReadOnly(true);
  log_->setTabChangesFocus(true);
  log_->setMaximumBlockCount(10000);
  row->addWidget(log_, 1);
  auto* copy = new QPushButton(tr("Cop&y the log"));
  copy->setObjectName("copyLog");
  connect(copy, &QPushButton::clicked, this,
          [this] { QApplication::clipboard()->setText(log_->toPlainText()); });
  row->addWidget(copy, 0, Qt::AlignTop);
  log_dock_->setWidget(whole);
  addDockWidget(Qt::BottomDockWidgetArea, log_dock_);
  log_dock_->hide();
}

void MainWindow::log(const QString& words) {
  log_->appendPlainText(QTime::currentTime().toString("HH:mm:ss  ") + words);
}

void MainWindow::log_steps(const StepCards& before) {
  for (std::size_t i = 0; i < cards_.size(); ++i) {
    const StepCard& now = cards_[i];
    const bool is_same =
        now.status == before[i].status && now.figure == before[i].figure && now.why == before[i].why;
    const bool is_idle = now.status == StepStatus::waiting || now.status == StepStatus::running;
    if (is_same || is_idle || !now.is_offered) continue;
    QStringList words{now.figure, now.all.isEmpty() ? now.why : now.all.join("; ")};
    if (now.status == StepStatus::stale) words.front() = tr("out of date");
    words.removeAll(QString());
    log(QString("%1: %2").arg(now.name, words.join("; ")));
  }
}

}  // namespace helicarm::gui
