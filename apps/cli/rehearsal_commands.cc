// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "demo_command.h"
#include "drr_command.h"
#include "helicarm/phantom/knee_cone.h"
#include "phantom_command.h"
#include "simulate_command.h"
#include "study_command.h"

namespace helicarm::cli {
namespace {

void add_demo(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::measure, "demo",
                              "Simulate two X-ray images, measure them and compare with the ground truth",
                              "helicarm demo --out helicarm-demo");
  auto& a = arguments_of(command, action, demo_command);
  command->add_option("--out", a.out, "Folder for the case and its result")->capture_default_str();
}

void add_simulate(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::studies, "simulate",
                  "Simulate a case with known ground truth: X-ray images of a knee with the calibrator",
                  "helicarm simulate my-case --kind tunnels --seed 7\n"
                  "  helicarm simulate my-case --calibrator my-phantom.json --plate my-plate.json");
  auto& a = arguments_of(command, action, simulate_command);
  command->add_option("DIR", a.folder, "Folder for the case and truth.json")->required();
  command
      ->add_option("--kind", a.kind,
                   "accuracy: AP and lateral image, five check targets\n"
                   "tunnels: balls at the tunnels' ends, tracker and tool\n"
                   "flat: as accuracy, on a flat panel\n"
                   "grid: the test grid of wires (3.1), for rectify --test-grid")
      ->type_name("WORD")
      ->capture_default_str();
  command
      ->add_option("--distance", a.distances_mm,
                   "grid: distance of the wires from the receiver, mm; one value gives GRID.dcm (default: "
                   "45), 30,60,90 give GRID-30.dcm and so on")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(20, 500));
  command
      ->add_option(
          "--preset", a.preset,
          "The C-arm; pixel sizes are those of images with 1024 px per side\n"
          "paper-sim: the paper's simulation (2.3.3): f 900 mm, 0.15 mm pixels, AP and lateral at 800 mm, "
          "no distortion, no plate\n"
          "ii-9in: 9 inch intensifier, 997 mm, 0.2295 mm: plate, distortion, sag (default)\n"
          "flat-panel: 1020 mm, 0.29 mm: sag, no distortion (default of kind flat)")
      ->type_name("WORD");
  command->add_option("--size", a.size, "Pixels per side: 512 or 1024")->capture_default_str();
  command->add_option("--bits", a.bits, "Stored bits: 8, 10, 12, 14 or 16")->capture_default_str();
  command->add_flag_callback(
      "--no-knee", [&a] { a.knee = false; }, "Without the knee");
  command->add_option(
      "--calibrator", a.calibrator,
      "calibrator.json instead of udcsc and its check targets; the C-arm turns about its balls' "
      "centroid, z along the knee");
  command->add_option("--plate", a.plate,
                      "plate.json instead of plate48; a lattice without dots fills the field");
  command
      ->add_option("--response", a.response,
                   "Response of the grey values: linear or log (default: log with the knee, else linear)")
      ->type_name("WORD");
  command
      ->add_option("--view", a.views,
                   "NAME:PRIMARY,SECONDARY, degrees; repeatable, 2 to 20 (grid: one). AP:0,0 has the source "
                   "below the knee, LAT:90,0 beside it (default: these two, approximately)")
      ->allow_extra_args(false);
  command->add_option("--arm-seed", a.arm_seed, "Seed of the C-arm (default: the seed)")
      ->check(within(0, 1e19));
  command->add_option("--ct", a.ct,
                      "A CT instead of the synthetic knee: MHA, NRRD, NIfTI or a folder of DICOM slices");
  command
      ->add_option("--ct-centre", a.ct_centre_mm,
                   "x,y,z (L, P, S; mm) of the CT at the knee's origin; default: its centre")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-1e5, 1e5));
  command
      ->add_option("--ct-turn", a.ct_turn_deg,
                   "x,y,z: rotation of the CT about the knee's distal, lateral and anterior axis, degrees")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-360, 360));
  command
      ->add_option(
          "--fault", a.faults,
          "decoys, wires, screws, low_dose, shutters, mirrored, saturated, or lost:LABEL; repeatable")
      ->type_name("WORD");
}

