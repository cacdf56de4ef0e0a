// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/registration_figures.h"

#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/registration/outline.h"
#include "helicarm/registration/scene_test.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector3d;
using testing::HasSubstr;
using testing::Not;

struct Extent {
  Vector2d low = Vector2d::Constant(1e9), high = Vector2d::Constant(-1e9);

  void add(const Vector2d& at) { low = low.cwiseMin(at), high = high.cwiseMax(at); }
};

/// Two balls, far off the image's centre.
phantom::TriangleMesh surface() {
  const auto ball = [](const Vector3d& p, const Vector3d& c, double r) { return (p - c).norm() - r; };
  return phantom::surface_of(
      [&](const Vector3d& p) {
        return std::min(ball(p, {0, 0, 0}, 10), ball(p, {9, 4, 8}, 6));
      },
      {Vector3d(-14, -14, -14), Vector3d(18, 14, 18)}, 1.0);
}

/// 1200 x 1500 pixels.
geometry::View large_view() {
  geometry::View view = registration::view_from(0);
  view.intrinsics = {10400, 10400, 599.5, 749.5, 0};
  return view;
}

TEST(DrrImage, DarkBoneLiesWhereTheOutlineLies) {
  const auto model = *registration::model_from("implant", surface());
  const geometry::RigidTransform pose{geometry::rotation_from_vector({0.3, 0.5, -0.2}), {13, 2, 21}};
  const auto drr = drr_image(model, large_view(), pose, {1200, 1500}, 1);
  ASSERT_EQ(Vector2i(drr.width(), drr.height()), Vector2i(512, 640));
  Extent dark, outline;
  const Vector2d step(1200.0 / drr.width(), 1500.0 / drr.height());
  for (int v = 0; v < drr.height(); ++v)
    for (int u = 0; u < drr.width(); ++u)
      if (drr(u, v) < 240) dark.add(step.cwiseProduct(Vector2d(u + 0.5, v + 0.5)) - Vector2d::Constant(0.5));
  for (const Vector2d& at : registration::outline(model, large_view(), pose, 2)) outline.add(at);
  const double voxel_px = 10400 * model.resolution_mm / 650;
  EXPECT_LT((dark.low - outline.low).cwiseAbs().maxCoeff(), 2 * voxel_px);
  EXPECT_LT((dark.high - outline.high).cwiseAbs().maxCoeff(), 2 * voxel_px);
}

TEST(DrrImage, IsAsDarkAsMatterIsThick) {
  const auto model = *registration::model_from("bone", registration::lopsided_bone(), std::nullopt,
                                               registration::HuWindow{150, 3000});
  const geometry::View view = registration::view_from(0);
  const auto drr = drr_image(model, view, registration::true_pose(), {160, 160}, 1);
  const auto integrals = registration::PosedDensity(model.density, registration::true_pose(),
                                                    view.source_in_world(), Vector3d::Zero());
  const auto integral = [&](int u, int v) {
    return integrals.integrate(
        (view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse() * Vector3d(u, v, 1))
            .normalized());
  };
  ASSERT_EQ(drr.width(), 160);
  EXPECT_EQ(drr(0, 0), 255);
  for (const Vector2i& at : {Vector2i(80, 80), Vector2i(80, 60), Vector2i(90, 80), Vector2i(70, 100)})
    for (const Vector2i& other : {Vector2i(80, 80), Vector2i(75, 90)})
      EXPECT_EQ(drr(at.x(), at.y()) > drr(other.x(), other.y()),
                integral(at.x(), at.y()) < integral(other.x(), other.y()));
  EXPECT_LT(drr(80, 80), 160);
}

TEST(DrrImage, LessThanSoftTissueIsNotDark) {
  auto model = *registration::model_from("implant", surface());
  for (float& value : model.density.values) value = -value;
  const auto drr = drr_image(model, large_view(), {}, {1200, 1500}, 1);
  ASSERT_FALSE(drr.empty());
  EXPECT_EQ(std::ranges::min(drr.pixels()), 255);
}

TEST(DrrImage, ModelBehindTheSourceHasNone) {
  const auto model = *registration::model_from("implant", surface());
  geometry::RigidTransform pose;
  pose.translation = large_view().source_in_world();
  EXPECT_TRUE(drr_image(model, large_view(), pose, {1200, 1500}, 1).empty());
}

