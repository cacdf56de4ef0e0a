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
      return {style::colours().quiet, QStringLiteral("○"), StepStrip::tr("waiting")};
    case StepStatus::running:
      return {style::colours().blue, QStringLiteral("◐"), StepStrip::tr("working")};
    case StepStatus::good:
      return {style::colours().green, QStringLiteral("✓"), StepStrip::tr("good")};
    case StepStatus::warning:
      return {style::colours().amber, QStringLiteral("!"), StepStrip::tr("warning")};
    case StepStatus::refused:
      return {style::colours().red, QStringLiteral("✕"), StepStrip::tr("refused")};
    case StepStatus::stale:
      return {style::colours().amber, QStringLiteral("↻"), StepStrip::tr("out of date")};
  }
  return {};
}

/// A text in at most so many lines, elided at the end.
QStringList in_lines(const QString& text, int most, const QFontMetrics& metrics, int width) {
  QStringList lines;
  QString rest = text;
  while (!rest.isEmpty() && lines.size() < most - 1 && metrics.horizontalAdvance(rest) > width) {
    qsizetype fits = 1;  // characters; to the end of a word where a word fits
    while (fits < rest.size() && metrics.horizontalAdvance(rest.left(fits + 1)) <= width) ++fits;
    const qsizetype space = rest.lastIndexOf(' ', fits);
    lines << rest.left(space > 0 ? space : fits);
    rest = rest.mid(lines.back().size()).trimmed();
  }
  if (!rest.isEmpty()) lines << metrics.elidedText(rest, Qt::ElideRight, width);
  return lines;
}

constexpr int card_px = 92, head_px = 22, lines_of_card = 4;
constexpr int line_px = 15, text_px = 12;

}  // namespace

QString definition_of(Phase phase) {
  switch (phase) {
    case Phase::acquire:
      return StepStrip::tr("Number of X-ray images received, of those needed.");
    case Phase::rectify:
      return StepStrip::tr(
          "Residual: distance of the plate's dots from the correction of distortion, root mean square in the "
          "worst view, px.");
    case Phase::calibrate:
      return StepStrip::tr(
          "FRE: mean distance of the fiducials, located by their images, from their places in the "
          "calibrator's file, mm; and fiducials used in all views, of all.");
    case Phase::registration:
      return StepStrip::tr(
          "Length that 95 % of the errors of the worst point of the models' plans do not exceed, without "
          "plans of "
          "the worst model's centre, mm.");
    case Phase::plan:
      return StepStrip::tr("Length that 95 % of the errors of the worst point do not exceed, mm.");
    case Phase::navigate:
      return StepStrip::tr(
          "Residual of the robot's registration, root mean square, mm; then tunnels reached, and the largest "
          "distance of the tool's tip from its target, mm.");
    case Phase::verify:
      return StepStrip::tr(
          "Largest distance of a tunnel's end from the tool's axis, mm, and its predicted value; from files, "
          "of the case's tool lines by the X-ray images.");
  }
  return {};
}

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
  setToolTip(QString("%1: %2\n%3\n%4\n\n%5\nAlt+%6")
                 .arg(card.name, word, card.figure, card.why, definition_of(card.phase))
                 .arg(int(card.phase) + 1));
  update();
}

QSize StepButton::sizeHint() const { return {style::scaled(180), style::scaled(card_px)}; }

QSize StepButton::minimumSizeHint() const { return {100, style::scaled(card_px)}; }

void StepButton::paintEvent(QPaintEvent*) {
  const Appearance appearance = appearance_of(card_.status);
  QPainter painter(this);
  painter.setRenderHint(QPainter::Antialiasing);
  const QRectF frame = QRectF(rect()).adjusted(1.5, 1.5, -1.5, -1.5);
  QPainterPath shape;
  shape.addRoundedRect(frame, 6, 6);
  painter.fillPath(shape, isChecked() ? style::colours().raised : style::colours().panel);
  painter.setPen(QPen(isChecked() ? appearance.colour : style::colours().line, isChecked() ? 3 : 1));
  painter.drawPath(shape);
  if (hasFocus()) {
    painter.setPen(QPen(style::colours().text, 1, Qt::DotLine));
    painter.drawRoundedRect(frame.adjusted(4, 4, -4, -4), 4, 4);
  }
  painter.fillRect(QRectF(frame.left(), frame.top() + 6, 4, frame.height() - 12), appearance.colour);

  QFont font = this->font();
  const QRectF inner = frame.adjusted(12, 6, -8, -4);
  font.setPixelSize(style::scaled(16)), font.setBold(true);
  painter.setFont(font);
  painter.setPen(appearance.colour);
  painter.drawText(inner, Qt::AlignRight | Qt::AlignTop, appearance.sign);
  painter.setPen(style::colours().text);
  painter.drawText(inner, Qt::AlignLeft | Qt::AlignTop, card_.name);
  const auto [figure, why] = words();
  font.setBold(false);
  font.setPixelSize(style::scaled(text_px));
  painter.setFont(font);
  double top = inner.top() + style::scaled(head_px);
  const auto paint = [&](const QStringList& lines, const QColor& colour) {
    painter.setPen(colour);
    for (const QString& line : lines) {
      painter.drawText(QRectF(inner.left(), top, inner.width(), style::scaled(line_px)),
                       Qt::AlignLeft | Qt::AlignVCenter, line);
      top += style::scaled(line_px);
    }
  };
  paint(figure, style::colours().text);
  paint(why, card_.status == StepStatus::good ? style::colours().quiet : appearance.colour);
}

StepButton::Words StepButton::words() const {
  QFont font = this->font();
  font.setPixelSize(style::scaled(text_px));
  const QFontMetrics metrics(font);
  const int width = this->width() - 24;
  Words words;
  words.figure = in_lines(card_.figure.isEmpty() ? appearance_of(card_.status).word : card_.figure,
                          lines_of_card - 1, metrics, width);
  words.why = in_lines(card_.why, lines_of_card - int(words.figure.size()), metrics, width);
  return words;
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
    row->insertWidget(phase == Phase::registration ? int(Phase::plan) : -1, button);
    connect(button, &QToolButton::clicked, this, [this, phase] { emit chosen(phase); });
  }
  choose(Phase::acquire);
}

void StepStrip::show_steps(const StepCards& cards) {
  for (const StepCard& card : cards) {
    button(card.phase)->show_card(card);
    button(card.phase)->setVisible(card.is_offered);
  }
}

void StepStrip::choose(Phase phase) { button(phase)->setChecked(true); }

}  // namespace helicarm::gui
