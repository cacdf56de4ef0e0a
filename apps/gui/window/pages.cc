// SPDX-License-Identifier: Apache-2.0
// Pages of the measurement steps.
#include "gui/window/pages.h"

#include <QButtonGroup>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QRadioButton>
#include <QVBoxLayout>

#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {

Page::Page(const QString& lead, Controller& controller, QWidget* parent)
    : QWidget(parent), controller_(controller) {
  auto* column = new QVBoxLayout(this);
  column->setContentsMargins(8, 4, 8, 4);
  auto* words = new QLabel(lead);
  words->setWordWrap(true);
  words->setObjectName("lead");
  column->addWidget(words);
  why_ = new QLabel;
  why_->setObjectName("why");
  why_->setWordWrap(true);
  why_->setProperty("class", "attention");
  why_->hide();
  column->addWidget(why_);
}

QPushButton* Page::add_button(const QString& words, const char* name, std::function<void()> act) {
  auto* button = new QPushButton(words);
  button->setObjectName(name);
  layout()->addWidget(button);
  connect(button, &QPushButton::clicked, this, std::move(act));
  return button;
}

HoldButton* Page::add_hold(const QString& words, const char* name, std::function<void()> act) {
  auto* button = new HoldButton(words);
  button->setObjectName(name);
  layout()->addWidget(button);
  connect(button, &HoldButton::held, this, std::move(act));
  return button;
}

PageTable* Page::add_table(const report::Table& content, const char* name) {
  auto* table = new PageTable(content, name);
  layout()->addWidget(table);
  layout()->addWidget(table->others());
  return table;
}

bool Page::event(QEvent* event) {
  const bool done = QWidget::event(event);
  if (event->type() == QEvent::LayoutRequest || event->type() == QEvent::Resize)
    setMinimumHeight(layout()->totalMinimumHeightForWidth(width()));
  if (event->type() == QEvent::LayoutRequest || event->type() == QEvent::Show)
    updateGeometry();  // also of smaller text that came while it was hidden
  return done;
}

void Page::tell_why_last() {
  layout()->removeWidget(why_);
  layout()->addWidget(why_);
}

void Page::show_card(const StepCard& card, const ApplicationState& state) {
  const bool by_picks = card.phase == Phase::plan || card.phase == Phase::verify;
  const bool is_told = card.status == StepStatus::refused || card.status == StepStatus::warning;
  QString why = card.out_of_date;
  if (why.isEmpty() && is_told) why = card.all.isEmpty() ? card.why : card.all.join('\n');
  if (by_picks && state.busy == Phase::calibrate && stale(state, Phase::calibrate).isEmpty()) why.clear();
  QString message = why.section(" (", 0, -2);  // without its view and code
  if (message.contains(": ")) message = message.section(": ", 1);
  for (const QLabel* label : findChildren<QLabel*>())
    if (label != why_ && label->isVisibleTo(this) &&
        (label->text().contains(why) || (!message.isEmpty() && label->text().contains(message))))
      why.clear();
  why_->setText(why);
  why_->setVisible(!why.isEmpty());
}

