// SPDX-License-Identifier: Apache-2.0
// Pages of the navigation and verification steps.
#include <QDesktopServices>
#include <QHBoxLayout>
#include <QHeaderView>
#include <QUrl>
#include <QVBoxLayout>
#include <algorithm>
#include <cmath>

#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/pages.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {

NavigatePage::NavigatePage(Controller& controller, QWidget* parent) : Page({}, controller, parent) {
  says_ = new QLabel;
  says_->setObjectName("robotSays");
  says_->setWordWrap(true);
  says_->setAlignment(Qt::AlignLeft | Qt::AlignTop);
  layout()->addWidget(says_);
  unlock_ = add_hold(tr("1  &Unlock the robot (only when no person is near it)"), "unlock",
                     [this] { controller_.unlock("the person at the screen", shown_); });
  register_ = add_hold(tr("2  &Register the robot (small moves, listed above)"), "register",
                       [this] { controller_.register_robot(); });
  tunnel_ = new QComboBox;
  tunnel_->setObjectName("tunnel");
  tunnel_->setAccessibleName(tr("Tunnel"));
  layout()->addWidget(tunnel_);
  connect(tunnel_, &QComboBox::currentTextChanged, this, [this](const QString& name) {
    controller_.follow(name.toStdString());
    allow();
  });
  plan_ = add_button(tr("3  &Plan the path and show it in both images"), "planWay",
                     [this] { controller_.plan_order(tunnel_->currentText().toStdString()); });
  go_ = add_hold(tr("4  &Move to the tunnel"), "go", [this] { controller_.go(); });
  withdraw_ = add_hold(tr("5  With&draw the tool"), "withdraw", [this] { controller_.withdraw(); });
  auto* ends = new QHBoxLayout;  // in one row: on a small screen all buttons are in sight
  for (QWidget* button : {go_, withdraw_}) ends->addWidget(button, 1);
  static_cast<QVBoxLayout*>(layout())->addLayout(ends);
  add_drill();
  for (HoldButton* button : {unlock_, register_, go_, withdraw_})
    connect(button, &HoldButton::released, this, &NavigatePage::tell);
  tell_why_last();  // the buttons stay where they are
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void NavigatePage::add_drill() {
  target_ = new DrillTarget;
  target_->setObjectName("drillTarget");
  layout()->addWidget(target_);
  guide_ = add_button(tr("&Guide the drill to the tunnel"), "guideDrill",
                      [this] { controller_.guide_drill(tunnel_->currentText().toStdString()); });
  verify_ = add_button(tr("The drill is in the drilled tunnel: &verify it"), "verifyDrilled",
                       [this] { controller_.verify_drilled(); });
  verify_->setToolTip(tr("Hold the drill still in the tunnel meanwhile"));
  end_ = add_button(tr("&End the guidance"), "endGuidance", [this] { controller_.end_guidance(); });
}

void NavigatePage::show_state(const ApplicationState& state) {
  findChild<QLabel*>("lead")->setText(
      state.drill
          ? tr("Shows a drill in the hand against its tunnel, at the bone's present pose.")
          : tr("Nothing moves unless you hold a yellow button until it is full; one hold starts all its "
               "moves. Space bar: stop."));
  QStringList names;
  for (const operation::OperationTunnel& tunnel : state.tunnels) names << text(tunnel.name);
  QStringList shown;
  for (int i = 0; i < tunnel_->count(); ++i) shown << tunnel_->itemText(i);
  if (names != shown) {
    tunnel_->clear();
    tunnel_->addItems(names);
  }
  allow();
}

void NavigatePage::show_live(const LiveState& live) {
  if (controller_.state().is_replayed) tunnel_->setCurrentText(live.tunnel);
  if (const auto& drill = controller_.state().drill) return target_->show_guidance(live.drill, *drill);
  if (!is_held()) shown_ = live.robot;  // its words stay while a button is held
  const auto coarse = [](const std::optional<operation::TunnelAim>& aim) {
    return aim ? std::round(10 * aim->distance_mm) : -1;
  };
  std::optional<operation::TunnelAim> aim;
  if (live.aim && *live.aim) aim = **live.aim;
  const bool is_off = controller_.state().tool_is_out && !controller_.state().has_arrived;
  if (phase_ == live.robot.phase && !live.robot.why && !(is_off && coarse(aim) != coarse(aim_))) return;
  aim_ = aim;
  phase_ = live.robot.phase;
  why_ = live.robot.why;
  allow();
}

QString NavigatePage::where_the_tool_is() const {
  const ApplicationState& state = controller_.state();
  const QString tunnel = text(state.bound_for);
  if (state.has_arrived)
    return tr("The tool is at the tunnel %1: hold button 5 to withdraw it first.").arg(tunnel);
  const QString off = aim_ ? tr(", %1 mm off its axis").arg(aim_->distance_mm, 0, 'f', 1) : QString();
  return tr("The tool stopped on its way to %1%2 (path in the X-ray images): withdraw it with button 5.")
      .arg(tunnel, off);
}

const operation::OperationTunnel* NavigatePage::chosen() const {
  const auto& tunnels = controller_.state().tunnels;
  const auto tunnel =
      std::ranges::find(tunnels, tunnel_->currentText().toStdString(), &operation::OperationTunnel::name);
  return tunnel == tunnels.end() ? nullptr : &*tunnel;
}

QString NavigatePage::next_by_hand() const {
  const ApplicationState& state = controller_.state();
  const auto refusal = state.refusals.find(Phase::navigate);
  const QString refused = refusal == state.refusals.end() ? QString() : sentence_of(refusal->second) + ". ";
  if (state.busy == Phase::navigate)
    return refused +
           tr("Bring the drill to the middle and drill while it is on target. At the tunnel's end hold "
              "it still and verify it.");
  if (state.busy) return text(state.doing);
  if (!state.measured) return tr("Acquire the X-ray images first (Alt+1).");
  if (const QString lacks = what_lacks(); !lacks.isEmpty()) return lacks;
  return refused + tr("Select a tunnel and begin the guidance.");
}

/// Before a path to the chosen tunnel, or guidance.
QString NavigatePage::what_lacks() const {
  const ApplicationState& state = controller_.state();
  if (next_pick(state)) return tr("Place the tunnels' ends first (Alt+4).");
  if (const auto* tunnel = chosen(); tunnel && !may_guide(state, *tunnel))
    return state.nudged ? tr("A model is moved by hand: register it there, or set its fields to 0 (Alt+7).")
                        : tr("Register the models and confirm their outlines first (Alt+7).");
  if (const auto refusal = state.refusals.find(Phase::plan); refusal != state.refusals.end())
    return sentence_of(refusal->second) + tr(". Pick its ends again (Alt+4).");
  return {};
}

QString NavigatePage::next_step() const {
  const ApplicationState& state = controller_.state();
  if (state.is_replayed)
    return tr(
        "A moment of a recorded operation: what is recorded is shown, nothing else is done. The "
        "outcomes are on Verify (Alt+6).");
  if (!is_operation(state))
    return state.registration ? tr("Images from files: no robot is connected. Export the tunnels (Alt+6), or "
                                   "connect the devices of a plan that names the models.")
                              : tr("Images from files: no robot is connected.");
  if (state.drill) return next_by_hand();
  if (state.busy) return text(state.doing);
  const QString why = why_ ? sentence_of(*why_) + ". " : QString();
  switch (phase_) {
    case robot::LinkPhase::disconnected:
      return why + tr("Check the robot's power and cable; the connection is retried.");
    case robot::LinkPhase::idle:
      return tr("The robot is locked. Hold button 1 when no person is near it.");
    case robot::LinkPhase::stopped:
      return why + tr("Check the robot, then hold button 1.") +
             (state.tool_is_out ? " " + where_the_tool_is() : QString());
    case robot::LinkPhase::starting:
    case robot::LinkPhase::moving:
      return tr("The robot moves.");
    case robot::LinkPhase::ready:
      break;
  }
  if (state.tool_is_out) return where_the_tool_is();
  if (state.order) return tr("Inspect the path in both X-ray images, then hold button 4. %1").arg(state.way);
  if (!state.measured) return tr("Acquire the X-ray images first (Alt+1).");
  if (!state.hand_eye_rms_mm) return tr("Hold button 2 to register the robot. %1").arg(state.tour);
  if (const QString lacks = what_lacks(); !lacks.isEmpty()) return lacks;
  if (const auto refusal = state.refusals.find(Phase::navigate);
      refusal != state.refusals.end() && refusal->second.reason == Reason::plan_stale)
    return sentence_of(refusal->second) +
           tr(". The robot will not be moved along this path: plan it again with button 3.");
  return tr("Select a tunnel and plan its path with button 3.");
}

void NavigatePage::allow() {
  const ApplicationState& state = controller_.state();
  const bool free = !state.busy && is_operation(state);
  const bool ready = free && phase_ == robot::LinkPhase::ready;
  const bool placed = state.measured && chosen() && what_lacks().isEmpty();
  tell();
  unlock_->setEnabled(free && (phase_ == robot::LinkPhase::idle || phase_ == robot::LinkPhase::stopped));
  register_->setEnabled(ready && !state.tool_is_out);
  plan_->setEnabled(ready && placed && state.hand_eye_rms_mm && !state.tool_is_out);
  go_->setEnabled(ready && state.order.has_value());
  withdraw_->setEnabled(ready && state.tool_is_out);
  for (QWidget* of_robot : std::initializer_list<QWidget*>{unlock_, register_, plan_, go_, withdraw_})
    of_robot->setVisible(!state.drill);
  target_->setVisible(state.drill.has_value());
  for (QWidget* of_hand : std::initializer_list<QWidget*>{guide_, verify_, end_})
    of_hand->setVisible(state.drill && !state.is_replayed);
  const bool is_guided = state.drill && state.busy == Phase::navigate;
  guide_->setEnabled(free && placed);
  verify_->setEnabled(is_guided);
  end_->setEnabled(is_guided);
  tunnel_->setEnabled(!is_guided && !state.is_replayed);
}

bool NavigatePage::is_held() const {
  return std::ranges::any_of(std::initializer_list<const HoldButton*>{unlock_, register_, go_, withdraw_},
                             &HoldButton::is_held);
}

/// Not under the finger: a longer text would move the button that is held.
void NavigatePage::tell() {
  says_->setMinimumHeight(4 *
                          (says_->fontMetrics().lineSpacing() + 2));  // the buttons below stay where they are
  if (!is_held()) says_->setText(next_step());
}

namespace {

QString depth_words(const std::string& tunnel, const guidance::TipDepth& depth) {
  if (const auto off = depth.why_off(tunnel)) return sentence_of(*off);
  return VerifyPage::tr("%1: the drill's tip is %2, tolerance %3 mm")
      .arg(text(tunnel), text(guidance::words_of(depth)))
      .arg(depth.tolerance_mm);
}

}  // namespace

VerifyPage::VerifyPage(Controller& controller, QWidget* parent)
    : Page(tr("Error: distance of each tunnel end from the tool's axis by tracker and X-ray images, mm, with "
              "its predicted value. From the X-ray images alone: Eq. 17 in px and mm, and the distance in "
              "space, mm."),
           controller, parent) {
  add_button(tr("&Export report, CSV, JSON and other formats..."), "export",
             [this] { emit report_wanted(); });
  for (QLabel** label : {&depths_, &lacks_, &exported_}) {
    *label = new QLabel;
    (*label)->setWordWrap(true);
    layout()->addWidget(*label);
  }
  depths_->setObjectName("depths");
  lacks_->setObjectName("exportLacks");
  lacks_->setProperty("class", "attention");
  exported_->setObjectName("exportedTo");
  exported_->setTextFormat(Qt::RichText);
  connect(exported_, &QLabel::linkActivated, this,
          [](const QString& folder) { QDesktopServices::openUrl(QUrl::fromLocalFile(folder)); });
  table_ = add_table(report::verification_table({}), "outcomeTable");
  const int depth = table_->columnCount() - 1;
  table_->horizontalHeader()->moveSection(depth, 2);  // before what may not fit
  static_cast<QVBoxLayout*>(layout())->addStretch();
}

void VerifyPage::show_state(const ApplicationState& state) {
  std::vector<report::ToolAtEnd> tools;
  QStringList depths;
  const auto outcomes = stale(state, Phase::verify).isEmpty() ? state.outcomes : decltype(state.outcomes)();
  for (const auto& [name, outcome] : outcomes) {
    for (const auto& [end, miss, in_images] :
         {std::tuple("start", &outcome.start, &guidance::Verification::start),
          std::tuple("end", &outcome.end, &guidance::Verification::end)})
      tools.push_back({name, end, miss->distance_mm(), miss->predicted_mm(),
                       outcome.verification ? (*outcome.verification).*in_images : std::nullopt});
    const auto depth = outcome.depth();
    if (!depth) continue;
    tools.push_back({name, "tip", {}, {}, {}, depth});
    depths << depth_words(name, *depth);
  }
  depths_->setText(depths.join("\n"));
  depths_->setVisible(!depths.isEmpty());
  if (tools.empty() && state.result) tools = report::tools_at_ends(state.result->verifications);
  table_->fill(report::verification_table(tools));
  const QStringList lacks = lacks_of_export(state);
  lacks_->setText(lacks.isEmpty() ? QString() : tr("An export lacks:\n%1").arg(lacks.join("\n")));
  lacks_->setVisible(!lacks.isEmpty());
  exported_->setVisible(state.exported.has_value());
  if (!state.exported) return exported_->clear();
  const QString folder = text(state.exported->folder.string()).toHtmlEscaped();
  QString words =
      tr("Exported at %1 to <a href=\"%2\">%2</a>.").arg(state.exported->at.toHtmlEscaped(), folder);
  if (!state.exported->lacks.isEmpty())
    words += tr("<br>Without: %1.").arg(state.exported->lacks.join("; ").toHtmlEscaped());
  if (!is_exported(state)) words += tr("<br><b>Changed since: export again.</b>");
  exported_->setText(words);
}

}  // namespace helicarm::gui
