// SPDX-License-Identifier: Apache-2.0
// Measuring in the X-ray images: the tool, its menu and its panel.
#include <QDockWidget>
#include <QMenuBar>

#include "gui/window/main_window.h"

namespace helicarm::gui {
namespace {

using Results = std::vector<std::shared_ptr<const pipeline::Result>>;

/// A result with further images, each the only one of its result.
std::shared_ptr<const pipeline::Result> with_frames(const std::shared_ptr<const pipeline::Result>& result,
                                                    const Results& frames) {
  if (!result || frames.empty()) return result;
  auto all = std::make_shared<pipeline::Result>(*result);
  for (const auto& frame : frames) all->views.push_back(frame->views.front());
  return all;
}

}  // namespace

void MainWindow::build_measures() {
  measures_dock_ = new QDockWidget(tr("Measures"), this);
  measures_dock_->setObjectName("measuresDock");
  measures_ = new MeasuresPanel(measure_tool_);
  measures_dock_->setWidget(measures_);
  addDockWidget(Qt::BottomDockWidgetArea, measures_dock_);
  measures_dock_->hide();
  connect(measures_, &MeasuresPanel::changed, this, &MainWindow::show_measures);
  for (XrayView* xray : xrays_) {
    connect(xray, &XrayView::measured, this, [this, xray](const QPointF& raw) {
      measure_tool_.click(xray->image(), {raw.x(), raw.y()});
    });
    connect(xray, &XrayView::measure_click_moved, this, [this](int number, int click, const QPointF& raw) {
      measure_tool_.move(number, click, {raw.x(), raw.y()});
    });
    connect(xray, &XrayView::measure_finished, &measure_tool_, &MeasureTool::finish);
  }
}

void MainWindow::build_measure_menu() {
  QMenu* menu = menuBar()->addMenu(tr("&Measure"));
  for (const measures::KindInfo& info : measures::kinds())
    menu->addAction(QString::fromUtf8(info.label.data(), qsizetype(info.label.size())), this,
                    [this, kind = info.kind] { measure_tool_.begin(kind); });
  menu->addSeparator();
  leave_tool_ = menu->addAction(tr("&Leave the tool"), QKeySequence(Qt::Key_Escape), &measure_tool_,
                                &MeasureTool::leave);
  leave_tool_->setEnabled(false);
}

void MainWindow::show_measures() {
  if (leave_tool_ == nullptr) return;  // the menus are not built yet
  auto frames = panels_->other_frames();
  if (measures_of_ != present_ || measures_of_frames_ != frames) {
    measures_of_ = present_;
    measures_of_frames_ = std::move(frames);
    return measures_->show_result(with_frames(present_, measures_of_frames_));  // comes back
  }
  const bool measures = measure_tool_.kind().has_value();
  if (measures) measures_dock_->show();
  leave_tool_->setEnabled(measures);
  for (XrayView* xray : xrays_) {
    xray->set_measuring(measures);
    xray->set_measures(measures_->of_image(xray->image()));
  }
}

}  // namespace helicarm::gui
