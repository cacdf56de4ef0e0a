// SPDX-License-Identifier: Apache-2.0
// A sequence of markers: its film, its list of markers, and its table by frames.
#include <QSvgRenderer>
#include <QTabWidget>
#include <QTableWidget>
#include <cmath>

#include "gui/scene/scene_view.h"
#include "gui/window/curves_view.h"
#include "gui/window/legibility_test.h"
#include "gui/window/sequence_window.h"
#include "gui/window/window_test.h"
#include "gui/xray/xray_view.h"
#include "helicarm/core/json.h"
#include "helicarm/image/png.h"

namespace helicarm::gui {
namespace {

constexpr int side = 160, frames_drawn = 5, hidden_at = 3;
constexpr double focus = 1600, distance_mm = 800, radius_mm = 1;

struct Bead {
  const char* name;
  Eigen::Vector3d at;
};

/// Two cameras at right angles look at four beads that shift and turn together; in one frame the second view
/// does not show the first bead.
class WindowSequence : public Window {
 protected:
  static std::vector<Bead> beads(int frame) {
    std::vector<Bead> all{
        {"J1", {-14, 3, 5}}, {"J2", {8, -12, -9}}, {"J3", {3, 11, 14}}, {"J4", {-6, -7, -16}}};
    const Eigen::AngleAxisd turn(0.02 * frame, Eigen::Vector3d::UnitY());
    for (Bead& bead : all) bead.at = turn * bead.at + Eigen::Vector3d(0, 0.5 * frame, 0);
    return all;
  }
  static Eigen::Matrix3d axes(int view) {
    Eigen::Matrix3d rows;
    if (view == 0)
      rows << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    else
      rows << 0, -1, 0, 0, 0, -1, 1, 0, 0;
    return rows;
  }
  static Eigen::Vector2d project(int view, const Eigen::Vector3d& at) {
    const Eigen::Vector3d p = axes(view) * at + Eigen::Vector3d(0, 0, distance_mm);
    const Eigen::Vector2d middle = Eigen::Vector2d::Constant((side - 1) / 2.0);
    return middle + focus / p.z() * p.head<2>();
  }
  static std::string drawn(int view, int frame) {
    image::Image<std::uint8_t> grey(side, side, 0);
    constexpr double radius = radius_mm * focus / distance_mm;
    for (int v = 0; v < side; ++v)
      for (int u = 0; u < side; ++u) {
        double value = 120 + (u * 7919 + v * 104729 + frame * 1299709) % 1009 / 1009.0 * 6 - 3;
        for (const Bead& bead : beads(frame)) {
          if (view == 1 && frame == hidden_at && bead.name == std::string("J1")) continue;
          const double off = (Eigen::Vector2d(u, v) - project(view, bead.at)).norm();
          value -= 80 * std::clamp(radius + 0.5 - off, 0.0, 1.0);
        }
        grey(u, v) = std::uint8_t(std::clamp(std::lround(value), 0L, 255L));
      }
    return image::encode_png(grey);
  }
  static Json camera(int view) {
    const double middle = (side - 1) / 2.0;
    Json rows = Json::array();
    for (int row = 0; row < 3; ++row)
      rows.push_back({axes(view)(row, 0), axes(view)(row, 1), axes(view)(row, 2)});
    return {{"K", {{focus, 0, middle}, {0, focus, middle}, {0, 0, 1}}},
            {"R", rows},
            {"t", {0, 0, distance_mm}},
            {"image_size", {side, side}}};
  }
  void write_sequence(const fs::path& folder) {
    fs::create_directories(folder);
    Json views = Json::array(), picks = Json::array();
    for (int view = 0; view < 2; ++view) {
      const std::string name = view == 0 ? "A" : "B";
      ASSERT_TRUE(write_file(folder / (name + ".json"), to_text(camera(view))));
      for (int frame = 1; frame <= frames_drawn; ++frame)
        ASSERT_TRUE(write_file(folder / fmt::format("{}_{:04d}.png", name, frame), drawn(view, frame)));
      views.push_back({{"name", name}, {"image", name + "_{frame:04d}.png"}, {"camera", name + ".json"}});
      for (const Bead& bead : beads(1)) {
        const Eigen::Vector2d uv = project(view, bead.at);
        picks.push_back({{"name", bead.name},
                         {"view", name},
                         {"frame", 1},
                         {"uv", {std::round(uv.x()), std::round(uv.y())}}});
      }
    }
    const Json given{{"format", "helicarm-case/2"},
                     {"views", views},
                     {"markers", {{"diameter_mm", 2 * radius_mm}}},
                     {"picks", picks},
                     {"bodies", {{{"name", "jaw"}, {"markers", {"J1", "J2", "J3", "J4"}}}}}};
    ASSERT_TRUE(write_file(folder / "case.json", to_text(given)));
  }
  SequenceWindow* sequence() { return window_->findChild<SequenceWindow*>("sequence"); }
  std::string says() { return sequence()->findChild<QLabel*>("sequenceSays")->text().toStdString(); }
  void wait_free() {
    ASSERT_TRUE(wait("the sequence is read", [&] { return !sequence()->is_busy(); }));
  }
  QTableWidget* table(const char* name) { return sequence()->findChild<QTableWidget*>(name); }
};

TEST_F(WindowSequence, IsFollowedPlayedAndListedByFrames) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  drop(*window_, {folder_ / "run"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  ASSERT_TRUE(sequence()->shown()) << says();
  EXPECT_EQ(sequence()->shown()->range.count(), frames_drawn);
  EXPECT_EQ(table("markerList")->rowCount(), 4);
  EXPECT_EQ(table("markerList")->item(0, 2)->text(), "–");  // not followed yet
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  ASSERT_TRUE(sequence()->shown()->sequence) << says();
  EXPECT_EQ(table("markersByFrames")->rowCount(), frames_drawn);
  EXPECT_EQ(table("markerList")->item(1, 2)->text(), QString::number(frames_drawn));
  EXPECT_EQ(table("markerList")->item(0, 2)->text(), QString::number(frames_drawn - 1));
  const QString hidden = table("markersByFrames")->item(hidden_at - 1, 1)->text();
  EXPECT_FALSE(hidden.startsWith("±")) << hidden.toStdString();
  emit table("markersByFrames")->cellClicked(hidden_at - 1, 1);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_EQ(sequence()->frame(), hidden_at - 1);
  EXPECT_EQ(table("markerList")->item(0, 1)->text(), hidden);
  screenshot("sequence", sequence());
  EXPECT_EQ(illegible_parts(*sequence()).join('\n').toStdString(), "");
  sequence()->set_frame(0);
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequencePlay"), Qt::LeftButton);
  ASSERT_TRUE(wait("it plays to its end", [&] { return sequence()->frame() == frames_drawn - 1; }));
}

TEST_F(WindowSequence, SavedFilmHasEachFrameWithItsOwnMarks) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  sequence()->set_frame(1);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  QWidget* film = sequence()->findChild<XrayView*>()->parentWidget();
  QImage displayed(film->size(), QImage::Format_RGB32);
  film->render(&displayed);
  sequence()->save_film(folder_);
  ASSERT_TRUE(wait("it is saved", [&] { return says().find("film's frames") != std::string::npos; }));
  const QImage saved((folder_ / "frame-00002.png").c_str());
  EXPECT_EQ(saved.convertToFormat(QImage::Format_RGB32), displayed);
}

TEST_F(WindowSequence, APickInALaterFrameIsKeptFollowedAndUndone) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  const auto follow = [&] {
    QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
    wait_free();
  };
  ASSERT_NO_FATAL_FAILURE(follow());
  ASSERT_TRUE(sequence()->shown()->sequence) << says();
  const auto before = sequence()->shown()->sequence->sights;
  constexpr int corrected = 4;
  sequence()->set_frame(corrected - 1);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  table("markerList")->selectRow(0);
  const Eigen::Vector2d at = project(1, beads(corrected)[2].at);
  sequence()->pick(1, at);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_TRUE(sequence()->shown()->is_corrected());
  EXPECT_FALSE(sequence()->findChild<QPushButton*>("sequenceWrite")->isEnabled());
  const auto case_picks = [&] { return read_json(folder_ / "run" / "case.json")->at("picks"); };
  EXPECT_EQ(case_picks().size(), 9u);
  EXPECT_EQ(case_picks().back().at("frame"), corrected);
  ASSERT_NO_FATAL_FAILURE(follow());
  const auto& after = sequence()->shown()->sequence->sights;
  ASSERT_TRUE(after[corrected - 1].of[0][1]) << says();
  EXPECT_LT((after[corrected - 1].of[0][1]->uv_raw - at).norm(), 0.3);
  EXPECT_EQ(after[corrected - 2].of[0][0]->uv_raw, before[corrected - 2].of[0][0]->uv_raw);
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceUndo"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_EQ(case_picks().size(), 8u);
  ASSERT_NO_FATAL_FAILURE(follow());
  EXPECT_EQ(sequence()->shown()->sequence->sights[corrected - 1].of[0][1]->uv_raw,
            before[corrected - 1].of[0][1]->uv_raw);
}

TEST_F(WindowSequence, NothingOfACaseStaysUnderTheNameOfOneThatCannotBeRead) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "other"));
  fs::remove(folder_ / "other" / "B_0002.png");
  const std::string kept = *read_file(folder_ / "other" / "case.json", 1 << 20);
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  table("markerList")->selectRow(0);
  sequence()->pick(1, project(1, beads(1)[0].at));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  window_->open_paths({folder_ / "other" / "case.json"});
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_FALSE(sequence()->shown());
  EXPECT_THAT(says(), HasSubstr("B_0002.png"));
  EXPECT_EQ(table("markerList")->rowCount(), 0);
  EXPECT_FALSE(sequence()->findChild<QPushButton*>("sequenceUndo")->isEnabled());
  EXPECT_FALSE(sequence()->findChild<QPushButton*>("sequenceWrite")->isEnabled());
  sequence()->pick(1, project(1, beads(1)[0].at));
  EXPECT_EQ(*read_file(folder_ / "other" / "case.json", 1 << 20), kept);
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_TRUE(sequence()->shown()) << says();
}