/// Registers the two balls, whose images are made from their own density, from a start 2 mm off; or by
/// landmarks.
class Report : public testing::Test {
 protected:
  CaseRegistration registered(pipeline::CaseModel case_model) {
    pipeline::Case the_case;
    case_model.name = "implant";
    the_case.models = {case_model};
    RegisterOptions options;
    options.run.threads = 1;
    options.search = {3, 3};
    const auto model = *registration::model_from("implant", surface());
    volume::Volume volume{model.density.size, model.density.values, model.density.model_from_voxel, {}};
    for (float& voxel : volume.voxels) voxel = voxel > 0 ? 3000.0F : -1024.0F;
    LoadedViews loaded;
    loaded.views = registration::two_views(volume, {});
    loaded.maps.resize(2);
    for (const Vector3d& point : landmarks)
      for (const auto& view : loaded.views)
        the_case.picks.push_back({"p" + std::to_string(int(point.x())),
                                  view.name,
                                  view.view.project(point),
                                  pipeline::Snap::none,
                                  3,
                                  {},
                                  {}});
    auto made = register_loaded(the_case, std::move(loaded), options);
    EXPECT_TRUE(made) << made.error().message;
    return *made;
  }
  pipeline::CaseModel with_surface() {
    EXPECT_TRUE(write_file(folder_.path() / "implant.stl", phantom::to_stl(surface())));
    pipeline::CaseModel model;
    model.surface = folder_.path() / "implant.stl";
    model.world_from_model = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {1, -1, 1}};
    return model;
  }
  pipeline::CaseModel with_landmarks() {
    std::string csv = "name,x_mm,y_mm,z_mm\n";
    for (const Vector3d& point : landmarks)
      csv += "p" + std::to_string(int(point.x())) + "," + std::to_string(point.x()) + "," +
             std::to_string(point.y()) + "," + std::to_string(point.z()) + "\n";
    EXPECT_TRUE(write_file(folder_.path() / "points.csv", csv));
    pipeline::CaseModel model;
    model.landmarks = folder_.path() / "points.csv";
    return model;
  }

  const std::vector<Vector3d> landmarks = {{1, 2, 10}, {2, -8, -5}, {9, 5, 1}, {-7, 1, 2}};
  TemporaryFolder folder_;
};

TEST_F(Report, HoldsSliderAndAgreementOfEachView) {
  const CaseRegistration result = registered(with_surface());
  const RegisteredModel& model = result.models[0];
  ASSERT_EQ(model.drrs.size(), 2u);
  ASSERT_EQ(model.registration.views.size(), 2u);
  const std::string html = report_html(result);
  const auto count = [&](const std::string& part) {
    int found = 0;
    for (auto at = html.find(part); at != html.npos; at = html.find(part, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("<input type=\"range\""), 2);
  EXPECT_EQ(count("<figure class=\"agreement\">"), 2);
  EXPECT_EQ(count("data:image/png"), 4) << "each X-ray image and each DRR once";
  EXPECT_THAT(html, HasSubstr("contour points"));
  EXPECT_THAT(html, Not(HasSubstr("src=\"http")));
}

TEST_F(Report, UntrackedBodyHasANoteOnItsMotion) {
  const CaseRegistration result = registered(with_surface());
  ASSERT_EQ(result.models[0].registration.notes.size(), 1u);
  EXPECT_EQ(result.models[0].registration.notes[0].reason, Reason::unobservable_motion);
}

TEST_F(Report, RefusedModelHasItsFiguresToo) {
  CaseRegistration result = registered(with_surface());
  result.models[0].registration.failure = Failure{Reason::wrong_model, "another implant", {}, {}};
  EXPECT_THAT(report_html(result), HasSubstr("<input type=\"range\""));
}

TEST_F(Report, LandmarksAloneHaveNoDrr) {
  const CaseRegistration result = registered(with_landmarks());
  ASSERT_TRUE(result.models[0].by_landmarks_only);
  const std::string html = report_html(result);
  EXPECT_THAT(html, HasSubstr("<figure class=\"overlay\">"));
  for (const char* part : {"type=\"range\"", "class=\"agreement\"", "class=\"drr\"", "<script"})
    EXPECT_THAT(html, Not(HasSubstr(part)));
}

/// Marks are squares around their pixel, coloured by their agreement.
TEST(ModelFigures, MarksHavePlaceSizeAndColourOfTheirAgreement) {
  CaseRegistration result;
  result.loaded.views.resize(1);
  result.loaded.views[0].grey = image::Image<float>(100, 100);
  result.models.resize(1);
  result.models[0].drrs.resize(1);
  registration::RegisteredView view{"AP", 0.5, 1, {}, 3};
  view.comparison_px = 40;
  view.agreements = {{{20, 30}, 0.95, 0.5}, {{60, 30}, 0.5, 0.25}, {{60, 70}, -0.4, 0.25}};
  result.models[0].registration.views = {view};
  const std::string html = model_figures(result, 0);
  EXPECT_THAT(html, HasSubstr("3 patches of 40 px"));
  // With half of its frame outside, each square is 40 px wide.
  for (
      const char* mark :
      {R"(x="5.0" y="15.0" width="30.0" height="30.0" fill="#0072b2" stroke="#0072b2" stroke-width="10.0"><title>0.95<)",
       R"(x="43.0" y="13.0" width="34.0" height="34.0" fill="#f0e442" stroke="#f0e442" stroke-width="6.0"><title>0.50<)",
       R"(x="43.0" y="53.0" width="34.0" height="34.0" fill="#d55e00" stroke="#d55e00" stroke-width="6.0"><title>-0.40<)"})
    EXPECT_THAT(html, HasSubstr(mark));
}

}  // namespace
}  // namespace helicarm::case_registration
