// SPDX-License-Identifier: Apache-2.0
#include "phantom_command.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/phantom/body.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/drawing.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/phantom/rules.h"
#include "helicarm/phantom/uniformity.h"

namespace helicarm::cli {
namespace {

using Files = std::vector<std::pair<std::filesystem::path, std::string>>;

Calibrator calibrator_of(const PhantomArguments& arguments) {
  if (arguments.name_or_file.empty() || arguments.name_or_file == udcsc().name) return udcsc();
  return value_or_throw(read_calibrator(arguments.name_or_file));
}

Plate plate_of(const PhantomArguments& arguments) {
  if (arguments.name_or_file.empty() || arguments.name_or_file == plate48().name) return plate48();
  return value_or_throw(read_plate(arguments.name_or_file));
}

void show(const Calibrator& calibrator, Console& console) {
  if (console.json) {
    console.out << to_text(to_json(calibrator)) << "\n";
    return;
  }
  console.out << fmt::format("{}: {} balls, {} targets\n\n{:<12}{:>10}{:>10}{:>10}{:>12}\n", calibrator.name,
                             calibrator.balls.size(), calibrator.targets.size(), "label", "x mm", "y mm",
                             "z mm", "diameter mm");
  const auto row = [&](const std::string& name, const Eigen::Vector3d& p, double diameter) {
    console.out << fmt::format("{:<12}{:>10.3f}{:>10.3f}{:>10.3f}{:>12.2f}\n", name, p.x(), p.y(), p.z(),
                               diameter);
  };
  for (const auto& ball : calibrator.balls) row(ball.label, ball.centre_in_calibrator, ball.diameter_mm);
  for (const auto& target : calibrator.targets)
    row(target.name, target.point_in_calibrator, target.diameter_mm);
}

void show(const Plate& plate, Console& console) {
  if (console.json) {
    console.out << to_text(to_json(plate)) << "\n";
    return;
  }
  const auto number = [](const std::optional<double>& value) {
    return value ? fmt::format("{} mm", *value) : std::string("not given");
  };
  console.out << fmt::format("{}: {} {} of {} mm, {} lattice, pitch {}, height above the receiver {}\n",
                             plate.name,
                             plate.dots_mm.empty() ? "unbounded," : fmt::to_string(plate.dots_mm.size()),
                             plate.kind == DotKind::balls ? "balls" : "holes", plate.diameter_mm,
                             plate.lattice == Lattice::square ? "square" : "hexagonal",
                             number(plate.pitch_mm), number(plate.height_above_receiver_mm));
  for (const auto& dot : plate.dots_mm) console.out << fmt::format("{:>10.3f}{:>10.3f}\n", dot.x(), dot.y());
}

void check(const Calibrator& calibrator, Console& console) {
  const auto findings = check_rules(calibrator);
  const bool passed = std::all_of(findings.begin(), findings.end(), [](const auto& f) { return f.passed(); });
  std::vector<Eigen::Vector3d> centres;
  for (const auto& ball : calibrator.balls) centres.push_back(ball.centre_in_calibrator);
  const double spread = uniformity(centres);
  if (console.json) {
    Json json{
        {"name", calibrator.name}, {"passed", passed}, {"uniformity", spread}, {"rules", Json::array()}};
    for (const auto& f : findings)
      json["rules"].push_back({{"rule", f.rule},
                               {"sentence", f.sentence},
                               {"figure", f.figure},
                               {"bound", f.bound == Bound::at_most ? "at_most" : "at_least"},
                               {"limit", f.limit},
                               {"unit", f.unit},
                               {"passed", f.passed()}});
    console.out << to_text(json) << "\n";
  } else {
    for (const auto& f : findings)
      console.out << fmt::format("{:<7}{:>9.3f} {} {:>6.2f} {:<6} {}\n", f.passed() ? "kept" : "BROKEN",
                                 f.figure, f.bound == Bound::at_most ? "<=" : ">=", f.limit, f.unit,
                                 f.sentence);
    console.out << fmt::format("\n{}: {}; uniformity (Eq. 13) {:.3f}\n", calibrator.name,
                               passed ? "keeps all rules" : "breaks a rule", spread);
  }
  if (!passed) throw BadInput(Reason::rules_broken, fmt::format("{} breaks a design rule", calibrator.name));
}

Files exported(const Calibrator& calibrator, const PhantomArguments& arguments) {
  Files files;
  if (arguments.stl) files.emplace_back(*arguments.stl, to_stl(value_or_throw(printable_body(calibrator))));
  if (arguments.svg) files.emplace_back(*arguments.svg, drawing_of(calibrator));
  if (arguments.file) files.emplace_back(*arguments.file, to_text(to_json(calibrator)) + "\n");
  return files;
}

Files exported(const Plate& plate, const PhantomArguments& arguments) {
  if (arguments.stl) throw BadInput(Reason::usage, "--stl: only the calibrator has a printable body");
  Files files;
  if (arguments.svg) files.emplace_back(*arguments.svg, value_or_throw(drawing_of(plate)));
  if (arguments.file) files.emplace_back(*arguments.file, to_text(to_json(plate)) + "\n");
  return files;
}

void write(const Files& files, Console& console) {
  if (files.empty()) throw BadInput(Reason::usage, "phantom export: name at least one file to write");
  for (const auto& [path, bytes] : files) {
    value_or_throw(write_file(path, bytes));
    if (!console.quiet) console.progress << fmt::format("wrote {} ({} bytes)\n", path.string(), bytes.size());
  }
  if (!console.json) return;
  Json written = Json::array();
  for (const auto& file : files) written.push_back(file.first.string());
  console.out << to_text(Json{{"written", written}}) << "\n";
}

}  // namespace

CommandResult phantom_command(const PhantomArguments& arguments, Console& console) {
  return guarded([&] {
    switch (arguments.action) {
      case PhantomAction::show:
        return arguments.plate ? show(plate_of(arguments), console) : show(calibrator_of(arguments), console);
      case PhantomAction::check:
        if (arguments.plate)
          throw BadInput(Reason::usage,
                         "phantom check: the rules apply to the calibrator only; omit --plate");
        return check(calibrator_of(arguments), console);
      case PhantomAction::export_files:
        return write(arguments.plate ? exported(plate_of(arguments), arguments)
                                     : exported(calibrator_of(arguments), arguments),
                     console);
    }
  });
}

}  // namespace helicarm::cli
