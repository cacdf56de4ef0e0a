// SPDX-License-Identifier: Apache-2.0
#include "studies/biplane_images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/streams.h"
#include "helicarm/simulation/write_case.h"
#include "studies/paper_scene.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr double no_error = std::numeric_limits<double>::quiet_NaN();
constexpr PointErrors no_errors{0, no_error, no_error, no_error, no_error};
const geometry::RigidTransform camera_from_biplane{Eigen::Matrix3d::Identity(), {0, 0, biplane_depth_mm}};

geometry::RigidTransform udcsc_from_biplane(const simulation::TrueView& view) {
  return view.view.camera_from_world.inverse() * camera_from_biplane;
}

/// A tracker's reading.
geometry::RigidTransform read_pose(const geometry::RigidTransform& pose, const BiplaneImagesOptions& options,
                                   RandomStream& random) {
  const auto normals = [&]() -> Eigen::Vector3d {
    return {random.normal(), random.normal(), random.normal()};
  };
  const double angle = options.tracker_sigma_deg * std::numbers::pi / 180;
  return {pose.rotation * geometry::rotation_from_vector(angle * normals()),
          pose.translation + options.tracker_sigma_mm * normals()};
}

/// case.json and calibrator.json of the biplane: the tracker's frame is UDCSC's, whose points are clicked in
/// both images.
void write_biplane_case(const std::filesystem::path& folder, const simulation::SimulatedCase& simulated,
                        const BiplaneImagesOptions& options, RandomStream& random) {
  value_or_throw(simulation::write_case(folder, simulated));
  Json json = simulation::case_json(simulated);
  json["tracker"] = {{"sigma_mm", options.tracker_sigma_mm},
                     {"sigma_deg", options.tracker_sigma_deg},
                     {"samples", "independent"}};
  for (std::size_t i = 0; i < simulated.views.size(); ++i) {
    const simulation::SimulatedView& view = simulated.views[i];
    const auto biplane = read_pose(udcsc_from_biplane(view.true_view), options, random);
    json["views"][i]["poses"] = {
        {"tracker_from_calibrator", geometry::json_rows(biplane.matrix())},
        {"tracker_from_bone", {{"femur", geometry::json_rows(Eigen::Matrix4d::Identity().eval())}}}};
    for (const auto* points : {&view.balls, &view.targets})
      for (const simulation::TruePoint& point : *points)
        json["picks"].push_back(pipeline::to_json(pipeline::Pick{
            point.name, view.true_view.name, point.raw + options.click_sigma_px * normal_2(random),
            pipeline::Snap::none, 3, options.click_sigma_px, "femur"}));
  }
  value_or_throw(write_file(folder / "case.json", to_text(json) + "\n"));
  value_or_throw(
      write_file(folder / "calibrator.json", to_text(phantom::to_json(biplane_calibrator())) + "\n"));
}

PointErrors summed(const std::vector<double>& errors) {
  if (errors.empty()) return no_errors;
  PointErrors sum{double(errors.size()), 0, 0, errors[0], 0};
  for (const double error : errors) {
    sum.mean += error / sum.n;
    sum.max = std::max(sum.max, error);
    sum.min = std::min(sum.min, error);
    sum.rms += error * error / sum.n;
  }
  sum.rms = std::sqrt(sum.rms);
  return sum;
}

double from_ray(const Eigen::Vector3d& point, const geometry::Ray& ray) {
  return (point - ray.origin).cross(ray.direction).norm();
}

BiplaneImageTest biplane_test_of(const pipeline::Case& the_case, const phantom::Calibrator& udcsc,
                                 rectification::Method method) {
  pipeline::RunOptions options;
  options.method = method;
  options.threads = 1;
  const pipeline::Result result = value_or_throw(pipeline::measure(the_case, options));
  if (result.failure) return {1, no_errors, no_errors, no_errors};
  std::vector<double> fre, centre, on_udcsc;
  for (const pipeline::ViewResult& view : result.views)
    for (const fiducials::Fiducial& ball : view.found->fiducials)
      if (ball.status == fiducials::FiducialStatus::used)
        fre.push_back(
            from_ray(ball.centre_in_calibrator, geometry::ray_through(view.calibrated->view, ball.uv)));
  const auto error_of = [&](const std::string& name, const Eigen::Vector3d& position, auto& errors) {
    const auto point = std::ranges::find(result.points, name, &pipeline::PointResult::name);
    if (point != result.points.end() && point->place)
      if (const guidance::Place* in_femur = point->place->in("femur"))
        errors.push_back((in_femur->point() - position).norm());
  };
  for (const phantom::CalibratorBall& ball : udcsc.balls)
    error_of(ball.label, ball.centre_in_calibrator, on_udcsc);
  for (const phantom::CalibratorTarget& target : udcsc.targets)
    error_of(target.name, target.point_in_calibrator, target.name == "T1" ? centre : on_udcsc);
  return {0, summed(fre), summed(centre), summed(on_udcsc)};
}

