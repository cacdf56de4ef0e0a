// SPDX-License-Identifier: Apache-2.0
// Pages of the navigation and verification steps.
#include <QVBoxLayout>

#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/pages.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {

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
  if (state.source != Source::virtual_or && state.source != Source::devices)
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
  const bool free = !state.busy && (state.source == Source::virtual_or || state.source == Source::devices);
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
  table_ = add_table(report::verification_table({}), "outcomeTable");
  add_button(tr("&Export report, CSV, JSON and other formats..."), "export",
             [this] { emit report_wanted(); });
}

void VerifyPage::show_state(const ApplicationState& state) {
  std::vector<report::ToolAtEnd> tools;
  for (const auto& [name, outcome] : state.outcomes)
    for (const auto& [end, miss, in_images] :
         {std::tuple("start", &outcome.start, &guidance::Verification::start),
          std::tuple("end", &outcome.end, &guidance::Verification::end)})
      tools.push_back({name, end, miss->distance_mm(), miss->predicted_mm(),
                       outcome.verification ? (*outcome.verification).*in_images : std::nullopt});
  if (tools.empty() && state.result) tools = report::tools_at_ends(state.result->verifications);
  fill(table_, report::verification_table(tools));
}

}  // namespace helicarm::gui
