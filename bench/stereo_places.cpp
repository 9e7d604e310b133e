// Place recognition of stereo sessions (MS §4.1, §4.2): precision and recall with and without CRF-Matching, whether the
// covariances are the size of the errors, and what a keyframe costs with few and with many scenes remembered.
//
//   bench_stereo_places VOCABULARY WEIGHTS SET... [csv=FILE] [svg=FILE]
//
// SET is a name of sessions with truth, joined by '+', that are walked one after the other (a stereo recording's folder
// or synthetic:building?...), `corridor=IMAGE_FOLDER,TRUTH.bmp` (one camera: words and the far graph alone), or
// `growth=COUNT,SESSIONS` (the last of the sessions asks with an eighth of COUNT scenes remembered, then with two
// eighths, up to COUNT; what is remembered are the sessions, repeated with changed bits).
//
// Two keyframes show one place when their cameras are within 3 m and 40 degrees of each other and the one sees points
// of the other where and as far away as truth has them. An encounter is right when its pose is within 0.3 m and 3
// degrees of truth. The table is that of the options as they are; the curves (a plot a set in svg=FILE; CSV, a row a
// candidate) are those of no option. svg=FILE also gets the plot of the growth.
#include <time.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "app/session_report_svg.h"
#include "camera/stereo_rectification.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/time.h"
#include "place/place_recogniser.h"
#include "render/synthetic_stereo_source.h"
#include "solver/chi_square.h"

using namespace parallax;

namespace {

constexpr double kKeyframe_m = 0.2, kKeyframe_rad = 0.2;  // MS §3.2
constexpr double kSamePlace_m = 3, kSamePlace_deg = 40;
constexpr double kRight_m = 0.3, kRight_deg = 3;

struct Keyframe {
  Timestamp time{0};
  RigidTransform world_from_camera;
  StereoScene scene;
};
struct Session {
  std::string name;
  StereoCamera camera;
  std::vector<Keyframe> keyframes;
};

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == at) {
      out.emplace_back();
    } else {
      out.back() += c;
    }
  }
  return out;
}

std::optional<RigidTransform> pose_at(const std::vector<StampedPose>& truth, Timestamp time) {
  const StampedPose* best = nullptr;
  for (const StampedPose& pose : truth)
    if (best == nullptr || std::abs((pose.time - time).count()) < std::abs((best->time - time).count())) best = &pose;
  if (best == nullptr || std::abs(to_seconds(best->time - time)) > 0.01) return std::nullopt;
  return best->world_from_camera;
}

// Of this thread: others may use the machine.
double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double degrees(double radians) { return radians * 180 / M_PI; }

// What a keyframe's features cost is added up here.
struct FeatureTimes {
  std::vector<double> features_ms, words_ms;
};

Session read_session(const std::string& name, const Vocabulary& vocabulary, const StereoSceneOptions& options,
                     FeatureTimes* times) {
  std::unique_ptr<StereoSource> source;
  if (name.rfind("synthetic:", 0) == 0) {
    source = open_synthetic_stereo_source(name);
  } else {
    source = open_stereo_source(name);
  }
  const auto calibration = source->calibration();
  const std::vector<StampedPose> truth = source->ground_truth();
  if (!calibration || truth.empty()) throw InputError(name + ": no calibration or no true poses");
  const StereoRectifier rectifier(*calibration, {}, name);
  const RigidTransform camera_from_rectified = rectifier.rectified_from_left().inverse();
  Session session{name, rectifier.camera(), {}};
  RigidTransform last;
  const auto use = [&](const StereoFrame& pair, const RigidTransform& pose) {
    StereoImages images;
    rectifier.rectify(pair, &images);
    Keyframe keyframe;
    keyframe.time = pair.left.time;
    keyframe.world_from_camera = pose;
    double start = processor_ms();
    extract_stereo_features(session.camera, images.left, images.right, options, &keyframe.scene);
    build_scene_trees(session.camera, options, &keyframe.scene);
    times->features_ms.push_back(processor_ms() - start);
    start = processor_ms();
    keyframe.scene.bag = vocabulary.bag_of(descriptors_of(keyframe.scene.features));
    times->words_ms.push_back(processor_ms() - start);
    session.keyframes.push_back(std::move(keyframe));
    last = pose;
  };
  const auto is_keyframe = [&](const RigidTransform& pose) {
    const RigidTransform moved = last.inverse() * pose;
    return session.keyframes.empty() || moved.t.norm() >= kKeyframe_m || moved.angle() >= kKeyframe_rad;
  };
  if (auto* drawn = dynamic_cast<SyntheticStereoSource*>(source.get())) {
    for (int i = 0; i < drawn->frame_count(); ++i) {
      const RigidTransform pose = drawn->world_from_camera(i) * camera_from_rectified;
      if (is_keyframe(pose)) use(drawn->frame(i), pose);
    }
    return session;
  }
  while (const auto pair = source->next()) {
    const auto pose = pose_at(truth, pair->left.time);
    if (pose && is_keyframe(*pose * camera_from_rectified)) use(*pair, *pose * camera_from_rectified);
  }
  return session;
}

