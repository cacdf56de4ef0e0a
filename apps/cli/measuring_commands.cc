// SPDX-License-Identifier: Apache-2.0
#include "command_line.h"
#include "detect_command.h"
#include "export_command.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/rectification/distortion_model.h"
#include "helicarm/report/exports.h"
#include "import_command.h"
#include "locate_command.h"
#include "measure_command.h"
#include "predict_command.h"
#include "rectify_command.h"
#include "register_command.h"
#include "run_cases_command.h"
#include "solve_command.h"

namespace helicarm::cli {
namespace {

void add_motion(CLI::App* command, double& motion_sigma_mm) {
  constexpr Field<pipeline::RunOptions> field =
      field_named<pipeline::RunOptions>(pipeline::run_fields, "motion_sigma_mm");
  command->add_option(std::string(field.flag), motion_sigma_mm, std::string(field.help))
      ->check(within(field.range.low, field.range.high))
      ->capture_default_str();
}

void add_run(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "run",
      "Measure a case: cameras with covariances from X-ray images, and from two or more points and tunnels",
      "helicarm run my-case --out my-result\n"
      "  helicarm run study/* --out results    each case in results/NAME, all in results/summary.csv");
  auto& [cases, a] = arguments_of(command, action, run_cases_command);
  command->add_option("CASE", cases, "Folder that holds case.json; several are run one after the other")
      ->required();
  command
      ->add_option("--out", a.out,
                   "Folder for result.json, report.html and the overlays; with several cases for a folder of "
                   "each and summary.csv")
      ->capture_default_str();
  add_fields(command, a.options.run, pipeline::run_fields);
  add_fields(command, a.options.search, case_registration::search_fields);
  command->add_option("--machine", a.history,
                      "The C-arm's history (JSON): used as prior; this case's acquisitions are added");
  command->add_flag("--no-report", a.no_report, "Write result.json only");
}

void add_register(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::motion, "register",
                              "Register CT volumes and surfaces of bones or implants to the views of a case",
                              "helicarm register my-case --out my-registration\n\n"
                              "case.json holds \"models\": a CT (\"volume\", with \"mask\" or \"window_hu\") "
                              "or a closed surface (\"surface\",\n"
                              "STL, PLY or VTP), a \"start\" (a pose, landmarks, or none) and a \"plan\" (3D "
                              "Slicer's markups). The views are\n"
                              "calibrated by the program, or bring cameras: \"camera\": \"camera.json\" as "
                              "helicarm import --json prints it.\n"
                              "Exit code 3: a registration is refused; registration.json holds the figures. "
                              "See docs/registration.md.");
  auto& a = arguments_of(command, action, register_command);
  command->add_option("CASE", a.run.folder, "Folder that holds case.json")->required();
  command->add_option("--out", a.run.out, "Folder for registration.json, report.html and the overlays")
      ->capture_default_str();
  add_fields(command, a.run.options.run, pipeline::run_fields);
  add_fields(command, a.run.options.search, case_registration::search_fields);
  command->add_option("--machine", a.run.history, "The C-arm's history (JSON), read only");
  command->add_option("--frames", a.frames,
                      "Follow the models through the frames A-B[:STEP] of files with several frames, or of "
                      "numbered files (\"image\": \"ap_{frame:03d}.tif\"); writes registration.csv and "
                      "relative.csv");
}

void add_export(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::images, "export", "Measure a case and write the result for other programs",
                  "helicarm export my-case --out exported\n"
                  "  helicarm export my-case --out exported --as csv,slicer");
  auto& a = arguments_of(command, action, export_command);
  command->add_option("CASE", a.run.folder, "Folder that holds case.json")->required();
  command->add_option("--out", a.run.out, "Folder for the files")->capture_default_str();
  command
      ->add_option("--as", a.as,
                   fmt::format("One or more of {}, separated by commas (default: all)",
                               fmt::join(report::export_words, ", ")))
      ->type_name("WORD")
      ->delimiter(',');
  add_fields(command, a.run.options.run, pipeline::run_fields);
  add_fields(command, a.run.options.search, case_registration::search_fields);
  command->add_option("--machine", a.run.history, "The C-arm's history (JSON), read only");
}

