// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/from_scratch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom_calibration/correspondence.h"
#include "helicarm/phantom_calibration/pair_match.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double degree = std::numbers::pi / 180;
constexpr std::size_t most_pairs = 60;    // hypotheses of two views
constexpr std::size_t most_triples = 12;  // of three
constexpr int least_tracks = 6;
constexpr double usual_focal_widths = 4.4;  // 1000 mm over a field of 230 mm
constexpr double good_rms_px = 0.6;         // per axis at 1024 px a side, by uncorrected blob centres
constexpr double largest_rms_px = 2;
constexpr double reversal_ratio = 1.5;  // of the rms of a depth-reversed phantom to that of the best

struct PlainView {
  std::vector<PlainCandidate> candidates;
  bool mirrored;
  double focal_px;
  Vector2d principal_px;
  double limit_scale;
};

/// Which kind of ball each candidate is: the kinds' radii in the image are as their diameters, and the balls
/// of a kind, seen from 0.8 to 1.2 times the mean distance, differ by up to 20 %.
std::vector<int> kinds_of(const std::vector<fiducials::BallCandidate>& candidates,
                          std::vector<double> diameters_mm) {
  if (diameters_mm.size() == 1) return std::vector<int>(candidates.size(), 0);
  double best_cost = 1e300, best_scale = 1;
  for (const fiducials::BallCandidate& base : candidates)
    for (const double diameter : diameters_mm) {
      const double scale = base.radius_px / diameter;
      double cost = 0;
      std::vector<int> count(diameters_mm.size(), 0);
      for (const fiducials::BallCandidate& c : candidates) {
        double nearest = 0.3;
        for (std::size_t kind = 0; kind < diameters_mm.size(); ++kind) {
          const double off = std::abs(std::log(c.radius_px / (scale * diameters_mm[kind])));
          if (off < nearest) nearest = off, ++count[kind];
        }
        cost += nearest;
      }
      for (const int n : count) cost += n == 0 ? 0.5 : 0;
      if (cost < best_cost) best_cost = cost, best_scale = scale;
    }
  std::vector<int> kinds;
  for (const fiducials::BallCandidate& c : candidates) {
    const auto off = [&](double d) { return std::abs(std::log(c.radius_px / (best_scale * d))); };
    kinds.push_back(int(std::ranges::min_element(diameters_mm, {}, off) - diameters_mm.begin()));
  }
  return kinds;
}

PlainView plain(const PhantomView& view, const std::vector<double>& diameters_mm) {
  PlainView result{{},
                   *view.labelling.mirrored,
                   view.labelling.focal_px.value_or(usual_focal_widths * 2 * view.labelling.principal_px.x()),
                   view.labelling.principal_px,
                   limit_scale(view)};
  const std::vector<int> kinds = kinds_of(view.candidates, diameters_mm);
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    Vector2d uv = view.candidates[k].uv - result.principal_px;
    if (result.mirrored) uv.x() = -uv.x();
    result.candidates.push_back({uv, kinds[k]});
  }
  return result;
}

using Track = std::array<int, 3>;

/// Candidates that three pairs of views match consistently.
struct Triple {
  std::array<std::size_t, 3> views;
  std::vector<Track> tracks;
  PairHypothesis ab, ac;
};

std::vector<int> as_map(const PairHypothesis& h, std::size_t count) {
  std::vector<int> map(count, -1);
  for (const auto& [i, k] : h.matches) map[std::size_t(i)] = k;
  return map;
}

/// Matches of two views, each made once.
using PairMatches = std::map<std::pair<std::size_t, std::size_t>, std::vector<PairHypothesis>>;