TEST_F(WindowSequence, CurvesAreThoseOfTheReport) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  auto* curves = sequence()->findChild<CurvesView*>("sequenceCurves");
  EXPECT_TRUE(curves->svg().isEmpty());
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_EQ(sequence()->findChild<QComboBox*>("sequenceSheet")->currentText(), "jaw");
  EXPECT_TRUE(curves->svg().contains("Rotation vector against the first frame"));
  EXPECT_TRUE(QSvgRenderer(curves->svg()).isValid());
  const QByteArray at_first = curves->svg();
  sequence()->set_frame(3);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_NE(curves->svg(), at_first);  // its line is at the displayed frame
  sequence()->findChild<QTabWidget*>("sequenceTabs")->setCurrentIndex(1);
  screenshot("sequence-curves", sequence());
  EXPECT_EQ(illegible_parts(*sequence()).join('\n').toStdString(), "");
}

TEST_F(WindowSequence, BodiesAreInTheSceneOfTheDisplayedFrame) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_TRUE(wait("the sequence is shown", [&] { return sequence() != nullptr; }));
  ASSERT_NO_FATAL_FAILURE(wait_free());
  QTest::mouseClick(sequence()->findChild<QPushButton*>("sequenceFollow"), Qt::LeftButton);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  ASSERT_TRUE(sequence()->shown()->sequence) << says();
  const ResultScene scene = scene_of_frame(*sequence()->shown(), 4);
  EXPECT_EQ(scene.views.size(), 2u);
  ASSERT_EQ(scene.points.size(), 4u);
  EXPECT_EQ(scene.tunnels.size(), 6u);
  EXPECT_LT((scene.points[1].error.centre - beads(5)[1].at).norm(), 0.1);
  EXPECT_LT((scene.tunnels[0].axis.from - beads(5)[0].at).norm(), 0.1);
  EXPECT_EQ(scene.tunnels[0].name, "jaw");
  sequence()->findChild<QTabWidget*>("sequenceTabs")->setCurrentIndex(2);
  auto* view = sequence()->findChild<SceneView*>("sequenceScene");
  screenshot("sequence-scene", sequence());
  const QImage first = view->grab().toImage();
  sequence()->set_frame(4);
  ASSERT_NO_FATAL_FAILURE(wait_free());
  if (!view->obstacle()) {
    EXPECT_NE(view->grab().toImage(), first);
  }
}

