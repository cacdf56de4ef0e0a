// SPDX-License-Identifier: Apache-2.0
#include "gui/window/curves_view.h"

#include <QPainter>
#include <QSvgRenderer>
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

}  // namespace helicarm::gui
