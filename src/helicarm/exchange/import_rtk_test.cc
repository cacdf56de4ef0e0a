// SPDX-License-Identifier: Apache-2.0
#include "helicarm/exchange/import_text_test.h"
#include "helicarm/exchange/rtk_projection.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

/// As RTK writes it: what all projections share comes first. The matrix was computed with NumPy from the
/// equations of RTK's documentation.
const std::string rtk_xml = R"(<?xml version="1.0"?>
<!DOCTYPE RTKGEOMETRY>
<RTKThreeDCircularGeometry version="3">
  <SourceToIsocenterDistance>1000</SourceToIsocenterDistance>
  <SourceToDetectorDistance>1536</SourceToDetectorDistance>
  <!-- <GantryAngle>7</GantryAngle> -->
  <Projection>
    <GantryAngle>0</GantryAngle>
  </Projection>
  <Projection>
    <GantryAngle>30</GantryAngle>
    <OutOfPlaneAngle>4</OutOfPlaneAngle>
    <InPlaneAngle>-7</InPlaneAngle>
    <SourceOffsetX>3</SourceOffsetX>
    <SourceOffsetY>-2</SourceOffsetY>
    <ProjectionOffsetX>-116</ProjectionOffsetX>
    <ProjectionOffsetY>11.5</ProjectionOffsetY>
    <Matrix>
        -1254.415835275482 178.43430246821637 876.3898173260545 -114392.0
        -222.0196354675674 -1519.8954471837728 -10.166665967134872 10428.0
        0.49878202512991204 -0.0697564737441253 0.8639158094271043 -1000.0
    </Matrix>
  </Projection>
</RTKThreeDCircularGeometry>
)";
const ImportOptions second{
    .column = 2, .image_size = Eigen::Vector2i(1024, 768), .pixel_mm = Eigen::Vector2d(0.388, 0.4)};

/// mm on the detector by the equations, then (mm - origin) / spacing with RTK's centred origin.
TEST(ImportRtk, PointsLieAtTheirPixels) {
  const auto camera = import_text(rtk_xml, second);
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(*camera->image_size, Eigen::Vector2i(1024, 768));
  for (const auto& [point, pixel] :
       {std::pair{Eigen::Vector3d(10, 20, 30), Eigen::Vector2d(769.3031160741336, 441.4478127113461)},
        {Eigen::Vector3d(-25, 4, 12), Eigen::Vector2d(696.1149345901509, 359.11580032245564)},
        {Eigen::Vector3d(33, -41, -7), Eigen::Vector2d(953.5481211164102, 217.57722456815603)}})
    EXPECT_LT((camera->view.project(point) - pixel).norm(), 1e-8) << point.transpose();
}

TEST(ImportRtk, RowsThatRunUpwardsAreAMirroredImage) {
  EXPECT_LT(import_text(rtk_xml, second)->view.intrinsics.fx, 0);
}

TEST(ImportRtk, OriginOfTheProjectionImagesIsUsed) {
  ImportOptions options = second;
  options.origin_mm = {0, 0};
  const auto camera = import_text(rtk_xml, options);
  ASSERT_TRUE(camera) << camera.error().message;
  const Eigen::Vector2d mm(100.02760903676385, 23.179125084538438);
  EXPECT_LT((camera->view.project({10, 20, 30}) - mm.cwiseQuotient(*options.pixel_mm)).norm(), 1e-8);
}

/// The pixels' spacing is in mm whatever the file's unit.
TEST(ImportRtk, TheSameGeometryInCentimetresIsTheSameCamera) {
  std::string in_cm = rtk_xml;
  for (const auto& [mm, cm] : {std::pair{">1000<", ">100<"},
                               {">1536<", ">153.6<"},
                               {">3<", ">0.3<"},
                               {">-2<", ">-0.2<"},
                               {">-116<", ">-11.6<"},
                               {">11.5<", ">1.15<"}})
    in_cm = replaced(in_cm, mm, cm);
  const std::size_t matrix = in_cm.find("<Matrix>"), end = in_cm.find("</Matrix>") + 9;
  in_cm.erase(matrix, end - matrix);
  EXPECT_EQ(import_text(in_cm, second).error().reason, Reason::usage);  // 100 mm from source to isocentre
  for (const bool with_origin : {false, true}) {
    ImportOptions options = second;
    if (with_origin) options.origin_mm = {-190, -150};
    const auto mm = import_text(rtk_xml, options);
    options.mm_per_unit = 10;
    const auto cm = import_text(in_cm, options);
    ASSERT_TRUE(mm && cm) << cm.error().message;
    EXPECT_LT((cm->view.projection() - mm->view.projection()).norm(), 1e-9 * mm->view.projection().norm());
    EXPECT_NEAR(cm->view.intrinsics.fx, mm->view.intrinsics.fx, 1e-8);
  }
}

