// SPDX-License-Identifier: Apache-2.0
#include "gui/replay/pdf_report.h"

#include <QImage>
#include <QPainter>
#include <QSvgRenderer>
#include <QTemporaryDir>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "gui/replay/application_test.h"
#include "gui/replay/print_svg.h"
#include "helicarm/core/files.h"
#include "helicarm/report/figures.h"

namespace helicarm::gui {
namespace {
namespace fs = std::filesystem;

pipeline::Result result_of_two_views(std::size_t points) {
  pipeline::Result result;
  for (const char* name : {"AP", "LAT <&>"}) {
    pipeline::ViewResult& view = result.views.emplace_back();
    view.name = name;
    xray::XrayImage exposure{name, image::Image<float>(640, 480, 3000), 0, 4095, {}, {}};
    for (int v = 0; v < 480; ++v)
      for (int u = 0; u < 640; ++u) exposure.pixels(u, v) = float(500 + 4 * u);
    view.xray_image = std::make_shared<const xray::XrayImage>(std::move(exposure));
    view.rectification = rectification::Rectification{};
    view.rectification->map = rectification::identity_map(640, 480, 0.2);
    view.found = fiducials::LabelledFiducials{};
    fiducials::Fiducial ball{"P1", Eigen::Vector3d::Zero()};
    ball.status = fiducials::FiducialStatus::used;
    ball.uv = {320, 240};
    view.found->fiducials = {ball};
  }
  for (std::size_t i = 0; i < points; ++i) {
    pipeline::PointResult& point = result.points.emplace_back();
    point.name = "point " + std::to_string(i);
    point.source = localization::PointSource::pick;
    point.seen.resize(2);
    if (i % 7 == 6) {
      point.reason = Failure{Reason::not_seen, "is in one view only", "", {}};
      continue;
    }
    point.place = guidance::PointInFrames{};
    point.place->covariance_in_calibrator = 0.01 * Eigen::Matrix3d::Identity();
  }
  result.tunnels.push_back({"femur", {}, {}, {}, 30});
  result.accuracy.fre_mm = {0.1, 0.1, 0.2, 0.05, 12};
  return result;
}

class Pdf : public testing::Test {
 protected:
  void SetUp() override { application(); }
  std::string bytes() const { return read_file(path_, 1 << 26).value(); }
  int pages() const {
    int count = 0;
    const std::string pdf = bytes();
    for (auto at = pdf.find("/Type /Page\n"); at != std::string::npos; at = pdf.find("/Type /Page\n", at + 1))
      ++count;
    return count;
  }

  QTemporaryDir root_;
  const fs::path path_ = fs::path(root_.path().toStdString()) / "report.pdf";
};

TEST_F(Pdf, IsCompleteAndGrowsByPages) {
  ASSERT_TRUE(write_pdf_report(result_of_two_views(5), path_));
  EXPECT_TRUE(bytes().starts_with("%PDF-"));
  EXPECT_THAT(bytes().substr(bytes().size() - 8), testing::HasSubstr("%%EOF"));
  const int few = pages();
  ASSERT_TRUE(write_pdf_report(result_of_two_views(200), path_));
  EXPECT_GT(pages(), few + 2);
}

TEST_F(Pdf, RefusedResultHasAReport) {
  pipeline::Result refused;
  refused.failure = Failure{Reason::views_too_close, "AP and LAT are 3 degrees apart, limit 30", "", {}};
  ASSERT_TRUE(write_pdf_report(refused, path_));
  EXPECT_EQ(pages(), 1);
}

TEST_F(Pdf, IsWrittenCompletelyOrNotAtAll) {
  fs::create_directory(path_);
  const auto written = write_pdf_report(result_of_two_views(1), path_);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().reason, Reason::cannot_write);
  EXPECT_EQ(std::distance(fs::directory_iterator(path_.parent_path()), {}), 1);
}

TEST_F(Pdf, FigureContainsItsImageAndColours) {
  const pipeline::Result result = result_of_two_views(1);
  QSvgRenderer svg(print_svg(report::view_figure(result, 1)));
  ASSERT_TRUE(svg.isValid());
  EXPECT_EQ(svg.viewBoxF(), QRectF(-0.5, -0.5, 640, 480));
  QImage page(640, 480, QImage::Format_RGB32);
  page.fill(Qt::red);
  QPainter painter(&page);
  svg.render(&painter, QRectF(0, 0, 640, 480));
  painter.end();
  EXPECT_LT(qRed(page.pixel(20, 100)), 80);  // the grey ramp, not the page
  EXPECT_GT(qGreen(page.pixel(600, 100)), 180);
  int green = 0;
  for (int u = 300; u < 340; ++u)
    for (int v = 220; v < 260; ++v) green += qGreen(page.pixel(u, v)) > qRed(page.pixel(u, v)) + 60;
  EXPECT_GT(green, 20);  // the ball's circle
}

}  // namespace
}  // namespace helicarm::gui
