// SPDX-License-Identifier: Apache-2.0
#include "gui/window/sequence_window.h"

#include <QApplication>
#include <QPointer>
#include <QRegularExpression>
#include <QThreadPool>
#include <QVBoxLayout>
#include <algorithm>
#include <climits>
#include <set>

#include "gui/controller/steps.h"
#include "gui/window/ask_files.h"
#include "gui/window/film_bar.h"
#include "gui/xray/text.h"
#include "gui/xray/xray_view.h"
#include "helicarm/core/json.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/track/track.h"
#include "helicarm/track/view_map.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

/// Thrown by the progress of a cancelled work.
struct Cancelled {};

Expected<std::shared_ptr<const FollowedSequence>> read_sequence(const fs::path& folder,
                                                                const std::string& frames) {
  return guarded([&]() -> std::shared_ptr<const FollowedSequence> {
    const auto range = value_or_throw(case_registration::frame_range_from(frames));
    track::TrackCase given = value_or_throw(track::read_track_case(folder, range));
    const std::vector<track::SequenceView> views(given.views.begin(), given.views.end());
    auto images = value_or_throw(track::SequenceImages::open(views, range));
    return std::make_shared<const FollowedSequence>(
        FollowedSequence{folder, std::move(given), std::move(images), range, {}});
  });
}

}  // namespace

std::vector<MarkerSummary> marker_list(const track::Sequence& sequence,
                                       const std::vector<std::string>& markers) {
  std::vector<MarkerSummary> list(markers.size());
  for (std::size_t m = 0; m < markers.size(); ++m) {
    list[m].name = markers[m];
    for (const auto& frame : sequence.markers) {
      const track::TrackedMarker& marker = frame[m];
      ++list[m].frames[std::size_t(marker.status)];
      if (marker.status == track::MarkerStatus::tracked && marker.place)
        list[m].worst_95_mm =
            std::max(list[m].worst_95_mm, localization::length_at_95(marker.place->covariance));
    }
  }
  return list;
}

bool is_sequence(const fs::path& folder) {
  const auto json = read_json(folder / "case.json");
  return json && json->is_object() && json->contains("markers");
}

QString all_frames(const fs::path& folder) {
  const auto json = read_json(folder / "case.json");
  if (!json || !json->contains("views") || !json->at("views").is_array() || json->at("views").empty())
    return {};
  const Json& view = json->at("views").front();
  if (!view.is_object() || !view.contains("image") || !view.at("image").is_string()) return {};
  const fs::path file = folder / view.at("image").get<std::string>();
  const QString name = text(file.filename().string());
  const auto from = name.indexOf("{frame"), to = name.indexOf('}', from);
  if (from < 0 || to < 0) return QString("1-%1").arg(xray::count_frames(file).value_or(1));
  const QRegularExpression numbered("^" + QRegularExpression::escape(name.left(from)) + "(\\d+)" +
                                    QRegularExpression::escape(name.mid(to + 1)) + "$");
  const bool has_offset = view.contains("frame_offset") && view.at("frame_offset").is_number_integer();
  const int offset = has_offset ? view.at("frame_offset").get<int>() : 0;
  int first = INT_MAX, last = INT_MIN;
  std::error_code unreadable;
  for (const fs::directory_entry& entry : fs::directory_iterator(file.parent_path(), unreadable))
    if (const auto match = numbered.match(text(entry.path().filename().string())); match.hasMatch()) {
      first = std::min(first, match.captured(1).toInt() - offset);
      last = std::max(last, match.captured(1).toInt() - offset);
    }
  return first <= last ? QString("%1-%2").arg(first).arg(last) : QString();
}

SequenceWindow::~SequenceWindow() { *stopped_ = true; }

int SequenceWindow::frame() const { return bar_->frame(); }

void SequenceWindow::set_frame(int number) { bar_->set_frame(number); }

void SequenceWindow::open_case(const fs::path& folder, const QString& frames) {
  if (busy_) return;
  folder_ = folder;
  show_nothing();
  frames_->setText(frames);
  setWindowTitle(tr("Sequence: %1").arg(text(folder.string())));
  read();
}

/// Nothing of a case stays under the name of another one.
void SequenceWindow::show_nothing() {
  shown_.reset();
  corrections_ = {};
  film_.reset();
  has_scene_ = false;
  displayed_ = -1;
  if (std::exchange(awaited_, 0) > 0) end_frame();
  bar_->stop();
  for (XrayView* view : views_) view->clear({});
  markers_->setRowCount(0);
  by_frames_->setRowCount(0);
  show_curves();
  show_scene();
}

