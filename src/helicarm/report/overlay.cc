// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/overlay.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "helicarm/image/opencv.h"
#include "helicarm/image/png.h"
#include "helicarm/report/marks.h"
#include "helicarm/report/rectified_image.h"

namespace helicarm::report {
namespace {

const cv::Scalar green(74, 222, 128), red(248, 113, 113), blue(147, 197, 253), violet(240, 171, 252),
    yellow(250, 204, 21), crimson(239, 68, 68), orange(251, 146, 60);

/// OpenCV draws at fixed-point coordinates: here sixteenths of a pixel.
constexpr int shift = 4;
cv::Point fixed_point(const Eigen::Vector2d& at) {
  const Eigen::Vector2d safe = at.cwiseMax(-1e5).cwiseMin(1e5) * (1 << shift);
  return {static_cast<int>(std::lround(safe.x())), static_cast<int>(std::lround(safe.y()))};
}

class Canvas {
 public:
  explicit Canvas(const image::Image<std::uint8_t>& grey) : scale_(grey.width() / 1024.0) {
    cv::cvtColor(image::as_mat(grey), image_, cv::COLOR_GRAY2RGB);
  }
  void circle(const Eigen::Vector2d& at, double radius, const cv::Scalar& colour) {
    cv::circle(image_, fixed_point(at), static_cast<int>(radius * scale_ * (1 << shift)), colour, 1,
               cv::LINE_AA, shift);
  }
  void line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const cv::Scalar& colour) {
    cv::line(image_, fixed_point(a), fixed_point(b), colour, 2, cv::LINE_AA, shift);
  }
  void cross(const Eigen::Vector2d& at, double arm, const cv::Scalar& colour) {
    const double reach = arm * scale_;
    line(at - Eigen::Vector2d(reach, reach), at + Eigen::Vector2d(reach, reach), colour);
    line(at - Eigen::Vector2d(reach, -reach), at + Eigen::Vector2d(reach, -reach), colour);
  }
  void text(const Eigen::Vector2d& at, const std::string& words, const cv::Scalar& colour) {
    const Eigen::Vector2d corner = at + scale_ * Eigen::Vector2d(17, -9);
    const cv::Point corner_px(static_cast<int>(corner.x()), static_cast<int>(corner.y()));
    for (const auto& [ink, thickness] : {std::pair{cv::Scalar(0, 0, 0), 3}, {colour, 1}})
      cv::putText(image_, words, corner_px, cv::FONT_HERSHEY_SIMPLEX, 0.5 * scale_, ink, thickness,
                  cv::LINE_AA);
  }
  std::string png() const { return image::encode_png(image_); }

 private:
  cv::Mat image_;
  double scale_;
};

/// Magnified, with the factor in the lower left corner.
void draw_residuals(Canvas& canvas, const ViewMarks& marks, const pipeline::ViewResult& view) {
  const double largest = largest_residual(marks), unit = view.xray_image->pixels.width() / 1024.0;
  if (!(largest > 0)) return;
  const double factor = round_below(60 * unit / largest);
  for (const BallMark& ball : marks.balls)
    if (ball.used && ball.residual) canvas.line(ball.place, ball.place + factor * *ball.residual, orange);
  canvas.text(Eigen::Vector2d(0, view.xray_image->pixels.height() - 20 * unit),
              fmt::format("residuals, magnified {:g} times, up to {:.2f} px", factor, largest), orange);
}

}  // namespace

std::string overlay_png(const pipeline::Result& result, std::size_t index,
                        std::span<const Eigen::Vector2d> path) {
  Canvas canvas(rectified_image(result.views[index]));
  const ViewMarks marks = marks_of(result, index);
  for (const DotMark& dot : marks.plate_dots) canvas.circle(dot.place, 9, blue);
  for (const DotMark& blob : marks.false_blobs) canvas.cross(blob.place, 8, red);
  for (const DotMark& candidate : marks.candidates) canvas.circle(candidate.place, 15, orange);
  for (const BallMark& guess : marks.guessed) canvas.text(guess.place, guess.label, orange);
  for (const BallMark& ball : marks.balls) {
    canvas.circle(ball.place, 15, ball.used ? green : red);
    canvas.text(ball.place, ball.label, ball.used ? green : red);
  }
  if (result.failure) draw_residuals(canvas, marks, result.views[index]);
  for (const PointMark& point : marks.points) {
    canvas.cross(point.place, 7, violet);
    canvas.text(point.place, point.name, violet);
  }
  for (const rectification::PixelPath& tunnel : marks.tunnels)
    canvas.line(tunnel.front(), tunnel.back(), yellow);
  for (const rectification::PixelPath& tool : marks.tool_lines)
    canvas.line(tool.front(), tool.back(), crimson);
  for (std::size_t i = 1; i < path.size(); ++i) canvas.line(path[i - 1], path[i], orange);
  return canvas.png();
}

std::string file_stem(const std::string& view_name, std::size_t index) {
  const auto suits = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-';
  };
  const bool plain = !view_name.empty() && view_name.size() <= 64 && std::ranges::all_of(view_name, suits);
  return plain ? view_name : fmt::format("view{}", index + 1);
}

std::string overlay_name(const std::string& view_name, std::size_t index) {
  return file_stem(view_name, index) + "_overlay.png";
}

}  // namespace helicarm::report