// Points of `a` that `b` has too: near features of both within 12 pixels and 15 % of the depth.
bool show_one_place(const Session& of_a, const Keyframe& a, const Session& of_b, const Keyframe& b) {
  const RigidTransform b_from_a = b.world_from_camera.inverse() * a.world_from_camera;
  if (b_from_a.t.norm() > kSamePlace_m) return false;
  const double turned = std::acos(std::clamp(b_from_a.R(2, 2), -1.0, 1.0));
  if (degrees(turned) > kSamePlace_deg) return false;
  int inside = 0, shared = 0;
  for (const std::int32_t i : a.scene.near_tree.feature) {
    const Eigen::Vector3d p = b_from_a * a.scene.points[static_cast<std::size_t>(i)].cast<double>();
    Eigen::Vector3d px;
    if (!of_b.camera.project(p, &px) || !of_b.camera.in_image({px.x(), px.z()})) continue;
    ++inside;
    for (const std::int32_t j : b.scene.near_tree.feature) {
      const auto row = static_cast<std::size_t>(j);
      const Eigen::Vector2d apart = b.scene.features[row].pixel.cast<double>() - Eigen::Vector2d(px.x(), px.z());
      if (apart.norm() < 12 && std::abs(static_cast<double>(b.scene.points[row].z()) - p.z()) < 0.15 * p.z()) {
        ++shared;
        break;
      }
    }
  }
  return of_a.camera.width > 0 && inside >= 20 && shared > 0.3 * inside;
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return NAN;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(part * static_cast<double>(values.size())))];
}
double worst(const std::vector<double>& values) { return quantile(values, 1); }

struct Row {
  PlaceEncounter encounter;
  bool same_place = false, right_pose = false;
  double error_m = NAN, error_deg = NAN, nees = NAN;
};

struct Walk {
  std::vector<Row> rows;
  int queries = 0, with_loop = 0;
  std::vector<bool> has_loop;  // a query
  std::vector<int> query_of;   // a row
  std::vector<double> words_ms, crf_ms, geometry_ms;
};

