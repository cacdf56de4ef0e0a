// SPDX-License-Identifier: Apache-2.0
#include "gui/window/register_page.h"

#include <QGridLayout>
#include <QSignalBlocker>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>
#include <limits>

#include "gui/controller/model_landmarks.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/registration_reasons.h"
#include "helicarm/case_registration/registration_tables.h"
#include "helicarm/report/markup.h"

namespace helicarm::gui {
namespace {

using case_registration::RegisteredModel;

/// Those registered, without numbers of a pose that is not the displayed one; before the registration their
/// names.
std::vector<RegisteredModel> listed_models(const ApplicationState& state) {
  std::vector<RegisteredModel> models;
  if (state.registration) {
    models = present_registration(state).models;
    for (std::size_t i = 0; i < models.size(); ++i)
      if (!stale_model(state, i).isEmpty()) {
        models[i].registration.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
        models[i].registration.views.clear();
      }
    return models;
  }
  for (const pipeline::CaseModel& model : state.models) models.emplace_back().registration.name = model.name;
  return models;
}

report::Table table_of_models(const ApplicationState& state, const std::vector<RegisteredModel>& models) {
  report::Table table = case_registration::models_table(models);
  const auto say = [&](std::size_t model, const QString& words, bool is_bad) {
    table.rows[model][1] = {words.toStdString(), is_bad};
    for (std::size_t i = 2; i < table.rows[model].size(); ++i) table.rows[model][i] = report::Cell{};
  };
  for (std::size_t i = 0; i < models.size(); ++i) {
    if (!state.registration)
      say(i,
          is_moved(state, i) || is_placed(state, i) ? RegisterPage::tr("placed by hand")
                                                    : RegisterPage::tr("not registered"),
          false);
    else if (is_moved(state, i))
      say(i, RegisterPage::tr("moved by hand"), true);
    else if (!stale_model(state, i).isEmpty())
      say(i, RegisterPage::tr("out of date"), true);
  }
  return table;
}

}  // namespace

RegisterPage::RegisterPage(Controller& controller, QWidget* parent)
    : Page(tr("Registers the case's models to the calibrated views. Check that each outline follows the "
              "bone's edges in every X-ray image."),
           controller, parent) {
  register_ = add_button(tr("Register models"), "registerModels", [this] {
    controller_.return_models();  // to the case's starts
    controller_.register_models();
  });
  confirm_ = add_button(tr("The outlines follow the bones in every view: &confirm"), "confirmRegistration",
                        [this] { controller_.confirm_registration(); });
  confirm_->setToolTip(tr("Tunnels of the models' plans guide the tool from then on"));
  pose_images_ = new PoseImages;
  pose_images_->setObjectName("poseImages");
  connect(pose_images_, &PoseImages::chosen, this, &RegisterPage::move_to);
  layout()->addWidget(pose_images_);
  says_ = new QLabel;
  says_->setObjectName("registerSays");
  says_->setWordWrap(true);
  layout()->addWidget(says_);
  models_ = add_table(case_registration::models_table({}), "modelTable");
  place_ =
      add_button(tr("Place the models by hand..."), "placeModels", [this] { controller_.place_models(); });
  place_->setToolTip(
      tr("Shows each model where its search would begin, or in the middle of the images, to be moved before "
         "the first registration"));
  add_hand();
  tunnels_ = add_table(case_registration::tunnels_in_bone_table({}), "modelTunnelTable");
  slices_ = new QLabel;
  slices_->setObjectName("tunnelSlices");
  slices_->setAlignment(Qt::AlignLeft | Qt::AlignTop);
  layout()->addWidget(slices_);
  connect(tunnels_, &QTableWidget::currentCellChanged, this, &RegisterPage::show_slices);
  ct_ = add_button(tr("Slices of the CT..."), "ctSlices",
                   [this] { emit slices_wanted(std::size_t(std::max(0, model_->currentIndex()))); });
  ct_->setToolTip(tr("The chosen model's CT in three directions, with its planned tunnels"));
  in_model_ = add_button(tr("&Landmarks in the model..."), "modelLandmarks",
                         [this] { emit landmarks_wanted(chosen_model()); });
  in_model_->setToolTip(
      tr("Three landmarks of the model that are picked in two X-ray images each start its "
         "registration"));
  connect(models_, &QTableWidget::currentCellChanged, this, [this] { allow_landmarks(controller_.state()); });
  points_ = add_table(case_registration::points_table({}), "modelPointTable");
  measures_ = add_table(case_registration::measures_table({}), "modelMeasureTable");
  static_cast<QVBoxLayout*>(layout())->addStretch();
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
    auto* by = by_[std::size_t(i)] = new PoseBox;
    by->setObjectName((turns ? "turn" : "shift") + axis.toUpper());
    by->setAccessibleName((turns ? tr("Turn about %1, degrees") : tr("Shift along %1, mm")).arg(axis));
    by->setToolTip((turns ? tr("Turns it about its centre and %1 of the world (calibrator's or cameras')")
                          : tr("Moves it along %1 of the world (calibrator's or cameras')"))
                       .arg(axis));
    by->setPrefix(axis + " ");
    by->setSuffix(turns ? tr(" °") : tr(" mm"));
    by->setRange(-180, 180);
    by->setSingleStep(0.5);
    by->setDecimals(2);
    by->setKeyboardTracking(false);
    grid->addWidget(by, 1 + i / 3, i % 3);
    connect(by, &PoseBox::valueChanged, this,
            [this, field = std::size_t(i)](double value) { nudge(field, value); });
  }
  connect(model_, &QComboBox::currentIndexChanged, this, [this] {
    choose();
    show_pose_images(controller_.state());
    emit held_changed();
  });
  layout()->addWidget(hand_);
  from_here_ =
      add_button(tr("Register from here"), "registerFromHere", [this] { controller_.register_models(); });
  from_here_->setToolTip(tr("Starts the search from the model's present pose"));
  grid->addWidget(from_here_, 0, 1, 1, 2);
}

