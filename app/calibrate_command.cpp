// `parallax calibrate`: a lens or a stereo rig from views of a printed target; prints targets; converts calibrations.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <iomanip>
#include <iostream>
#include <memory>
#include <string>
#include <system_error>

#include "app/calibrate_plots.h"
#include "app/calibrate_report.h"
#include "app/calibrate_settings.h"
#include "app/calibrate_views.h"
#include "app/command.h"
#include "calib/lens_conversion.h"
#include "calib/target_pdf.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

// Fewest pixels of a conversion's residual that are worth a warning.
constexpr double large_conversion_px = 0.5;

void parse_pair(const std::string& option, const std::string& text, const std::string& expected, int* first,
                int* second) {
  const std::size_t x = text.find('x');
  double a = 0, b = 0;
  if (x == std::string::npos || !parse_number(text.substr(0, x), &a) || !parse_number(text.substr(x + 1), &b) ||
      a != static_cast<int>(a) || b != static_cast<int>(b) || a < 1 || b < 1)
    throw InputError(option + ": found '" + text + "', expected " + expected);
  *first = static_cast<int>(a);
  *second = static_cast<int>(b);
}

void write_json(const std::string& path, const nlohmann::ordered_json& json) {
  write_file_atomically(path, [&](std::ostream& out) {
    out << json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
  });
}

void print_target(const CalibrateSettings& settings) {
  if (settings.output.empty()) throw InputError("--print-target: expected --output FILE.pdf");
  const Paper sheet = paper(settings.paper);
  CalibrationTarget target = settings.target;
  if (!settings.square_given) target.square_m = fitting_square_m(target, sheet);
  write_target_pdf(target, sheet, settings.output);
  std::cout << settings.output << ": " << to_string(target.kind) << " " << target.columns << "x" << target.rows
            << ", side " << target.square_m * 1e3
            << " mm. Print it at 100 %, measure the ruler, glue it on something flat,"
            << " then: parallax calibrate SOURCE --target " << to_string(target.kind) << " --board " << target.columns
            << "x" << target.rows << " --square " << target.square_m << "\n";
}

void convert(const CalibrateSettings& settings) {
  if (settings.output.empty()) throw InputError("--convert: expected --output FILE");
  const CameraModel source = read_calibration(settings.convert, settings.camera_index, settings.width, settings.height);
  CameraModel camera = source;
  std::cout << settings.convert << ": " << to_string(lens_model(source)) << ", " << source.width() << "x"
            << source.height() << "\n";
  if (settings.convert_model && *settings.convert_model != lens_model(source)) {
    const auto converted = convert_lens(source, *settings.convert_model);
    if (!converted)
      throw RunError(settings.convert + ": no " + to_string(*settings.convert_model) +
                     " lens comes near this one without folding inside the image");
    camera = converted->camera;
    std::cout << "as " << to_string(*settings.convert_model) << ": differs by " << std::setprecision(3)
              << converted->rms_px << " px rms, at most " << converted->max_px << " px, over "
              << 100 * converted->covered << " % of the image\n";
    if (converted->max_px > large_conversion_px)
      std::cerr << "parallax: warning: the two models differ by " << std::setprecision(3) << converted->max_px
                << " px somewhere in the image\n";
  } else {
    std::cout << "the same model: nothing is lost\n";
  }
  const std::string holds = format_problem(camera, settings.format);
  if (!holds.empty())
    throw InputError(std::string("--format ") + to_string(settings.format) + ": cannot hold the model " +
                     to_string(lens_model(camera)) + "; expected --model " + holds);
  write_calibration(camera, settings.format, settings.output);
}

void check_format(const CalibrateSettings& settings, const CameraModel& camera) {
  const std::string holds = format_problem(camera, settings.format);
  if (!holds.empty())
    throw InputError(std::string("--format ") + to_string(settings.format) + ": cannot hold the model " +
                     to_string(lens_model(camera)) + "; expected --model " + holds);
}