TEST_F(WindowSequence, AnImageThatIsMissingIsNamed) {
  ASSERT_NO_FATAL_FAILURE(write_sequence(folder_ / "run"));
  fs::remove(folder_ / "run" / "B_0004.png");
  window_->open_paths({folder_ / "run" / "case.json"});
  ASSERT_NO_FATAL_FAILURE(wait_free());
  EXPECT_FALSE(sequence()->shown());
  EXPECT_THAT(says(), HasSubstr("B_0004.png"));
  EXPECT_FALSE(sequence()->findChild<QPushButton*>("sequenceFollow")->isEnabled());
}

TEST(MarkerList, CountsEachState) {
  track::Sequence sequence;
  for (const track::MarkerStatus status :
       {track::MarkerStatus::tracked, track::MarkerStatus::tracked, track::MarkerStatus::lost}) {
    track::TrackedMarker marker;
    marker.status = status;
    if (status == track::MarkerStatus::tracked) {
      marker.place.emplace();
      marker.place->covariance.diagonal().setConstant(0.01);
    }
    sequence.markers.push_back({marker});
  }
  const auto list = marker_list(sequence, {"J1"});
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0].frames, (std::array{2, 0, 0, 1}));
  EXPECT_NEAR(list[0].worst_95_mm, 0.28, 0.01);
}

}  // namespace
}  // namespace helicarm::gui
