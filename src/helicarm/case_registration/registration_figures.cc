// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/registration_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/image/grey_window.h"
#include "helicarm/image/opencv.h"
#include "helicarm/image/png.h"
#include "helicarm/report/markup.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;
using Eigen::Vector3d;
using image::Image;
using registration::LocalAgreement;
using registration::RegisteredView;

constexpr int longest_side_px = 640;  // of an image in the report
constexpr double dark_share = 0.15;   // of white, where the DRR is darkest
constexpr double dark_quantile = 0.99;

Vector2i size_of(const Image<float>& grey) { return {grey.width(), grey.height()}; }

Vector2i reduced_size(const Vector2i& size) {
  const double scale = std::min(1.0, double(longest_side_px) / size.maxCoeff());
  return (scale * size.cast<double>()).array().round().cast<int>().max(1);
}

/// The figure's coordinates are the view's rectified pixels.
std::string svg(const std::string& label, const Vector2i& size, const std::string& content) {
  return fmt::format(R"(<svg viewBox="-0.5 -0.5 {} {}" role="img" aria-label="{}">)"
                     "\n{}</svg>\n",
                     size.x(), size.y(), report::escaped(label), content);
}

std::string image_element(const Image<std::uint8_t>& grey, const Vector2i& size,
                          const std::string& attributes) {
  return fmt::format(R"(<image {} x="-0.5" y="-0.5" width="{}" height="{}" preserveAspectRatio="none" )"
                     R"(href="data:image/png;base64,{}"/>)"
                     "\n",
                     attributes, size.x(), size.y(), report::base64(image::encode_png(grey)));
}

std::string xray_element(std::size_t view) { return fmt::format("<use href=\"#xray-{}\"/>\n", view); }

std::string figure(const char* kind, const std::string& drawing, const std::string& caption) {
  return fmt::format("<figure class=\"{}\">{}<figcaption>{}</figcaption></figure>\n", kind, drawing, caption);
}

/// Whether the corners of the density's grid are in front of the source.
bool in_front(const registration::Density& density, const geometry::View& view,
              const geometry::RigidTransform& world_from_model) {
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d voxel((corner & 1) ? density.size.x() : 0, (corner & 2) ? density.size.y() : 0,
                         (corner & 4) ? density.size.z() : 0);
    if (!(view.depth(world_from_model * (density.model_from_voxel * voxel)) > 1)) return false;
  }
  return true;
}

/// 255 without matter (marrow may be less dense than soft tissue); the strongest integrals get `dark_share`
/// of it.
Image<std::uint8_t> displayed(const Image<float>& integrals) {
  std::vector<float> matter;
  std::ranges::copy_if(integrals.pixels(), std::back_inserter(matter), [](float value) { return value > 0; });
  Image<std::uint8_t> grey(integrals.width(), integrals.height(), 255);
  if (matter.empty()) return grey;
  const double rate = std::log(dark_share) / double(quantile(matter, dark_quantile));
  std::ranges::transform(integrals.pixels(), grey.pixels().begin(), [&](float value) {
    return static_cast<std::uint8_t>(std::lround(255 * std::exp(rate * std::max(0.0, double(value)))));
  });
  return grey;
}

/// Classes of agreement from bad to good; colours distinct for readers with any colour deficiency (Okabe and
/// Ito 2008).
struct AgreementClass {
  double below;
  const char* colour;
  const char* label;
};
constexpr double thinnest = 0.05, boldest = 0.25;  // frame of a mark, of its side
constexpr AgreementClass agreement_classes[] = {{0.2, "#d55e00", "below 0.2"},
                                                {0.4, "#e69f00", "0.2 to 0.4"},
                                                {0.6, "#f0e442", "0.4 to 0.6"},
                                                {0.8, "#56b4e9", "0.6 to 0.8"},
                                                {1e9, "#0072b2", "above 0.8"}};

const AgreementClass& class_of(double agreement) {
  return *std::ranges::find_if(agreement_classes,
                               [&](const AgreementClass& each) { return !(agreement >= each.below); });
}

std::string legend() {
  std::string html = "<span class=\"legend\">";
  for (const AgreementClass& each : agreement_classes)
    html += fmt::format("<span><span class=\"key\" style=\"background:{}\"></span> {}</span> ", each.colour,
                        each.label);
  return html + "</span>";
}

