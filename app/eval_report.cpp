#include "app/eval_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace parallax {
namespace {

std::string relative_step(const RelativePairOptions& options) {
  return fmt::format("{:g} {}{}", options.delta,
                     options.in_metres    ? "m"
                     : options.delta == 1 ? "frame"
                                          : "frames",
                     options.all_pairs ? ", all pairs" : "");
}

void print_statistics(const std::string& name, const std::vector<double>& errors, std::ostream& out) {
  const ErrorStatistics s = summarise_errors(errors);
  if (s.count == 0) {
    out << fmt::format("  {:<30} no pairs\n", name);
    return;
  }
  out << fmt::format("  {:<30}{:>11.6f}{:>11.6f}{:>11.6f}{:>11.6f}{:>11.6f}{:>11.6f}{:>8}\n", name, s.rmse, s.mean,
                     s.median, s.deviation, s.min, s.max, s.count);
}

void print_file(const EvaluatedFile& file, const RelativePairOptions& relative, bool are_keyframes, std::ostream& out) {
  const TrajectoryError& e = file.error;
  out << fmt::format("\n{}: {} of {} poses matched", are_keyframes ? "keyframes" : "all frames", e.matches.size(),
                     file.poses);
  if (!are_keyframes) out << fmt::format("; tracked {:.4f} of {} frames", e.tracked_fraction, e.frames);
  if (e.scale > 0) {
    out << fmt::format("; scale truth/estimate {:.6f}, scale error {:+.4f} %", e.scale, 100 * e.scale_error);
  }
  out << fmt::format("\n  {:<30}{:>11}{:>11}{:>11}{:>11}{:>11}{:>11}{:>8}\n", "", "rmse", "mean", "median", "std",
                     "min", "max", "count");
  print_statistics("ATE position (m)", e.position, out);
  print_statistics("ATE rotation (deg)", e.rotation_deg, out);
  print_statistics("RPE position (m), " + relative_step(relative), e.relative.translation, out);
  print_statistics("RPE rotation (deg), " + relative_step(relative), e.relative.rotation_deg, out);
}

nlohmann::ordered_json statistics_json(const std::vector<double>& errors) {
  const ErrorStatistics s = summarise_errors(errors);
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.deviation},
          {"min", s.min},   {"max", s.max},   {"count", s.count}};
}

nlohmann::ordered_json file_json(const EvaluatedFile& file, bool are_keyframes) {
  const TrajectoryError& e = file.error;
  const SimilarityTransform& T = e.truth_from_estimate;
  const Eigen::Quaterniond q(T.R);
  nlohmann::ordered_json json;
  json["file"] = file.path;
  json["poses"] = file.poses;
  json["matched"] = e.matches.size();
  if (!are_keyframes) {
    json["frames"] = e.frames;
    json["tracked_fraction"] = e.tracked_fraction;
  }
  json["scale"] = e.scale > 0 ? nlohmann::ordered_json(e.scale) : nlohmann::ordered_json();
  json["scale_error"] = e.scale > 0 ? nlohmann::ordered_json(e.scale_error) : nlohmann::ordered_json();
  json["truth_from_estimate"] = {
      {"scale", T.s}, {"translation", {T.t.x(), T.t.y(), T.t.z()}}, {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
  json["ate_position_m"] = statistics_json(e.position);
  json["ate_rotation_deg"] = statistics_json(e.rotation_deg);
  json["rpe_position_m"] = statistics_json(e.relative.translation);
  json["rpe_rotation_deg"] = statistics_json(e.relative.rotation_deg);
  return json;
}

}  // namespace

const char* alignment_name(Alignment alignment) {
  switch (alignment) {
    case Alignment::none:
      return "none";
    case Alignment::se3:
      return "se3";
    case Alignment::sim3:
      return "sim3";
  }
  return "";
}

void print_eval_table(const EvalReport& report, std::ostream& out) {
  out << "estimate   " << report.frames.path << ", " << report.frames.poses << " poses\n"
      << "truth      " << report.truth_path << ", " << report.truth_poses << " poses\n"
      << "alignment  " << alignment_name(report.options.alignment) << "; ";
  if (report.options.match_by_line) {
    out << "poses matched line by line\n";
  } else {
    out << fmt::format("poses matched within {:g} s\n", report.options.max_time_difference_s);
  }
  print_file(report.frames, report.options.relative, false, out);
  if (report.keyframes) print_file(*report.keyframes, report.options.relative, true, out);
}

nlohmann::ordered_json eval_json(const EvalReport& report) {
  const auto& relative = report.options.relative;
  nlohmann::ordered_json json;
  json["truth"] = {{"file", report.truth_path}, {"poses", report.truth_poses}};
  json["alignment"] = alignment_name(report.options.alignment);
  json["relative"] = {
      {"delta", relative.delta}, {"unit", relative.in_metres ? "m" : "frames"}, {"all_pairs", relative.all_pairs}};
  json["all_frames"] = file_json(report.frames, false);
  if (report.keyframes) json["keyframes"] = file_json(*report.keyframes, true);
  return json;
}

}  // namespace parallax