Walk walk(const std::vector<Session>& sessions, const std::shared_ptr<const Vocabulary>& vocabulary,
          const CrfModel& model, const PlaceRecogniserOptions& options) {
  PlaceRecogniser recogniser(vocabulary, model, options);
  Walk out;
  for (std::size_t s = 0; s < sessions.size(); ++s) {
    recogniser.begin_session(static_cast<int>(s), sessions[s].camera);
    for (std::size_t k = 0; k < sessions[s].keyframes.size(); ++k) {
      const Keyframe& query = sessions[s].keyframes[k];
      const SceneKey key{static_cast<int>(s), static_cast<int>(k)};
      const auto encounters = recogniser.add(key, query.time, query.scene);
      out.words_ms.push_back(recogniser.times().words_ms);
      out.crf_ms.push_back(recogniser.times().crf_ms);
      out.geometry_ms.push_back(recogniser.times().geometry_ms);
      bool loop = false;
      for (std::size_t o = 0; o <= s && !loop; ++o) {
        for (std::size_t j = 0; j < sessions[o].keyframes.size() && !loop; ++j) {
          const Keyframe& other = sessions[o].keyframes[j];
          if (o == s && (static_cast<int>(k) - static_cast<int>(j) < options.min_gap_keyframes ||
                         to_seconds(query.time - other.time) < options.min_gap_s))
            break;
          loop = show_one_place(sessions[s], query, sessions[o], other);
        }
      }
      out.has_loop.push_back(loop);
      out.with_loop += loop ? 1 : 0;
      for (const PlaceEncounter& encounter : encounters) {
        const Session& other = sessions[static_cast<std::size_t>(encounter.found.session)];
        const Keyframe& found = other.keyframes[static_cast<std::size_t>(encounter.found.keyframe)];
        const RigidTransform truth = found.world_from_camera.inverse() * query.world_from_camera;
        Row row;
        row.encounter = encounter;
        row.same_place = show_one_place(sessions[s], query, other, found);
        const RigidTransform apart = encounter.found_from_query * truth.inverse();
        row.error_m = (encounter.found_from_query.t - truth.t).norm();
        row.error_deg = degrees(apart.angle());
        row.right_pose = row.error_m < kRight_m && row.error_deg < kRight_deg;
        if (encounter.refused.empty()) {
          const Vector6d error = apart.log();
          row.nees = error.dot(encounter.covariance.ldlt().solve(error));
        }
        out.rows.push_back(row);
        out.query_of.push_back(out.queries);
      }
      ++out.queries;
    }
  }
  return out;
}

void print_walk(const char* name, const Walk& walk) {
  int accepted = 0, right = 0, answered = 0, last = -1;
  std::vector<double> nees, error_m, error_deg;
  for (std::size_t i = 0; i < walk.rows.size(); ++i) {
    const Row& row = walk.rows[i];
    if (!row.encounter.refused.empty()) continue;
    ++accepted;
    right += row.right_pose ? 1 : 0;
    nees.push_back(row.nees);
    error_m.push_back(row.error_m);
    error_deg.push_back(row.error_deg);
    if (!row.right_pose)
      std::printf("  WRONG %d.%d found %d.%d inliers %d of %d bow %.2f crf %.2f %.2f: off by %.2f m, %.1f deg\n",
                  row.encounter.query.session, row.encounter.query.keyframe, row.encounter.found.session,
                  row.encounter.found.keyframe, row.encounter.inliers, row.encounter.matches, row.encounter.bow,
                  row.encounter.crf_near, row.encounter.crf_far, row.error_m, row.error_deg);
    const int query = walk.query_of[i];
    if (query != last && walk.has_loop[static_cast<std::size_t>(query)]) ++answered, last = query;
  }
  double mean_nees = 0;
  for (const double v : nees) mean_nees += v / static_cast<double>(nees.size());
  std::printf("| %s | %d | %d | %d | %.1f | %.1f | %.0f / %.0f | %.2f / %.2f | %.2f (95 %%: %.2f) |\n", name,
              walk.queries, walk.with_loop, accepted, accepted > 0 ? 100.0 * right / accepted : 100.0,
              walk.with_loop > 0 ? 100.0 * answered / walk.with_loop : 0.0, 1e3 * quantile(error_m, 0.5),
              1e3 * worst(error_m), quantile(error_deg, 0.5), worst(error_deg), mean_nees, quantile(nees, 0.95));
}