void add_predict(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::measure, "predict", "Predict the error of a point before it is picked",
                  "helicarm predict my-case --at 0,0,40 --at 60,0,40 --map tre");
  auto& a = arguments_of(command, action, predict_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option("--at", a.at,
                      "x,y,z in the calibrator's frame, mm; repeatable (default: the calibrator's centre)");
  command->add_option("--sigma-px", a.sigma_px, "Standard deviation of a picked point, per axis, px")
      ->check(within(0, 100))
      ->capture_default_str();
  add_motion(command, a.motion_sigma_mm);
  command
      ->add_option("--max-error", a.max_error_mm, "A point is accepted if its 95 % error is at most this, mm")
      ->check(within(1e-6, 1000))
      ->capture_default_str();
  command->add_option("--machine", a.history, "The C-arm's history (JSON), read only");
  command->add_option("--map", a.map, "Folder for a map about the calibrator: tre.csv, tre.vtk, tre.svg");
  command->add_option("--half", a.half_mm, "Half the side of the map, mm")
      ->check(within(1, 1000))
      ->capture_default_str();
  command->add_option("--step", a.step_mm, "Spacing of the map's points, mm")
      ->check(within(0.5, 100))
      ->capture_default_str();
}

void add_solve(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "solve",
                              "Calibrate one view from known 3-D points and their pixels (Eq. 4-7)",
                              "helicarm solve --points points.csv --method ml --json");
  auto& a = arguments_of(command, action, solve_command);
  command->add_option("--points", a.points, "CSV: label,x_mm,y_mm,z_mm,u_px,v_px[,sigma_px]")->required();
  command->add_option("--method", a.method, "dlt, homogeneous or ml")
      ->type_name("WORD")
      ->capture_default_str();
}

void add_locate(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "locate", "Triangulate picked pixels in calibrated views (Eq. 8)",
      "helicarm locate --calibration my-result/result.json --picks picks.csv --json\n"
      "  helicarm locate --calibration AP=cam1.json --calibration LAT=cam2.json --picks picks.csv");
  auto& a = arguments_of(command, action, locate_command);
  command
      ->add_option("--calibration", a.calibrations,
                   "result.json of a run; or for each view VIEW=FILE: result.json, the output of solve or "
                   "import, or a file that import reads, all in one frame and in mm")
      ->allow_extra_args(false)
      ->required();
  command->add_option("--picks", a.picks, "CSV: name,view,u_px,v_px[,sigma_px], rectified pixels")
      ->required();
  command->add_flag("--raw", a.raw, "The picks are raw pixels");
  add_motion(command, a.motion_sigma_mm);
}

void add_measure(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "measure",
      "Measure in single images: distance, angle, circle, positions in femur and tibia",
      "helicarm measure --clicks clicks.csv --calibration my-result/result.json\n"
      "  helicarm measure --clicks clicks.csv      without a calibration: lengths in pixels\n\n"
      "kind and the names of its clicks:\n"
      "  distance           from, to\n"
      "  angle              first, vertex, second\n"
      "  line_angle         line1_from, line1_to, line2_from, line2_to\n"
      "  circle             rim1, rim2, rim3 and any further ones\n"
      "  femoral_quadrants  blumensaat_posterior, blumensaat_anterior, inferior[, posterior, anterior]\n"
      "  tibia_ap           anterior, posterior[, plateau1, plateau2]\n"
      "  tibia_ml           medial, lateral\n"
      "In the last three, clicks of other names are points whose positions are given in per cent; a point\n"
      "without pixels is the located one of this name in result.json.");
  auto& a = arguments_of(command, action, measure_command);
  command
      ->add_option("--clicks", a.clicks,
                   "CSV: measure,kind,view,name,u_px,v_px[,sigma_px], rectified pixels; a row per click")
      ->required();
  command->add_option("--calibration", a.calibration, "result.json of a run: gives lengths in mm");
  command->add_option("--registration", a.registration,
                      "registration.json of the same views: its planned points may be named too");
  command->add_flag("--raw", a.raw, "The clicks are raw pixels");
  command
      ->add_option("--depth", a.depth_mm,
                   "Distance of the plane of lengths from the source, mm (default: through the fiducials' "
                   "centre)")
      ->check(within(1, 10000));
  command->add_option("--depth-sigma", a.depth_sigma_mm, "Its standard deviation, mm")
      ->check(within(0, 1000))
      ->capture_default_str();
  command->add_option("--at", a.at, "A located point of result.json in that plane");
}