std::optional<std::size_t> RegisterPage::movable() const {
  if (!hand_->isEnabled() || model_->currentIndex() < 0) return {};
  return std::size_t(model_->currentIndex());
}

namespace {

constexpr double deg = EIGEN_PI / 180;

/// The field's value of a step: shifts in mm, then turns in degrees.
double field_of(const registration::RigidStep& step, std::size_t field) {
  return field < 3 ? step[Eigen::Index(field + 3)] : step[Eigen::Index(field - 3)] / deg;
}

}  // namespace

void RegisterPage::choose() {
  if (model_->currentIndex() < 0) return;
  controller_.nudge(std::size_t(model_->currentIndex()), registration::RigidStep::Zero());
  show_hand(controller_.state());  // also where nothing has moved
}

namespace {

/// From the registered pose to that of an image.
registration::RigidStep step_to(const registration::Registration& found, std::size_t pose) {
  if (pose == 0) return registration::RigidStep::Zero();
  return registration::step_about(found.world_from_model, found.alternatives.at(pose - 1).world_from_model,
                                  found.centre);
}

}  // namespace

void RegisterPage::move_to(std::size_t pose) {
  if (!shown_ || model_->currentIndex() < 0) return;
  const auto model = std::size_t(model_->currentIndex());
  controller_.nudge(model, step_to(shown_->models.at(model).registration, pose));
  show_pose_images(controller_.state());  // also where nothing has moved
}

void RegisterPage::show_pose_images(const ApplicationState& state) {
  const auto model = std::size_t(std::max(0, model_->currentIndex()));
  pose_images_->show_model(state.registration, model);
  if (!state.registration || model >= state.registration->models.size()) return;
  const bool is_moved = state.nudged && state.nudged->model == model;
  const registration::Registration& found = state.registration->models[model].registration;
  std::optional<std::size_t> displayed;
  for (std::size_t pose = 0; pose <= found.alternatives.size(); ++pose)
    if (is_moved ? state.nudged->step == step_to(found, pose) : pose == 0) displayed = pose;
  pose_images_->mark(displayed);
}

