// SPDX-License-Identifier: Apache-2.0
// Pages of the planning, navigation and verification steps.
#include <QHBoxLayout>
#include <QHeaderView>
#include <QKeyEvent>
#include <QLineEdit>
#include <QVBoxLayout>
#include <algorithm>

#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/pages.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::gui {

PlanPage::PlanPage(Controller& controller, QWidget* parent)
    : Page(tr("Click each tunnel end in both X-ray images; the dashed line in the second one is its epipolar "
              "line."),
           controller, parent) {
  next_ = new QLabel;
  next_->setObjectName("nextPick");
  next_->setWordWrap(true);
  next_->setStyleSheet("color: #ffc400; font-weight: bold;");
  layout()->addWidget(next_);
  ends_ = add_table(
      {tr("Point"), tr("Is"), tr("Clicked in"), tr("x, y, z mm"), tr("±mm (95 %)"), tr("Ray gap mm")},
      "endTable");
  ends_->horizontalHeaderItem(3)->setToolTip(tr("In the calibrator's frame, at the first view's exposure"));
  ends_->horizontalHeaderItem(4)->setToolTip(tr(
      "Longest semi-axis of the 95 % confidence ellipsoid; of a target its error (TRE) and the 95 % bound"));
  ends_->horizontalHeaderItem(5)->setToolTip(tr("Largest distance between two of the point's rays"));
  connect(ends_, &QTableWidget::itemSelectionChanged, this, [this] {
    const int row = ends_->currentRow();
    chosen_.reset();
    placed_of_chosen_ = 0;
    if (ends_->selectionModel()->hasSelection() && row >= 0)
      chosen_ = ends_->item(row, 0)->text().toStdString();
    tell_next();
    emit target_changed();
  });
  snap_ = new QCheckBox(tr("Snap to a &ball of 3 mm"));
  snap_->setChecked(true);
  layout()->addWidget(snap_);
  auto* row = new QHBoxLayout;
  offered_ =
      add_button(tr("Use the &plan's picks"), "offeredPicks", [this] { controller_.take_offered_picks(); });
  delete_ = add_button(tr("Delete selecte&d end"), "deletePick", [this] { delete_chosen(); });
  delete_->setToolTip(tr("Removes the picks of the end selected in the table (Delete key)"));
  ends_->installEventFilter(this);  // Delete
  auto* clear = add_button(tr("&Clear all picks"), "clearPicks", [this] {
    ends_->clearSelection();
    controller_.clear_picks();
  });
  for (QWidget* button : {offered_, delete_, clear}) row->addWidget(button);
  static_cast<QVBoxLayout*>(layout())->addLayout(row);
  add_landmark_row();
  unsaved_ = new QLabel;
  unsaved_->setObjectName("unsavedPicks");
  unsaved_->setWordWrap(true);
  layout()->addWidget(unsaved_);
  add_map();
}

