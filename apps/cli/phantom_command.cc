// SPDX-License-Identifier: Apache-2.0
#include "phantom_command.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command_line.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom/body.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/drawing.h"
#include "helicarm/phantom/knee_cone.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/phantom/rules.h"
#include "named_files.h"
#include "one_of.h"
#include "phantom_check_command.h"
#include "phantom_measure_command.h"

namespace helicarm::cli {

constexpr std::array<std::pair<std::string_view, PhantomAction>, 6> actions{
    {{"show", PhantomAction::show},
     {"check", PhantomAction::check},
     {"export", PhantomAction::export_files},
     {"design", PhantomAction::design},
     {"measure", PhantomAction::measure},
     {"verify", PhantomAction::verify}}};

namespace {

using Files = std::vector<std::pair<std::filesystem::path, std::string>>;

phantom::Calibrator calibrator_of(const PhantomArguments& arguments) {
  return arguments.name_or_file.empty() ? phantom::udcsc() : calibrator_from(arguments.name_or_file);
}

phantom::Plate plate_of(const PhantomArguments& arguments) {
  return arguments.name_or_file.empty() ? phantom::plate48() : plate_from(arguments.name_or_file);
}

void show(const phantom::Calibrator& calibrator, Console& console) {
  if (console.json) {
    console.out << to_text(phantom::to_json(calibrator)) << "\n";
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

void show(const phantom::Plate& plate, Console& console) {
  if (console.json) {
    console.out << to_text(phantom::to_json(plate)) << "\n";
    return;
  }
  const auto number = [](const std::optional<double>& value) {
    return value ? fmt::format("{} mm", *value) : std::string("not given");
  };
  console.out << fmt::format("{}: {} {} of {} mm, {} lattice, pitch {}, height above the receiver {}\n",
                             plate.name,
                             plate.dots_mm.empty() ? "unbounded," : fmt::to_string(plate.dots_mm.size()),
                             plate.kind == phantom::DotKind::balls ? "balls" : "holes", plate.diameter_mm,
                             plate.lattice == phantom::Lattice::square ? "square" : "hexagonal",
                             number(plate.pitch_mm), number(plate.height_above_receiver_mm));
  for (const auto& dot : plate.dots_mm) console.out << fmt::format("{:>10.3f}{:>10.3f}\n", dot.x(), dot.y());
}

phantom::BodyOptions body_options(const phantom::Calibrator& calibrator, const PhantomArguments& arguments,
                                  Console& console) {
  phantom::BodyOptions options{.clearance_mm = arguments.clearance_mm, .step_mm = arguments.step_mm};
  constexpr std::array<std::string_view, 3> shapes{"cone", "rings", "plate"};
  if (!arguments.body) {
    options.shape = phantom::suitable_shape(calibrator);
    if (!console.quiet)
      console.progress << fmt::format("body: {} (--body chooses another)\n",
                                      shapes[std::size_t(options.shape)]);
    return options;
  }
  const auto found = std::ranges::find(shapes, *arguments.body);
  if (found == shapes.end())
    throw BadInput(Reason::usage,
                   fmt::format("--body: \"{}\" is none of: {}", *arguments.body, fmt::join(shapes, ", ")));
  options.shape = phantom::BodyShape(found - shapes.begin());
  return options;
}

Files exported(const phantom::Calibrator& calibrator, const PhantomArguments& arguments, Console& console) {
  Files files;
  if (arguments.stl)
    files.emplace_back(*arguments.stl, phantom::to_stl(value_or_throw(phantom::printable_body(
                                           calibrator, body_options(calibrator, arguments, console)))));
  if (arguments.svg) files.emplace_back(*arguments.svg, phantom::drawing_of(calibrator));
  if (arguments.file) files.emplace_back(*arguments.file, to_text(phantom::to_json(calibrator)) + "\n");
  return files;
}

Files exported(const phantom::Plate& plate, const PhantomArguments& arguments) {
  if (arguments.stl)
    throw BadInput(Reason::usage, "--stl: only the calibrator can be exported for 3D printing; omit --plate");
  Files files;
  if (arguments.svg) files.emplace_back(*arguments.svg, value_or_throw(phantom::drawing_of(plate)));
  if (arguments.file) files.emplace_back(*arguments.file, to_text(phantom::to_json(plate)) + "\n");
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

/// A calibrator for a knee (2.3.1), checked by the rules of 2.3.4.
void design(const PhantomArguments& arguments, Console& console) {
  if (arguments.knee_mm.size() != 2)
    throw BadInput(Reason::usage,
                   "phantom design: --knee D1,D2 is required, mm (paper: 64.6 to 68.9, 55.3 to 59.0)");
  const phantom::KneeCone cone =
      value_or_throw(phantom::cone_for_knee(arguments.knee_mm[0], arguments.knee_mm[1]));
  const phantom::ConicalHelix helix = phantom::helix_on(cone);
  const phantom::Calibrator calibrator = phantom::calibrator_on(helix, "knee");
  std::vector<std::string> broken;
  for (const phantom::RuleFinding& rule : phantom::check_rules(calibrator))
    if (!rule.passed())
      broken.push_back(fmt::format("{} ({:.3g}, limit {:g})", rule.rule, rule.figure, rule.limit));
  if (console.json) {
    console.out << to_text(Json{{"cone",
                                 {{"base_diameter_mm", cone.base_diameter_mm},
                                  {"top_diameter_mm", cone.top_diameter_mm},
                                  {"height_mm", cone.height_mm}}},
                                {"helix", {{"rr", helix.rr}, {"pp", helix.pp}, {"h", helix.h}}},
                                {"calibrator", phantom::to_json(calibrator)},
                                {"broken_rules", broken}})
                << "\n";
  } else {
    console.out << fmt::format(
        "cone: base {:.1f} mm, top {:.1f} mm, height {:.1f} mm\nhelix (Eq. 9): rr {:.3f}, pp {:.3f}, h "
        "{:.3f}, 3.5 "
        "turns\nrules broken: {}\n\n",
        cone.base_diameter_mm, cone.top_diameter_mm, cone.height_mm, helix.rr, helix.pp, helix.h,
        broken.empty() ? "none" : fmt::format("{}", fmt::join(broken, "; ")));
    show(calibrator, console);
  }
  if (arguments.svg) value_or_throw(write_file(*arguments.svg, phantom::drawing_of(calibrator)));
  if (arguments.file)
    value_or_throw(write_file(*arguments.file, to_text(phantom::to_json(calibrator)) + "\n"));
}

/// Refuses what another action would need.
void check_options(const PhantomArguments& a) {
  using enum PhantomAction;
  const PhantomArguments usual;
  struct Option {
    const char* name;
    bool is_given;
    std::vector<PhantomAction> of;
  };
  const std::array options{Option{"--plate", a.plate, {show, check, export_files}},
                           Option{"--stl", a.stl.has_value(), {export_files}},
                           Option{"--body", a.body.has_value(), {export_files}},
                           Option{"--clearance", a.clearance_mm != usual.clearance_mm, {export_files}},
                           Option{"--step", a.step_mm != usual.step_mm, {export_files}},
                           Option{"--svg", a.svg.has_value(), {export_files, design}},
                           Option{"--file", a.file.has_value(), {export_files, design}},
                           Option{"--knee", !a.knee_mm.empty(), {design}},
                           Option{"--out", a.out.has_value(), {measure, verify}},
                           Option{"--from-scratch", a.from_scratch, {measure}},
                           Option{"--distance", !a.distances.empty(), {measure}},
                           Option{"--distance-sigma", a.distance_sigma_mm.has_value(), {measure}},
                           Option{"--distance-is", a.distance_is != usual.distance_is, {measure}},
                           Option{"--history", a.history.has_value(), {verify}}};
  const auto word = [](PhantomAction action) {
    return std::ranges::find(actions, action, [](const auto& one) { return one.second; })->first;
  };
  for (const Option& option : options) {
    if (!option.is_given || std::ranges::find(option.of, a.action) != option.of.end()) continue;
    std::vector<std::string_view> words;
    for (const PhantomAction action : option.of) words.push_back(word(action));
    throw BadInput(Reason::usage, fmt::format("phantom {}: {} belongs to {}", word(a.action), option.name,
                                              fmt::join(words, ", ")));
  }
}

}  // namespace

CommandResult phantom_command(const PhantomArguments& arguments, Console& console) {
  return guarded([&] {
    check_options(arguments);
    switch (arguments.action) {
      case PhantomAction::show:
        return arguments.plate ? show(plate_of(arguments), console) : show(calibrator_of(arguments), console);
      case PhantomAction::check:
        if (arguments.plate)
          throw BadInput(Reason::usage,
                         "phantom check: the rules apply to the calibrator only; omit --plate");
        return check_calibrator(calibrator_of(arguments), console);
      case PhantomAction::export_files:
        return write(arguments.plate ? exported(plate_of(arguments), arguments)
                                     : exported(calibrator_of(arguments), arguments, console),
                     console);
      case PhantomAction::design:
        return design(arguments, console);
      case PhantomAction::measure:
        return measure_phantom(arguments, console);
      case PhantomAction::verify:
        return verify_phantom(arguments, console);
    }
  });
}

void add_phantom(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::phantom, "phantom", "Show, check, design, export, measure or verify the calibrator",
      "helicarm phantom show\n  helicarm phantom check calibrator.json\n"
      "  helicarm phantom design --knee 66.7,57.2 --file knee.json\n"
      "  helicarm phantom export --stl calibrator.stl --svg calibrator.svg\n"
      "  helicarm phantom export my-balls.json --body rings --clearance -0.1 --step 0.5 --stl body.stl\n"
      "  helicarm phantom measure eight-views --distance P1,P7=118.42 --distance-is outer --out my-phantom\n"
      "  helicarm phantom measure eight-views --from-scratch --distance \"212,480;803,466=83.4\" --out "
      "my-phantom\n"
      "  helicarm phantom verify two-views --history my-phantom/history.json");
  auto& a = arguments_of(command, action, phantom_command);
  std::vector<std::string> words;
  for (const auto& [word, of] : actions) words.emplace_back(word);
  command
      ->add_option_function<std::string>(
          "ACTION",
          [&a](const std::string& word) {
            a.action = std::ranges::find(actions, word, [](const auto& one) { return one.first; })->second;
          },
          "show, check, export: a calibrator or plate\n"
          "design: a calibrator for a knee's dimensions\n"
          "measure: ball coordinates as built, from a case of three views or more (6 to 10 advised, 10 to "
          "30 degrees apart)\n"
          "verify: whether the balls are still at the file's positions, from a case of two views or more")
      ->check(one_of(words))
      ->type_name("WORD")
      ->required();
  command->add_option(
      "NAME_OR_FILE", a.name_or_file,
      "Name of a built-in or a file (default: udcsc or plate48). measure, verify: the case's folder");
  command->add_flag("--plate", a.plate, "The rectification plate instead of the calibrator");
  command->add_option("--stl", a.stl, "export: the body for 3D printing, as STL");
  command
      ->add_option("--body", a.body,
                   "export: shape of the body\n"
                   "cone: balls on the wall of the built-in calibrator's cone\n"
                   "rings: any layout, a ring through each ball and four ribs\n"
                   "plate: any layout, a plate with a post under each ball\n"
                   "(default: cone if the balls lie on its wall, else rings)")
      ->type_name("WORD");
  command
      ->add_option("--clearance", a.clearance_mm,
                   "export: diameter of a ball's pocket less that of the ball, mm; negative: press fit")
      ->check(within(-0.5, 2))
      ->capture_default_str();
  command->add_option("--step", a.step_mm, "export: step of the body's surface, mm; fine for a press fit")
      ->check(within(0.2, 3))
      ->capture_default_str();
  command
      ->add_option(
          "--knee", a.knee_mm,
          "design: D1,D2: width between lateral femoral wall and medial condyle, and height from the "
          "top of the knee to the resident's ridge, mm (Fig. 4)")
      ->delimiter(',')
      ->expected(2)
      ->check(within(phantom::knee_range_mm.low, phantom::knee_range_mm.high));
  command->add_option("--svg", a.svg, "export, design: the drawing with all coordinates, as SVG");
  command->add_option("--file", a.file, "export, design: calibrator.json or plate.json");
  command->add_option("--out", a.out,
                      "measure: folder for calibrator.json, result.json and report.html; verify: for "
                      "result.json");
  command->add_flag(
      "--from-scratch", a.from_scratch,
      "measure: without a nominal file; the case gives \"diameters_mm\" and each view \"mirrored\"");
  command
      ->add_option(
          "--distance", a.distances,
          "measure: distance of two balls by caliper, A,B=MM with labels (from scratch those that a first "
          "measurement gives, see its report) or u1,v1;u2,v2=MM with raw pixels in the first view; "
          "repeatable. "
          "Without it the scale has a sigma of 3 %")
      ->allow_extra_args(false);
  command
      ->add_option("--distance-sigma", a.distance_sigma_mm,
                   "measure: standard error of each distance, mm (default: 0.05)")
      ->check(within(1e-4, 10));
  command
      ->add_option("--distance-is", a.distance_is,
                   "measure: centres (centre to centre) or outer (outside dimension across both balls)")
      ->type_name("WORD")
      ->capture_default_str();
  command->add_option("--history", a.history, "verify: JSON file to which this verification is added");
}

}  // namespace helicarm::cli
