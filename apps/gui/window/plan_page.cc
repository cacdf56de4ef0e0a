// SPDX-License-Identifier: Apache-2.0
#include <QHBoxLayout>
#include <QHeaderView>
#include <QKeyEvent>
#include <QLineEdit>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/controller/model_landmarks.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/controller/unsaved_changes.h"
#include "gui/window/page_parts.h"
#include "gui/window/pages.h"
#include "gui/window/plan_tables.h"

namespace helicarm::gui {

PlanPage::PlanPage(Controller& controller, QWidget* parent)
    : Page(tr("Click each tunnel end in two X-ray images; the dashed line is the epipolar line of its click "
              "in the "
              "other one."),
           controller, parent) {
  next_ = new QLabel;
  next_->setObjectName("nextPick");
  next_->setWordWrap(true);
  next_->setProperty("class", "attention");
  next_->setAlignment(Qt::AlignLeft | Qt::AlignTop);
  layout()->addWidget(next_);
  ends_ = add_table(ends_table({}, {}), "endTable");
  for (const auto& [error, shown_at] : {std::pair(3, 1), {11, 2}})  // number and reason first
    ends_->horizontalHeader()->moveSection(error, shown_at);
  connect(ends_, &QTableWidget::itemSelectionChanged, this, [this] {
    const int row = ends_->currentRow();
    chosen_.reset();
    placed_of_chosen_ = 0;
    if (ends_->selectionModel()->hasSelection() && row >= 0 && std::size_t(row) < clickable_)
      chosen_ = ends_->item(row, 0)->text().toStdString();
    tell_next();
    show_snap();
    emit target_changed();
  });
  tunnels_ = add_table(plan_tunnels_table({}), "tunnelTable");
  of_models_ = new QLabel(tr(
      "Tunnels of a model's plan are for looking and for the export here: the tool is guided to them in an "
      "operation whose plan names the models."));
  of_models_->setObjectName("tunnelsOfModels");
  of_models_->setWordWrap(true);
  layout()->addWidget(of_models_);
  auto* clicks = new QHBoxLayout;
  snap_ = new QCheckBox;
  snap_->setObjectName("snap");
  connect(snap_, &QCheckBox::clicked, this, [this](bool on) {
    if (!chosen_)
      snaps_new_ = on;
    else
      controller_.set_snap(*chosen_, on ? pipeline::Snap::ball : pipeline::Snap::none);
  });
  take_ = new QPushButton(tr("Ta&ke click as it is"));
  take_->setObjectName("takeAsClicked");
  take_->setToolTip(tr("For a click that found no ball: the click itself is the pick"));
  connect(take_, &QPushButton::clicked, this, &PlanPage::take_as_clicked);
  clicks->addWidget(snap_, 1);
  clicks->addWidget(take_);
  static_cast<QVBoxLayout*>(layout())->addLayout(clicks);
  auto* row = new QHBoxLayout;
  offered_ =
      add_button(tr("Use the &plan's picks"), "offeredPicks", [this] { controller_.take_offered_picks(); });
  delete_ = add_button(tr("Delete selecte&d end"), "deletePick", [this] { delete_chosen(); });
  delete_->setToolTip(tr("Removes the picks of the end selected in the table (Delete key)"));
  ends_->installEventFilter(this);  // Delete
  clear_ = add_button(tr("&Clear all picks"), "clearPicks", [this] {
    ends_->clearSelection();
    controller_.clear_picks();
  });
  for (QWidget* button : {delete_, clear_}) row->addWidget(button);
  no_tunnels_ = add_button(tr("&Without tunnels: other points only"), "noTunnels",
                           [this] { controller_.leave_out_tunnels(); });
  no_tunnels_->setToolTip(tr("Asks no more for the ends of tunnels of which none is picked"));
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  add_landmark_row();
  unsaved_ = new QLabel;
  unsaved_->setObjectName("unsavedPicks");
  unsaved_->setWordWrap(true);
  layout()->addWidget(unsaved_);
  add_map();
  tell_why_last();
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

namespace {

/// What an end is. Where the drill enters is known of an operation's plan only.
QString kind_of(const ApplicationState& state, const operation::OperationTunnel& tunnel,
                const std::string& end) {
  const QString kind = end == tunnel.start ? PlanPage::tr("start") : PlanPage::tr("end");
  if (state.source == Source::files) return kind;
  const bool enters = (tunnel.enter_at == operation::TunnelEnd::start) == (end == tunnel.start);
  return enters ? PlanPage::tr("%1, where the drill enters").arg(kind)
                : PlanPage::tr("%1, where the drill ends").arg(kind);
}

std::optional<pipeline::BoneLabel> bone_in(const QString& name, int side) {
  if (name.trimmed().isEmpty()) return std::nullopt;
  pipeline::BoneLabel bone{name.trimmed().toStdString()};
  if (side > 0) bone.side = side == 1 ? pipeline::Side::left : pipeline::Side::right;
  return bone;
}

}  // namespace

void PlanPage::add_landmark_row() {
  landmark_row_ = new QWidget;
  auto* row = new QHBoxLayout(landmark_row_);
  row->setContentsMargins(0, 0, 0, 0);
  auto* name = new QLineEdit;
  name->setObjectName("landmarkName");
  name->setPlaceholderText(tr("name of another point"));
  name->setAccessibleName(tr("Name of the landmark"));
  name->setMaxLength(64);
  auto* bone = new QLineEdit;
  bone->setObjectName("landmarkBone");
  bone->setPlaceholderText(tr("bone"));
  bone->setAccessibleName(tr("Bone of the landmark"));
  bone->setMaxLength(64);
  auto* side = new QComboBox;
  side->setObjectName("landmarkSide");
  side->setAccessibleName(tr("Side"));
  side->addItems({tr("side"), tr("left"), tr("right")});
  auto* add = new QPushButton(tr("&Add landmark"));
  add->setObjectName("addLandmark");
  const auto take = [this, name, bone, side] {
    controller_.add_landmark(name->text().trimmed().toStdString(),
                             bone_in(bone->text(), side->currentIndex()));
    choose(name->text().trimmed());
    name->clear();
  };
  connect(add, &QPushButton::clicked, this, take);
  connect(name, &QLineEdit::returnPressed, this, take);
  row->addWidget(name, 3);
  row->addWidget(bone, 2);
  row->addWidget(side);
  row->addWidget(add);
  layout()->addWidget(landmark_row_);
}

bool PlanPage::eventFilter(QObject* watched, QEvent* event) {
  if (event->type() != QEvent::KeyPress || static_cast<QKeyEvent*>(event)->key() != Qt::Key_Delete)
    return Page::eventFilter(watched, event);
  delete_chosen();
  return true;
}

void PlanPage::delete_chosen() {
  if (!chosen_) return;
  const std::string point = *chosen_;
  ends_->clearSelection();
  controller_.erase_picks(point);
}

void PlanPage::add_map() {
  auto* row = new QHBoxLayout;
  auto* map = new QCheckBox(tr("Predicted error (&TRE) in 3-D"));
  map->setObjectName("treMap");
  auto* axis = new QComboBox;
  axis->setObjectName("treAxis");
  axis->setAccessibleName(tr("Axis of the slice"));
  axis->addItems({"x", "y", "z"});
  axis->setCurrentIndex(2);
  axis->setToolTip(tr("The slice is perpendicular to this axis of the calibrator"));
  auto* place = new QSlider(Qt::Horizontal);
  place->setObjectName("trePlace");
  place->setRange(-int(tre_half_mm), int(tre_half_mm));
  place->setAccessibleName(tr("Position of the slice"));
  auto* words = new QLabel;
  for (QWidget* part : std::initializer_list<QWidget*>{map, axis, place, words}) row->addWidget(part);
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  const auto notify = [this, map, axis, place, words] {
    for (QWidget* part : std::initializer_list<QWidget*>{axis, place}) part->setEnabled(map->isChecked());
    words->setText(tr("%1 mm").arg(place->value()));
    emit map_wanted(map->isChecked()
                        ? std::optional(TreCut{SliceAxis(axis->currentIndex()), double(place->value())})
                        : std::nullopt);
  };
  connect(map, &QCheckBox::toggled, this, notify);
  connect(axis, &QComboBox::currentIndexChanged, this, notify);
  connect(place, &QSlider::valueChanged, this, notify);
  notify();
}

/// Of given cameras, whose errors are not known, no error is predicted.
void PlanPage::show_map(const ApplicationState& state) {
  auto* map = findChild<QCheckBox*>("treMap");
  const bool is_known = state.cameras.empty();
  map->setEnabled(is_known);
  map->setToolTip(is_known ? QString() : tr("The errors of the given cameras are not known"));
  if (!is_known) map->setChecked(false);
}

std::optional<WantedPick> PlanPage::target() const {
  const ApplicationState& state = controller_.state();
  if (!chosen_) {
    const auto end = next_pick(state);
    return end ? end : next_landmark(state);
  }
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    if (tunnel.start == *chosen_ || tunnel.end == *chosen_) return wanted_end(tunnel, *chosen_);
  if (std::ranges::find(state.landmarks, *chosen_) != state.landmarks.end())
    return WantedPick{*chosen_, "", {}, {}};
  return std::nullopt;
}

void PlanPage::show_state(const ApplicationState& state) {
  std::vector<PlannedPoint> points;
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    for (const std::string& end : ends_to_pick(tunnel)) points.push_back({end, kind_of(state, tunnel, end)});
  for (const std::string& landmark : state.landmarks) points.push_back({landmark, tr("landmark")});
  clickable_ = points.size();
  for (const auto& [model, out_of_date] : usable_models(state))
    for (const case_registration::RegisteredPoint& point : model->points)
      points.push_back(
          {point.name, tr("plan of %1").arg(text(model->registration.name)), &point, out_of_date});
  if (state.result && stale(state, Phase::calibrate).isEmpty())
    for (const localization::TargetError& target : state.result->accuracy.targets)
      points.push_back({target.name, tr("target, error %1 mm").arg(number(target.error_mm, 3))});
  ends_->fill(ends_table(state, points));
  const auto tunnels = plan_tunnels(state);
  tunnels_->fill(plan_tunnels_table(tunnels));
  tunnels_->setVisible(std::ranges::any_of(tunnels, &PlanTunnelRow::is_of_model));
  of_models_->setVisible(tunnels_->isVisibleTo(this) && !is_operation(state));
  offered_->setVisible(!state.offered_picks.empty());
  show_map(state);
  landmark_row_->setVisible(state.source == Source::files);
  no_tunnels_->setVisible(
      state.source == Source::files &&
      std::ranges::any_of(state.tunnels, [&](const auto& tunnel) { return is_unpicked(state, tunnel); }));
  show_unsaved(state);
  clear_->setEnabled(!state.picks.empty() && controller_.takes_picks());
  show_snap();
  tell_next();
}

void PlanPage::show_unsaved(const ApplicationState& state) {
  const UnsavedChanges changes = unsaved_changes(state);
  QStringList lines;
  if (state.picks_not_kept)
    lines << tr("Changes are not kept in the case: %1").arg(sentence_of(*state.picks_not_kept));
  else if (changes.can_be_saved())
    lines
        << tr("Not in case.json yet: %1. Ctrl+S saves them; they are kept until then.").arg(changes.words());
  lines << changes.not_yet;
  unsaved_->setVisible(!lines.isEmpty());
  unsaved_->setText(lines.join('\n'));
}

/// Landmarks of a model are taken as they are clicked; one that a case snaps may be changed.
void PlanPage::show_snap() {
  const ApplicationState& state = controller_.state();
  const auto next = target();
  snap_->setText(chosen_ ? tr("Snap %1 to a &ball of 3 mm").arg(text(*chosen_))
                         : tr("Snap to a &ball of 3 mm"));
  const auto of_chosen = [&](const pipeline::Pick& pick) { return chosen_ && pick.name == *chosen_; };
  const bool has_picks = std::ranges::any_of(state.picks, of_chosen);
  const bool snaps = std::ranges::any_of(state.picks, [&](const pipeline::Pick& pick) {
    return of_chosen(pick) && pick.snap == pipeline::Snap::ball;
  });
  const bool is_of_model = next && is_landmark_of_model(state, next->point) && !snaps;
  snap_->setChecked(has_picks ? snaps : snaps_new_ && !is_of_model);
  snap_->setEnabled(!is_of_model && (!chosen_ || (has_picks && controller_.takes_picks())));
  snap_->setToolTip(
      is_of_model
          ? tr("%1 is a landmark of a model, where no ball is: its clicks are taken as they are.")
                .arg(text(next->point))
          : tr("A click is refined to the centre of the ball near it; else it is taken as it is. A right "
               "click on a pick in an X-ray image changes that pick alone."));
  take_->setEnabled(controller_.takes_picks() &&
                    std::ranges::any_of(state.failed_picks, [](const FailedPick& failed) {
                      return failed.pick.snap == pipeline::Snap::ball;
                    }));
}

/// The failed pick that the instruction names, else the first one.
void PlanPage::take_as_clicked() {
  const auto failed = controller_.state().failed_picks;
  const auto wanted = target();
  for (const bool any : {false, true})
    for (const FailedPick& one : failed)
      if (one.pick.snap == pipeline::Snap::ball && (any || (wanted && one.pick.name == wanted->point)))
        return controller_.set_snap(one.pick.name, pipeline::Snap::none, one.pick.view);
}

namespace {

/// What is wrong with the first point whose picks do not agree; empty if there is none.
QString contradicting_pick(const ApplicationState& state) {
  if (state.result && stale(state, Phase::calibrate).isEmpty())
    for (const pipeline::PointResult& point : state.result->points) {
      if (point.source != localization::PointSource::pick || is_stale(state, point.name)) continue;
      if (point.reason)
        return QObject::tr("%1 is not located: %2.").arg(text(point.name), sentence_of(*point.reason));
      if (point.rays_miss)
        return QObject::tr("The rays of %1 miss each other by %2 mm.")
            .arg(text(point.name), number(point.ray_gap_mm, 2));
    }
  return {};
}

}  // namespace

void PlanPage::tell_next() {
  delete_->setEnabled(chosen_.has_value() && controller_.takes_picks());
  next_->setMinimumHeight(
      3 * (next_->fontMetrics().lineSpacing() + 2));  // the controls below stay where they are
  next_->setText(next_words());
}

QString PlanPage::next_words() const {
  const ApplicationState& state = controller_.state();
  if (!state.measured)
    return state.refusals.empty()
               ? tr("Acquire the X-ray images first.")
               : tr("No points without a calibration: %1").arg(sentence_of(state.refusals.begin()->second));
  const QString again = tr("Click it again, or take the click as it is.");
  if (chosen_) {
    for (const std::string& view : state.views)
      if (const Failure* failed = failure_of(state, *chosen_, view))
        return tr("%1 is not picked in %2: %3. %4")
            .arg(text(*chosen_), text(view), text(failed->message), again);
    return tr("%1 is selected: click its new position in each X-ray image.").arg(text(*chosen_));
  }
  auto wanted = next_pick(state);
  if (!wanted) wanted = next_landmark(state);
  if (wanted && wanted->failed)
    return tr("%1 is not picked in %2: %3. %4")
        .arg(text(wanted->point), text(wanted->view), text(wanted->failed->message), again);
  for (const operation::OperationTunnel& tunnel : state.tunnels)
    if (wanted && (tunnel.start == wanted->point || tunnel.end == wanted->point))
      return tr("Click %1 in %2: the %3 of the %4's tunnel.")
          .arg(text(wanted->point), text(wanted->view), kind_of(state, tunnel, wanted->point),
               text(tunnel.name));
  if (wanted) return tr("Click %1 in %2.").arg(text(wanted->point), text(wanted->view));
  if (const QString bad = contradicting_pick(state); !bad.isEmpty())
    return tr("%1 Select it in the table and click it again, or undo the click (Ctrl+Z).").arg(bad);
  if (!state.failed_picks.empty()) {
    const FailedPick& failed = state.failed_picks.front();
    return tr("%1 is not picked in %2: %3. %4")
        .arg(text(failed.pick.name), text(failed.pick.view), text(failed.why.message), again);
  }
  if (!state.picks.empty())
    return tr(
        "All points are placed. To move one, drag it, or select it in the table and click it again in each "
        "image; further views make it more accurate.");
  if (state.registration)
    return tr(
        "The points below come from the plans of the models and move with these (Alt+7). To locate another "
        "point, name it below.");
  if (state.has_models && state.is_replayed)
    return tr("No model is registered at this moment of the record: their plans hold the tunnels.");
  if (state.has_models)
    return tr(
        "Register the models first (Alt+7): their plans hold the tunnels. To locate another point, name it "
        "below.");
  return tr("This case has no points: name one below, then click it in two X-ray images.");
}

void PlanPage::choose(const QString& point) {
  for (std::size_t row = 0; row < clickable_; ++row)
    if (ends_->item(int(row), 0)->text() == point)
      ends_->setCurrentCell(int(row), 0, QItemSelectionModel::ClearAndSelect | QItemSelectionModel::Rows);
}

void PlanPage::placed(const std::string& point) {
  if (chosen_ != point || ++placed_of_chosen_ < controller_.state().views.size()) return;
  ends_->clearSelection();
}

}  // namespace helicarm::gui