TEST(ImportRtk, BrokenFilesAreNamed) {
  for (const auto& [text, reason] :
       {std::pair{replaced(rtk_xml, "-1254.4158", "-1254.4258"), Reason::bad_value},
        {replaced(rtk_xml, "<GantryAngle>30<", "<GantryAngle>thirty<"), Reason::bad_value},
        {replaced(rtk_xml, "<GantryAngle>30<", "<GantryAngle>30 2<"), Reason::bad_size},
        {replaced(rtk_xml, "<GantryAngle>30<", "<GantryAngle>1e999<"), Reason::not_finite},
        {replaced(rtk_xml, "<SourceToDetectorDistance>1536<", "<SourceToDetectorDistance>0<"),
         Reason::bad_value},
        {replaced(rtk_xml, "<SourceToIsocenterDistance>",
                  "<RadiusCylindricalDetector>900</RadiusCylindricalDetector>"
                  "<SourceToIsocenterDistance>"),
         Reason::unsupported},
        {rtk_xml.substr(0, rtk_xml.size() - 40), Reason::truncated}}) {
    const auto refused = import_text(text, second);
    ASSERT_FALSE(refused) << text;
    EXPECT_EQ(refused.error().reason, reason) << refused.error().message;
  }
}

TEST(ImportRtk, ProjectionSpacingAndSizeAreRequired) {
  ImportOptions options = second;
  options.column.reset();
  EXPECT_EQ(import_text(rtk_xml, options).error().reason, Reason::usage);
  options.column = 3;
  EXPECT_EQ(import_text(rtk_xml, options).error().reason, Reason::bad_value);
  options = second;
  options.pixel_mm.reset();
  EXPECT_EQ(import_text(rtk_xml, options).error().reason, Reason::usage);
}

class RtkViews : public testing::TestWithParam<double> {};

/// A point's pixel by RTK's matrix is the view's, whichever way the rows run.
TEST_P(RtkViews, AreTheCamera) {
  const Eigen::Vector2i size(640, 480);
  const geometry::View view{{GetParam(), 3100, 331.5, 228.25, 1e-18},
                            {geometry::rotation_from_vector({0.4, -1.9, 0.7}), {14, -9, 610}}};
  const auto rtk = rtk_view(view, size, 0.3);
  ASSERT_TRUE(rtk) << rtk.error().message;
  const geometry::Projection matrix = rtk->pixels.pixels_from_mm() * rtk->projection.matrix();
  for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), {30, -12, 8}, {-7, 25, -33}}) {
    Eigen::Vector2d pixel = (matrix * point.homogeneous()).hnormalized();
    if (rtk->rows_upwards) pixel.y() = size.y() - 1 - pixel.y();
    EXPECT_LT((pixel - view.project(point)).norm(), 1e-8);
  }
  EXPECT_EQ(rtk->rows_upwards, GetParam() > 0);
  EXPECT_NEAR(rtk->projection.source_to_detector, 930, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Handedness, RtkViews, testing::Values(3000.0, -3000.0));

TEST(RtkView, GimbalLockKeepsTheCamera) {
  // The camera's y along the world's -z: RTK's in-plane and gantry axes coincide.
  Eigen::Matrix3d rotation;
  rotation << 0.6, 0.8, 0, 0, 0, -1, -0.8, 0.6, 0;
  Eigen::Matrix3d locked;
  locked << 0.6, 0, 0.8, 0.8, 0, -0.6, 0, 1, 0;
  for (const Eigen::Matrix3d& r : {rotation, locked}) {
    const geometry::View view{{3000, 3000, 320, 240, 0}, {r, {0, 0, 600}}};
    const auto rtk = rtk_view(view, {640, 480}, 0.3);
    ASSERT_TRUE(rtk);
    Eigen::Vector2d pixel =
        (rtk->pixels.pixels_from_mm() * rtk->projection.matrix() * Eigen::Vector4d(20, -5, 9, 1))
            .hnormalized();
    pixel.y() = 479 - pixel.y();
    EXPECT_LT((pixel - view.project({20, -5, 9})).norm(), 1e-8);
  }
}

TEST(RtkView, SkewAndAnIsocenterBehindTheSourceAreRefused) {
  geometry::View view{{3000, 3000, 320, 240, 0.5}, {Eigen::Matrix3d::Identity(), {0, 0, 600}}};
  EXPECT_EQ(rtk_view(view, {640, 480}, 0.3).error().reason, Reason::unsupported);
  view.intrinsics.skew = 0;
  view.camera_from_world.translation.z() = -600;
  EXPECT_EQ(rtk_view(view, {640, 480}, 0.3).error().reason, Reason::behind_source);
}

}  // namespace
}  // namespace helicarm::exchange
