// SPDX-License-Identifier: Apache-2.0
#include "gui/window/curves_view.h"

#include <QPainter>
#include <QSvgRenderer>
#include <QVBoxLayout>
#include <utility>

namespace helicarm::gui {

void CurvesView::show_svg(QByteArray svg) {
  svg_ = std::move(svg);
  update();
}

void CurvesView::paintEvent(QPaintEvent*) {
  if (svg_.isEmpty()) return;
  QSvgRenderer drawn(svg_);
  drawn.setAspectRatioMode(Qt::KeepAspectRatio);
  QPainter painter(this);
  painter.fillRect(rect(), Qt::white);
  drawn.render(&painter, rect());
}

CurvesPanel::CurvesPanel(const QString& name, const QString& sheet_says, const QString& curves_say)
    : sheet_(new QComboBox), curves_(new CurvesView) {
  sheet_->setObjectName(name + "Sheet");
  sheet_->setAccessibleName(sheet_says);
  curves_->setObjectName(name + "Curves");
  curves_->setAccessibleName(curves_say);
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(0, 0, 0, 0);
  column->addWidget(sheet_);
  column->addWidget(curves_, 1);
}

}  // namespace helicarm::gui