/// Exact and near duplicates of a hypothesis cost time only: those with most tracks first.
std::vector<Triple> triples_of(const std::vector<PlainView>& views, const std::array<std::size_t, 3>& at,
                               PairMatches& pairs) {
  const auto& a = views[at[0]].candidates;
  const auto& b = views[at[1]].candidates;
  const auto matches = [&](std::size_t i, std::size_t j) -> const std::vector<PairHypothesis>& {
    const auto [found, fresh] = pairs.try_emplace({i, j});
    if (fresh)
      found->second = match_pair(views[i].candidates, views[j].candidates, most_pairs, views[i].limit_scale);
    return found->second;
  };
  const auto& ab = matches(at[0], at[1]);
  const auto& bc = matches(at[1], at[2]);
  const auto& ac = matches(at[0], at[2]);
  std::vector<std::vector<int>> map_bc, map_ac;
  for (const auto& h : bc) map_bc.push_back(as_map(h, b.size()));
  for (const auto& h : ac) map_ac.push_back(as_map(h, a.size()));
  std::vector<std::tuple<int, double, std::size_t, std::size_t, std::size_t>> ranking;
  for (std::size_t x = 0; x < ab.size(); ++x)
    for (std::size_t y = 0; y < bc.size(); ++y)
      for (std::size_t z = 0; z < ac.size(); ++z) {
        int closed = 0;
        for (const auto& [i, k] : ab[x].matches) {
          const int end = map_bc[y][std::size_t(k)];
          closed += end >= 0 && end == map_ac[z][std::size_t(i)];
        }
        if (closed >= least_tracks)
          ranking.emplace_back(-closed, ab[x].rms_px + bc[y].rms_px + ac[z].rms_px, x, y, z);
      }
  std::ranges::sort(ranking);
  std::vector<Triple> triples;
  for (const auto& [closed, rms, x, y, z] : ranking) {
    Triple triple{at, {}, ab[x], ac[z]};
    for (const auto& [i, k] : ab[x].matches)
      if (const int end = map_bc[y][std::size_t(k)]; end >= 0 && end == map_ac[z][std::size_t(i)])
        triple.tracks.push_back({i, k, end});
    const bool known =
        std::ranges::any_of(triples, [&](const Triple& t) { return t.tracks == triple.tracks; });
    if (!known) triples.push_back(std::move(triple));
    if (triples.size() == most_triples) break;
  }
  return triples;
}

/// Rotation by `angle` about the axis that lies at angle_a in the first image and at angle_b in the second.
Matrix3d rotation_of(const PairHypothesis& h, double angle) {
  return geometry::rotation_from_vector({0, 0, h.angle_b}) * geometry::rotation_from_vector({angle, 0, 0}) *
         geometry::rotation_from_vector({0, 0, -h.angle_a});
}

/// Scaled orthographic views of the tracks at given rotations: squared residual, px^2, and the points in the
/// first view's frame (px).
double orthographic_residual(const std::vector<std::array<Vector2d, 3>>& images,
                             const std::array<Matrix3d, 3>& rotations, const std::array<double, 3>& scales,
                             Eigen::Matrix3Xd* points) {
  Eigen::Matrix<double, 6, 3> rows;
  for (Eigen::Index v = 0; v < 3; ++v)
    rows.middleRows<2>(2 * v) = scales[std::size_t(v)] * rotations[std::size_t(v)].topRows<2>();
  const Eigen::Matrix<double, 3, 6> inverse = (rows.transpose() * rows).inverse() * rows.transpose();
  double sum = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    Eigen::Vector<double, 6> seen;
    seen << images[i][0], images[i][1], images[i][2];
    const Vector3d point = inverse * seen;
    sum += (rows * point - seen).squaredNorm();
    if (points) points->col(Eigen::Index(i)) = point;
  }
  return sum;
}

/// The rotation angles (about the axes to the second and to the third view) that fit best.
std::pair<double, double> best_angles(const std::vector<std::array<Vector2d, 3>>& images, const Triple& t) {
  constexpr double first = 4 * degree, last = 60 * degree, step = 2 * degree;
  double best = 1e300;
  std::pair<double, double> angles;
  for (double ab = first; ab <= last; ab += step)
    for (double ac = -last; ac <= last; ac += step) {
      if (std::abs(ac) < first - 1e-9) continue;
      const double residual =
          orthographic_residual(images, {Matrix3d::Identity(), rotation_of(t.ab, ab), rotation_of(t.ac, ac)},
                                {1, t.ab.scale, t.ac.scale}, nullptr);
      if (residual < best) best = residual, angles = {ab, ac};
    }
  return angles;
}

