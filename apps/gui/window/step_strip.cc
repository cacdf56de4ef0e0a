// SPDX-License-Identifier: Apache-2.0
#include "gui/window/step_strip.h"

#include <QButtonGroup>
#include <QHBoxLayout>
#include <QPainter>
#include <QPainterPath>

#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

struct Appearance {
  QColor colour;
  QString sign;  ///< for colour-blind users
  QString word;
};

Appearance appearance_of(StepStatus status) {
  switch (status) {
    case StepStatus::waiting:
      return {style::quiet, QStringLiteral("○"), StepStrip::tr("waiting")};
    case StepStatus::running:
      return {style::blue, QStringLiteral("◐"), StepStrip::tr("working")};
    case StepStatus::good:
      return {style::green, QStringLiteral("✓"), StepStrip::tr("good")};
    case StepStatus::warning:
      return {style::amber, QStringLiteral("!"), StepStrip::tr("warning")};
    case StepStatus::refused:
      return {style::red, QStringLiteral("✕"), StepStrip::tr("refused")};
  }
  return {};
}

}  // namespace

StepButton::StepButton(Phase phase, QWidget* parent) : QToolButton(parent) {
  card_.phase = phase;
  setCheckable(true);
  setFocusPolicy(Qt::StrongFocus);
  setSizePolicy(QSizePolicy::Expanding, QSizePolicy::Fixed);
  setShortcut(QKeySequence(Qt::ALT | Qt::Key(Qt::Key_1 + int(phase))));
}

void StepButton::show_card(const StepCard& card) {
  card_ = card;
  const QString word = appearance_of(card.status).word;
  setAccessibleName(QString("%1: %2").arg(card.name, word));
  setAccessibleDescription(QString("%1 %2").arg(card.figure, card.why));
  setToolTip(
      QString("%1: %2\n%3\n%4\nAlt+%5").arg(card.name, word, card.figure, card.why).arg(int(card.phase) + 1));
  update();
}

void StepButton::paintEvent(QPaintEvent*) {
  const Appearance appearance = appearance_of(card_.status);
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  const QRectF frame = QRectF(rect()).adjusted(1.5, 1.5, -1.5, -1.5);
  QPainterPath shape;
  shape.addRoundedRect(frame, 6, 6);
  painter.fillPath(shape, isChecked() ? style::raised : style::panel);
  painter.setPen(QPen(isChecked() ? appearance.colour : style::line, isChecked() ? 3 : 1));
  painter.drawPath(shape);
  if (hasFocus()) {
    painter.setPen(QPen(style::text, 1, Qt::DotLine));
    painter.drawRoundedRect(frame.adjusted(4, 4, -4, -4), 4, 4);
  }
  painter.fillRect(QRectF(frame.left(), frame.top() + 6, 4, frame.height() - 12), appearance.colour);

  QFont font = this->font();
  const QRectF inner = frame.adjusted(12, 6, -8, -4);
  font.setPixelSize(16), font.setBold(true);
  painter.setFont(font);
  painter.setPen(appearance.colour);
  painter.drawText(inner, Qt::AlignRight | Qt::AlignTop, appearance.sign);
  painter.setPen(style::text);
  painter.drawText(inner, Qt::AlignLeft | Qt::AlignTop, card_.name);
  font.setPixelSize(13), font.setBold(false);
  painter.setFont(font);
  const auto line = [&](const QString& text, double top, const QColor& colour) {
    painter.setPen(colour);
    painter.drawText(QRectF(inner.left(), inner.top() + top, inner.width(), 18),
                     Qt::AlignLeft | Qt::AlignVCenter,
                     painter.fontMetrics().elidedText(text, Qt::ElideRight, int(inner.width())));
  };
  line(card_.figure.isEmpty() ? appearance.word : card_.figure, 22, style::text);
  line(card_.why, 40, card_.status == StepStatus::good ? style::quiet : appearance.colour);
}

StepStrip::StepStrip(QWidget* parent) : QWidget(parent) {
  auto* row = new QHBoxLayout(this);
  row->setContentsMargins(0, 0, 0, 0);
  row->setSpacing(6);
  auto* group = new QButtonGroup(this);
  for (const Phase phase : phases) {
    auto* button = new StepButton(phase, this);
    button->setObjectName(QString("step%1").arg(int(phase)));
    buttons_[std::size_t(phase)] = button;
    group->addButton(button);
    row->addWidget(button);
    connect(button, &QToolButton::clicked, this, [this, phase] { emit chosen(phase); });
  }
  choose(Phase::acquire);
}

void StepStrip::show_steps(const std::array<StepCard, phases.size()>& cards) {
  for (const StepCard& card : cards) button(card.phase)->show_card(card);
}

void StepStrip::choose(Phase phase) { button(phase)->setChecked(true); }

}  // namespace helicarm::gui
