// SPDX-License-Identifier: Apache-2.0
#include "gui/window/tour.h"

#include <QEvent>
#include <QHBoxLayout>
#include <QVBoxLayout>

#include "gui/window/style.h"

namespace helicarm::gui {

Tour::Tour(QWidget* window)
    : window_(window),
      outline_(new QFrame(window)),
      title_(new QLabel),
      words_(new QLabel),
      back_(new QPushButton(tr("Bac&k"))),
      next_(new QPushButton) {
  setObjectName("tour");
  outline_->setObjectName("tourOutline");
  outline_->setAttribute(Qt::WA_TransparentForMouseEvents);
  outline_->hide();
  title_->setObjectName("tourTitle");
  words_->setObjectName("tourWords");
  words_->setWordWrap(true);
  back_->setObjectName("tourBack");
  next_->setObjectName("tourNext");
  auto* end = new QPushButton(tr("End the tou&r"));
  end->setObjectName("tourEnd");
  auto* row = new QHBoxLayout(this);
  auto* text = new QVBoxLayout;
  text->addWidget(title_);
  text->addWidget(words_, 1);
  row->addLayout(text, 1);
  for (QPushButton* button : {back_, next_, end}) row->addWidget(button, 0, Qt::AlignTop);
  connect(back_, &QPushButton::clicked, this, [this] { go_to(step_ - 1); });
  connect(next_, &QPushButton::clicked, this, [this] { go_to(step_ + 1); });
  connect(end, &QPushButton::clicked, this, &Tour::end);
  window_->installEventFilter(this);
}

void Tour::begin(std::vector<TourStep> steps) {
  steps_ = std::move(steps);
  outline_->setStyleSheet(QString("QFrame#tourOutline { border: 3px solid %1; background: transparent; }")
                              .arg(style::colours().amber.name()));
  go_to(0);
}

void Tour::end() {
  if (!is_running()) return;
  step_ = steps_.size();
  outline_->hide();
  emit ended();
}

void Tour::go_to(std::size_t step) {
  if (step >= steps_.size()) return end();
  step_ = step;
  const TourStep& now = steps_[step];
  title_->setText(QString("<b>%1 / %2  %3</b>").arg(step + 1).arg(steps_.size()).arg(now.title));
  words_->setText(now.words);
  back_->setEnabled(step > 0);
  next_->setText(step + 1 == steps_.size() ? tr("Ne&xt: close") : tr("Ne&xt"));
  emit phase_wanted(now.phase);
  place_outline();
}

void Tour::place_outline() {
  if (!is_running()) return;
  const QWidget* about = steps_[step_].about;
  outline_->setGeometry(QRect(about->mapTo(window_, QPoint()), about->size()));
  outline_->show();
  outline_->raise();
}

bool Tour::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() == QEvent::Resize || event->type() == QEvent::LayoutRequest)
    QMetaObject::invokeMethod(this, &Tour::place_outline, Qt::QueuedConnection);
  return QWidget::eventFilter(watched, event);
}

}  // namespace helicarm::gui