/// Adjusted in perspective, from rotation angles found in parallel projection. `depth_sign` -1: the other of
/// the two that a parallel projection shows alike.
Expected<Reconstruction> start_of(const std::vector<PhantomView>& phantom_views,
                                  const std::vector<PlainView>& views, const Triple& t,
                                  const std::vector<double>& diameters_mm,
                                  const std::pair<double, double>& angles, double depth_sign) {
  std::vector<std::array<Vector2d, 3>> images;
  std::array<Vector2d, 3> means;
  means.fill(Vector2d::Zero());
  for (const Track& track : t.tracks)
    for (std::size_t v = 0; v < 3; ++v)
      means[v] += views[t.views[v]].candidates[std::size_t(track[v])].uv / double(t.tracks.size());
  for (const Track& track : t.tracks) {
    auto& image = images.emplace_back();
    for (std::size_t v = 0; v < 3; ++v)
      image[v] = views[t.views[v]].candidates[std::size_t(track[v])].uv - means[v];
  }
  const std::array<Matrix3d, 3> rotations{Matrix3d::Identity(), rotation_of(t.ab, depth_sign * angles.first),
                                          rotation_of(t.ac, depth_sign * angles.second)};
  const std::array<double, 3> scales{1, t.ab.scale, t.ac.scale};
  Eigen::Matrix3Xd points(3, Eigen::Index(t.tracks.size()));
  orthographic_residual(images, rotations, scales, &points);

  Reconstruction r;
  r.views.resize(phantom_views.size());
  r.candidate_of.assign(phantom_views.size(), std::vector<int>(t.tracks.size(), -1));
  std::vector<double> magnifications;  // px / mm in the first view
  for (std::size_t i = 0; i < t.tracks.size(); ++i) {
    const auto first = std::size_t(t.tracks[i][0]);
    const double diameter = diameters_mm[std::size_t(views[t.views[0]].candidates[first].kind)];
    r.diameters_mm.push_back(diameter);
    magnifications.push_back(2 * phantom_views[t.views[0]].candidates[first].radius_px / diameter);
    for (std::size_t v = 0; v < 3; ++v) r.candidate_of[t.views[v]][i] = t.tracks[i][v];
  }
  const double magnification = median(std::move(magnifications));
  for (Eigen::Index i = 0; i < points.cols(); ++i) r.centres.push_back(points.col(i) / magnification);
  for (std::size_t v = 0; v < 3; ++v) {
    const PlainView& view = views[t.views[v]];
    const double depth = view.focal_px / (magnification * scales[v]);
    const Vector2d shift = means[v] / view.focal_px * depth;
    r.views[t.views[v]] = geometry::View{{view.mirrored ? -view.focal_px : view.focal_px, view.focal_px,
                                          view.principal_px.x(), view.principal_px.y(), 0},
                                         {rotations[v], {shift.x(), shift.y(), depth}}};
  }
  if (auto adjusted = readjust(r, phantom_views); !adjusted) return tl::unexpected<Failure>(adjusted.error());
  return r;
}

std::optional<Reconstruction> best_start(const std::vector<PhantomView>& phantom_views,
                                         const std::vector<PlainView>& views,
                                         const std::array<std::size_t, 3>& at,
                                         const std::vector<double>& diameters_mm, PairMatches& pairs) {
  const double limit = views[at[0]].limit_scale;
  std::optional<Reconstruction> best;
  for (const Triple& t : triples_of(views, at, pairs)) {
    if (best && best->centres.size() > t.tracks.size() + 1) break;
    std::vector<std::array<Vector2d, 3>> images;
    std::array<Vector2d, 3> means;
    means.fill(Vector2d::Zero());
    for (const Track& track : t.tracks) {
      auto& image = images.emplace_back();
      for (std::size_t v = 0; v < 3; ++v) {
        image[v] = views[t.views[v]].candidates[std::size_t(track[v])].uv;
        means[v] += image[v] / double(t.tracks.size());
      }
    }
    for (auto& image : images)
      for (std::size_t v = 0; v < 3; ++v) image[v] -= means[v];
    const auto angles = best_angles(images, t);
    for (const double sign : {1.0, -1.0}) {
      auto start = start_of(phantom_views, views, t, diameters_mm, angles, sign);
      if (!start || start->rms_px > limit * largest_rms_px) continue;
      const auto rank = [&](const Reconstruction& r) {
        return std::tuple(-double(r.centres.size()) + (r.rms_px > limit * good_rms_px ? 4 : 0), r.rms_px);
      };
      if (!best || rank(*start) < rank(*best)) best = std::move(*start);
    }
  }
  return best;
}

std::size_t count_views(const Reconstruction& r) {
  return std::size_t(std::ranges::count_if(r.views, [](const auto& view) { return view.has_value(); }));
}

/// Fiducials that fewer than three views show may be anything.
void drop_unsupported(Reconstruction& r) {
  for (std::size_t ball = r.centres.size(); ball-- > 0;) {
    int seen = 0;
    for (std::size_t v = 0; v < r.views.size(); ++v) seen += r.views[v] && r.candidate_of[v][ball] >= 0;
    if (seen >= 3) continue;
    r.centres.erase(r.centres.begin() + std::ptrdiff_t(ball));
    r.diameters_mm.erase(r.diameters_mm.begin() + std::ptrdiff_t(ball));
    for (auto& of_view : r.candidate_of) of_view.erase(of_view.begin() + std::ptrdiff_t(ball));
  }
}