void SequenceWindow::run(const QString& doing,
                         std::function<Expected<std::shared_ptr<const FollowedSequence>>()> work) {
  if (busy_) return;
  busy_ = true;
  *stopped_ = false;
  says_->setText(doing);
  allow();
  QThreadPool::globalInstance()->start([self = QPointer<SequenceWindow>(this), work = std::move(work)] {
    const auto done = work();
    QMetaObject::invokeMethod(
        qApp,
        [self, done] {
          if (self) self->take(done);
        },
        Qt::QueuedConnection);
  });
}

void SequenceWindow::take(const Expected<std::shared_ptr<const FollowedSequence>>& done) {
  busy_ = false;
  if (!done) {
    says_->setText(sentence_of(done.error()));
    return allow();
  }
  shown_ = *done;
  if (!shown_->sequence) corrections_ = Corrections(shown_->given);
  const auto& sequence = shown_->sequence;
  QStringList words;
  if (!sequence)
    words << tr("%1 frames of %2 views, %3 markers; not followed yet.")
                 .arg(shown_->range.count())
                 .arg(shown_->given.views.size())
                 .arg(shown_->given.markers.size());
  else
    words << tr("%1 of %2 frames with all %3 markers tracked.")
                 .arg(sequence->complete)
                 .arg(sequence->frames.size())
                 .arg(shown_->given.markers.size());
  if (sequence && sequence->failure) words << sentence_of(*sequence->failure);
  for (const auto* warnings : {&shown_->given.warnings, sequence ? &sequence->warnings : nullptr})
    if (warnings)
      for (const Warning& warning : *warnings) words << sentence_of(warning);
  says_->setText(words.join('\n'));
  bar_->set_count(shown_->range.count());
  displayed_ = -1;
  show_views();
  fill_tables();
  show_curves();
  show_scene();
  allow();
  read_frame();
}

void SequenceWindow::pick(std::size_t view, const Eigen::Vector2d& raw) {
  const int marker = markers_->currentRow();
  if (!shown_ || busy_ || marker < 0 || displayed_ < 0) return;
  const int frame = shown_->range.first + displayed_ * shown_->range.step;
  const track::MarkerPick made{std::size_t(marker), view, raw, frame};
  const auto checked = guarded([&] { track::check_pick_in_map(shown_->given, made, shown_->range.first); });
  if (!checked) return says_->setText(sentence_of(checked.error()));
  corrections_.set(made, shown_->range);
  take_picks();
}

void SequenceWindow::undo_pick() {
  if (busy_ || !corrections_.can_undo()) return;
  corrections_.undo();
  take_picks();
}

/// Shows and keeps them; the sequence stays that of the picks before until it is followed again.
void SequenceWindow::take_picks() {
  auto changed = std::make_shared<FollowedSequence>(*shown_);
  corrections_.put_into(changed->given);
  shown_ = changed;
  const auto saved = corrections_.save(shown_->folder, shown_->given, shown_->range);
  says_->setText(
      !saved ? sentence_of(saved.error())
      : shown_->sequence && !shown_->is_corrected()
          ? tr("The picks are those that the markers were followed from.")
          : tr("The picks are in case.json. \"Follow the markers\" goes on from their first frame."));
  displayed_ = -1;
  allow();
  read_frame();
}

std::vector<track::MarkerPick> SequenceWindow::picks_of(int frame) const {
  std::vector<track::MarkerPick> made;
  if (shown_->is_corrected())
    for (const track::MarkerPick& pick : shown_->given.corrections)
      if (pick.frame == frame) made.push_back(pick);
  if (!shown_->sequence || (shown_->is_corrected() && frame == shown_->range.first))
    for (const track::MarkerPick& pick : shown_->given.picks)
      if (frame == shown_->range.first) made.push_back(pick);
  return made;
}

void SequenceWindow::read() {
  run(tr("The case and its images are read."),
      [folder = folder_, frames = frames_->text().trimmed().toStdString()] {
        return read_sequence(folder, frames);
      });
}

void SequenceWindow::follow() {
  if (!shown_) return;
  const auto tell = [self = QPointer<SequenceWindow>(this), all = shown_->range.count()](int frame) {
    QMetaObject::invokeMethod(
        qApp,
        [self, frame, all] {
          if (self && self->busy_) self->says_->setText(tr("Frame %1 of %2").arg(frame).arg(all));
        },
        Qt::QueuedConnection);
  };
  run(tr("The markers are followed."),
      [from = shown_, stopped = stopped_, tell]() -> Expected<std::shared_ptr<const FollowedSequence>> {
        try {
          auto followed = std::make_shared<FollowedSequence>(*from);
          followed->picks = from->given.picks;
          followed->corrections = from->given.corrections;
          track::TrackOptions options;
          if (from->sequence && from->picks == from->given.picks) {
            options.kept = from->sequence->sights;
            options.kept_corrections = from->corrections;
          }
          auto sequence = track::run_track(from->given, from->range, options, [&](int frame) {
            tell(frame);
            if (*stopped) throw Cancelled();
          });
          if (!sequence) return tl::unexpected(sequence.error());
          followed->sequence = *std::move(sequence);
          return followed;
        } catch (const Cancelled&) {
          return fail(Reason::interrupted, "cancelled");
        }
      });
}

