// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/limit.h"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/machine.h"
#include "helicarm/core/parallel.h"
#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/localization/locate.h"
#include "helicarm/navigation/prior.h"
#include "helicarm/phantom/conical_helix.h"
#include "helicarm/study/cramer_rao.h"

namespace helicarm {
namespace {

using Eigen::Vector3d;

constexpr double px_per_mm = 1 / 0.15;
constexpr double focal_mm = 900;
constexpr double middle_px = 511.5;
constexpr double exact_px = 1e-3;              // of a pixel that counts as exact
constexpr double chi2_95 = 7.814727903251179;  // 3 degrees of freedom
constexpr double pinned = 1e-6;                // sigma of what is known
constexpr double known_mm = 1e-3;              // likewise, of a length
constexpr double aspect_sigma = 1e-3;
constexpr int bound_trials = 200;  // where each trial has a bound of its own
constexpr int trials_per_machine = 50;
constexpr int shots_of_machine = 12;
const Vector3d centre(0, 0, 40);

/// What the experiment's C-arms are like: an unknown one of its make, and one that sags little.
const MachinePrior make = unknown_machine();
const MachinePrior stiff{Departure{10, 0.3}, Departure{7, 0.5}};

enum class Model { free, square, prior, machine, known };
constexpr std::array models{Model::free, Model::square, Model::prior, Model::machine, Model::known};
constexpr std::array model_names{"free", "square", "prior", "machine", "known"};

struct Place {
  const char* name;
  Vector3d point;
};
const std::array<Place, 4> places{{{"centre", centre},
                                   {"50 mm lateral", centre + Vector3d(50, 0, 0)},
                                   {"100 mm lateral", centre + Vector3d(100, 0, 0)},
                                   {"150 mm axial", centre + Vector3d(0, 0, 150)}}};
constexpr std::size_t rows_of_setting = 2 * places.size();

struct Setting {
  int balls;
  double sigma_px;
  Model model;
  std::uint32_t stream;
};

std::vector<Vector3d> balls_on_helix(int n) {
  std::vector<Vector3d> balls;
  for (int k = 0; k < n; ++k)
    balls.push_back(ConicalHelix().point(std::numbers::pi * (1.0 / 6 + 5.5 * k / (n - 1))));
  return balls;
}

/// Departures from nominal of focal length and principal point, mm.
Vector3d departure(const MachinePrior& machine, double Departure::*part, RandomStream& random) {
  return {*machine.focal.*part * random.normal(), *machine.principal.*part * random.normal(),
          *machine.principal.*part * random.normal()};
}

View view_with(const Vector3d& departure_mm, double aspect, double angle) {
  const double f = px_per_mm * (focal_mm + departure_mm.x());
  const Eigen::Matrix3d rotation = rotation_from_euler(angle, 0, 0);
  return {{2 * f * aspect / (1 + aspect), 2 * f / (1 + aspect), middle_px + px_per_mm * departure_mm.y(),
           middle_px + px_per_mm * departure_mm.z(), 0},
          {rotation, Vector3d(0, 0, 800) - rotation * centre}};
}

std::array<View, 2> views_of(const MachinePrior& machine, const Vector3d& common_mm, double aspect_spread,
                             RandomStream& random) {
  std::array<View, 2> views;
  for (std::size_t i = 0; i < 2; ++i) {
    const double aspect = 1 + aspect_spread * random.normal();
    views[i] = view_with(common_mm + departure(machine, &Departure::of_view, random), aspect,
                         double(i) * std::numbers::pi / 2);
  }
  return views;
}

ViewFiducials pictured(const char* name, const View& view, const std::vector<Vector3d>& balls, double sigma,
                       RandomStream& random) {
  ViewFiducials seen{name, {}};
  for (const Vector3d& ball : balls) {
    Fiducial fiducial{fmt::format("P{}", seen.fiducials.size() + 1), ball};
    fiducial.status = FiducialStatus::used;
    fiducial.sigma_px = sigma;
    fiducial.uv = view.project(ball) + sigma * Eigen::Vector2d(random.normal(), random.normal());
    seen.fiducials.push_back(fiducial);
  }
  seen.prior = {px_per_mm * focal_mm, Eigen::Vector2d(middle_px, middle_px), px_per_mm};
  return seen;
}

/// A machine and what its earlier shots have told of it.
struct KnownMachine {
  Vector3d mean_departure_mm;
  MachineKnowledge knowledge;
};

KnownMachine machine_with_history(const Setting& setting, const std::vector<Vector3d>& balls,
                                  RandomStream random) {
  KnownMachine known;
  known.mean_departure_mm = departure(stiff, &Departure::common, random);
  std::vector<MachineShot> shots;
  while (int(shots.size()) < shots_of_machine)
    for (const View& view : views_of(stiff, known.mean_departure_mm, aspect_sigma, random)) {
      ViewFiducials seen = pictured("", view, balls, setting.sigma_px, random);
      seen.prior.aspect = Belief{1, aspect_sigma};
      if (const auto shot = shot_of(seen, "", {make, 0})) shots.push_back(*shot);
    }
  known.knowledge = knowledge_of(shots, {focal_mm, 0, 0}, make);
  return known;
}

/// What the estimator is told, and what the bound is told.
struct Told {
  MachinePrior machine;
  std::optional<Belief> aspect;
  std::optional<Belief> skew = Belief{0, pinned};
  PriorInformation bound;
};

Told told_of(Model model) {
  const auto departures = [](const Departure& d) {
    return Eigen::MatrixXd(px_per_mm * px_per_mm *
                           (Eigen::Matrix2d::Constant(d.common * d.common) +
                            Eigen::Matrix2d(d.of_view * d.of_view * Eigen::Matrix2d::Identity())));
  };
  const auto with = [&](const MachinePrior& machine, double aspect) {
    return Told{machine,
                Belief{1, aspect},
                Belief{0, pinned},
                {departures(*machine.focal), departures(*machine.principal), aspect, pinned}};
  };
  switch (model) {
    case Model::free:
      return {{}, {}, {}, {}};
    case Model::square:
      return {{}, Belief{1, pinned}, Belief{0, pinned}, {{}, {}, pinned, pinned}};
    case Model::prior:
      return with(make, aspect_sigma);
    case Model::machine:  // the bound is that of a machine whose mean and sag are known
      return with({Departure{known_mm, stiff.focal->of_view}, Departure{known_mm, stiff.principal->of_view}},
                  aspect_sigma);
    case Model::known:
      return with({Departure{known_mm, known_mm}, Departure{known_mm, known_mm}}, pinned);
  }
  return {};
}

struct Outcome {
  bool located = false;
  bool covered = false;
  double error2 = 0;
  std::optional<double> dlt2;
  std::optional<double> bound2;
};
using Outcomes = std::array<Outcome, rows_of_setting>;

std::optional<LocatedPoint> located(const std::array<Eigen::Vector2d, 2>& pixels, double sigma,
                                    const Expected<CalibrationResult>& calibration) {
  if (!calibration) return std::nullopt;
  std::vector<PointPicture> pictures;
  for (std::size_t i = 0; i < 2; ++i)
    pictures.push_back({i, pixels[i], sigma * sigma * Eigen::Matrix2d::Identity()});
  const auto point = locate("", PointSource::target, pictures, *calibration);
  return point ? std::optional(*point) : std::nullopt;
}

Outcomes try_once(const Setting& setting, const std::vector<Vector3d>& balls, const KnownMachine* machine,
                  std::uint64_t seed, int trial) {
  RandomStream random(seed, setting.stream, std::uint64_t(trial));
  const Told told = told_of(setting.model);
  const bool drawn = setting.model == Model::prior || setting.model == Model::machine;
  const MachinePrior& arm = machine ? stiff : make;
  const Vector3d common = machine                         ? machine->mean_departure_mm
                          : setting.model == Model::prior ? departure(arm, &Departure::common, random)
                                                          : Vector3d::Zero();
  const std::array<View, 2> views = drawn ? views_of(arm, common, aspect_sigma, random)
                                          : std::array{view_with(Vector3d::Zero(), 1, 0),
                                                       view_with(Vector3d::Zero(), 1, std::numbers::pi / 2)};
  std::vector<ViewFiducials> seen;
  for (std::size_t i = 0; i < 2; ++i) {
    seen.push_back(pictured(i == 0 ? "AP" : "LAT", views[i], balls, setting.sigma_px, random));
    seen[i].prior.aspect = told.aspect;
    seen[i].prior.skew = told.skew;
    if (machine) seen[i].prior = known_prior(seen[i].prior, machine->knowledge, false);
  }
  CalibrationOptions options;
  options.common.machine = machine ? machine->knowledge.prior : told.machine;
  const auto calibration = calibrate(seen, options);
  const auto dlt = calibrate_paper(seen, options);

  Outcomes outcomes;
  for (std::size_t k = 0; k < rows_of_setting; ++k) {
    const Vector3d& truth = places[k / 2].point;
    const double sigma = k % 2 ? exact_px : setting.sigma_px;
    std::array<Eigen::Vector2d, 2> pixels;
    for (std::size_t i = 0; i < 2; ++i)
      pixels[i] = views[i].project(truth) + sigma * Eigen::Vector2d(random.normal(), random.normal());
    Outcome& outcome = outcomes[k];
    if (const auto point = located(pixels, sigma, calibration)) {
      const Vector3d error = point->point_in_anchor - truth;
      outcome.located = true;
      outcome.error2 = error.squaredNorm();
      outcome.covered = error.dot(point->covariance_in_anchor.ldlt().solve(error)) < chi2_95;
    }
    if (const auto point = located(pixels, sigma, dlt))
      outcome.dlt2 = (point->point_in_anchor - truth).squaredNorm();
    if (trial == 0 || (drawn && trial < bound_trials))
      outcome.bound2 = least_covariance(views, balls, truth, setting.sigma_px, sigma, told.bound).trace();
  }
  return outcomes;
}

LimitRow row_of(const Setting& setting, std::size_t k, const std::vector<Outcomes>& trials) {
  LimitRow row{setting.balls, setting.sigma_px, model_names[std::size_t(setting.model)], places[k / 2].name,
               k % 2 == 1};
  row.trials = int(trials.size());
  double bounds = 0, errors = 0, dlts = 0, covered = 0;
  int bound_count = 0, dlt_count = 0;
  for (const Outcomes& outcomes : trials) {
    const Outcome& outcome = outcomes[k];
    row.failures += !outcome.located;
    errors += outcome.error2;
    covered += outcome.covered;
    if (outcome.dlt2) dlts += *outcome.dlt2, ++dlt_count;
    if (outcome.bound2) bounds += *outcome.bound2, ++bound_count;
  }
  const int answered = row.trials - row.failures;
  row.bound_mm = std::sqrt(bounds / bound_count);
  row.error_mm = std::sqrt(errors / answered);
  row.dlt_mm = std::sqrt(dlts / dlt_count);
  row.coverage = covered / answered;
  return row;
}

std::vector<Setting> all_settings() {
  std::vector<Setting> settings;
  for (const int balls : {8, 12, 20})
    for (const double sigma : {0.1, 0.5, 1.0, 2.34})
      for (const Model model : models)
        settings.push_back({balls, sigma, model, std::uint32_t(100 + settings.size())});
  return settings;
}

}  // namespace

std::vector<LimitRow> study_limit(const LimitOptions& options,
                                  const std::function<void(double share)>& progress) {
  std::vector<LimitRow> rows;
  const std::vector<Setting> settings = all_settings();
  for (const Setting& setting : settings) {
    const std::vector<Vector3d> balls = balls_on_helix(setting.balls);
    std::vector<KnownMachine> machines(
        setting.model == Model::machine ? std::size_t(options.trials / trials_per_machine + 1) : 0);
    parallel_for(machines.size(), options.threads, [&](std::size_t i) {
      machines[i] =
          machine_with_history(setting, balls, RandomStream(options.seed, setting.stream + 1000, i));
    });
    std::vector<Outcomes> trials(std::size_t(options.trials));
    parallel_for(trials.size(), options.threads, [&](std::size_t i) {
      const KnownMachine* machine = machines.empty() ? nullptr : &machines[i / trials_per_machine];
      trials[i] = try_once(setting, balls, machine, options.seed, int(i));
    });
    for (std::size_t k = 0; k < rows_of_setting; ++k) rows.push_back(row_of(setting, k, trials));
    progress(double(rows.size()) / double(settings.size() * rows_of_setting));
  }
  return rows;
}

}  // namespace helicarm