void RegisterPage::nudge(std::size_t field, double value) {
  if (model_->currentIndex() < 0) return;
  const auto model = std::size_t(model_->currentIndex());
  const auto& nudged = controller_.state().nudged;
  registration::RigidStep step =
      nudged && nudged->model == model ? nudged->step : registration::RigidStep::Zero();
  if (field < 3)
    step[Eigen::Index(field + 3)] = value;
  else
    step[Eigen::Index(field - 3)] = value * deg;
  controller_.nudge(model, step);
}

/// The fields follow a model that is dragged, and undo.
void RegisterPage::show_hand(const ApplicationState& state) {
  if (state.nudged && int(state.nudged->model) < model_->count()) {
    const QSignalBlocker quiet(model_);
    model_->setCurrentIndex(int(state.nudged->model));
  }
  const auto chosen = std::size_t(std::max(0, model_->currentIndex()));
  const bool has_shape = shown_ && chosen < shown_->models.size() && shown_->models[chosen].model;
  for (std::size_t field = 0; field < by_.size(); ++field) {
    const double value = state.nudged ? field_of(state.nudged->step, field) : 0;
    const QSignalBlocker quiet(by_[field]);
    by_[field]->setEnabled(has_shape);
    if (std::abs(value - by_[field]->value()) > 0.005) by_[field]->setValue(value);
  }
}

void RegisterPage::show_state(const ApplicationState& state) {
  const bool can =
      can_register(state) && !state.busy && !state.is_replayed && stale(state, Phase::calibrate).isEmpty();
  register_->setEnabled(can);
  const bool can_move = can && movable_models(state);
  hand_->setEnabled(can_move);
  hand_->setToolTip(can_move || !can ? QString()
                                     : tr("No model is displayed yet: register the models, or place them by "
                                          "hand"));
  place_->setVisible(!state.is_replayed && state.has_models && !movable_models(state));
  place_->setEnabled(can);
  confirm_->setVisible(is_operation(state) && state.has_models);
  confirm_->setEnabled(can && awaits_confirmation(state) && !state.nudged);
  from_here_->setEnabled(can && has_poses_by_hand(state));
  const std::size_t chosen = std::size_t(std::max(0, model_->currentIndex()));
  ct_->setEnabled(state.registration && chosen < state.models.size() && state.models[chosen].volume);
  says_->setText(with_landmark_words(words_of(state), state));
  std::vector<RegisteredModel> models = listed_models(state);
  models_->fill(table_of_models(state, models));
  points_->fill(case_registration::points_table(models));
  const report::Table measures = case_registration::measures_table(models);
  measures_->fill(measures);
  measures_->setVisible(!measures.rows.empty());
  tunnels_->fill(case_registration::tunnels_in_bone_table(models));
  listed_ = std::move(models);
  drawn_.first = -1;
  show_slices();
  list_models(state);
  show_hand(state);
  allow_landmarks(state);
  show_pose_images(state);
  pose_images_->setEnabled(hand_->isEnabled());
}

std::size_t RegisterPage::chosen_model() const {
  const int chosen = model_->count() > 0 ? model_->currentIndex() : models_->currentRow();
  return std::size_t(std::max(0, chosen));
}

void RegisterPage::allow_landmarks(const ApplicationState& state) {
  const std::size_t model = chosen_model();
  const bool is_own_case = state.source == Source::files && !state.is_replayed;
  in_model_->setEnabled(is_own_case && model < state.models.size() &&
                        (state.models[model].volume || state.models[model].surface));
}

void RegisterPage::list_models(const ApplicationState& state) {
  if (shown_ == movable_models(state)) return;
  shown_ = movable_models(state);
  QStringList names, listed;
  if (shown_)
    for (const RegisteredModel& model : shown_->models) names << text(model.registration.name);
  for (int i = 0; i < model_->count(); ++i) listed << model_->itemText(i);
  if (names == listed) return;
  const QSignalBlocker quiet(model_);
  const int chosen = model_->currentIndex();
  model_->clear();
  model_->addItems(names);
  model_->setCurrentIndex(std::clamp(chosen, std::min(0, model_->count() - 1), model_->count() - 1));
}

void RegisterPage::resizeEvent(QResizeEvent* event) {
  Page::resizeEvent(event);
  show_slices();
}

