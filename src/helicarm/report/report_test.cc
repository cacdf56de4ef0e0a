// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/report.h"

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/report/overlay.h"

namespace helicarm::report {
namespace {

const char* const nasty = "<script>alert('&')</script>";

pipeline::Result full_result() {
  pipeline::Result result;
  for (const char* name : {"AP", nasty}) {
    pipeline::ViewResult view;
    view.name = name;
    xray::XrayImage xray_image{name, image::Image<float>(64, 48, 7), 0, 4095, {}, {}};
    xray_image.acquisition.patient_key = "CANARY";
    xray_image.pixels(3, 3) = 900;
    view.xray_image = std::make_shared<const xray::XrayImage>(std::move(xray_image));
    view.rectification = rectification::Rectification{};
    view.rectification->map = rectification::identity_map(64, 48, 0.2);
    fiducials::Fiducial ball{nasty, Eigen::Vector3d::Zero()};
    ball.status = fiducials::FiducialStatus::used;
    ball.uv = {20, 20};
    ball.residual_px = 0.1;
    view.found = fiducials::LabelledFiducials{};
    view.found->fiducials = {ball, {"P2", Eigen::Vector3d::Zero()}};
    view.calibrated = calibration::CalibratedView{};
    view.calibrated->view = {{400, 400, 20, 20.1, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 800}}};
    result.views.push_back(std::move(view));
  }
  pipeline::PointResult seen{nasty,
                             localization::PointSource::pick,
                             {},
                             {fiducials::ImagePoint{{1, 2}, {3, 4}, 0.1}, {}},
                             guidance::PointInFrames{},
                             0.2,
                             {}};
  pipeline::PointResult lost{"T1",
                             localization::PointSource::target,
                             {},
                             {{}, {}},
                             {},
                             0,
                             Failure{Reason::target_not_found, nasty, "", {}}};
  result.points = {seen, lost};
  result.tunnel_ends = {{0, 0}};
  result.tunnels.push_back({nasty, {}, {}, {}, 30});
  result.tool_lines.push_back({nasty, nasty, {0, 0, 0}, {0, 10, 0}});
  result.verifications.push_back(
      {nasty, guidance::LineError{{1.0, {}}, 1, 2, 3}, guidance::LineError{{1.0, {}}, 1, 2, 3}});
  result.warnings.push_back({{Reason::few_fiducials, nasty, nasty, {}}, pipeline::Stage::calibrate});
  result.accuracy.fre_mm = {0.1, 0.1, 0.2, 0.05, 12};
  result.accuracy.targets.push_back({nasty, 0.1, 0.1, 0.2});
  result.timing_ms.total = 12;
  return result;
}

/// Every opened tag is closed in order; void elements close themselves.
void expect_balanced(const std::string& html) {
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at + 1)) {
    const std::size_t end = html.find('>', at);
    ASSERT_NE(end, std::string::npos);
    const std::string tag = html.substr(at + 1, end - at - 1);
    if (tag.starts_with('!') || tag.ends_with('/')) continue;
    if (tag.starts_with('/')) {
      ASSERT_FALSE(open.empty()) << tag;
      ASSERT_EQ(open.back(), tag.substr(1));
      open.pop_back();
    } else {
      open.push_back(tag.substr(0, tag.find_first_of(" \n")));
    }
  }
  EXPECT_TRUE(open.empty()) << open.back();
}

TEST(ReportHtml, IsBalanced) { expect_balanced(report_html(full_result())); }

TEST(ReportHtml, TextFromFilesIsEscapedAndIdentityIsAbsent) {
  const std::string html = report_html(full_result());
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(html.find("CANARY"), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;"), std::string::npos);
}

TEST(ReportHtml, LoadsNoExternalResources) {
  const std::string html = report_html(full_result());
  for (const char* address : {"http:", "https:", "src=", "@import", "url("})
    EXPECT_EQ(html.find(address), std::string::npos) << address;
  EXPECT_NE(html.find("Research instrument, not a medical device"), std::string::npos);
}

TEST(ReportHtml, RefusalBeforeTheFirstStageStillGivesAReport) {
  pipeline::Result result;
  result.views.push_back({"AP", {}, {}, {}, {}});
  result.failure = Failure{Reason::blank_image, "nothing to see", "AP", {}};
  const std::string html = report_html(result);
  expect_balanced(html);
  EXPECT_NE(html.find("blank_image"), std::string::npos);
}

TEST(ReportHtml, DepthOfADrillStandsBesideTheErrorsOfItsTunnel) {
  pipeline::Result result = full_result();
  EXPECT_EQ(report_html(result).find("Beyond end, mm"), std::string::npos);  // only of a drill
  result.verifications = {{"femur", {}, {}, guidance::TipDepth{1.8, 0.25, 1}}};
  const std::string html = report_html(result);
  expect_balanced(html);
  EXPECT_NE(html.find("Beyond end, mm"), std::string::npos);
  EXPECT_NE(html.find("+1.80 ± 0.49"), std::string::npos);
}

TEST(OverlayName, UnsuitableNamesAreNumbered) {
  EXPECT_EQ(overlay_name("AP", 0), "AP_overlay.png");
  EXPECT_EQ(overlay_name("../x", 1), "view2_overlay.png");
  EXPECT_EQ(overlay_name("", 0), "view1_overlay.png");
}

TEST(OverlayPng, IsAPngOfTheImage) {
  const std::string png = overlay_png(full_result(), 0);
  ASSERT_GT(png.size(), 33u);
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(static_cast<unsigned char>(png[19]), 64);
  EXPECT_EQ(static_cast<unsigned char>(png[23]), 48);
}

}  // namespace
}  // namespace helicarm::report
