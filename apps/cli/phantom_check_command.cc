// SPDX-License-Identifier: Apache-2.0
#include "phantom_check_command.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/json.h"
#include "helicarm/fiducials/phantom_check.h"
#include "helicarm/phantom/rules.h"
#include "helicarm/phantom/uniformity.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {
namespace {

Json json_of(const fiducials::NearSymmetry& symmetry) {
  Json moves = Json::array();
  for (const auto& [from, to] : symmetry.moves) moves.push_back({from, to});
  return {{"rms_mm", symmetry.rms_mm}, {"turn_deg", symmetry.turn_deg}, {"moves", std::move(moves)}};
}

Json json_of(const phantom::RuleFinding& finding) {
  return {{"rule", finding.rule},
          {"sentence", finding.sentence},
          {"figure", finding.figure},
          {"bound", finding.bound == phantom::Bound::at_most ? "at_most" : "at_least"},
          {"limit", finding.limit},
          {"unit", finding.unit},
          {"passed", finding.passed()}};
}

Json json_of(const fiducials::PhantomCheck& check) {
  Json json{{"directions", check.directions.size()},
            {"refused", check.refused()},
            {"refused_directions", Json::array()},
            {"rotation", check.rotation ? json_of(*check.rotation) : Json(nullptr)},
            {"mirror", check.mirror ? json_of(*check.mirror) : Json(nullptr)},
            {"hiding", Json::array()}};
  for (const fiducials::SeenDirection& seen : check.directions)
    if (seen.refused)
      json["refused_directions"].push_back({{"beam", {seen.beam.x(), seen.beam.y(), seen.beam.z()}},
                                            {"code", code(seen.refused->reason)},
                                            {"mirror", seen.mirror}});
  for (const fiducials::HidingPair& pair : check.hiding)
    json["hiding"].push_back({{"balls", {pair.a, pair.b}}, {"directions", pair.directions}});
  return json;
}

/// The labelling's own verdict as one more rule.
phantom::RuleFinding labels_rule(const fiducials::PhantomCheck& check) {
  constexpr double most_refused = 0.1;
  return {"labels",
          fmt::format("the labels are unambiguous from {} directions all round, handedness unknown: share of "
                      "refused ones",
                      check.directions.size()),
          double(check.refused()) / double(check.directions.size()),
          phantom::Bound::at_most,
          most_refused,
          ""};
}

void print(const fiducials::PhantomCheck& check, std::ostream& out) {
  for (const auto* symmetry : {&check.rotation, &check.mirror})
    if (*symmetry) {
      std::vector<std::string> moves;
      for (const auto& [from, to] : (*symmetry)->moves) moves.push_back(from + " to " + to);
      out << fmt::format("\n{} brings the balls to each other's places within {:.2f} mm rms:\n  {}\n",
                         (*symmetry)->mirror ? "a reflection"
                                             : fmt::format("a turn by {:.0f} degrees", (*symmetry)->turn_deg),
                         (*symmetry)->rms_mm, fmt::join(moves, ", "));
    }
  constexpr std::size_t most_pairs = 5;
  for (std::size_t i = 0; i < std::min(most_pairs, check.hiding.size()); ++i)
    out << fmt::format("{}{} and {} hide each other from {} of {} directions\n", i == 0 ? "\n" : "",
                       check.hiding[i].a, check.hiding[i].b, check.hiding[i].directions,
                       check.directions.size());
}

}  // namespace

void check_calibrator(const phantom::Calibrator& calibrator, Console& console) {
  auto findings = phantom::check_rules(calibrator);
  const fiducials::PhantomCheck labels = fiducials::check_phantom(calibrator, {.threads = console.threads});
  findings.push_back(labels_rule(labels));
  std::vector<std::string> broken;
  for (const auto& f : findings)
    if (!f.passed()) broken.push_back(f.rule);
  std::vector<Eigen::Vector3d> centres;
  for (const auto& ball : calibrator.balls) centres.push_back(ball.centre_in_calibrator);
  const double spread = phantom::uniformity(centres);
  const Failure failure{Reason::rules_broken,
                        fmt::format("{} breaks {} of {} design rules: {}", calibrator.name, broken.size(),
                                    findings.size(), fmt::join(broken, ", "))};
  if (console.json) {
    Json json{{"status", broken.empty() ? "ok" : "refused"},
              {"failure", broken.empty() ? Json(nullptr) : pipeline::to_json(failure)},
              {"name", calibrator.name},
              {"passed", broken.empty()},
              {"uniformity", spread},
              {"rules", Json::array()},
              {"labels", json_of(labels)}};
    for (const auto& f : findings) json["rules"].push_back(json_of(f));
    console.out << to_text(json) << "\n";
    console.answered = true;
  } else {
    for (const auto& f : findings)
      console.out << fmt::format("{:<7}{:>9.3f} {} {:>6.2f} {:<6} {}{}\n", f.passed() ? "kept" : "BROKEN",
                                 f.figure, f.bound == phantom::Bound::at_most ? "<=" : ">=", f.limit, f.unit,
                                 f.sentence, f.names.empty() ? "" : " (" + f.names + ")");
    print(labels, console.out);
    console.out << fmt::format("\n{}: {}; uniformity (Eq. 13) {:.3f}\n", calibrator.name,
                               broken.empty() ? "keeps all rules" : "breaks a rule", spread);
  }
  if (!broken.empty()) throw BadInput(failure);
}

}  // namespace helicarm::cli
