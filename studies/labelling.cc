// SPDX-License-Identifier: Apache-2.0
#include "studies/labelling.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>
#include <optional>

#include "helicarm/core/parallel.h"
#include "helicarm/fiducials/label.h"

namespace helicarm::study {
namespace {

using simulation::SyntheticDetection;
using simulation::SyntheticView;

constexpr std::uint32_t views_stream = 2000;
constexpr int many_balls = 8;

enum class Verdict { right, imitated, wrong };

struct Trial {
  int visible = 0;
  bool spread = false;
  Verdict verdict = Verdict::right;
  std::optional<Reason> refused;
  double ms = 0;
};

fiducials::LabellingPrior nominal_prior() {
  const simulation::NominalCamera camera;
  return {.focal_px = camera.focal_px,
          .principal_px = camera.principal_px,
          .field_radius_px = camera.field_radius_px};
}

Expected<fiducials::Labelling> label(const phantom::Calibrator& calibrator,
                                     const std::vector<SyntheticDetection>& detections) {
  std::vector<fiducials::BallCandidate> candidates;
  for (const SyntheticDetection& disc : detections)
    candidates.push_back({disc.uv, disc.sigma_px, disc.radius_px, disc.radius_sigma_px});
  return fiducials::label_balls(calibrator, candidates, nominal_prior());
}

/// An outlier may imitate an occluded ball unless a fit to the true ones excludes it by 4 sigma.
Verdict judge(const fiducials::Labelling& labelling, const SyntheticView& image,
              const phantom::Calibrator& calibrator) {
  if (labelling.mirrored != image.mirrored()) return Verdict::wrong;
  std::vector<fiducials::WeightedCorrespondence> seen;
  for (const SyntheticDetection& disc : image.detections)
    if (disc.ball >= 0)
      seen.push_back({calibrator.balls[disc.ball].centre_in_calibrator, disc.uv, disc.sigma_px});
  const fiducials::LabellingPrior prior = nominal_prior();
  const fiducials::PoseFit known = fiducials::fit_pose(
      image.view, seen, {*prior.focal_px, prior.focal_sigma, prior.principal_px, prior.principal_sigma_px},
      20);
  Verdict verdict = Verdict::right;
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    if (labelling.candidate_of_ball[k] < 0) continue;
    const SyntheticDetection& disc = image.detections[labelling.candidate_of_ball[k]];
    if (disc.ball == static_cast<int>(k)) continue;
    const Eigen::Vector3d& centre = calibrator.balls[k].centre_in_calibrator;
    const Eigen::Vector2d off = disc.uv - known.view.project(centre);
    const Eigen::Matrix2d noise = disc.sigma_px * disc.sigma_px * Eigen::Matrix2d::Identity();
    if (!(off.dot((noise + fiducials::prediction_covariance(known, centre)).inverse() * off) <= 4 * 4))
      return Verdict::wrong;
    verdict = Verdict::imitated;
  }
  return verdict;
}

double degrees_off_axis(const phantom::Calibrator& calibrator, const geometry::View& view) {
  const Eigen::Vector3d ray = phantom::middle_of(calibrator) - view.source_in_world();
  return std::acos(std::abs(ray.normalized().z())) * 180 / std::numbers::pi;
}

double thread_ms() {
  std::timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

Trial try_view(const phantom::Calibrator& calibrator, const LabellingStudy& study, std::uint64_t number) {
  RandomStream random(study.seed, views_stream, number);
  const int hidden = static_cast<int>(random.index(study.most_hidden + 1));
  const int outliers = static_cast<int>(random.index(study.most_false + 1));
  const auto image = simulation::synthetic_detections(
      calibrator,
      {.hidden = hidden, .outliers = outliers, .kind = study.outliers, .noise_px = study.noise_px}, random);
  Trial trial;
  trial.visible = image.visible;
  const double start = thread_ms();
  const auto labelling = label(calibrator, image.detections);
  trial.ms = thread_ms() - start;
  if (labelling)
    trial.verdict = judge(*labelling, image, calibrator);
  else
    trial.refused = labelling.error().reason;
  trial.spread = degrees_off_axis(calibrator, image.view) >= spread_deg;
  return trial;
}

void count(LabellingCount& into, const Trial& trial) {
  ++into.views;
  if (trial.refused) {
    ++into.refused[*trial.refused];
  } else {
    into.solved += trial.verdict != Verdict::wrong;
    into.imitated += trial.verdict == Verdict::imitated;
    into.wrong += trial.verdict == Verdict::wrong;
  }
}

}  // namespace

LabellingTally study_labelling(const phantom::Calibrator& calibrator, const LabellingStudy& study) {
  std::vector<Trial> trials(study.views);
  parallel_for(trials.size(), study.threads,
               [&](std::size_t i) { trials[i] = try_view(calibrator, study, i); });
  LabellingTally tally;
  tally.by_visible.resize(calibrator.balls.size() + 1);
  std::vector<double> ms;
  for (const Trial& trial : trials) {
    count(tally.all, trial);
    count(tally.by_visible[trial.visible], trial);
    if (trial.visible >= many_balls) count(trial.spread ? tally.spread : tally.not_spread, trial);
    ms.push_back(trial.ms);
  }
  std::sort(ms.begin(), ms.end());
  if (!ms.empty()) {
    tally.median_ms = ms[ms.size() / 2];
    tally.p99_ms = ms[ms.size() * 99 / 100];
  }
  return tally;
}

}  // namespace helicarm::study
