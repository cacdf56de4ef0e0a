// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/replay_panel.h"

#include <QComboBox>
#include <QFontDatabase>
#include <QHBoxLayout>
#include <QLabel>
#include <QListWidget>
#include <QMouseEvent>
#include <QPlainTextEdit>
#include <QProgressBar>
#include <QPushButton>
#include <QShortcut>
#include <QSignalBlocker>
#include <QSlider>
#include <QSplitter>
#include <QVBoxLayout>
#include <algorithm>

namespace helicarm::gui {
namespace {

constexpr int tick_ms = 40;
/// A poses record holds hundreds of samples; only the first ones are displayed.
constexpr qsizetype longest_detail = 100'000;

QString clock_time(double seconds) {
  const int tenths = int(seconds * 10);
  return QString("%1:%2.%3").arg(tenths / 600).arg(tenths / 10 % 60, 2, 10, QChar('0')).arg(tenths % 10);
}

/// A click moves the slider to its position.
class TimeSlider : public QSlider {
 public:
  using QSlider::QSlider;

 protected:
  void mousePressEvent(QMouseEvent* event) override {
    setValue(QStyle::sliderValueFromPosition(minimum(), maximum(), int(event->position().x()), width()));
    QSlider::mousePressEvent(event);
  }
};

/// Never takes the focus: the space bar stops the robot.
QPushButton* button(const QString& text, const QString& tip, QWidget* parent) {
  auto* made = new QPushButton(text, parent);
  made->setToolTip(tip);
  made->setAccessibleName(tip);
  made->setFocusPolicy(Qt::NoFocus);
  return made;
}

}  // namespace

QString verdict_of(const Expected<operation::ReplayReport>& report) {
  if (!report)
    return ReplayPanel::tr("Cannot be replayed: %1").arg(QString::fromStdString(report.error().message));
  QString words;
  if (report->complete())
    words = ReplayPanel::tr(
                "Reproduced bit for bit: acquisitions %1, images %2, results %3, registrations of models %4, "
                "hand-eye calibrations %5")
                .arg(report->exposures)
                .arg(report->images)
                .arg(report->results)
                .arg(report->registrations)
                .arg(report->hand_eyes);
  else if (report->differences.empty())
    words = ReplayPanel::tr("The record has no end: the program was killed, or records were removed");
  else
    words = ReplayPanel::tr("These values differ on recomputation:");
  for (const std::string& difference : report->differences)
    words += "\n" + QString::fromStdString(difference);
  for (const std::string& note : report->notes)
    words += ReplayPanel::tr("\nNote: %1").arg(QString::fromStdString(note));
  return words;
}

ReplayPanel::ReplayPanel(QWidget* parent) : QWidget(parent) {
  build();
  bind_keys();
  connect(&clock_, &QTimer::timeout, this, &ReplayPanel::advance);
  connect(list_, &QListWidget::currentRowChanged, this, [this](int row) { set_moment(row); });
  connect(slider_, &QSlider::valueChanged, this, [this](int ms) {
    seconds_ = ms / 1000.0;
    if (timeline_) show_moment(int(timeline_->at(seconds_)));
  });
  connect(back_, &QPushButton::clicked, this, [this] { step(-1); });
  connect(forward_, &QPushButton::clicked, this, [this] { step(1); });
  connect(play_, &QPushButton::clicked, this, [this] { set_playing(!is_playing()); });
  connect(verify_, &QPushButton::clicked, this, &ReplayPanel::verify);
}

void ReplayPanel::build() {
  about_ = new QLabel(tr("No session is open"), this);
  list_ = new QListWidget(this);
  list_->setUniformItemSizes(true);
  list_->setAccessibleName(tr("Moments"));
  detail_ = new QPlainTextEdit(this);
  detail_->setReadOnly(true);
  detail_->setLineWrapMode(QPlainTextEdit::NoWrap);
  detail_->setFont(QFontDatabase::systemFont(QFontDatabase::FixedFont));
  auto* middle = new QSplitter(Qt::Horizontal, this);
  middle->addWidget(list_);
  middle->addWidget(detail_);

  back_ = button(tr("◀"), tr("Previous record (J or comma)"), this);
  play_ = button(tr("Play"), tr("Play and pause (K)"), this);
  forward_ = button(tr("▶"), tr("Next record (L or period)"), this);
  slider_ = new TimeSlider(Qt::Horizontal, this);
  slider_->setAccessibleName(tr("Time"));
  time_ = new QLabel(clock_time(0), this);
  speed_ = new QComboBox(this);
  for (const int times : {1, 4, 16, 64}) speed_->addItem(tr("%1 ×").arg(times), times);
  speed_->setToolTip(tr("Speed"));
  auto* controls = new QHBoxLayout;
  for (QWidget* widget : std::initializer_list<QWidget*>{back_, play_, forward_}) controls->addWidget(widget);
  controls->addWidget(slider_, 1);
  controls->addWidget(time_);
  controls->addWidget(speed_);

  verify_ = button(tr("Verify"), tr("Recompute the operation from its record"), this);
  progress_ = new QProgressBar(this);
  progress_->hide();
  verdict_ = new QLabel(this);
  verdict_->setWordWrap(true);
  verdict_->setTextInteractionFlags(Qt::TextSelectableByMouse);
  auto* checks = new QHBoxLayout;
  checks->addWidget(verify_);
  checks->addWidget(progress_);
  checks->addWidget(verdict_, 1);

  auto* all = new QVBoxLayout(this);
  all->addWidget(about_);
  all->addWidget(middle, 1);
  all->addLayout(controls);
  all->addLayout(checks);
  for (QWidget* widget : std::initializer_list<QWidget*>{back_, play_, forward_, slider_, verify_})
    widget->setEnabled(false);
}

void ReplayPanel::bind_keys() {
  const auto bind = [this](std::initializer_list<Qt::Key> keys, auto&& act) {
    for (const Qt::Key key : keys) {
      auto* shortcut = new QShortcut(QKeySequence(key), this);
      shortcut->setContext(Qt::WidgetWithChildrenShortcut);
      connect(shortcut, &QShortcut::activated, this, act);
    }
  };
  bind({Qt::Key_J, Qt::Key_Comma}, [this] { step(-1); });
  bind({Qt::Key_L, Qt::Key_Period}, [this] { step(1); });
  bind({Qt::Key_K}, [this] { set_playing(!is_playing()); });
}

Expected<void> ReplayPanel::open(const std::filesystem::path& session) {
  auto timeline = read_timeline(session);
  if (!timeline) return tl::unexpected<Failure>(timeline.error());
  worker_ = {};
  set_playing(false);
  timeline_ = std::move(*timeline);
  moment_ = -1;
  verdict_->clear();
  progress_->hide();
  const QString end = timeline_->torn       ? tr("incomplete: interrupted while writing")
                      : timeline_->finished ? tr("complete")
                                            : tr("operation not ended");
  about_->setText(tr("%1: %2 records, %3")
                      .arg(QString::fromStdString(session.filename().string()))
                      .arg(timeline_->moments.size())
                      .arg(end));
  {
    const QSignalBlocker quiet_list(list_), quiet_slider(slider_);
    list_->clear();
    for (const Moment& moment : timeline_->moments)
      list_->addItem(clock_time(moment.seconds) + "   " + moment.summary);
    slider_->setRange(0, int(timeline_->length_s() * 1000) + 1);
  }
  for (QWidget* widget : std::initializer_list<QWidget*>{back_, play_, forward_, slider_, verify_})
    widget->setEnabled(true);
  set_moment(0);
  return {};
}

void ReplayPanel::set_moment(int index) {
  if (!timeline_ || index < 0 || index >= int(timeline_->moments.size())) return;
  seconds_ = timeline_->moments[std::size_t(index)].seconds;
  const QSignalBlocker quiet(slider_);
  slider_->setValue(int(seconds_ * 1000));
  show_moment(index);
}

void ReplayPanel::step(int by) {
  if (timeline_) set_moment(std::clamp(moment_ + by, 0, int(timeline_->moments.size()) - 1));
}

void ReplayPanel::show_moment(int index) {
  time_->setText(clock_time(seconds_) + " / " + clock_time(timeline_->length_s()));
  if (index == moment_) return;
  moment_ = index;
  state_ = state_at(*timeline_, std::size_t(index));
  const QSignalBlocker quiet(list_);
  list_->setCurrentRow(index);
  QString detail = timeline_->moments[std::size_t(index)].detail();
  if (detail.size() > longest_detail) {
    detail.truncate(longest_detail);
    detail += tr("\n… more is in session.log");
  }
  detail_->setPlainText(detail);
  Q_EMIT moment_changed(index);
}

void ReplayPanel::set_playing(bool playing) {
  if (!timeline_) return;
  if (playing && moment_ + 1 == int(timeline_->moments.size())) set_moment(0);
  play_->setText(playing ? tr("Halt") : tr("Play"));
  since_.start();
  playing ? clock_.start(tick_ms) : clock_.stop();
}

void ReplayPanel::advance() {
  seconds_ += double(since_.restart()) / 1000 * speed_->currentData().toInt();
  {
    const QSignalBlocker quiet(slider_);
    slider_->setValue(int(seconds_ * 1000));
  }
  seconds_ = std::min(seconds_, timeline_->length_s());
  show_moment(int(timeline_->at(seconds_)));
  if (seconds_ >= timeline_->length_s()) set_playing(false);
}

QString ReplayPanel::verdict() const { return verdict_->text(); }

void ReplayPanel::verify() {
  if (!timeline_ || !verify_->isEnabled()) return;
  verify_->setEnabled(false);
  verdict_->setText(tr("Recomputing …"));
  progress_->setRange(0, int(timeline_->moments.size()));
  progress_->setValue(0);
  progress_->show();
  worker_ = std::jthread([this, session = timeline_->session](const std::stop_token& stop) {
    const auto report = operation::replay(session, [&](std::size_t done, std::size_t) {
      QMetaObject::invokeMethod(progress_, [this, done] { progress_->setValue(int(done)); });
      return !stop.stop_requested();
    });
    if (!stop.stop_requested())
      QMetaObject::invokeMethod(this, [this, report, session] {
        if (timeline_->session == session) show_verdict(report);
      });
  });
}

void ReplayPanel::show_verdict(const Expected<operation::ReplayReport>& report) {
  progress_->hide();
  verify_->setEnabled(true);
  verdict_->setText(verdict_of(report));
  Q_EMIT verified(report && report->complete());
}

}  // namespace helicarm::gui
