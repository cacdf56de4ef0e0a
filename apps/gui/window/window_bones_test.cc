// SPDX-License-Identifier: Apache-2.0
// Slices of a CT: seeds clicked in its bones, masks and surfaces.
#include <QPolygonF>
#include <QTableWidget>

#include "gui/controller/case_with_model_test.h"
#include "gui/window/bones_window.h"
#include "gui/window/legibility_test.h"
#include "gui/window/window_test.h"

namespace helicarm::gui {
namespace {

class WindowBones : public Window {
 protected:
  void open() {
    ASSERT_TRUE(write_file(folder_ / "ct.nrrd", to_nrrd(bone_in_tissue())));
    drop(*window_, {folder_ / "ct.nrrd"});
    ASSERT_TRUE(wait("the CT is read", [&] { return bones() && !bones()->is_busy(); }));
    ASSERT_TRUE(bones()->scene().ct) << says();
  }
  BonesWindow* bones() { return window_->findChild<BonesWindow*>("bones"); }
  template <class Part>
  Part* part(const char* name) {
    auto* found = bones()->findChild<Part*>(name);
    EXPECT_NE(found, nullptr) << name;
    return found;
  }
  std::string says() { return part<QLabel>("bonesSay")->text().toStdString(); }
  void click_at(const Eigen::Vector3d& voxel) {
    auto* slice = part<SliceView>("slice2");
    QTest::mouseClick(slice, Qt::LeftButton, {}, slice->place_of(voxel).toPoint());
  }
  void add_seed(const char* name) {
    part<QLineEdit>("seedName")->setText(name);
    QTest::mouseClick(part<QPushButton>("addSeed"), Qt::LeftButton);
  }
  void find_bones() {
    QTest::mouseClick(part<QPushButton>("findBones"), Qt::LeftButton);
    ASSERT_TRUE(wait("the bones are found", [&] { return !bones()->is_busy(); }));
  }
};

TEST_F(WindowBones, AClickInABoneFindsIt) {
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_FALSE(part<QPushButton>("findBones")->isEnabled());
  click_at({41, 30, 0});
  EXPECT_NEAR(bones()->scene().cursor.x(), 41, 1);
  EXPECT_NEAR(bones()->scene().cursor.y(), 30, 1);
  add_seed("two words");
  EXPECT_TRUE(bones()->seeds().empty());
  EXPECT_THAT(says(), HasSubstr("two words"));
  add_seed("femur");
  ASSERT_EQ(bones()->seeds().size(), 1u);
  EXPECT_EQ(part<QTableWidget>("seedTable")->item(0, 1)->text(), "1200");
  ASSERT_NO_FATAL_FAILURE(find_bones());
  ASSERT_TRUE(bones()->found()) << says();
  EXPECT_GT(bones()->found()->segmentation.bones[0].volume_cm3, 10);
  const QString volume = part<QTableWidget>("seedTable")->item(0, 2)->text();
  EXPECT_EQ(volume, QString::number(bones()->found()->segmentation.bones[0].volume_cm3, 'f', 1));
  screenshot("bones", bones());
  EXPECT_EQ(illegible_parts(*bones()).join('\n').toStdString(), "");
  QImage grey = slice_image(bones()->scene(), 2);
  CtScene bare = bones()->scene();
  bare.labels.reset();
  EXPECT_NE(grey, slice_image(bare, 2));

  click_at({42, 31, 0});  // another seed: the bones are not of these seeds
  add_seed("tibia");
  EXPECT_FALSE(bones()->found());
  EXPECT_EQ(part<QTableWidget>("seedTable")->item(0, 2)->text(), "–");
  EXPECT_FALSE(part<QPushButton>("writeBones")->isEnabled());
}

TEST_F(WindowBones, ASeedInAirIsRefusedWithItsReason) {
  ASSERT_NO_FATAL_FAILURE(open());
  click_at({1, 1, 0});
  add_seed("femur");
  ASSERT_NO_FATAL_FAILURE(find_bones());
  EXPECT_FALSE(bones()->found());
  EXPECT_THAT(says(), HasSubstr("seed_off_bone"));
}

TEST_F(WindowBones, TheBodyOfAModelIsOutlinedInItsCt) {
  pipeline::CaseModel model;
  model.name = "femur";
  model.volume = folder_ / "ct.nrrd";
  model.window_hu = {150, 3000};
  ASSERT_TRUE(write_file(*model.volume, to_nrrd(bone_in_tissue())));
  BonesWindow window;
  window.show();
  window.open_ct(*model.volume, {}, model);
  ASSERT_TRUE(wait("the CT is read", [&] { return !window.is_busy(); }));
  EXPECT_EQ(window.scene().body.says, "femur: 150 HU or more");
  EXPECT_GT(body_outline(window.scene(), 2).size(), 50u);
  screenshot("body-in-ct", &window);
}

TEST_F(WindowBones, AFileThatIsNoCtIsNamed) {
  ASSERT_TRUE(write_file(folder_ / "broken.nrrd", "NRRD0004\n"));
  window_->open_paths({folder_ / "broken.nrrd"});
  ASSERT_TRUE(wait("it is read", [&] { return bones() && !bones()->is_busy(); }));
  EXPECT_FALSE(bones()->scene().ct);
  EXPECT_THAT(says(), HasSubstr("broken.nrrd"));
  EXPECT_FALSE(part<QPushButton>("addSeed")->isEnabled());
}

TEST(BodyOutline, IsAroundTheVoxelsOfTheBodyAsTheyAreDrawn) {
  CtScene scene;
  volume::Volume ct;
  ct.size = {4, 3, 2};
  ct.voxels.assign(24, 0);
  ct.patient_from_voxel = Eigen::Scaling(-1.0, 1.0, 1.0);  // x is drawn against its direction
  scene.ct = std::make_shared<const volume::Volume>(ct);
  EXPECT_TRUE(body_outline(scene, 2).empty());
  std::vector<std::uint8_t> body(24, 0);
  body[0] = body[1] = 1;  // x 0 and 1, y 0, z 0
  scene.body.voxels = std::make_shared<const std::vector<std::uint8_t>>(body);
  const auto edges = body_outline(scene, 2);
  EXPECT_EQ(edges.size(), 6u);
  QPolygonF ends;
  for (const QLineF& edge : edges) ends << edge.p1() << edge.p2();
  EXPECT_EQ(ends.boundingRect(), QRectF(2, 0, 2, 1));
  scene.cursor.z() = 1;
  EXPECT_TRUE(body_outline(scene, 2).empty());
}

TEST(SliceImage, ShowsTheSliceAtTheCursor) {
  CtScene scene;
  volume::Volume ct;
  ct.size = {3, 2, 2};
  ct.voxels.assign(12, -1000);
  ct.voxels[1 + 3 * 0 + 6 * 1] = 3000;  // x 1, y 0, z 1
  scene.ct = std::make_shared<const volume::Volume>(ct);
  scene.cursor = {1, 0, 1};
  EXPECT_EQ(slice_image(scene, 2).size(), QSize(3, 2));
  EXPECT_EQ(qRed(slice_image(scene, 2).pixel(1, 0)), 255);
  EXPECT_EQ(qRed(slice_image(scene, 1).pixel(1, 0)), 255);  // superior is up
  EXPECT_EQ(qRed(slice_image(scene, 0).pixel(0, 0)), 255);
  scene.cursor.z() = 0;
  EXPECT_EQ(qRed(slice_image(scene, 2).pixel(1, 0)), 0);
}

}  // namespace
}  // namespace helicarm::gui