std::uint32_t seed_of_case(const BiplaneImagesOptions& options, std::size_t test) {
  return RandomStream(options.seed, calibration_stream, test).bits();  // the cases of `study calibration`
}

void run_test(const BiplaneImagesOptions& options, std::size_t number, std::span<double> out) {
  simulation::SimulationOptions scene;
  scene.seed = seed_of_case(options, number);
  scene.size = options.size_px;
  scene.threads = 1;
  const auto simulated = with_biplane(value_or_throw(simulation::simulate_case(scene)));
  const auto folder = options.folder / (number == 0 ? std::string(kept_biplane_case)
                                                    : fmt::format("biplane-images.partial-{}", number));
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);  // of an earlier run
  RandomStream random(options.seed, bench_stream, number);
  write_biplane_case(folder, simulated, options, random);
  const pipeline::Case the_case = value_or_throw(pipeline::read_case(folder));
  for (const rectification::Method method : {rectification::Method::paper, rectification::Method::best})
    put_record(biplane_test_of(the_case, simulated.calibrator, method), out);
  if (number > 0) std::filesystem::remove_all(folder, ignored);
}

struct ImageRow {
  const char* points;
  PointErrors BiplaneImageTest::*errors;
  std::array<double, 4> printed;  ///< Table 1: max, min, mean, rms
};
const std::array<ImageRow, 3> image_rows{
    {{"fre", &BiplaneImageTest::fre, {0.58, 0.03, 0.25, 0.32}},
     {"centre", &BiplaneImageTest::centre, {3.08, 1.75, 2.65, 2.77}},
     {"on_udcsc", &BiplaneImageTest::on_udcsc, {3.33, 1.43, 2.04, 2.16}}}};

/// Largest, least, mean and rms over all tests.
std::array<double, 4> over_tests(const std::vector<BiplaneImageTests>& tests,
                                 BiplaneImageTest BiplaneImageTests::*method,
                                 PointErrors BiplaneImageTest::*errors) {
  double n = 0, most = 0, least = std::numeric_limits<double>::infinity(), sum = 0, squares = 0;
  for (const BiplaneImageTests& test : tests) {
    const PointErrors& e = test.*method.*errors;
    if (e.n == 0) continue;
    n += e.n;
    most = std::max(most, e.max);
    least = std::min(least, e.min);
    sum += e.n * e.mean;
    squares += e.n * e.rms * e.rms;
  }
  if (n == 0) return {no_error, no_error, no_error, no_error};
  return {most, least, sum / n, std::sqrt(squares / n)};
}

}  // namespace

phantom::Calibrator biplane_calibrator() {
  constexpr double half_mm = 30, diameter_mm = 4;
  const std::array<Eigen::Vector3d, 8> centres{{{-46, -40, -half_mm},
                                                {48, -28, -half_mm},
                                                {20, 46, -half_mm},
                                                {-34, 26, -half_mm},
                                                {-6, -54, half_mm},
                                                {56, 22, half_mm},
                                                {-58, -6, half_mm},
                                                {-4, 12, half_mm}}};
  phantom::Calibrator calibrator{"biplane", {}, {}};
  for (const Eigen::Vector3d& centre : centres)
    calibrator.balls.push_back({fmt::format("B{}", calibrator.balls.size() + 1), centre, diameter_mm});
  return calibrator;
}