AcquirePage::AcquirePage(Controller& controller, QWidget* parent)
    : Page(tr("Acquire an AP and a lateral X-ray image of the bones with the calibrator."), controller,
           parent) {
  refused_ = new QLabel;
  refused_->setObjectName("notOpened");
  refused_->setWordWrap(true);
  refused_->setProperty("class", "attention");
  layout()->addWidget(refused_);
  acquisitions_ = new QWidget;
  new QVBoxLayout(acquisitions_);
  acquisitions_->layout()->setContentsMargins(0, 0, 0, 0);
  layout()->addWidget(acquisitions_);
  ways_in_ = new QWidget;
  auto* row = new QHBoxLayout(ways_in_);
  row->setContentsMargins(0, 0, 0, 0);
  auto* rehearse = new QPushButton(tr("&New rehearsal"));
  auto* open = new QPushButton(tr("&Open a case..."));
  auto* tour = new QPushButton(tr("&Tour"));
  tour->setObjectName("startTour");
  tour->setToolTip(tr("Walks through the window with a simulated case"));
  for (QPushButton* button : {rehearse, open, tour}) row->addWidget(button);
  layout()->addWidget(ways_in_);
  new_case_ = add_button({}, "newCase", [this] { emit new_case_wanted(); });
  connect(rehearse, &QPushButton::clicked, this, &AcquirePage::rehearsal_wanted);
  connect(open, &QPushButton::clicked, this, &AcquirePage::folder_wanted);
  connect(tour, &QPushButton::clicked, this, &AcquirePage::tour_wanted);
  where_ = new QLabel;
  where_->setWordWrap(true);
  layout()->addWidget(where_);
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void AcquirePage::show_state(const ApplicationState& state) {
  const bool of_files = state.source == Source::files || state.source == Source::images;
  if (views_ != state.views || of_files) {
    views_ = of_files ? std::vector<std::string>{} : state.views;
    qDeleteAll(acquisitions_->findChildren<QPushButton*>());
    for (const std::string& point : state.check_points) {
      auto* button = new QPushButton(tr("The pointer is on check point %1").arg(text(point)));
      button->setToolTip(tr("Before the first X-ray image, and again before the robot moves to this bone"));
      acquisitions_->layout()->addWidget(button);
      connect(button, &QPushButton::clicked, this, [this, point] { controller_.touch(point); });
    }
    for (const std::string& view : views_) {
      const bool own = state.source == Source::virtual_or;
      auto* button = new QPushButton((own ? tr("Acquire %1") : tr("The next image is %1")).arg(text(view)));
      button->setObjectName("shoot" + text(view));
      acquisitions_->layout()->addWidget(button);
      connect(button, &QPushButton::clicked, this,
              [this, view, own] { own ? controller_.shoot(view) : controller_.expect(view); });
    }
  }
  for (QPushButton* button : acquisitions_->findChildren<QPushButton*>()) button->setEnabled(!state.busy);
  ways_in_->setVisible(state.source == Source::none && !state.busy);
  const bool loose = state.source == Source::images;
  findChild<QLabel*>("lead")->setVisible(state.source == Source::virtual_or ||
                                         state.source == Source::devices);
  const auto refusal = state.refusals.find(Phase::acquire);
  const bool is_refused = refusal != state.refusals.end() && !state.busy;
  refused_->setVisible(is_refused);
  if (is_refused) {
    const QString why = sentence_of(refusal->second), asked = text(state.asked_for.string());
    const bool is_named = state.source != Source::none || why.contains(asked);
    refused_->setText(state.source != Source::none ? why
                      : is_named                   ? tr("Not opened: %1").arg(why)
                                                   : tr("%1 is not opened: %2").arg(asked, why));
  }
  new_case_->setText(loose ? tr("New &case of these images...") : tr("New &case of X-ray images..."));
  new_case_->setVisible(loose || ways_in_->isVisibleTo(this));
  where_->setText(
      state.source == Source::none
          ? state.busy ? text(state.doing)
                       : tr("Open a case or X-ray images, make a case of your own images, or rehearse an "
                            "operation with virtual devices.")
      : state.source == Source::files ? tr("From %1.").arg(text(state.folder.string()))
      : loose ? tr("%1: for looking and measuring in the image. Points in space need a case: two or "
                   "more images with the calibrator.")
                    .arg(text(state.folder.string()))
      : state.source == Source::devices ? tr("Waiting for %1 from the C-arm.").arg(text(state.next_view))
                                        : QString());
}

namespace {

const std::vector<pipeline::ViewResult>& views_of(const ApplicationState& state) {
  static const std::vector<pipeline::ViewResult> none;
  return state.result ? state.result->views : none;
}

}  // namespace

RectifyPage::RectifyPage(Controller& controller, QWidget* parent)
    : Page(
          tr("Corrects the intensifier's distortion from the dots of the plate. Check that the residuals are "
             "small."),
          controller, parent) {
  auto* row = new QHBoxLayout;
  auto* group = new QButtonGroup(this);
  for (const auto& [layer, words, name] : {std::tuple(Layer::raw, tr("Raw"), "layerRaw"),
                                           {Layer::rectified, tr("Rectified"), "layerRectified"},
                                           {Layer::inpainted, tr("Without dots"), "layerInpainted"}}) {
    auto* choice = new QRadioButton(words);
    choice->setObjectName(name);
    choice->setChecked(layer == Layer::rectified);
    group->addButton(choice);
    row->addWidget(choice);
    connect(choice, &QRadioButton::clicked, this, [this, wanted = layer] { emit layer_wanted(wanted); });
  }
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  table_ = add_table(report::rectification_table({}), "rectifyTable");
  constexpr int residual = 3;
  table_->horizontalHeader()->moveSection(residual, 1);  // number first
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void RectifyPage::show_state(const ApplicationState& state) {
  table_->fill(report::rectification_table(views_of(state)));
}

namespace {

QString lead_of_calibration(const ApplicationState& state) {
  if (state.cameras.empty())
    return CalibratePage::tr("Labels the calibrator's fiducials and calibrates each view from them.");
  QStringList files;
  for (std::size_t i = 0; i < state.cameras.size(); ++i)
    files << CalibratePage::tr("%1 by %2")
                 .arg(text(state.views[i]), text(state.cameras[i].filename().string()));
  return CalibratePage::
      tr("The cameras are given by files of another program: %1. No calibrator is looked for; the world is "
         "that of the cameras.")
          .arg(files.join(", "));
}

}  // namespace

CalibratePage::CalibratePage(Controller& controller, QWidget* parent)
    : Page(lead_of_calibration({}), controller, parent) {
  views_ = add_table(report::calibration_table({}), "viewTable");
  balls_ = add_table(report::fiducials_table({}), "ballTable");
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void CalibratePage::show_state(const ApplicationState& state) {
  findChild<QLabel*>("lead")->setText(lead_of_calibration(state));
  for (PageTable* table : {views_, balls_}) table->setHidden(!state.cameras.empty());
  views_->fill(report::calibration_table(views_of(state)));
  balls_->fill(report::fiducials_table(views_of(state)));
}

}  // namespace helicarm::gui
