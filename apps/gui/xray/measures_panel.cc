// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/measures_panel.h"

#include <QClipboard>
#include <QGuiApplication>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QVBoxLayout>
#include <algorithm>
#include <array>

#include "gui/xray/text.h"

namespace helicarm::gui {
namespace {

constexpr int through_fiducials = 0, at_depth = 1;  // entries before the points

QTableWidget* result_table() {
  auto* table = new QTableWidget(0, 6);
  table->setObjectName("measuresTable");
  table->setAccessibleName(QObject::tr("Measures"));
  const std::array columns{
      std::pair(QObject::tr("No."), QObject::tr("Number of the measure")),
      std::pair(QObject::tr("Measure"), QObject::tr("Kind of the measure")),
      std::pair(QObject::tr("View"), QObject::tr("Name of the X-ray view")),
      std::pair(QObject::tr("What"), QObject::tr("The quantity; of a point its position in per cent")),
      std::pair(QObject::tr("Value"),
                QObject::tr("mm in the plane of lengths, parallel to the detector; px in a view without "
                            "calibration; degrees; per cent of the landmarks' distance")),
      std::pair(QObject::tr("95 %"),
                QObject::tr("95 % of the errors of clicks, points and calibration are smaller: 1.96 standard "
                            "deviations, in the value's unit"))};
  for (int i = 0; i < table->columnCount(); ++i) {
    auto* header = new QTableWidgetItem(columns[std::size_t(i)].first);
    header->setToolTip(columns[std::size_t(i)].second);
    table->setHorizontalHeaderItem(i, header);
  }
  table->horizontalHeader()->setSectionResizeMode(QHeaderView::ResizeToContents);
  table->horizontalHeader()->setStretchLastSection(true);
  table->verticalHeader()->hide();
  table->setEditTriggers(QAbstractItemView::NoEditTriggers);
  table->setSelectionBehavior(QAbstractItemView::SelectRows);
  table->setTabKeyNavigation(false);
  constexpr int header_and_three_rows = 110;
  table->setMinimumHeight(header_and_three_rows);
  table->verticalHeader()->setDefaultSectionSize(24);
  return table;
}

}  // namespace

MeasuresPanel::MeasuresPanel(MeasureTool& tool, QWidget* parent) : QWidget(parent), tool_(tool) {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(6, 2, 6, 4);
  column->addWidget(build_palette());
  auto* middle = new QHBoxLayout;
  hint_ = new QLabel;
  hint_->setObjectName("measureHint");
  hint_->setWordWrap(true);
  middle->addWidget(hint_, 1);
  middle->addWidget(build_plane());
  column->addLayout(middle);
  auto* bottom = new QHBoxLayout;
  table_ = result_table();
  bottom->addWidget(table_, 1);
  auto* buttons = new QVBoxLayout;
  const auto add = [&](const QString& words, const char* name, auto act) {
    auto* button = new QPushButton(words);
    button->setObjectName(name);
    connect(button, &QPushButton::clicked, this, act);
    buttons->addWidget(button);
    return button;
  };
  copy_ = add(tr("Copy table"), "copyMeasures", [this] { copy(); });
  remove_ = add(tr("Remove"), "removeMeasure", [this] { remove_chosen(); });
  clear_ = add(tr("Remove all"), "clearMeasures", [this] { remove_shown(); });
  bottom->addLayout(buttons);
  column->addLayout(bottom);
  connect(&tool_, &MeasureTool::changed, this, &MeasuresPanel::show_measures);
  connect(table_, &QTableWidget::itemSelectionChanged, this,
          [this] { remove_->setEnabled(table_->currentRow() >= 0); });
  show_result({});
}

QWidget* MeasuresPanel::build_palette() {
  auto* palette = new QWidget;
  auto* row = new QHBoxLayout(palette);
  row->setContentsMargins(0, 0, 0, 0);
  for (const measures::KindInfo& info : measures::kinds()) {
    auto* button = new QPushButton(text(info.brief));
    button->setObjectName("measure_" + text(info.word));
    button->setCheckable(true);
    QStringList clicks;
    for (const measures::Role& role : info.roles)
      clicks << (role.is_optional ? tr("%1 (may be left out)") : QStringLiteral("%1")).arg(text(role.place));
    button->setToolTip(tr("%1. Clicks: %2").arg(text(info.label), clicks.join("; ")));
    row->addWidget(button);
    connect(button, &QPushButton::clicked, this,
            [this, kind = info.kind] { tool_.kind() == kind ? tool_.leave() : tool_.begin(kind); });
    kinds_.push_back(button);
  }
  return palette;
}

QWidget* MeasuresPanel::build_plane() {
  auto* whole = new QWidget;
  auto* row = new QHBoxLayout(whole);
  row->setContentsMargins(0, 0, 0, 0);
  auto* label = new QLabel(tr("Lengths in the plane"));
  row->addWidget(label);
  plane_ = new QComboBox;
  plane_->setObjectName("measurePlane");
  plane_->setAccessibleName(label->text());
  plane_->setToolTip(tr("Parallel to the detector. What lies 1 % nearer to the source appears 1 % longer."));
  row->addWidget(plane_, 1);
  depth_ = new QDoubleSpinBox;
  depth_->setObjectName("measureDepth");
  depth_->setAccessibleName(tr("Distance of the plane from the source"));
  depth_->setRange(100, 3000);
  depth_->setValue(700);
  depth_->setToolTip(depth_->accessibleName());
  depth_->setSuffix(tr(" mm"));  // the window stays within 1280 px with large text
  row->addWidget(depth_);
  connect(plane_, &QComboBox::currentIndexChanged, this, &MeasuresPanel::show_measures);
  connect(depth_, &QDoubleSpinBox::valueChanged, this, &MeasuresPanel::show_measures);
  return whole;
}

LengthPlane MeasuresPanel::plane() const {
  if (plane_->currentIndex() == at_depth) return {.depth_mm = depth_->value()};
  return {.point = plane_->currentIndex() > at_depth ? plane_->currentData().toString().toStdString() : ""};
}

void MeasuresPanel::show_result(std::shared_ptr<const pipeline::Result> result) {
  result_ = std::move(result);
  show_points();
  show_measures();
}

void MeasuresPanel::show_points() {
  const QSignalBlocker silent(plane_);
  const QString before = plane_->currentData().toString();
  const int index_before = plane_->currentIndex();
  plane_->clear();
  plane_->addItem(tr("through the fiducials' centre"));
  plane_->addItem(tr("at a distance"));
  if (result_)
    for (const pipeline::PointResult& point : result_->points)
      if (point.place) plane_->addItem(tr("through %1").arg(text(point.name)), text(point.name));
  const int again = before.isEmpty() ? std::clamp(index_before, through_fiducials, at_depth)
                                     : std::max(through_fiducials, plane_->findData(before));
  plane_->setCurrentIndex(again);
}

void MeasuresPanel::show_measures() {
  depth_->setVisible(plane_->currentIndex() == at_depth);
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    kinds_[i]->setChecked(tool_.kind() == measures::kinds()[i].kind);
  hint_->setText(tool_.hint());
  evaluated_.clear();
  if (result_)
    for (const ImageMeasure& measure : tool_.measures())
      evaluated_.push_back(evaluated(measure, *result_, plane()));
  table_->setRowCount(0);
  for (const MeasuredLine& line : shown_lines()) {
    const int row = table_->rowCount();
    table_->insertRow(row);
    int column = 0;
    for (const QString& words :
         {QString::number(line.number), line.kind, line.view, line.what, line.value, line.within})
      table_->setItem(row, column++, new QTableWidgetItem(words));
  }
  clear_->setEnabled(table_->rowCount() > 0);
  copy_->setEnabled(table_->rowCount() > 0);
  remove_->setEnabled(false);
  emit changed();
}

std::vector<MeasuredLine> MeasuresPanel::shown_lines() const {
  std::vector<MeasuredLine> lines;
  for (const EvaluatedMeasure& measure : evaluated_)
    lines.insert(lines.end(), measure.lines.begin(), measure.lines.end());
  return lines;
}

std::vector<EvaluatedMeasure> MeasuresPanel::of_image(const std::string& image) const {
  std::vector<EvaluatedMeasure> all;
  for (const EvaluatedMeasure& measure : evaluated_)
    if (measure.image == image) all.push_back(measure);
  return all;
}

void MeasuresPanel::copy() const { QGuiApplication::clipboard()->setText(table_text(shown_lines())); }

void MeasuresPanel::remove_chosen() {
  if (const int row = table_->currentRow(); row >= 0) tool_.remove(table_->item(row, 0)->text().toInt());
}

void MeasuresPanel::remove_shown() {
  for (const MeasuredLine& line : shown_lines()) tool_.remove(line.number);
}

}  // namespace helicarm::gui