simulation::SimulatedCase with_biplane(simulation::SimulatedCase simulated) {
  for (std::size_t i = 0; i < simulated.views.size(); ++i) {
    simulation::SimulatedView& view = simulated.views[i];
    const simulation::TrueView& at = view.true_view;
    simulation::Scene scene = simulation::calibrator_body(simulated.calibrator);
    for (const simulation::Body& body : simulation::knee_body())
      scene.push_back(simulation::moved(body, *simulated.calibrator_from_knee));
    for (const simulation::Body& dot :
         simulation::plate_body(*simulated.plate, at.camera_from_plate, at.view))
      scene.push_back(dot);
    for (const phantom::CalibratorBall& ball : biplane_calibrator().balls)
      scene.push_back(simulation::steel(
          "biplane " + ball.label,
          {simulation::sphere(udcsc_from_biplane(at) * ball.centre_in_calibrator, ball.diameter_mm / 2)}));
    view.pixels = simulation::detector_response(
        simulation::render_view(scene, at.detector, at.view, simulated.options.threads), at.imaging,
        simulated.options.seed, simulation::stream::noise + 2 * std::uint32_t(i), simulated.options.threads);
  }
  return simulated;
}

Expected<std::vector<BiplaneImageTests>> study_biplane_images(const BiplaneImagesOptions& options,
                                                              const EngineOptions& engine,
                                                              const Ranks& ranks) {
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  StudySetting setting;
  setting.blocks = options.groups;
  setting.values_per_block = 2 * numbers_in<BiplaneImageTest>;
  setting.work = [&](std::size_t block, std::span<double> values) { run_test(options, block, values); };
  const std::string identity =
      fmt::format("biplane-images {} groups {} seed {} size {} tracker {} {} click {}", HELICARM_VERSION,
                  options.groups, options.seed, options.size_px, options.tracker_sigma_mm,
                  options.tracker_sigma_deg, options.click_sigma_px);
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    std::vector<BiplaneImageTests> tests;
    if (kept.empty()) return tests;
    std::span<const double> values = kept.front();
    while (tests.size() < options.groups) {
      const auto paper = take_record<BiplaneImageTest>(values), best = take_record<BiplaneImageTest>(values);
      tests.push_back({seed_of_case(options, tests.size()), paper, best});
    }
    return tests;
  });
}

StudyFiles files_of(const std::vector<BiplaneImageTests>& tests, const BiplaneImagesOptions& options) {
  StudyFiles files;
  files.csv = "test,case_seed,method,refused,points,n,mean,max,min,rms\n";
  int refused_paper = 0, refused_best = 0;
  for (std::size_t i = 0; i < tests.size(); ++i) {
    refused_paper += tests[i].paper.refused > 0;
    refused_best += tests[i].best.refused > 0;
    for (const auto& [name, test] : {std::pair{"paper", &tests[i].paper}, {"best", &tests[i].best}})
      for (const ImageRow& row : image_rows)
        files.csv += fmt::format("{},{},{},{},{}{}\n", i + 1, tests[i].case_seed, name, test->refused,
                                 row.points, csv_cells(numbers_of(test->*row.errors)));
  }
  const auto json_of = [](const std::array<double, 4>& f) {
    return Json{{"max", f[0]}, {"min", f[1]}, {"mean", f[2]}, {"rms", f[3]}};
  };
  Json table = Json::array();
  std::string means;
  for (const ImageRow& row : image_rows) {
    const auto paper = over_tests(tests, &BiplaneImageTests::paper, row.errors);
    const auto best = over_tests(tests, &BiplaneImageTests::best, row.errors);
    table.push_back({{"points", row.points},
                     {"printed_mm", json_of(row.printed)},
                     {"paper_mm", json_of(paper)},
                     {"best_mm", json_of(best)}});
    means += fmt::format("{}{} {:.2f} published, {:.2f} by the paper method, {:.2f} by the best method",
                         means.empty() ? "" : "; ", row.points, row.printed[2], paper[2], best[2]);
  }
  files.summary = fmt::format(
      "Biplane columns of Table 1 from images, mean errors in mm of {} simulated tests: {}. Tests refused: "
      "{} by "
      "the paper method, {} by the best method.",
      tests.size(), means, refused_paper, refused_best);
  files.json = study_json("biplane-images", options);
  files.json.update({{"size_px", options.size_px},
                     {"tracker_sigma_mm", options.tracker_sigma_mm},
                     {"tracker_sigma_deg", options.tracker_sigma_deg},
                     {"click_sigma_px", options.click_sigma_px},
                     {"refused", {{"paper", refused_paper}, {"best", refused_best}}},
                     {"summary", files.summary},
                     {"rows", std::move(table)}});
  return files;
}

}  // namespace helicarm::study
