// SPDX-License-Identifier: Apache-2.0
// From image files of a C-arm that the application does not know to saved picks and an export.
#include <QAbstractButton>
#include <QAction>
#include <QFileDialog>
#include <QLineEdit>
#include <QMessageBox>
#include <QSpinBox>
#include <fstream>

#include "gui/window/window_test.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::gui {
namespace {

constexpr int frames = 5, acquired_frame = 4;

/// The image as one frame of a run in which the beam was open before and after it.
std::string run_of(const xray::DerivedImage& image) {
  const auto pixels = image.pixels.pixels();
  std::vector<std::uint16_t> values;
  for (int frame = 1; frame <= frames; ++frame)
    for (std::size_t i = 0; i < pixels.size(); ++i)
      values.push_back(frame == acquired_frame ? pixels[i] : std::uint16_t(2000 + (i * 7 + frame) % 31));
  xray::DicomBuilder dicom;
  const xray::Acquisition& a = image.acquisition;
  dicom.text(0x00100010, "PN", image.patient_name).text(0x00100020, "LO", image.patient_id);
  dicom.text(0x0020000D, "UI", image.study_uid).text(0x00280008, "IS", std::to_string(frames));
  dicom.text(0x00181110, "DS", fmt::format("{:.6g}", *a.source_detector_mm));
  dicom.text(0x00181164, "DS", fmt::format("{:.6g}\\{:.6g}", a.pixel_mm->y(), a.pixel_mm->x()));
  dicom.text(0x00181510, "DS", fmt::format("{:.4g}", *a.primary_angle_deg));
  dicom.text(0x00181511, "DS", fmt::format("{:.4g}", *a.secondary_angle_deg));
  if (a.logarithmic) dicom.text(0x00281040, "CS", *a.logarithmic ? "LOG" : "LIN");
  dicom.word(0x00280010, image.pixels.height()).word(0x00280011, image.pixels.width());
  dicom.word(0x00280101, image.bits_stored).word(0x00280102, image.bits_stored - 1);
  return dicom.pixels(values).bytes();
}

class WindowWithOwnImages : public Window {
 protected:
  void SetUp() override {
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.seed = 7;
    for (const char* view : {"AP:2,1", "LAT:88,-2", "OBL:45,3"})
      options.views.push_back(*simulation::view_angles(view));
    simulated_ = simulation::simulate_case(options).value();
    fs::create_directories(folder_ / "disk");
    for (std::size_t i = 0; i < 3; ++i) {
      const xray::DerivedImage image = simulation::dicom_of(simulated_, i);
      files_.push_back(folder_ / "disk" / fmt::format("IM{}", i + 1));
      if (i < 2)
        ASSERT_TRUE(xray::write_dicom(files_.back(), image));
      else
        ASSERT_TRUE(write_file(files_.back(), run_of(image)));
    }
  }