// Recall at 100 % precision when every query's answer is its candidate of the best score.
struct Answer {
  double score = 0;
  bool right = false;
};
template <class Score>
PlotSeries print_curve(const char* name, const Walk& walk, const Score& score, bool by_pose) {
  std::vector<Answer> answers;
  for (std::size_t i = 0; i < walk.rows.size();) {
    const int query = walk.query_of[i];
    Answer best{-HUGE_VAL, false};
    for (; i < walk.rows.size() && walk.query_of[i] == query; ++i) {
      const double value = score(walk.rows[i].encounter);
      if (value > best.score) best = {value, by_pose ? walk.rows[i].right_pose : walk.rows[i].same_place};
    }
    if (best.score > -HUGE_VAL) answers.push_back(best);
  }
  std::sort(answers.begin(), answers.end(), [](const Answer& a, const Answer& b) { return a.score > b.score; });
  int right = 0, perfect = 0;
  double threshold = HUGE_VAL;
  bool pure = true;
  const double loops = std::max(1, walk.with_loop);
  PlotSeries curve{name, {}, true, false, {}};
  for (std::size_t i = 0; i < answers.size(); ++i) {
    right += answers[i].right ? 1 : 0;
    pure = pure && answers[i].right;
    if (pure) perfect = right, threshold = answers[i].score;
    // Answers of one score stand or fall together.
    if (i + 1 == answers.size() || answers[i + 1].score < answers[i].score)
      curve.points.push_back({100 * right / loops, 100.0 * right / static_cast<double>(i + 1)});
  }
  std::printf("| %s | %.1f (at %.3f) | %.1f | %.1f |\n", name, 100 * perfect / loops, threshold,
              answers.empty() ? 0.0 : 100.0 * right / static_cast<double>(answers.size()), 100 * right / loops);
  return curve;
}

double worse_of(double near, double far) {
  return std::isnan(near) ? far : std::isnan(far) ? near : std::max(near, far);
}

// Plots of one run, one below the other.
class PlotPage {
 public:
  void add(const std::vector<PlotSeries>& series, PlotAxes axes) {
    axes.width = SvgWidth::fixed;
    body_ +=
        "<g transform=\"translate(0," + std::to_string(height_px_) + ")\">\n" + plot_element(series, axes) + "</g>\n";
    width_px_ = std::max(width_px_, axes.width_px);
    height_px_ += axes.height_px;
  }
  void save(const std::string& path) const {
    write_file_atomically(path, [this](std::ostream& out) {
      out << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << width_px_ << ' ' << height_px_
          << "\" width=\"" << width_px_ << "\" height=\"" << height_px_
          << "\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
          << body_ << "</svg>\n";
    });
  }

 private:
  std::string body_;
  int width_px_ = 0, height_px_ = 0;
};

constexpr CanvasColour kWordsColour{0x99, 0x99, 0x99}, kCrfColour{0xe6, 0x9f, 0x00}, kGeometryColour{0x56, 0xb4, 0xe9},
    kAllColour{0x00, 0x60, 0x9e};