void PlanPage::add_landmark_row() {
  landmark_row_ = new QWidget;
  auto* row = new QHBoxLayout(landmark_row_);
  row->setContentsMargins(0, 0, 0, 0);
  auto* name = new QLineEdit;
  name->setObjectName("landmarkName");
  name->setPlaceholderText(tr("name of another point"));
  name->setAccessibleName(tr("Name of the landmark"));
  name->setMaxLength(64);
  auto* add = new QPushButton(tr("&Add landmark"));
  add->setObjectName("addLandmark");
  const auto take = [this, name] {
    controller_.add_landmark(name->text().trimmed().toStdString());
    for (int i = 0; i < ends_->rowCount(); ++i)
      if (ends_->item(i, 0)->text() == name->text().trimmed())
        ends_->setCurrentCell(i, 0, QItemSelectionModel::ClearAndSelect | QItemSelectionModel::Rows);
    name->clear();
  };
  connect(add, &QPushButton::clicked, this, take);
  connect(name, &QLineEdit::returnPressed, this, take);
  row->addWidget(name, 1);
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

std::optional<WantedPick> PlanPage::target() const {
  const ApplicationState& state = controller_.state();
  if (!chosen_) {
    const auto end = next_pick(state);
    return end ? end : next_landmark(state);
  }
  for (const operation::PlannedTunnel& tunnel : state.tunnels)
    if (tunnel.start == *chosen_ || tunnel.end == *chosen_) return WantedPick{*chosen_, "", tunnel.bone};
  if (std::ranges::find(state.landmarks, *chosen_) != state.landmarks.end())
    return WantedPick{*chosen_, "", {}};
  return std::nullopt;
}

namespace {

/// Columns of a point: where it is clicked, its place, 95 % error and ray gap, or why it is not located.
QStringList columns_of(const ApplicationState& state, const std::string& name, const QString& kind) {
  QStringList in;
  for (const std::string& view : state.views)
    if (pick_of(state, name, view) != nullptr) in << text(view);
  QString place, within, gap;
  if (state.result)
    for (const pipeline::PointResult& point : state.result->points) {
      if (point.name != name) continue;
      if (point.reason) within = sentence_of(*point.reason);
      if (!point.place) continue;
      const Eigen::Vector3d& at = point.place->in_calibrator;
      place = QString("%1, %2, %3").arg(number(at.x(), 2), number(at.y(), 2), number(at.z(), 2));
      within = number(localization::length_at_95(point.place->covariance_in_calibrator), 2);
      gap = number(point.ray_gap_mm, 2);
    }
  return {text(name), kind, in.join(", "), place, within, gap};
}

}  // namespace

void PlanPage::show_state(const ApplicationState& state) {
  std::vector<QStringList> rows;
  for (const operation::PlannedTunnel& tunnel : state.tunnels)
    for (const std::string& end : {tunnel.start, tunnel.end}) {
      const bool enters = (tunnel.enter_at == operation::TunnelEnd::start) == (end == tunnel.start);
      rows.push_back(columns_of(state, end, enters ? tr("enters") : tr("ends")));
    }
  for (const std::string& landmark : state.landmarks)
    rows.push_back(columns_of(state, landmark, tr("landmark")));
  if (state.result)
    for (const localization::TargetError& target : state.result->accuracy.targets) {
      rows.push_back(columns_of(state, target.name, tr("target")));
      rows.back()[4] =
          tr("error %1 of %2").arg(number(target.error_mm, 3), number(target.predicted_95_mm, 3));
    }
  fill(ends_, rows);
  offered_->setVisible(!state.offered_picks.empty());
  landmark_row_->setVisible(state.source == Source::files);
  unsaved_->setVisible(state.has_unsaved_picks || state.picks_not_kept);
  unsaved_->setText(
      state.picks_not_kept
          ? tr("The picks are not kept in the case: %1").arg(sentence_of(*state.picks_not_kept))
          : tr("These picks are not in case.json yet: Ctrl+S saves them. They are kept until then."));
  tell_next();
}

void PlanPage::tell_next() {
  const ApplicationState& state = controller_.state();
  delete_->setEnabled(chosen_.has_value() && controller_.takes_picks());
  if (!state.measured) return next_->setText(tr("Acquire the X-ray images first."));
  if (chosen_)
    return next_->setText(
        tr("%1 is selected: click its new position in each X-ray image.").arg(text(*chosen_)));
  const auto wanted = next_pick(state);
  if (const auto landmark = next_landmark(state); !wanted && landmark)
    return next_->setText(tr("Click %1 in %2.").arg(text(landmark->point), text(landmark->view)));
  if (!wanted)
    return next_->setText(tr(
        "All points are placed. To move one, drag it, or select it in the table and click its new position "
        "in both X-ray images."));
  for (const operation::PlannedTunnel& tunnel : state.tunnels)
    if (tunnel.start == wanted->point || tunnel.end == wanted->point) {
      const bool enters = (tunnel.enter_at == operation::TunnelEnd::start) == (wanted->point == tunnel.start);
      next_->setText((enters ? tr("Click %1 in %2: where the drill enters the %3.")
                             : tr("Click %1 in %2: where the drill ends in the %3."))
                         .arg(text(wanted->point), text(wanted->view), text(tunnel.name)));
    }
}

void PlanPage::placed(const std::string& point) {
  if (chosen_ != point || ++placed_of_chosen_ < controller_.state().views.size()) return;
  ends_->clearSelection();
}

NavigatePage::NavigatePage(Controller& controller, QWidget* parent)
    : Page(tr("Nothing moves unless you hold a yellow button until it is full. The space bar stops the "
              "robot."),
           controller, parent) {
  says_ = new QLabel;
  says_->setObjectName("robotSays");
  says_->setWordWrap(true);
  layout()->addWidget(says_);
  unlock_ = add_hold(tr("1  &Unlock the robot (only when no person is near it)"), "unlock",
                     [this] { controller_.unlock("the person at the screen"); });
  register_ = add_hold(tr("2  &Register the robot (about twelve small moves)"), "register",
                       [this] { controller_.register_robot(); });
  tour_ = new QLabel;
  tour_->setWordWrap(true);
  tour_->hide();
  layout()->addWidget(tour_);
  tunnel_ = new QComboBox;
  tunnel_->setObjectName("tunnel");
  tunnel_->setAccessibleName(tr("Tunnel"));
  layout()->addWidget(tunnel_);
  connect(tunnel_, &QComboBox::currentTextChanged, this,
          [this](const QString& name) { controller_.follow(name.toStdString()); });
  plan_ = add_button(tr("3  &Plan the approach path and show it in both images"), "planWay",
                     [this] { controller_.plan_tunnel(tunnel_->currentText().toStdString()); });
  go_ = add_hold(tr("4  &Move to the tunnel"), "go", [this] { controller_.go(); });
  withdraw_ = add_hold(tr("5  With&draw the tool"), "withdraw", [this] { controller_.withdraw(); });
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void NavigatePage::show_state(const ApplicationState& state) {
  QStringList names;
  for (const operation::PlannedTunnel& tunnel : state.tunnels) names << text(tunnel.name);
  QStringList shown;
  for (int i = 0; i < tunnel_->count(); ++i) shown << tunnel_->itemText(i);
  if (names != shown) {
    tunnel_->clear();
    tunnel_->addItems(names);
  }
  tour_->setText(state.tour);
  tour_->setVisible(!state.tour.isEmpty() && !state.hand_eye_rms_mm);
  allow();
}

void NavigatePage::show_live(const LiveState& live) {
  if (phase_ == live.robot.phase && !live.robot.why) return;
  phase_ = live.robot.phase;
  why_ = live.robot.why;
  allow();
}

QString NavigatePage::next_step() const {
  const ApplicationState& state = controller_.state();
  if (state.source == Source::files || state.source == Source::none)
    return tr("Images from files: no robot is connected.");
  if (state.busy) return text(state.doing);
  const QString why = why_ ? sentence_of(*why_) + ". " : QString();
  switch (phase_) {
    case robot::LinkPhase::disconnected:
      return why + tr("Check the robot's power and cable; the connection is retried.");
    case robot::LinkPhase::idle:
      return tr("The robot is locked. Hold button 1 when no person is near it.");
    case robot::LinkPhase::stopped:
      return why + tr("The robot stays stopped until you have checked it and hold button 1.");
    case robot::LinkPhase::starting:
    case robot::LinkPhase::moving:
      return tr("The robot moves.");
    case robot::LinkPhase::ready:
      break;
  }
  if (state.tool_is_out) return tr("The tool is at a tunnel: hold button 5 to withdraw it first.");
  if (state.order) return tr("Inspect the path in both X-ray images, then hold button 4.");
  if (!state.measured) return tr("Acquire the X-ray images first (Alt+1).");
  if (!state.hand_eye_rms_mm) return tr("Hold button 2 to register the robot.");
  if (next_pick(state)) return tr("Place the tunnels' ends first (Alt+4).");
  if (const auto refusal = state.refusals.find(Phase::plan); refusal != state.refusals.end())
    return sentence_of(refusal->second) + tr(". Pick its ends again (Alt+4).");
  if (const auto refusal = state.refusals.find(Phase::navigate);
      refusal != state.refusals.end() && refusal->second.reason == Reason::plan_stale)
    return sentence_of(refusal->second) +
           tr(". The robot will not be moved along this path: plan it again with button 3.");
  return tr("Select a tunnel and plan its path with button 3.");
}

void NavigatePage::allow() {
  const ApplicationState& state = controller_.state();
  const bool free = !state.busy && state.source != Source::files && state.source != Source::none;
  const bool ready = free && phase_ == robot::LinkPhase::ready;
  const bool placed = state.measured && !next_pick(state) && !state.refusals.contains(Phase::plan);
  says_->setText(next_step());
  unlock_->setEnabled(free && (phase_ == robot::LinkPhase::idle || phase_ == robot::LinkPhase::stopped));
  register_->setEnabled(ready && !state.tool_is_out);
  plan_->setEnabled(ready && placed && state.hand_eye_rms_mm && !state.tool_is_out);
  go_->setEnabled(ready && state.order.has_value());
  withdraw_->setEnabled(ready && state.tool_is_out);
}

VerifyPage::VerifyPage(Controller& controller, QWidget* parent)
    : Page(tr("Error: distance of each tunnel end from the tool's axis by tracker and X-ray images, mm, with "
              "its predicted value. From the X-ray images alone: Eq. 17 in px and mm, and the distance in "
              "space, mm."),
           controller, parent) {
  table_ = add_table({tr("Tunnel, end"), tr("Error"), tr("Predicted"), tr("px"), tr("mm"), tr("Space")},
                     "outcomeTable");
  add_button(tr("&Export report, CSV, JSON and other formats..."), "export",
             [this] { emit report_wanted(); });
}

void VerifyPage::show_state(const ApplicationState& state) {
  std::vector<QStringList> rows;
  for (const auto& [name, outcome] : state.outcomes)
    for (const auto& [end, miss, in_xrays] :
         {std::tuple(tr("start"), &outcome.start, &verification::Verification::start),
          std::tuple(tr("end"), &outcome.end, &verification::Verification::end)}) {
      QStringList row{QString("%1, %2").arg(text(name), end), number(miss->distance_mm(), 2),
                      number(miss->predicted_mm(), 2)};
      if (outcome.verification)
        if (const auto& seen = (*outcome.verification).*in_xrays)
          row << number(seen->combined_px, 2) << number(seen->combined_mm, 2) << number(seen->distance_mm, 2);
      rows.push_back(row);
    }
  if (rows.empty() && state.result)
    for (const verification::Verification& line : state.result->verifications)
      for (const auto& [end, seen] : {std::pair(tr("start"), &line.start), {tr("end"), &line.end}})
        if (*seen)
          rows.push_back({QString("%1, %2").arg(text(line.name), end),
                          {},
                          {},
                          number((*seen)->combined_px, 2),
                          number((*seen)->combined_mm, 2),
                          number((*seen)->distance_mm, 2)});
  fill(table_, rows);
}

}  // namespace helicarm::gui