/// A square for each comparison, framed the bolder the more it counts. The image shows through; frames keep
/// their colour on any grey value.
std::string agreement_marks(const RegisteredView& view, double side) {
  double heaviest = 1e-9;
  for (const LocalAgreement& at : view.agreements) heaviest = std::max(heaviest, at.weight);
  std::string marks;
  for (const LocalAgreement& at : view.agreements) {
    const double frame = side * (thinnest + (boldest - thinnest) * at.weight / heaviest);
    marks += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" stroke=\"{}\" "
        "stroke-width=\"{:.1f}\"><title>{:.2f}</title></rect>\n",
        at.pixel.x() - (side - frame) / 2, at.pixel.y() - (side - frame) / 2, side - frame, side - frame,
        class_of(at.agreement).colour, class_of(at.agreement).colour, frame, at.agreement);
  }
  return "<g fill-opacity=\"0.25\">\n" + marks + "</g>\n";
}

/// Dots in the model's colour.
std::string outline_path(const std::vector<Vector2d>& outline, std::size_t model, double width) {
  const auto& [red, green, blue] = outline_colour(model);
  std::string path;
  for (const Vector2d& at : outline) path += fmt::format("M{:.1f} {:.1f}h0", at.x(), at.y());
  return fmt::format(
      "<path stroke=\"rgb({},{},{})\" stroke-width=\"{:.2f}\" stroke-linecap=\"round\" d=\"{}\"/>\n", red,
      green, blue, width, path);
}

std::string blend_figure(const Image<std::uint8_t>& drr, const Vector2i& size, std::size_t index,
                         const std::string& title) {
  return figure("blend",
                svg(title + ": X-ray image and DRR", size,
                    xray_element(index) + image_element(drr, size, "class=\"drr\" opacity=\"0.5\"")) +
                    "<label hidden>X-ray image <input type=\"range\" min=\"0\" max=\"100\" value=\"50\" "
                    "autocomplete=\"off\"/> "
                    "DRR</label>",
                report::escaped(title) + ": X-ray image and DRR of the model at the final pose");
}

std::string agreement_figure(const RegisteredView& view, bool contour, const Vector2i& size,
                             std::size_t index, const std::string& title) {
  // A contour point of two pixels would not be seen.
  const double side = std::max(view.comparison_px, size.x() / 170.0);
  return figure(
      "agreement", svg(title + ": agreement", size, xray_element(index) + agreement_marks(view, side)),
      fmt::format("{}: agreement of {} {}{}", report::escaped(title), view.agreements.size(),
                  contour ? "contour points"
                          : fmt::format("patches of {:.0f} px; bold ones count most", view.comparison_px),
                  legend()));
}

}  // namespace

const std::array<int, 3>& outline_colour(std::size_t model) {
  static constexpr std::array<int, 3> colours[] = {
      {250, 204, 21}, {96, 165, 250}, {240, 171, 252}, {74, 222, 128}};
  return colours[model % std::size(colours)];
}

Image<std::uint8_t> drr_image(const registration::Model& model, const geometry::View& view,
                              const geometry::RigidTransform& world_from_model, const Vector2i& image_size,
                              unsigned threads) {
  if (!in_front(model.density, view, world_from_model)) return {};
  const Vector2i size = reduced_size(image_size);
  const Vector2d step = image_size.cast<double>().cwiseQuotient(size.cast<double>());
  const registration::PosedDensity posed(model.density, world_from_model, view.source_in_world(),
                                         world_from_model * model.centre);
  const Eigen::Matrix3d world_from_pixel =
      view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
  const auto direction = [&](int u, int v) -> Vector3d {
    const Vector2d pixel = step.cwiseProduct(Vector2d(u + 0.5, v + 0.5)) - Vector2d::Constant(0.5);
    return (world_from_pixel * pixel.homogeneous()).normalized();
  };
  Image<float> integrals(size.x(), size.y());
  parallel_for(std::size_t(size.y()), threads, [&](std::size_t row) {
    const int v = int(row);
    std::array<Vector3d, 8> directions;
    std::array<float, 8> values;
    for (int u = 0; u < size.x(); u += 8) {
      for (int k = 0; k < 8; ++k) directions[std::size_t(k)] = direction(u + k, v);
      posed.integrate_eight(directions, values);
      for (int k = 0; k < 8 && u + k < size.x(); ++k) integrals(u + k, v) = values[std::size_t(k)];
    }
  });
  return displayed(integrals);
}

