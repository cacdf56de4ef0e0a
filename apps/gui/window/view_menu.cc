// SPDX-License-Identifier: Apache-2.0
// What the window shows: layers and marks, theme and text size, layout; and copies of it.
#include <QActionGroup>
#include <QApplication>
#include <QClipboard>
#include <QDockWidget>
#include <QMenu>
#include <QSplitter>
#include <QStatusBar>

#include "gui/window/main_window.h"
#include "gui/window/style.h"

namespace helicarm::gui {
namespace {

/// The selected rows, or all, with tabs and the header.
QString text_of(const QTableWidget& table) {
  QStringList lines, header;
  for (int column = 0; column < table.columnCount(); ++column)
    header << table.horizontalHeaderItem(column)->text();
  lines << header.join('\t');
  const QModelIndexList rows = table.selectionModel()->selectedRows();
  for (int row = 0; row < table.rowCount(); ++row) {
    if (!rows.isEmpty() && !table.selectionModel()->isRowSelected(row)) continue;
    QStringList cells;
    for (int column = 0; column < table.columnCount(); ++column)
      cells << (table.item(row, column) != nullptr ? table.item(row, column)->text() : QString());
    lines << cells.join('\t');
  }
  return lines.join('\n') + '\n';
}

}  // namespace

void MainWindow::build_layers_menu(QMenu* view) {
  QMenu* menu = view->addMenu(tr("X-ray &layers"));
  auto* layers = new QActionGroup(menu);
  for (const auto& [words, layer] : {std::pair(tr("&Raw"), Layer::raw),
                                     {tr("R&ectified"), Layer::rectified},
                                     {tr("Rectified, &without plate"), Layer::inpainted}}) {
    QAction* action = menu->addAction(words);
    action->setCheckable(true);
    layers->addAction(action);
    connect(action, &QAction::triggered, this, [this, wanted = layer] { panels_->set_layer(wanted); });
    connect(xrays_.front(), &XrayView::layer_changed, action,
            [action, own = layer](Layer now) { action->setChecked(now == own); });
    action->setChecked(layer == xrays_.front()->layer());
  }
  menu->addSeparator();
  for (const auto& [words, group] : {std::pair(tr("&Fiducials"), MarkGroup::fiducials),
                                     {tr("Re&siduals"), MarkGroup::residuals},
                                     {tr("&Plate dots"), MarkGroup::plate},
                                     {tr("&Outliers and candidates"), MarkGroup::outliers},
                                     {tr("P&oints and tunnels"), MarkGroup::points},
                                     {tr("&Names"), MarkGroup::labels}}) {
    QAction* action = menu->addAction(words);
    action->setCheckable(true);
    action->setChecked(true);
    connect(action, &QAction::toggled, this, [this, own = group](bool on) {
      mark_groups_.setFlag(own, on);
      for (XrayView* xray : xrays_) xray->set_mark_groups(mark_groups_);
    });
  }
}

void MainWindow::build_scene_menu(QMenu* view) {
  QMenu* menu = view->addMenu(tr("In the &scene"));
  menu->setObjectName("sceneParts");
  for (const auto& [words, part] : {std::pair(tr("&Calibrator"), ScenePart::calibrator),
                                    {tr("&Rays and detectors"), ScenePart::rays},
                                    {tr("&Points and tunnels"), ScenePart::points},
                                    {tr("&Models"), ScenePart::models},
                                    {tr("&Bones of the rehearsal"), ScenePart::bones},
                                    {tr("R&obot and tool"), ScenePart::robot}}) {
    QAction* action = menu->addAction(words);
    action->setCheckable(true);
    action->setChecked(true);
    connect(action, &QAction::toggled, this, [this, own = part](bool on) {
      SceneParts parts = scene_->parts();
      if (parts.testFlag(own) != on) scene_->show_parts(parts.setFlag(own, on));
    });
    connect(scene_, &SceneView::objects_changed, action,
            [this, action, own = part] { action->setChecked(scene_->parts().testFlag(own)); });
  }
  QMenu* models = menu->addMenu(tr("&Each model"));
  connect(menu, &QMenu::aboutToShow, models, [this, models] {
    models->clear();
    for (const std::string& name : scene_->model_names()) {
      QAction* action = models->addAction(QString::fromStdString(name));
      action->setCheckable(true);
      action->setChecked(!scene_->hidden_models().contains(name));
      connect(action, &QAction::toggled, this, [this, name](bool on) {
        std::set<std::string> hidden = scene_->hidden_models();
        on ? static_cast<void>(hidden.erase(name)) : static_cast<void>(hidden.insert(name));
        scene_->hide_models(std::move(hidden));
      });
    }
    models->setEnabled(!models->isEmpty());
  });
}

void MainWindow::build_appearance_menu(QMenu* view) {
  QMenu* menu = view->addMenu(tr("A&ppearance"));
  const auto change = [this](style::Appearance appearance) {
    style::apply(appearance);
    recent_.setValue("appearance/light", style::applied().theme == style::Theme::light);
    recent_.setValue("appearance/text_px", style::applied().text_px);
  };
  QAction* is_light = menu->addAction(tr("&Light"));
  is_light->setCheckable(true);
  is_light->setChecked(style::applied().theme == style::Theme::light);
  connect(is_light, &QAction::toggled, this, [change](bool on) {
    change({on ? style::Theme::light : style::Theme::dark, style::applied().text_px});
  });
  menu->addSeparator();
  for (const auto& [words, key, step] : {std::tuple(tr("&Larger text"), QKeySequence(tr("Ctrl++")), 2),
                                         {tr("&Smaller text"), QKeySequence(tr("Ctrl+-")), -2}})
    menu->addAction(words, key, this, [change, by = step] {
      change({style::applied().theme, style::applied().text_px + by});
    });
  menu->addAction(tr("&Usual text"), QKeySequence(tr("Ctrl+0")), this, [change] {
    change({style::applied().theme, style::usual_text_px});
  });
}

void MainWindow::fit_text() {
  constexpr int widest_button = 416;
  if (right_ != nullptr) right_->setMinimumWidth(style::scaled(widest_button));
}

void MainWindow::changeEvent(QEvent* event) {
  if (event->type() == QEvent::StyleChange) fit_text();
  QMainWindow::changeEvent(event);
}

void MainWindow::copy() {
  QWidget* focus = QApplication::focusWidget();
  if (auto* table = qobject_cast<QTableWidget*>(focus)) {
    QApplication::clipboard()->setText(text_of(*table));
    return statusBar()->showMessage(tr("The table is on the clipboard."));
  }
  if (auto* xray = qobject_cast<XrayView*>(focus))
    QApplication::clipboard()->setImage(xray->image_with_marks());
  else
    QApplication::clipboard()->setImage(
        (focus == scene_ ? static_cast<QWidget*>(scene_) : this)->grab().toImage());
  statusBar()->showMessage(tr("The image is on the clipboard."));
}

void MainWindow::keep_layout() {
  recent_.setValue("window/geometry", saveGeometry());
  recent_.setValue("window/state", saveState());
  for (const QSplitter* splitter : findChildren<QSplitter*>())
    if (!splitter->objectName().isEmpty())
      recent_.setValue("window/" + splitter->objectName(), splitter->saveState());
}

void MainWindow::restore_layout() {
  restoreGeometry(recent_.value("window/geometry").toByteArray());
  restoreState(recent_.value("window/state").toByteArray());
  for (QDockWidget* dock : {replay_dock_, measures_dock_, log_dock_}) dock->hide();  // until they are used
  for (QDockWidget* dock : docks_) dock->hide();
  for (QSplitter* splitter : findChildren<QSplitter*>())
    if (!splitter->objectName().isEmpty())
      splitter->restoreState(recent_.value("window/" + splitter->objectName()).toByteArray());
}

}  // namespace helicarm::gui