/// Depth reversed about the plane through the middle that the first view looks at squarely.
Reconstruction reversed(const Reconstruction& r) {
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& centre : r.centres) middle += centre / double(r.centres.size());
  Reconstruction other = r;
  const auto first = std::ranges::find_if(r.views, [](const auto& view) { return view.has_value(); });
  const Vector3d axis = (*first)->camera_from_world.rotation.row(2).transpose();
  const Matrix3d mirror = Matrix3d::Identity() - 2 * axis * axis.transpose();
  for (Vector3d& centre : other.centres) centre = middle + mirror * (centre - middle);
  const Matrix3d depth = Vector3d(1, 1, -1).asDiagonal();
  for (auto& view : other.views) {
    if (!view) continue;
    geometry::RigidTransform& pose = view->camera_from_world;
    const Vector3d at = pose * middle;
    pose.rotation = depth * pose.rotation * mirror;
    pose.translation = at - pose.rotation * middle;
  }
  return other;
}

Expected<void> check_handedness(const Reconstruction& r) {
  if (!r.reversed_rms_px || *r.reversed_rms_px > reversal_ratio * r.rms_px) return {};
  return fail(
      Reason::ambiguous_handedness,
      fmt::format(
          "the phantom and its depth-reversed image fit almost alike ({:.3f} and {:.3f} px rms): take "
          "views farther apart, or use a less flat phantom",
          r.rms_px, *r.reversed_rms_px),
      {{"rms_px", r.rms_px}, {"reversed_rms_px", *r.reversed_rms_px}});
}

}  // namespace

Expected<Reconstruction> reconstruct_from_scratch(const std::vector<PhantomView>& phantom_views,
                                                  const std::vector<double>& diameters_mm) {
  if (phantom_views.size() < 3)
    return fail(Reason::too_few_views, "at least three views are required to measure a phantom",
                {{"views", double(phantom_views.size())}, {"needed", 3}});
  std::vector<PlainView> views;
  for (const PhantomView& view : phantom_views) {
    if (!view.labelling.mirrored) {
      Failure failure{Reason::ambiguous_handedness,
                      "the images do not distinguish a phantom from its mirror image in mirrored images: "
                      "state \"mirrored\" in the view",
                      view.name,
                      {}};
      return tl::unexpected<Failure>(std::move(failure));
    }
    views.push_back(plain(view, diameters_mm));
  }
  // The chain's neighbours first, then every other three.
  std::vector<std::array<std::size_t, 3>> order;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = i + 1; j < views.size(); ++j)
      for (std::size_t k = j + 1; k < views.size(); ++k) order.push_back({i, j, k});
  std::ranges::stable_sort(order, {}, [](const auto& t) { return t[2] - t[0]; });
  constexpr std::size_t most_tries = 20;
  Reconstruction best;
  PairMatches pairs;
  for (std::size_t i = 0; i < std::min(order.size(), most_tries); ++i) {
    auto start = best_start(phantom_views, views, order[i], diameters_mm, pairs);
    if (!start) continue;
    if (!complete(*start, phantom_views)) continue;
    add_fiducials(*start, phantom_views, diameters_mm);
    if (!complete(*start, phantom_views)) continue;
    drop_unsupported(*start);
    if (start->centres.size() < 6) continue;
    const auto rank = [](const Reconstruction& r) {
      return std::tuple(-double(count_views(r)), -double(r.centres.size()), r.rms_px);
    };
    if (best.views.empty() || rank(*start) < rank(best)) best = *std::move(start);
    if (count_views(best) == phantom_views.size() && best.rms_px < views[0].limit_scale * good_rms_px) break;
  }
  if (count_views(best) < 3)
    return fail(
        Reason::ambiguous_labels,
        "no three views agree on six fiducials: take further views, each 10 to 30 degrees from the next",
        {{"views", double(count_views(best))}});
  Reconstruction other = reversed(best);
  if (readjust(other, phantom_views)) {
    best.reversed_rms_px = other.rms_px;
    if (other.rms_px < best.rms_px) {
      other.reversed_rms_px = best.rms_px;
      best = std::move(other);
    }
  }
  if (auto handed = check_handedness(best); !handed) return tl::unexpected<Failure>(handed.error());
  return best;
}

}  // namespace helicarm::phantom_calibration