void print_curves(const Walk& open, const std::string& set, const PlaceRecogniserOptions& options, PlotPage* page) {
  std::printf(
      "\n| answer: the candidate of the best... | recall at 100 %% precision | precision of all | recall of all |\n"
      "|---|---|---|---|\n");
  std::vector<PlotSeries> curves;
  const auto curve = [&](const char* row, const char* name, CanvasColour colour, bool dashed, auto&& score,
                         bool by_pose) {
    PlotSeries series = print_curve(row, open, score, by_pose);
    if (series.points.empty()) return;
    series.name = name;
    series.colour = colour;
    series.dashed = dashed;
    curves.push_back(std::move(series));
  };
  curve(
      "similarity of words (Eq. 4)", "words", kWordsColour, false, [](const PlaceEncounter& e) { return e.bow; },
      false);
  const auto crf = [](const PlaceEncounter& e) {
    const double eta = worse_of(e.crf_near, e.crf_far);
    return std::isnan(eta) ? -HUGE_VAL : -eta;
  };
  curve("CRF-Matching (Eq. 5), greater of both", "CRF", kCrfColour, false, crf, false);
  curve(
      "CRF-Matching, near", "CRF near", kCrfColour, true,
      [](const PlaceEncounter& e) { return std::isnan(e.crf_near) ? -HUGE_VAL : -e.crf_near; }, false);
  print_curve(
      "CRF-Matching, far", open, [](const PlaceEncounter& e) { return std::isnan(e.crf_far) ? -HUGE_VAL : -e.crf_far; },
      false);
  const auto inliers = [](const PlaceEncounter& e) {
    return e.inliers > 0 ? static_cast<double>(e.inliers) : -HUGE_VAL;
  };
  curve("geometry: inliers, nothing else asked", "geometry", kGeometryColour, false, inliers, true);
  curve(
      "geometry: inliers, of what CRF-Matching lets through", "geometry of what CRF lets through", kAllColour, true,
      [&](const PlaceEncounter& e) {
        const bool near = std::isnan(e.crf_near) || e.crf_near <= options.beta_near;
        const bool far = std::isnan(e.crf_far) || e.crf_far <= options.beta_far;
        return near && far ? inliers(e) : -HUGE_VAL;
      },
      true);
  PlotAxes axes;
  axes.id = "precision-recall";
  axes.title = "precision over recall:";
  for (const std::string& name : split(set, '+')) axes.title += ' ' + name.substr(name.find_last_of("/:") + 1);
  axes.x_label = "recall, %";
  axes.y_label = "%";
  if (!curves.empty()) page->add(curves, axes);
}

void write_csv(std::ofstream* csv, const std::string& set, const Walk& open) {
  for (std::size_t i = 0; i < open.rows.size(); ++i) {
    const Row& r = open.rows[i];
    const PlaceEncounter& e = r.encounter;
    *csv << set << ',' << e.query.session << ',' << e.query.keyframe << ',' << e.found.session << ','
         << e.found.keyframe << ',' << open.has_loop[static_cast<std::size_t>(open.query_of[i])] << ',' << r.same_place
         << ',' << e.bow << ',' << e.crf_near << ',' << e.crf_far << ',' << e.matches << ',' << e.inliers << ','
         << e.refused.empty() << ',' << r.right_pose << ',' << r.error_m << ',' << r.error_deg << ',' << r.nees << ','
         << e.seen_share << ',' << e.silent_share << ",\"" << e.refused << "\"\n";
  }
}

void print_times(const char* name, const std::vector<double>& ms) {
  std::printf("%s %.2f / %.2f", name, quantile(ms, 0.5), worst(ms));
}

void run_set(const std::string& set, const std::shared_ptr<const Vocabulary>& vocabulary, const CrfModel& model,
             const PlaceRecogniserOptions& options, std::ofstream* csv, PlotPage* page) {
  FeatureTimes times;
  std::vector<Session> sessions;
  for (const std::string& name : split(set, '+'))
    sessions.push_back(read_session(name, *vocabulary, options.scene, &times));
  std::printf(
      "\n## %s\n\n| | queries | with a loop | accepted | precision %% | recall %% | error mm median / worst | "
      "deg | NEES of 6 |\n|---|---|---|---|---|---|---|---|---|\n",
      set.c_str());
  PlaceRecogniserOptions without = options;
  without.use_crf = false;
  print_walk("words, geometry", walk(sessions, vocabulary, model, without));
  const Walk closed = walk(sessions, vocabulary, model, options);
  print_walk("words, CRF, geometry", closed);
  PlaceRecogniserOptions all = options;
  all.alpha_minus = 0;
  all.beta_near = all.beta_far = HUGE_VAL;
  all.accepted = all.verified = all.candidates;
  const Walk open = walk(sessions, vocabulary, model, all);
  print_curves(open, set, options, page);
  if (csv->is_open()) write_csv(csv, set, open);
  std::printf("\nprocessor ms a keyframe, median / worst: ");
  print_times("features", times.features_ms);
  print_times(", words", times.words_ms);
  print_times(", query", closed.words_ms);
  print_times(", CRF", closed.crf_ms);
  print_times(", geometry", closed.geometry_ms);
  std::printf("\n");
}