void RegisterPage::show_slices() {
  int row = std::max(0, tunnels_->currentRow());
  // Slices that grow by a scroll bar's width would bring it back.
  constexpr int least_gain_px = 40;
  const int gain_px = width() - drawn_.second;
  if (row == drawn_.first && gain_px >= 0 && gain_px < least_gain_px) return;
  drawn_ = {row, width()};
  slices_->hide();
  for (const RegisteredModel& model : listed_)
    for (std::size_t i = 0; i < std::min(model.tunnels.size(), model.bone_checks.size()); ++i)
      if (model.bone_checks[i] && row-- == 0 && i < model.tunnel_slices.size() && model.tunnel_slices[i]) {
        const std::string png =
            case_registration::tunnel_slices_png(*model.tunnel_slices[i], *model.bone_checks[i]);
        QPixmap pixels;
        pixels.loadFromData(reinterpret_cast<const uchar*>(png.data()), uint(png.size()));
        const int width = std::min(pixels.width(), std::max(120, this->width() - 24));
        slices_->setPixmap(pixels.scaledToWidth(width, Qt::SmoothTransformation));
        slices_->setAccessibleName(tr("Slices of the CT with tunnel %1").arg(text(model.tunnels[i].name)));
        slices_->setToolTip(
            tr("Tunnel %1 in the CT: along it through the thinnest place of the bone beside "
               "it (cross), along it at a right angle to that, and across it there. Blue: the "
               "bone's surface; the walls are red where they may leave the bone, yellow where "
               "it is thinner than planned.")
                .arg(text(model.tunnels[i].name)));
        slices_->show();
        return;
      }
}

QString RegisterPage::words_of(const ApplicationState& state) const {
  if (state.busy == Phase::registration) return text(state.doing);
  if (const QString all = stale(state, Phase::calibrate); !all.isEmpty()) return all + ".";
  const auto refusal = state.refusals.find(Phase::registration);
  const bool is_ended = refusal != state.refusals.end() && is_cancelled(refusal->first, refusal->second);
  if (refusal != state.refusals.end() && !is_ended) return sentence_of(refusal->second);
  if (!state.has_models)
    return is_operation(state)
               ? tr("This operation has no models: name a CT volume or a surface under \"models\" in its "
                    "plan.")
               : tr("This case has no models: name a CT volume or a surface under \"models\" in case.json.");
  if (state.measured && state.result->failure)
    return tr("The measurement is refused (%1): no model is registered to it.")
        .arg(text(std::string(code(state.result->failure->reason))));
  if (const QString changed = stale(state, Phase::registration); !changed.isEmpty())
    return state.nudged
               ? tr("%1. Press \"Register from here\" to register it at this pose, or set all fields "
                    "to 0 for the registered one.")
                     .arg(changed)
               : changed + ".";
  const QString ended = is_ended ? tr("The registration was cancelled. ") : QString();
  QString guides;
  if (awaits_confirmation(state))
    guides =
        tr("Compare the outlines with the bones in every view: no tunnel of these models guides the tool "
           "before you confirm.\n");
  if (state.is_replayed && state.registration)
    guides = state.is_confirmed
                 ? tr("Recorded, and confirmed: the tunnels of these models guided the tool.\n")
                 : tr("Recorded: at this moment no person had confirmed the outlines.\n");
  else if (state.is_confirmed)
    guides = tr("Confirmed: the tunnels of these models guide the tool (Alt+5).\n");
  if (state.registration) return ended + guides + reasons_of(state);
  if (state.is_replayed) return ended + tr("No model is registered at this moment of the record.");
  if (has_old_starts(state))
    return ended +
           tr("No model is registered yet. Landmarks or picks have changed since the models were displayed: "
              "those placed by hand start there; another one may start elsewhere than it is displayed.");
  if (state.at_starts)
    return ended +
           tr("No model is registered yet. Each is displayed where its search would begin: move it in the "
              "images, in the scene or with the fields until its outline follows the bone's edges in every "
              "view, then press \"Register from here\".");
  return ended + tr("No model is registered yet.");
}

}  // namespace helicarm::gui
