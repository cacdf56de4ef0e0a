// SPDX-License-Identifier: Apache-2.0
#include "gui/window/register_page.h"

#include <QGridLayout>
#include <QSignalBlocker>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/xray/mark_painter.h"
#include "helicarm/case_registration/registration_tables.h"

namespace helicarm::gui {
namespace {

using case_registration::CaseRegistration;
using case_registration::RegisteredModel;

/// Decision's reason, warnings and notes of every model, a line each.
QString reasons_of(const CaseRegistration& done) {
  QStringList lines;
  for (const RegisteredModel& model : done.models) {
    const registration::Registration& found = model.registration;
    if (found.failure) lines << sentence_of(*found.failure);
    for (const auto* list : {&found.warnings, &found.notes})
      for (const Warning& each : *list) lines << sentence_of(each);
  }
  return lines.join("\n");
}

}  // namespace

RegisterPage::RegisterPage(Controller& controller, QWidget* parent)
    : Page(tr("Registers the case's models to the calibrated views. Check that each outline follows the "
              "bone's edges in every X-ray image."),
           controller, parent) {
  register_ = add_button(tr("Register models"), "registerModels", [this] {
    reset_hand();
    nudge();  // none: the case's start
    controller_.register_models();
  });
  says_ = new QLabel;
  says_->setObjectName("registerSays");
  says_->setWordWrap(true);
  layout()->addWidget(says_);
  models_ = add_table(case_registration::models_table({}), "modelTable");
  models_->setFixedHeight(104);
  add_hand();
  points_ = add_table(case_registration::points_table({}), "modelPointTable");
}

void RegisterPage::add_hand() {
  hand_ = new QWidget;
  auto* grid = new QGridLayout(hand_);
  grid->setContentsMargins(0, 0, 0, 0);
  model_ = new QComboBox;
  model_->setObjectName("nudgedModel");
  model_->setAccessibleName(tr("Model that is moved by hand"));
  grid->addWidget(model_, 0, 0);
  for (int i = 0; i < 6; ++i) {
    const bool turns = i >= 3;
    const QString axis = QStringList{"x", "y", "z"}[i % 3];
    auto* by = by_[std::size_t(i)] = new QDoubleSpinBox;
    by->setObjectName((turns ? "turn" : "shift") + axis.toUpper());
    by->setAccessibleName((turns ? tr("Turn about %1, degrees") : tr("Shift along %1, mm")).arg(axis));
    by->setToolTip((turns ? tr("Turns the model about its centre, about the calibrator's %1")
                          : tr("Moves the model along the calibrator's %1"))
                       .arg(axis));
    by->setPrefix(axis + " ");
    by->setSuffix(turns ? tr(" °") : tr(" mm"));
    by->setRange(-180, 180);
    by->setSingleStep(0.5);
    by->setDecimals(1);
    by->setKeyboardTracking(false);
    grid->addWidget(by, 1 + i / 3, i % 3);
    connect(by, &QDoubleSpinBox::valueChanged, this, &RegisterPage::nudge);
  }
  connect(model_, &QComboBox::currentIndexChanged, this, [this] {
    reset_hand();
    nudge();
  });
  layout()->addWidget(hand_);
  from_here_ =
      add_button(tr("Register from here"), "registerFromHere", [this] { controller_.register_models(); });
  from_here_->setToolTip(tr("Starts the search from the model's present pose"));
  grid->addWidget(from_here_, 0, 1, 1, 2);
}

void RegisterPage::reset_hand() {
  for (QDoubleSpinBox* by : by_) {
    const QSignalBlocker quiet(by);
    by->setValue(0);
  }
}

void RegisterPage::nudge() {
  registration::RigidStep step;
  for (int i = 0; i < 3; ++i) {
    step[i] = by_[std::size_t(i + 3)]->value() * EIGEN_PI / 180;
    step[i + 3] = by_[std::size_t(i)]->value();
  }
  if (model_->currentIndex() >= 0) controller_.nudge(std::size_t(model_->currentIndex()), step);
}

void RegisterPage::show_state(const ApplicationState& state) {
  const bool can = can_register(state) && !state.busy;
  register_->setEnabled(can);
  hand_->setEnabled(can && state.registration);
  from_here_->setEnabled(can && state.nudged);
  if (const auto refusal = state.refusals.find(Phase::registration); refusal != state.refusals.end())
    says_->setText(sentence_of(refusal->second));
  else if (!state.has_models)
    says_->setText(
        tr("This case has no models: name a CT volume or a surface under \"models\" in case.json."));
  else if (state.busy == Phase::registration)
    says_->setText(text(state.doing));
  else if (state.measured && state.result->failure)
    says_->setText(tr("The measurement is refused (%1): no model is registered to it.")
                       .arg(text(std::string(code(state.result->failure->reason)))));
  else
    says_->setText(state.registration ? reasons_of(*state.registration) : QString());
  if (shown_ == state.registration) return;
  shown_ = state.registration;
  const QSignalBlocker quiet(model_);
  const int chosen = model_->currentIndex();
  model_->clear();
  reset_hand();
  const std::vector<RegisteredModel> none;
  const std::vector<RegisteredModel>& models = shown_ ? shown_->models : none;
  for (const RegisteredModel& model : models) model_->addItem(text(model.registration.name));
  model_->setCurrentIndex(std::clamp(chosen, std::min(0, model_->count() - 1), model_->count() - 1));
  fill(models_, case_registration::models_table(models));
  fill(points_, case_registration::points_table(models));
}

std::vector<ModelShape> models_of(const ApplicationState& state) {
  std::vector<ModelShape> shapes;
  if (!state.registration) return shapes;
  for (std::size_t i = 0; i < state.registration->models.size(); ++i) {
    std::optional<geometry::RigidTransform> by_hand;
    if (state.nudged && state.nudged->model == i) by_hand = state.nudged->world_from_model;
    const QColor& ink = ink::of_model(i);
    if (auto shape = shape_of(state.registration->models[i], by_hand,
                              {std::uint8_t(ink.red()), std::uint8_t(ink.green()), std::uint8_t(ink.blue())}))
      shapes.push_back(*std::move(shape));
  }
  return shapes;
}

std::vector<ModelOutline> outlines_of(const ApplicationState& state, std::size_t view) {
  std::vector<ModelOutline> outlines;
  if (!state.registration) return outlines;
  for (std::size_t i = 0; i < state.registration->models.size(); ++i) {
    const RegisteredModel& model = state.registration->models[i];
    const bool is_nudged = state.nudged && state.nudged->model == i;
    const auto& dots = is_nudged ? state.nudged->outlines : model.outlines;
    ModelOutline& outline = outlines.emplace_back();
    if (view < dots.size()) outline.dots = dots[view];
    if (is_nudged || model.registration.failure || view >= model.views.size()) continue;
    for (const case_registration::RegisteredPoint& point : model.points)
      if (const Eigen::Vector3d& at = point.place.in_calibrator; model.views[view].depth(at) > 1)
        outline.points.emplace_back(text(point.name), model.views[view].project(at));
  }
  return outlines;
}

}  // namespace helicarm::gui