void SequenceWindow::read_frame() {
  if (!shown_ || reading_ || displayed_ == frame()) return;
  reading_ = true;
  bar_->set_waiting(true);
  const int number = frame();
  QThreadPool::globalInstance()->start([self = QPointer<SequenceWindow>(this), of = shown_, number] {
    auto images = std::make_shared<Expected<std::vector<xray::XrayImage>>>(
        of->images.at(of->range.first + number * of->range.step));
    QMetaObject::invokeMethod(
        qApp,
        [self, of, number, images] {
          if (!self) return;
          self->awaited_ = 0;
          if (self->shown_ == of) self->show_frame(number, *images);
          if (self->awaited_ == 0) self->end_frame();
        },
        Qt::QueuedConnection);
  });
}

void SequenceWindow::show_frame(int number, const Expected<std::vector<xray::XrayImage>>& images) {
  displayed_ = number;
  const int frame = shown_->range.first + number * shown_->range.step;
  bar_->set_name(tr("frame %1").arg(frame));
  if (!images) {
    bar_->stop();
    film_.reset();
    for (XrayView* view : views_) view->clear(sentence_of(images.error()));
    return says_->setText(sentence_of(images.error()));
  }
  auto result = std::make_shared<pipeline::Result>();
  for (std::size_t i = 0; i < images->size(); ++i) {
    pipeline::ViewResult& view = result->views.emplace_back();
    view.name = shown_->given.views[i].images.name;
    view.xray_image = std::make_shared<const xray::XrayImage>((*images)[i]);
  }
  awaited_ = views_.size();
  for (std::size_t i = 0; i < views_.size(); ++i) views_[i]->show_view(result, i, true);
}

std::vector<FreshPick> SequenceWindow::marks_in(std::size_t view) const {
  std::vector<FreshPick> marks;
  std::set<std::size_t> picked;
  for (const track::MarkerPick& pick : picks_of(shown_->range.first + displayed_ * shown_->range.step))
    if (pick.view == view && picked.insert(pick.marker).second)
      marks.push_back({text(shown_->given.markers[pick.marker]), pick.uv_raw});
  if (const auto& sequence = shown_->sequence)
    for (std::size_t m = 0; m < shown_->given.markers.size(); ++m)
      if (const auto& seen = sequence->images[std::size_t(displayed_)][m * views_.size() + view];
          seen && !picked.contains(m))
        marks.push_back({text(shown_->given.markers[m]), seen->uv_raw});
  return marks;
}

/// The images of a frame are displayed: now its marks are true of them.
void SequenceWindow::end_frame() {
  reading_ = false;
  awaited_ = 0;
  bar_->set_waiting(false);
  if (displayed_ >= 0) {
    for (std::size_t i = 0; i < views_.size(); ++i) views_[i]->set_picks(marks_in(i));
    mark_frame();
    if (film_) film_frame();
  }
  read_frame();  // another one is wanted meanwhile
}

void SequenceWindow::film_frame() {
  const int frame = shown_->range.first + displayed_ * shown_->range.step;
  const QString name = QString("frame-%1.png").arg(frame, 5, 10, QChar('0'));
  QImage film(film_frame_->size(), QImage::Format_RGB32);
  film_frame_->render(&film);
  if (!film.save(QString::fromStdString((*film_ / name.toStdString()).string()))) {
    says_->setText(tr("%1 cannot be written.").arg(name));
    film_.reset();
  } else if (bar_->is_last()) {
    says_->setText(tr("The film's frames are in %1.").arg(text(film_->string())));
    film_.reset();
  } else {
    set_frame(displayed_ + 1);
  }
  allow();
}

void SequenceWindow::ask_and_write() {
  ask_files(this, tr("Folder for the tables and the report"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) {
              if (!can_write()) return says_->setText(tr("There is nothing to be written now."));
              const auto written = track::write_track(*shown_->sequence, shown_->given, chosen.front());
              says_->setText(written ? tr("Written to %1.").arg(text(chosen.front().string()))
                                     : sentence_of(written.error()));
            });
}

void SequenceWindow::ask_and_film() {
  ask_files(this, tr("Folder for the frames of the film"), QFileDialog::Directory, {},
            [this](const std::vector<fs::path>& chosen) { save_film(chosen.front()); });
}

void SequenceWindow::save_film(const fs::path& folder) {
  if (!shown_ || film_) return;
  film_ = folder;
  displayed_ = -1;
  set_frame(0);
  allow();
  read_frame();
}

}  // namespace helicarm::gui