void add_rectify(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "rectify",
                              "Correct an intensifier's distortion by its plate, or apply a known map (2.1)",
                              "helicarm rectify AP.dcm --plate plate48 --out rectified\n"
                              "  helicarm rectify series/ --map rectified/map.json --out straight\n"
                              "  helicarm rectify --map rectified/map.json --points raw.csv --json\n"
                              "  helicarm rectify GRID.dcm --map rectified/map.json --test-grid 20 --json");
  auto& a = arguments_of(command, action, rectify_command);
  command->add_option("IMAGE", a.images,
                      "DICOM, PNG, TIFF, JPEG or BMP; with --map several, and folders of images");
  command->add_option("--frame", a.frame, "Number of the image in a multi-frame file, from 1")
      ->check(within(1, 100000));
  command->add_option("--plate", a.plate, "plate.json, or plate48");
  command->add_option("--map", a.map, "map.json of an earlier rectification");
  command->add_option("--points", a.points, "CSV: u_px,v_px, raw pixels");
  command->add_flag("--inverse", a.inverse, "The points are rectified pixels; return raw ones");
  command->add_option("--test-grid", a.test_grid_mm, "Pitch of the test grid, mm: report Eq. 14-15")
      ->check(within(0.1, 1000));
  command
      ->add_option("--out", a.out,
                   "Folder for rectified.dcm (of several images NAME_rectified.dcm), inpainted.dcm, "
                   "map.json and residuals.csv")
      ->capture_default_str();
  command->add_flag("--field", a.field,
                    "Also displacement.nrrd: the map as displacement field of ITK and 3D Slicer");
  command->add_flag("--keep-patient", a.keep_patient,
                    "Written images keep the patient and the study of theirs, to be stored with it (default: "
                    "neither name nor dates nor UIDs)");
  command->add_option("--method", a.method, "best, or paper: Hough circles and a quadratic")
      ->type_name("WORD")
      ->capture_default_str();
  command
      ->add_option("--model", a.model,
                   "Distortion model, with --method best: " + rectification::model_names() +
                       " (default: by the number of dots and their held-out errors)")
      ->type_name("WORD");
  command->add_flag("--stages", a.stages,
                    "With --method paper: also the paper's Fig. 2, stage-raw.png to stage-inpainted.png");
}

void add_detect(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::images, "detect",
                              "Detect balls, holes or wire crossings with sub-pixel precision",
                              "helicarm detect AP.dcm --kind balls --json\n"
                              "  helicarm detect series/ --out dots.csv");
  auto& a = arguments_of(command, action, detect_command);
  command->add_option("IMAGE", a.images, "DICOM, PNG, TIFF, JPEG or BMP; several, and folders of images")
      ->required();
  command->add_option("--frame", a.frame, "Number of the image in a multi-frame file, from 1")
      ->check(within(1, 100000));
  command->add_option("--kind", a.kind, "balls, holes or crosses")->type_name("WORD")->capture_default_str();
  command->add_option("--out", a.out, "CSV: image,u_px,v_px,sigma_px,radius_px of all images");
}

void add_import(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "import",
      "Read a projection or transform of another program: MayaCam, DLT, NRRD, OpenCV, RTK, ITK",
      "helicarm import camera.txt --unit cm --json\n"
      "  helicarm import MergedDlts.csv --column 2 --image-size 1760,1700 --json\n"
      "  helicarm import geometry.xml --column 1 --pixel-mm 0.388,0.388 --image-size 1024,768 --json\n"
      "  helicarm import femur.tfm --json");
  auto& a = arguments_of(command, action, import_command);
  command
      ->add_option(
          "FILE", a.file,
          "MayaCam 1 or 2, NRRD header, OpenCV (YAML, XML, JSON), RTK (XML), a 3x4 matrix as text or JSON, "
          "XMALab's DLT coefficients, an ITK transform (.tfm, .h5), or a rigid 4x4 matrix")
      ->required();
  command
      ->add_option("--unit", a.unit,
                   "Unit of length in the file: mm, cm or m; needed where mm would be implausible")
      ->type_name("WORD");
  command
      ->add_option("--column", a.column,
                   "Camera of DLT coefficients, projection of RTK, image of OpenCV; from 1")
      ->check(within(1, 100));
  command
      ->add_option("--image-size", a.image_size,
                   "Width,height in px; DLT coefficients count rows upwards from 1, RTK's mm from the centre")
      ->delimiter(',')
      ->expected(2)
      ->check(within(1, 16384));
  command->add_option("--pixel-mm", a.pixel_mm, "RTK: spacing of the projection images, column,row")
      ->delimiter(',')
      ->expected(2)
      ->check(within(1e-4, 100));
  command
      ->add_option("--origin-mm", a.origin_mm,
                   "RTK: origin of the projection images (default: the image's centre is 0,0)")
      ->delimiter(',')
      ->expected(2)
      ->check(within(-1e5, 1e5));
  command->add_flag("--undistorted", a.undistorted,
                    "The images are undistorted already: a lens distortion in the file is left out");
}

}  // namespace

void add_measuring_commands(CLI::App& app, Action& action) {
  add_run(app, action);
  add_register(app, action);
  add_export(app, action);
  add_predict(app, action);
  add_solve(app, action);
  add_locate(app, action);
  add_measure(app, action);
  add_rectify(app, action);
  add_detect(app, action);
  add_import(app, action);
}

}  // namespace helicarm::cli