  NewCaseDialog& dialog() { return *window_->new_case(); }
  template <class Part>
  Part* part(const char* name) {
    auto* found = dialog().findChild<Part*>(name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  }
  void wait_checked() {
    ASSERT_TRUE(wait("the images are looked at", [&] { return !dialog().is_checking(); }));
  }
  void choose_by_file_dialog(QAbstractButton* button, const fs::path& file) {
    QTest::mouseClick(button, Qt::LeftButton);
    auto* chooser = dialog().findChild<QFileDialog*>();
    ASSERT_NE(chooser, nullptr);
    chooser->selectFile(QString::fromStdString(file.string()));
    QMetaObject::invokeMethod(chooser, "accept");
  }
  QAbstractButton* file_button_of(const char* list) {
    const QRect of_list = part<QComboBox>(list)->geometry();
    for (auto* button : dialog().findChildren<QPushButton*>())
      if (button->text() == "File..." && button->geometry().top() <= of_list.center().y() &&
          button->geometry().bottom() >= of_list.center().y())
        return button;
    return nullptr;
  }
  Eigen::Vector2d click_of(const std::string& point, std::size_t view) {
    for (const simulation::Click& click : simulated_.views[view].clicks)
      if (click.point == point) return click.raw;
    throw std::out_of_range(point);
  }
  /// With the mouse, in the panel that shows the view.
  void pick(const std::string& point, std::size_t number) {
    const auto panel = window_->xrays().panel_of(number);
    ASSERT_TRUE(panel) << "the view of the next pick is not displayed";
    XrayView& xray = window_->xray(*panel);
    const Eigen::Vector2d raw = click_of(point, number);
    ASSERT_TRUE(wait("the layer is computed", [&] { return !xray.is_computing(); }));
    const auto place = xray.place_of({raw.x(), raw.y()});
    ASSERT_TRUE(place);
    QTest::mouseClick(&xray, Qt::LeftButton, {}, place->toPoint());
    const std::string view = state().views[number];
    ASSERT_TRUE(wait("the click is a pick", [&] { return pick_of(state(), point, view) != nullptr; }));
    ASSERT_TRUE(wait_idle());
    QTest::qWait(QApplication::doubleClickInterval() + 50);
  }
  void fill_in_the_dialog() {
    drop(*window_, files_);
    ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
    ASSERT_TRUE(wait("the images are shown", [&] { return state().source == Source::images; }));
    wait_checked();
    EXPECT_THAT(part<QLabel>("calibratorLack")->text().toStdString(), HasSubstr("Choose the calibrator"));
    EXPECT_FALSE(part<QPushButton>("createCase")->isEnabled());
    choose_by_file_dialog(file_button_of("calibrator"), folder_ / "calibrator.json");
    part<QTableWidget>("caseImages")->item(2, 2)->setText("OBL");
    part<QComboBox>("cArm")->setEditText("C-arm 2");
    part<QLineEdit>("intensifier")->setText("23 cm");
  }
  /// By the slider under the image, which the dialog follows.
  void choose_the_frame() {
    window_->xrays().display(2);
    const auto panel = window_->xrays().panel_of(2);
    ASSERT_TRUE(panel);
    auto* slider = window_->xrays().panel(*panel).findChild<QSlider*>("frame");
    ASSERT_EQ(slider->maximum(), frames);
    slider->setFocus();
    while (slider->value() < acquired_frame) QTest::keyClick(slider, Qt::Key_Right);
    wait_checked();
    EXPECT_EQ(dialog().checked().images[2].frame, acquired_frame);
  }
  void create_the_case() {
    wait_checked();
    screenshot("9-new-case", &dialog());
    auto* create = part<QPushButton>("createCase");
    ASSERT_TRUE(create->isEnabled()) << part<QLabel>("findings")->text().toStdString();
    QTest::mouseClick(create, Qt::LeftButton);
    ASSERT_TRUE(wait("the case is measured", [&] { return state().measured && !state().busy; }));
  }
  void expect_views_by_thumbnail_and_four_large() {
    XrayPanels& xrays = window_->xrays();
    ASSERT_FALSE(xrays.panel_of(0));
    QListWidget& all = xrays.thumbnails();
    QTest::mouseClick(all.viewport(), Qt::LeftButton, {}, all.visualItemRect(all.item(0)).center());
    EXPECT_TRUE(xrays.panel_of(0));
    QTest::keyClick(window_.get(), Qt::Key_5, Qt::ControlModifier);
    for (const std::size_t view : {0u, 1u, 2u}) {
      const auto panel = xrays.panel_of(view);
      ASSERT_TRUE(panel);
      EXPECT_TRUE(xrays.xray(*panel).isVisible());
    }
    EXPECT_FALSE(xrays.xray(3).isVisible());
    ASSERT_TRUE(wait("the layers are computed", [&] { return !xrays.xray(2).is_computing(); }));
    screenshot("13-four-large");
  }
  Eigen::Vector3d true_place(const std::string& point) {
    for (const simulation::TunnelPoint& of_tunnel : simulated_.navigation->points)
      if (of_tunnel.name == point) return of_tunnel.in_calibrator;
    throw std::out_of_range(point);
  }

  simulation::SimulatedCase simulated_;
  std::vector<fs::path> files_;
};

TEST_F(WindowWithOwnImages, BecomeACaseWithSavedPicksAndAnExport) {
  ASSERT_TRUE(write_file(folder_ / "calibrator.json", to_text(phantom::to_json(simulated_.calibrator))));
  ASSERT_NO_FATAL_FAILURE(fill_in_the_dialog());
  ASSERT_NO_FATAL_FAILURE(choose_the_frame());
  ASSERT_NO_FATAL_FAILURE(create_the_case());
  EXPECT_EQ(state().views, (std::vector<std::string>{"AP", "LAT", "OBL"}));
  EXPECT_EQ(window_->xrays().thumbnails().count(), 3);
  EXPECT_EQ(window_->xrays().thumbnails().item(2)->text().toStdString(), "OBL\nmeasured");

  while (const auto wanted = next_pick(state())) {
    const auto view = std::ranges::find(state().views, wanted->view) - state().views.begin();
    ASSERT_NO_FATAL_FAILURE(pick(wanted->point, std::size_t(view)));
  }
  auto* ends = find<QTableWidget>("endTable");
  ends->setCurrentCell(0, 0, QItemSelectionModel::ClearAndSelect | QItemSelectionModel::Rows);
  window_->xrays().display(2);
  screenshot("10-third-view");
  ASSERT_NO_FATAL_FAILURE(pick("FS", 2));
  EXPECT_EQ(ends->item(0, 2)->text().toStdString(), "AP (ball), LAT (ball), OBL (ball)");
  screenshot("12-three-views");
  expect_views_by_thumbnail_and_four_large();
  QTest::keyClick(window_.get(), Qt::Key_S, Qt::ControlModifier);
  EXPECT_FALSE(state().has_unsaved_picks);

  window_->controller().export_to(folder_ / "export");
  ASSERT_TRUE(wait_idle());
  EXPECT_TRUE(fs::exists(folder_ / "export" / "report.pdf"));
  const Json result = read_json(folder_ / "export" / "result.json").value();
  ASSERT_EQ(result.at("views").size(), 3u);
  int located = 0;
  for (const pipeline::PointResult& point : state().result->points)
    if (point.source == localization::PointSource::pick) {
      ASSERT_TRUE(point.place) << point.name;
      EXPECT_LT((point.place->in_calibrator - true_place(point.name)).norm(), 0.5) << point.name;
      ++located;
    }
  EXPECT_EQ(located, 4);
  const auto saved = pipeline::read_case(*state().case_folder);
  ASSERT_TRUE(saved) << saved.error().message;
  EXPECT_EQ(saved->picks.size(), 9u);
  EXPECT_EQ(saved->views[2].frame, acquired_frame);
  EXPECT_THAT(read_json(*state().case_folder / "case.json")->at("notes").get<std::string>(),
              HasSubstr("C-arm 2; detector: 23 cm"));
}

TEST_F(WindowWithOwnImages, ASingleImageIsForLookingAndDemandsNoSecond) {
  drop(*window_, {files_[2]});
  ASSERT_TRUE(wait("the image is shown", [&] { return state().source == Source::images && !state().busy; }));
  EXPECT_EQ(window_->new_case(), nullptr);
  EXPECT_EQ(card(Phase::acquire).status, StepStatus::good);
  EXPECT_TRUE(window_->xray(0).isVisible());
  EXPECT_FALSE(window_->xray(1).isVisible());
  auto* slider = window_->xrays().panel(0).findChild<QSlider*>("frame");
  EXPECT_TRUE(slider->isVisible());
  QTest::mouseClick(window_->xrays().panel(0).findChild<QPushButton*>("playFrames"), Qt::LeftButton);
  ASSERT_TRUE(wait("the acquired frame is played", [&] { return slider->value() == acquired_frame; }));
  QTest::mouseClick(window_->xrays().panel(0).findChild<QPushButton*>("playFrames"), Qt::LeftButton);
  slider->setValue(acquired_frame);
  ASSERT_TRUE(wait("it is shown", [&] {
    return window_->xrays().panel(0).other_frame() && !window_->xray(0).is_computing();
  }));
  for (QAction* action : window_->findChildren<QAction*>())
    if (action->text() == "Distance") action->trigger();
  const QPoint middle = window_->xray(0).rect().center();
  for (const QPoint& at : {middle, middle + QPoint(60, 0)}) {
    QTest::mouseClick(&window_->xray(0), Qt::LeftButton, {}, at);
    QTest::qWait(QApplication::doubleClickInterval() + 50);
  }
  ASSERT_EQ(find<QTableWidget>("measuresTable")->rowCount(), 1);
  EXPECT_TRUE(find<QTableWidget>("measuresTable")->item(0, 4)->text().endsWith(" px"));
  screenshot("11-single-image");
}

TEST_F(WindowWithOwnImages, AFolderOfDicomFilesWithoutExtensionsIsOfferedAsACase) {
  drop(*window_, {folder_ / "disk"});
  ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
  wait_checked();
  EXPECT_EQ(part<QTableWidget>("caseImages")->rowCount(), 3);
}

TEST_F(WindowWithOwnImages, SelectedOnesAreRemovedAndWhatIsMissingIsSaidBesideIt) {
  std::ofstream(folder_ / "notes.dcm") << "not an image";
  drop(*window_, {files_[0], folder_ / "notes.dcm", files_[1]});
  ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
  wait_checked();
  auto* images = part<QTableWidget>("caseImages");
  EXPECT_THAT(images->item(1, 4)->text().toStdString(), HasSubstr("not_an_image"));
  EXPECT_THAT(part<QLabel>("imagesLack")->text().toStdString(), HasSubstr("cannot be used"));
  for (const int row : {0, 1})
    images->selectionModel()->select(images->model()->index(row, 0),
                                     QItemSelectionModel::Select | QItemSelectionModel::Rows);
  QTest::mouseClick(part<QPushButton>("removeImage"), Qt::LeftButton);
  wait_checked();
  ASSERT_EQ(images->rowCount(), 1);
  EXPECT_EQ(images->item(0, 0)->text(), "IM2");
  EXPECT_TRUE(part<QLabel>("imagesLack")->text().isEmpty());
}

TEST_F(WindowWithOwnImages, APresetIsKeptChosenAndDeleted) {
  drop(*window_, {files_[0], files_[1]});
  ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
  part<QComboBox>("cArm")->setEditText("C-arm 2");
  part<QLineEdit>("intensifier")->setText("31 cm");
  part<QComboBox>("calibrator")->setCurrentIndex(1);
  part<QComboBox>("plate")->setCurrentIndex(1);
  QTest::mouseClick(part<QPushButton>("keepPreset"), Qt::LeftButton);
  ASSERT_EQ(c_arm_presets(QSettings()).size(), 1u);
  EXPECT_EQ(c_arm_presets(QSettings())[0], (CArmPreset{"C-arm 2", "31 cm", "udcsc", "plate48", {}}));
  part<QComboBox>("calibrator")->setCurrentIndex(0);
  part<QComboBox>("plate")->setCurrentIndex(0);
  emit part<QComboBox>("cArm")->textActivated("C-arm 2");
  EXPECT_EQ(part<QComboBox>("calibrator")->currentData().toString(), "udcsc");
  EXPECT_EQ(part<QComboBox>("plate")->currentData().toString(), "plate48");
  QTest::mouseClick(part<QPushButton>("deletePreset"), Qt::LeftButton);
  EXPECT_TRUE(c_arm_presets(QSettings()).empty());
}

TEST_F(WindowWithOwnImages, APresetGivesAViewItsImageOfThePlate) {
  QSettings settings;
  keep_preset(settings, {"C-arm 2", "", "udcsc", "plate48", {{"AP", {files_[1], {}}}}});
  drop(*window_, {files_[0], files_[1]});
  ASSERT_TRUE(wait("the dialog is offered", [&] { return window_->new_case() != nullptr; }));
  part<QComboBox>("cArm")->setEditText("C-arm 2");
  emit part<QComboBox>("cArm")->textActivated("C-arm 2");
  wait_checked();
  const auto distortion_of = [&](int row) {
    return qobject_cast<QPushButton*>(part<QTableWidget>("caseImages")->cellWidget(row, 3))->text();
  };
  EXPECT_EQ(distortion_of(0), "plate: IM2");
  EXPECT_EQ(distortion_of(1), "in the image");
  ASSERT_TRUE(dialog().checked().is_complete());
  EXPECT_TRUE((*dialog().checked().made)->the_case.views[0].plate_image);
}

}  // namespace
}  // namespace helicarm::gui