void add_drr(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::studies, "drr", "Project a CT volume: its line integrals on a flat detector",
                  "helicarm drr knee.nii.gz --angle 90 --out lateral.png --raw lateral.f32");
  auto& a = arguments_of(command, action, drr_command);
  command->add_option("VOLUME", a.volume, "MetaImage, NRRD, NIfTI-1, or a folder of DICOM CT slices")
      ->required();
  command->add_option("--out", a.out, "PNG, 16 bits: black = no attenuation, white = maximum");
  command->add_option("--raw", a.raw, "The line integrals as 32-bit floats, little endian, row by row");
  command->add_option("--size", a.size, "Pixels per side")->check(within(1, 8192))->capture_default_str();
  command->add_option("--pixel", a.pixel_mm, "Pixel on the detector, mm")
      ->check(within(0.01, 20))
      ->capture_default_str();
  command->add_option("--source-detector", a.source_detector_mm, "mm")
      ->check(within(10, 1e5))
      ->capture_default_str();
  command->add_option("--source-centre", a.source_centre_mm, "mm")
      ->check(within(1, 1e5))
      ->capture_default_str();
  command
      ->add_option("--centre", a.centre_mm,
                   "x,y,z (L, P, S; mm) on the central ray; default: the volume's centre")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-1e5, 1e5));
  command->add_option("--angle", a.angle_deg, "Position of the source: 0 anterior, 90 at the patient's left")
      ->check(within(-360, 360))
      ->capture_default_str();
  command->add_option("--tilt", a.tilt_deg, "Tilt of the source towards the head")
      ->check(within(-89, 89))
      ->capture_default_str();
  command
      ->add_option("--values", a.values,
                   "hu: attenuation by Hounsfield units, water 0.02059 / mm, 0 below -800\n"
                   "raw: integrate the voxels' values unchanged")
      ->type_name("WORD")
      ->capture_default_str();
}

void add_study(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::studies, "study",
                              "The paper's simulations, and the estimators against the Cramer-Rao bound",
                              "helicarm study number --out number\n"
                              "  helicarm study location --calibrator udcsc --out location\n"
                              "  helicarm study limit --groups 10000 --seed 1 --out limit");
  auto& a = arguments_of(command, action, study_command);
  command
      ->add_option("NAME", a.name,
                   "number: FRE and TRE by number of balls (Fig. 5)\n"
                   "uniformity: E(A) against TRE (Fig. 6)\n"
                   "location: TRE by position of the target (Fig. 7)\n"
                   "biplane: the cone against plates on the receiver (Table 1)\n"
                   "biplane-images: the plates from images; leaves biplane-case, a case for run (Table 1)\n"
                   "calibration: ten simulated tests, measured (Table 1, Fig. 14)\n"
                   "rectification: the test grid at ten distances, by ten intensifiers (Figs. 9 to 11)\n"
                   "design: ball positions of least TRE under the rules\n"
                   "limit: error over the Cramer-Rao bound, and coverage of the confidence regions\n"
                   "centres: errors of ball centres under wrong assumptions about the image")
      ->type_name("WORD")
      ->required();
  command
      ->add_option("--groups", a.groups,
                   "Number of trials per setting; centres: number of balls per situation")
      ->check(within(1, 1e6));
  command->add_option("--out", a.out, "Folder for NAME.csv, NAME.json and NAME.svg")->capture_default_str();
  command->add_flag("--resume", a.resume, "Continue an interrupted run that wrote to the same folder");
  command
      ->add_option("--balls", a.balls,
                   "Number of balls; study number takes several, as 6,7,8; uniformity, design and biplane "
                   "(default 8) take one")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(6, 64));
  command
      ->add_option("--sigma", a.sigmas,
                   "Interpretation of N(0, 2.34): std, var, mean_distance, rms_distance; study number takes "
                   "several (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--reading", a.readings,
                   "number: back-projected pixels: calibration_pixels, fresh_noise, exact (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--fle", a.fle, "Value instead of 2.34")->check(within(0, 1000));
  command
      ->add_option("--origin", a.origin,
                   "Origin of the world frame on the cone's axis: base (as published) or centre")
      ->type_name("WORD");
  command->add_option("--draws", a.draws, "uniformity: noise draws to average over")->check(within(1, 1e5));
  command->add_option("--surface", a.surface, "design: balls on the helix, the cone or a dome")
      ->type_name("WORD");
  command->add_option("--calibrator", a.calibrator,
                      "location: name of a built-in or a file (default: random balls)");
  add_fields(command, a.biplane, study::biplane_fields);
  add_fields(command, a.calibration, study::calibration_fields);
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
  command
      ->add_option(
          "ACTION", a.action,
          "show, check, export: a calibrator or plate\n"
          "design: a calibrator for a knee's dimensions\n"
          "measure: ball coordinates as built, from a case of three views or more (6 to 10 advised, 10 to "
          "30 degrees apart)\n"
          "verify: whether the balls are still at the file's positions, from a case of two views or more")
      ->transform(CLI::CheckedTransformer(
                      std::map<std::string, PhantomAction>{{"show", PhantomAction::show},
                                                           {"check", PhantomAction::check},
                                                           {"export", PhantomAction::export_files},
                                                           {"design", PhantomAction::design},
                                                           {"measure", PhantomAction::measure},
                                                           {"verify", PhantomAction::verify}})
                      .description("{show, check, export, design, measure, verify}"))
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

}  // namespace

void add_rehearsal_commands(CLI::App& app, Action& action) {
  add_demo(app, action);
  add_simulate(app, action);
  add_drr(app, action);
  add_study(app, action);
  add_phantom(app, action);
}

}  // namespace helicarm::cli