void run_growth(const std::string& arguments, const std::shared_ptr<const Vocabulary>& vocabulary,
                const CrfModel& model, const PlaceRecogniserOptions& options, PlotPage* page) {
  const std::size_t comma = arguments.find(',');
  if (comma == std::string::npos) throw InputError("growth: expected growth=COUNT,SESSIONS");
  const int count = std::atoi(arguments.c_str());
  constexpr int kSteps = 8;
  constexpr int kAsking = 1000000;  // the first of the sessions that ask
  FeatureTimes times;
  std::vector<Session> sessions;
  for (const std::string& name : split(arguments.substr(comma + 1), '+'))
    sessions.push_back(read_session(name, *vocabulary, options.scene, &times));
  std::printf("\n## growth\n\nfeatures and words of a keyframe, processor ms, median / worst: ");
  print_times("features", times.features_ms);
  print_times(", words", times.words_ms);
  std::printf("\n\n| scenes | asked | query | CRF | geometry | all | all, 99 %% |\n|---|---|---|---|---|---|---|\n");
  PlaceRecogniser recogniser(vocabulary, model, options);
  std::mt19937_64 rng(1);
  const Session asking = std::move(sessions.back());
  if (sessions.size() > 1) sessions.pop_back();
  PlotSeries median{"median", kAllColour, true, false, {}}, most{"worst", kCrfColour, true, true, {}};
  std::size_t k = 0;
  int session = 0;
  recogniser.begin_session(0, sessions[0].camera);
  for (int step = 1; step <= kSteps; ++step) {
    for (int wanted = count * step / kSteps; recogniser.size() < wanted; ++k) {
      const Session* from = &sessions[static_cast<std::size_t>(session) % sessions.size()];
      if (k == from->keyframes.size()) {
        k = 0;
        from = &sessions[static_cast<std::size_t>(++session) % sessions.size()];
        recogniser.begin_session(session, from->camera);
      }
      StereoScene scene;
      scene.features = from->keyframes[k].scene.features;
      scene.right_px = from->keyframes[k].scene.right_px;
      // The first time as it was; then as other buildings of the same kind.
      if (session >= static_cast<int>(sessions.size()))
        for (PlaceFeature& feature : scene.features)
          for (int bit = 0; bit < 24; ++bit) feature.descriptor.bits[rng() % 4] ^= std::uint64_t{1} << (rng() % 64);
      recogniser.restore({session, static_cast<int>(k)}, from->keyframes[k].time, std::move(scene));
    }
    const int remembered = recogniser.size();
    std::vector<double> words_ms, crf_ms, geometry_ms, all_ms;
    recogniser.begin_session(kAsking + step, asking.camera);
    for (std::size_t q = 0; q < asking.keyframes.size(); ++q) {
      const double start = processor_ms();
      recogniser.add({kAsking + step, static_cast<int>(q)}, asking.keyframes[q].time, asking.keyframes[q].scene);
      // Features and words of the query were made when the session was read.
      const std::size_t made = times.features_ms.size() - asking.keyframes.size() + q;
      all_ms.push_back(processor_ms() - start + times.features_ms[made] + times.words_ms[made]);
      words_ms.push_back(recogniser.times().words_ms);
      crf_ms.push_back(recogniser.times().crf_ms);
      geometry_ms.push_back(recogniser.times().geometry_ms);
    }
    std::printf("| %d | %zu", remembered, asking.keyframes.size());
    for (const auto* column : {&words_ms, &crf_ms, &geometry_ms, &all_ms}) print_times(" |", *column);
    std::printf(" | %.2f |\n", quantile(all_ms, 0.99));
    median.points.push_back({static_cast<double>(remembered), quantile(all_ms, 0.5)});
    most.points.push_back({static_cast<double>(remembered), worst(all_ms)});
  }
  PlotAxes axes;
  axes.id = "growth";
  axes.title = "place recognition, processor time a keyframe";
  axes.x_label = "keyframes remembered";
  axes.y_label = "ms";
  page->add({median, most}, axes);
}