std::string shared_images_html(const CaseRegistration& result) {
  std::string html =
      "<svg width=\"0\" height=\"0\" style=\"position:absolute\" aria-hidden=\"true\"><defs>\n";
  for (std::size_t i = 0; i < result.loaded.views.size(); ++i) {
    const registration::RegistrationView& view = result.loaded.views[i];
    const auto grey = image::eight_bit(view.grey, image::usual_window(view.grey, view.lowest));
    const Vector2i size = reduced_size(size_of(view.grey));
    Image<std::uint8_t> reduced(size.x(), size.y());
    cv::Mat out = image::as_mat(reduced);
    cv::resize(image::as_mat(grey), out, out.size(), 0, 0, cv::INTER_AREA);
    html += image_element(reduced, size_of(view.grey), fmt::format("id=\"xray-{}\"", i));
  }
  return html + "</defs></svg>\n";
}

std::string overlay_figure(const CaseRegistration& result, std::size_t index) {
  const registration::RegistrationView& view = result.loaded.views[index];
  const double unit = view.grey.width() / 1024.0;
  std::string elements = xray_element(index);
  for (std::size_t m = 0; m < result.models.size(); ++m) {
    const RegisteredModel& model = result.models[m];
    const auto& [red, green, blue] = outline_colour(m);
    std::string path;
    if (index < model.outlines.size())
      for (const Vector2d& at : model.outlines[index])
        path += fmt::format("M{:.1f} {:.1f}h0", at.x(), at.y());
    for (const RegisteredPoint& point : model.points) {
      if (!(model.views[index].depth(point.place.in_calibrator) > 1)) continue;
      const Vector2d at = model.views[index].project(point.place.in_calibrator);
      const double arm = 8 * unit;
      path += fmt::format("M{0:.1f} {1:.1f}l{2:.1f} {2:.1f}m0 {3:.1f}l{3:.1f} {2:.1f}", at.x() - arm,
                          at.y() - arm, 2 * arm, -2 * arm);
      elements += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" font-size=\"{:.1f}\">{}</text>\n",
                              at.x() + 12 * unit, at.y() - 8 * unit, 20 * unit, report::escaped(point.name));
    }
    elements += fmt::format(
        "<path stroke=\"rgb({},{},{})\" stroke-width=\"{:.2f}\" stroke-linecap=\"round\" d=\"{}\"/>\n", red,
        green, blue, 2 * unit, path);
  }
  return figure("overlay", svg(view.name, size_of(view.grey), elements),
                report::escaped(view.name) + ": outlines of the registered models");
}

std::string model_figures(const CaseRegistration& result, std::size_t index) {
  const RegisteredModel& model = result.models[index];
  std::string html;
  for (std::size_t i = 0; i < std::min(model.drrs.size(), model.registration.views.size()); ++i) {
    const RegisteredView& view = model.registration.views[i];
    const Vector2i size = size_of(result.loaded.views[i].grey);
    const std::string title = model.registration.name + ", " + view.name;
    if (!model.drrs[i].empty()) html += blend_figure(model.drrs[i], size, i, title);
    if (!view.agreements.empty()) html += agreement_figure(view, model.is_surface, size, i, title);
  }
  return html.empty() ? html : "<div class=\"views\">\n" + html + "</div>\n";
}

std::string alternatives_html(const CaseRegistration& result, std::size_t index) {
  const RegisteredModel& model = result.models[index];
  if (model.alternative_outlines.empty()) return "";
  std::string html =
      "<p>The best poses, to choose from. The right one's outline follows the bone's edges in every view; "
      "give "
      "its world_from_model in registration.json as the model's start.</p>\n<div class=\"views\">\n";
  for (std::size_t pose = 0; pose <= model.alternative_outlines.size(); ++pose) {
    const auto& of_views = pose == 0 ? model.outlines : model.alternative_outlines[pose - 1];
    const std::string title = pose == 0
                                  ? "the pose of this result"
                                  : fmt::format("alternative {}, {:.1f} mm away, cost ratio {:.2f}", pose,
                                                model.registration.alternatives[pose - 1].distance_mm,
                                                model.registration.alternatives[pose - 1].cost_ratio);
    for (std::size_t i = 0; i < of_views.size(); ++i)
      html += figure("overlay",
                     svg(title, size_of(result.loaded.views[i].grey),
                         xray_element(i) + outline_path(of_views[i], index,
                                                        2 * result.loaded.views[i].grey.width() / 1024.0)),
                     report::escaped(fmt::format("{}, {}: {}", model.registration.name,
                                                 result.loaded.views[i].name, title)));
  }
  return html + "</div>\n";
}

std::string slider_script() {
  return R"(<script>
for (const figure of document.querySelectorAll(".blend")) {
  const label = figure.querySelector("label"), drr = figure.querySelector(".drr");
  label.hidden = false;
  label.querySelector("input").oninput = event => drr.setAttribute("opacity", event.target.value / 100);
}
</script>
)";
}

}  // namespace helicarm::case_registration