void calibrate_stereo_rig(const CalibrateSettings& settings) {
  if (settings.format != CalibrationFormat::parallax)
    throw InputError("--format: a rig is written as parallax (--output) or EuRoC (--euroc) only");
  const GatheredPairs pairs = gather_pairs(settings);
  CalibrationOptions options;
  options.model = settings.request.model.value_or(LensModel::radtan4);
  options.freedom = settings.request.freedom;
  const StereoResult result = calibrate_stereo(pairs.data, options);
  if (!result.ok) throw RunError("no calibration: " + result.reason);
  print_stereo(result, pairs, std::cout);
  if (!settings.output.empty()) write_stereo_calibration(result.calibration, settings.output);
  if (!settings.report.empty()) write_json(settings.report, stereo_json(result, pairs));
  if (settings.euroc.empty()) return;
  namespace fs = std::filesystem;
  const CameraModel* cameras[] = {&result.calibration.left, &result.calibration.right};
  const RigidTransform body_from_camera[] = {RigidTransform(), result.calibration.right_from_left.inverse()};
  for (int i = 0; i < 2; ++i) {
    const fs::path folder = fs::path(settings.euroc) / "mav0" / ("cam" + std::to_string(i));
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw RunError(folder.string() + ": cannot be made: " + error.message());
    constexpr double rate_hz = 20;  // the data sets' own; nothing depends on it
    const std::string text = format_euroc_sensor(*cameras[i], body_from_camera[i], rate_hz);
    write_file_atomically((folder / "sensor.yaml").string(), [&](std::ostream& out) { out << text; });
  }
}

// Before minutes of work are lost for want of a folder.
void check_can_be_written(const std::string& path) {
  if (path.empty()) return;
  namespace fs = std::filesystem;
  std::error_code none;
  if (fs::is_directory(path, none)) throw RunError(path + ": cannot be written: it is a folder");
  if (fs::exists(path, none) && !fs::is_regular_file(path, none)) return;  // written in place, such as /dev/null
  const fs::path parent = fs::path(path).parent_path();
  if (::access(parent.empty() ? "." : parent.c_str(), W_OK) != 0)
    throw RunError(path + ": cannot be written: " + std::generic_category().message(errno));
}

void calibrate_one(const CalibrateSettings& settings) {
  CalibrateReport report;
  report.views = gather_views(settings);
  report.outcome = run_calibration(report.views.data, settings.request);
  if (!report.outcome.ok) throw RunError("no calibration: " + report.outcome.reason);
  const CameraCalibration& calibration = report.outcome.calibration;
  report.uncertainty = projection_uncertainty(calibration);
  report.coverage = measure_coverage(report.views.data, calibration.camera);
  report.judgement = judge_calibration(report.coverage, report.outcome);
  for (const auto& name : report.views.unused)
    std::cerr << "parallax: warning: " << name << ": the board was not found\n";
  print_calibration(report, std::cout);
  if (settings.output.empty()) {
    std::cout << "\n" << format_calibration(calibration.camera);
  } else {
    check_format(settings, calibration.camera);
    write_calibration(calibration.camera, settings.format, settings.output);
  }
  if (!settings.report.empty()) write_json(settings.report, calibration_json(report));
  if (!settings.plots.empty()) plot_calibration(report, settings.plots);
}

struct CommandLine {
  CalibrateSettings settings;
  std::string board, target = "chessboard", model = "auto", format = "parallax", size;
  bool tangential = true;
};

void run(CommandLine line) {
  CalibrateSettings& s = line.settings;
  const std::string target = s.print_target.empty() ? line.target : s.print_target;
  s.target.kind = target_kind(target);
  if (line.board.empty()) line.board = s.target.kind == TargetKind::asymmetric_circles ? "4x11" : "9x6";
  parse_pair("--board", line.board, "columns x rows, such as 9x6", &s.target.columns, &s.target.rows);
  s.target.validate();
  s.format = calibration_format(line.format);
  s.request.freedom.tangential = line.tangential;
  if (line.model != "auto") s.convert_model = s.request.model = lens_model(line.model);
  if (!line.size.empty()) parse_pair("--size", line.size, "width x height, such as 640x480", &s.width, &s.height);
  s.request.validate();
  if (!s.print_target.empty()) return print_target(s);
  if (!s.convert.empty()) return convert(s);
  for (const std::string& path : {s.output, s.report}) check_can_be_written(path);
  if (!s.stereo.empty()) return calibrate_stereo_rig(s);
  if (s.sources.empty()) throw InputError("SOURCE: missing; expected a folder of images, images, a video or a camera");
  calibrate_one(s);
}

}  // namespace