// One camera: no geometry, words and the far graph. Precision and recall as bench_place_recognition has them.
void run_corridor(const std::string& arguments, const std::shared_ptr<const Vocabulary>& vocabulary,
                  const CrfModel& model, const PlaceRecogniserOptions& given, PlotPage* page) {
  const auto names = split(arguments, ',');
  if (names.size() != 2) throw InputError("corridor: expected corridor=IMAGE_FOLDER,TRUTH.bmp");
  const cv::Mat1b truth = cv::imread(names[1], cv::IMREAD_GRAYSCALE);
  if (truth.empty()) throw InputError(names[1] + ": cannot be read");
  PlaceRecogniserOptions options = given;
  options.alpha_minus = 0;
  options.beta_near = options.beta_far = HUGE_VAL;
  options.min_gap_s = 0;
  options.min_gap_keyframes = 5;
  options.group_s = 0;
  PlaceRecogniser recogniser(vocabulary, model, options);
  Walk out;
  for (int i = 0; i < truth.rows; ++i) {
    const cv::Mat1b image = cv::imread(names[0] + "/" + std::to_string(i + 1) + ".jpg", cv::IMREAD_GRAYSCALE);
    if (image.empty()) throw InputError(names[0] + ": image " + std::to_string(i + 1) + " cannot be read");
    StereoCamera camera;
    camera.width = image.cols;
    camera.height = image.rows;
    recogniser.begin_session(0, camera);
    const auto same = [&](int j) { return truth(i, j) > 127 || truth(j, i) > 127; };
    bool loop = false;
    for (int j = 0; j <= i - options.min_gap_keyframes; ++j) loop = loop || same(j);
    out.has_loop.push_back(loop);
    out.with_loop += loop ? 1 : 0;
    for (const PlaceEncounter& e :
         recogniser.add({0, i}, from_seconds(i), make_stereo_scene(camera, image, {}, *vocabulary, options.scene))) {
      Row row;
      row.encounter = e;
      row.same_place = same(e.found.keyframe);
      out.rows.push_back(row);
      out.query_of.push_back(out.queries);
    }
    ++out.queries;
  }
  std::printf("\n## corridor: %d images, %d with a loop\n", out.queries, out.with_loop);
  print_curves(out, "corridor", given, page);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "bench_stereo_places VOCABULARY WEIGHTS SET... [csv=FILE] [svg=FILE]\n");
    return 2;
  }
  try {
    const auto vocabulary = std::make_shared<const Vocabulary>(Vocabulary::load(argv[1]));
    const CrfModel model = CrfModel::load(argv[2]);
    const PlaceRecogniserOptions options;
    std::ofstream csv;
    for (int i = 3; i < argc; ++i) {
      const std::string set = argv[i];
      if (set.rfind("csv=", 0) != 0) continue;
      csv.open(set.substr(4));
      csv << "set,query_session,query_keyframe,found_session,found_keyframe,query_has_loop,same_place,bow,crf_near,"
             "crf_far,matches,inliers,geometry,right_pose,error_m,error_deg,nees,seen_share,silent_share,refused\n";
    }
    PlotPage page;
    std::string svg;
    for (int i = 3; i < argc; ++i) {
      const std::string set = argv[i];
      if (set.rfind("csv=", 0) == 0) continue;
      if (set.rfind("svg=", 0) == 0) {
        svg = set.substr(4);
      } else if (set.rfind("growth=", 0) == 0) {
        run_growth(set.substr(7), vocabulary, model, options, &page);
      } else if (set.rfind("corridor=", 0) == 0) {
        run_corridor(set.substr(9), vocabulary, model, options, &page);
      } else {
        run_set(set, vocabulary, model, options, &csv, &page);
      }
      std::fflush(stdout);
    }
    if (!svg.empty()) page.save(svg);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_stereo_places: %s\n", error.what());
    return 2;
  }
}