void add_calibrate_command(CLI::App& app, int* exit_code) {
  CLI::App* calibrate =
      app.add_subcommand("calibrate", "Calibrate a camera or a stereo rig; print targets; convert calibrations");
  calibrate->footer(
      "SOURCE is a folder of images, image files, a quoted pattern ('left*.jpg'), a video, a live camera\n"
      "(v4l2:/dev/video0, libcamera:NAME), or synthetic:board to try it; still, sharp and new views are taken of "
      "these.\n\n"
      "  parallax calibrate --print-target chessboard --output board.pdf\n"
      "  parallax calibrate images/ --board 9x6 --square 0.025 --output camera.yaml --plots plots/\n"
      "  parallax calibrate --stereo left/ right/ --board 9x6 --square 0.025 --output rig.yaml\n"
      "  parallax calibrate --convert camera.yaml --model fov --format ptam --output camera.cfg");
  const auto line = std::make_shared<CommandLine>();
  CalibrateSettings& s = line->settings;
  calibrate->add_option("SOURCE", s.sources, "Images of the target, a video or a camera");
  calibrate->add_option("--stereo", s.stereo, "Synchronised images of a rig: left and right")
      ->expected(2)
      ->type_name("LEFT RIGHT");
  calibrate->add_option("--target", line->target, "chessboard, charuco, circles, acircles or squares")
      ->type_name("NAME")
      ->capture_default_str();
  calibrate
      ->add_option("--board", line->board, "Inner corners, circles or squares: columns x rows (9x6; acircles 4x11)")
      ->type_name("CxR");
  const auto* square = calibrate->add_option("--square", s.target.square_m, "Side of a square, or distance of circles")
                           ->type_name("METRES")
                           ->capture_default_str();
  calibrate->add_option("--detail", s.target.detail_m, "Side of a marker, diameter of a circle, gap of squares")
      ->type_name("METRES");
  calibrate
      ->add_option("--model", line->model,
                   "auto (cross-validated), pinhole, radtan4, radtan5, radtan8, kannala_brandt or fov")
      ->type_name("NAME")
      ->capture_default_str();
  calibrate->add_flag("--square-pixels", s.request.freedom.square_pixels, "One focal length for x and y");
  calibrate->add_flag("!--no-tangential", line->tangential, "Hold p1 and p2 at zero");
  calibrate->add_option("--take", s.take, "Frames: all, chosen (still, sharp, new), or auto (chosen of videos)")
      ->check(CLI::IsMember({"auto", "all", "chosen"}))
      ->capture_default_str();
  calibrate->add_option("--max-views", s.max_views, "Most views that are chosen")
      ->check(CLI::Range(10, 1000))
      ->capture_default_str();
  calibrate->add_option("--live-seconds", s.live_seconds, "Longest time a live camera is watched")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  calibrate->add_option("--hold-out", s.request.hold_out, "Share of the views kept for the held-out error")
      ->capture_default_str();
  calibrate->add_option("--output", s.output, "The calibration, the PDF, or what was converted")->type_name("FILE");
  calibrate->add_option("--format", line->format, "Of the output: parallax, kalibr, opencv, ros, orbslam or ptam")
      ->type_name("NAME")
      ->capture_default_str();
  calibrate->add_option("--report", s.report, "Everything that was found, as JSON")->type_name("FILE");
  calibrate->add_option("--plots", s.plots, "Residuals and uncertainty as SVG and PNG")->type_name("DIR");
  calibrate->add_option("--euroc", s.euroc, "Stereo: also write DIR/mav0/cam0 and cam1/sensor.yaml")->type_name("DIR");
  calibrate
      ->add_option("--print-target", s.print_target,
                   "Write a target as PDF: chessboard, charuco, circles, acircles or squares")
      ->type_name("NAME");
  calibrate->add_option("--paper", s.paper, "a4 or letter")->type_name("NAME")->capture_default_str();
  calibrate->add_option("--convert", s.convert, "Read this calibration and write it in another form or model")
      ->type_name("FILE");
  calibrate->add_option("--size", line->size, "Image size, for forms that state none (PTAM)")->type_name("WxH");
  calibrate->add_option("--camera-index", s.camera_index, "Of files with several cameras")->check(CLI::Range(0, 63));
  calibrate->callback([line, square, exit_code] {
    line->settings.square_given = square->count() > 0;
    run(*line);
    *exit_code = kExitDone;
  });
}

}  // namespace parallax
