#include "app/matching_training.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "app/progress_bar.h"
#include "app/stereo_input.h"
#include "camera/stereo_rectification.h"
#include "core/error.h"
#include "place/place_index.h"
#include "place/stereo_scene.h"
#include "render/synthetic_stereo_source.h"

namespace parallax {
namespace {

struct TrainingScene {
  int world = 0, recording = 0;
  Timestamp time{0};
  RigidTransform world_from_camera;  // rectified left
  StereoCamera camera;
  StereoScene scene, one_camera;  // as both cameras see it, and as one does: all is far
  const StereoScene& of(SceneGraph graph) const { return graph == SceneGraph::near ? scene : one_camera; }
  std::vector<Eigen::Vector3d> points;  // of each feature, as they truly are; NaN: not known
};

struct TrainingPair {
  std::size_t from = 0, to = 0;
  std::optional<std::size_t> before;  // a second before `from`
  bool same_place = false;
};

std::optional<RigidTransform> pose_at(const std::vector<StampedPose>& truth, Timestamp time) {
  const auto it = std::lower_bound(truth.begin(), truth.end(), time,
                                   [](const StampedPose& pose, Timestamp at) { return pose.time < at; });
  for (const auto near : {it, it == truth.begin() ? it : it - 1})
    if (near != truth.end() && std::abs(to_seconds(near->time - time)) < 0.005) return near->world_from_camera;
  return std::nullopt;
}

// Of a drawn scene the depth is known; else what the two images say of the near features.
std::vector<Eigen::Vector3d> true_points(const StereoScene& scene, const StereoCamera& camera, const cv::Mat1f& depth) {
  std::vector<Eigen::Vector3d> out(scene.features.size(), Eigen::Vector3d::Constant(NAN));
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (depth.empty()) {
      if (scene.is_near(i)) out[i] = scene.points[i].cast<double>();
      continue;
    }
    const Eigen::Vector2d px = scene.features[i].pixel.cast<double>();
    const int x = std::clamp(static_cast<int>(std::lround(px.x())), 0, depth.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(px.y())), 0, depth.rows - 1);
    const double z = static_cast<double>(depth(y, x));
    if (z > 0) out[i] = z * camera.ray(px);
  }
  return out;
}

void read_scenes(const std::string& name, int world, int recording, const Vocabulary& vocabulary,
                 const MatchingTrainingOptions& options, std::vector<TrainingScene>* out) {
  StereoInput input = open_stereo_input(name, "", {});
  const std::vector<StampedPose> truth = input.source->ground_truth();
  if (truth.empty()) throw InputError(name + ": found no true poses, expected a recording with truth");
  const StereoRectifier rectifier(input.calibration, {}, name);
  const RigidTransform camera_from_rectified = rectifier.rectified_from_left().inverse();
  auto* drawn = dynamic_cast<SyntheticStereoSource*>(input.source.get());
  ProgressBar progress(name, input.source->frame_count());
  const int every = std::max(1, static_cast<int>(std::lround(options.every_s * input.source->frames_per_second())));
  const auto use = [&](int i, const StereoFrame& pair) {
    progress.update(i, std::to_string(out->size()) + " scenes");
    const auto pose = pose_at(truth, pair.left.time);
    if (!pose) return;
    StereoImages images;
    rectifier.rectify(pair, &images);
    TrainingScene scene;
    scene.world = world;
    scene.recording = recording;
    scene.time = pair.left.time;
    scene.world_from_camera = *pose * camera_from_rectified;
    scene.camera = rectifier.camera();
    scene.scene = make_stereo_scene(scene.camera, images.left, images.right, vocabulary, options.scene);
    const bool has_depth = drawn != nullptr && rectifier.is_pass_through();
    scene.points = true_points(scene.scene, scene.camera, has_depth ? drawn->depth(i) : cv::Mat1f());
    scene.one_camera.features = scene.scene.features;
    scene.one_camera.right_px.assign(scene.points.size(), NAN);
    build_scene_trees(scene.camera, options.scene, &scene.one_camera);
    out->push_back(std::move(scene));
  };
  if (drawn != nullptr) {
    for (int i = 0; i < drawn->frame_count(); i += every) use(i, drawn->frame(i));
    return;
  }
  for (int i = 0; const auto pair = input.source->next(); ++i)
    if (i % every == 0) use(i, *pair);
}

double angle_between(const RigidTransform& a, const RigidTransform& b) {
  return std::acos(std::clamp(a.R.col(2).dot(b.R.col(2)), -1.0, 1.0));
}

LabelledProblem labelled(const std::vector<TrainingScene>& scenes, const TrainingPair& pair, SceneGraph graph) {
  const TrainingScene &from = scenes[pair.from], &to = scenes[pair.to];
  const RigidTransform to_from_from = to.world_from_camera.inverse() * from.world_from_camera;
  LabelledProblem out =
      label_problem(from.of(graph), to.of(graph), graph, from.points, to.points, to.camera, to_from_from);
  if (!pair.same_place) std::fill(out.state.begin(), out.state.end(), 0);
  return out;
}

int shared_features(const std::vector<TrainingScene>& scenes, std::size_t from, std::size_t to) {
  const LabelledProblem one = labelled(scenes, {from, to, {}, true}, SceneGraph::near);
  return static_cast<int>(one.state.size()) - static_cast<int>(std::count(one.state.begin(), one.state.end(), 0));
}

// Of every scene: with the scene a second before, with one that shows the same place, and with the most alike of those
// that do not.
std::vector<TrainingPair> choose_pairs(const std::vector<TrainingScene>& scenes,
                                       const MatchingTrainingOptions& options) {
  PlaceIndex index;
  for (std::size_t i = 0; i < scenes.size(); ++i) index.add(static_cast<int>(i), scenes[i].scene.bag);
  std::vector<TrainingPair> pairs;
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    const TrainingScene& one = scenes[i];
    std::optional<std::size_t> before;
    if (i > 0 && scenes[i - 1].recording == one.recording) before = i - 1;
    std::vector<std::size_t> same;
    for (std::size_t j = 0; j < scenes.size(); ++j) {
      const TrainingScene& other = scenes[j];
      const bool apart =
          other.recording != one.recording || std::abs(to_seconds(one.time - other.time)) > options.min_gap_s;
      if (other.world == one.world && apart &&
          (one.world_from_camera.t - other.world_from_camera.t).norm() < options.max_distance_m &&
          angle_between(one.world_from_camera, other.world_from_camera) < options.max_angle_deg * M_PI / 180)
        same.push_back(j);
    }
    if (before) pairs.push_back({i, *before, {}, true});
    if (!before) continue;
    if (!same.empty()) {
      // The one that words would propose.
      const auto most_alike = std::max_element(same.begin(), same.end(), [&](std::size_t a, std::size_t b) {
        return similarity(scenes[a].scene.bag, one.scene.bag) < similarity(scenes[b].scene.bag, one.scene.bag);
      });
      pairs.push_back({i, *most_alike, before, true});
    }
    const auto near_by = [&](int entry) {
      const TrainingScene& other = scenes[static_cast<std::size_t>(entry)];
      return other.world == one.world &&
             (one.world_from_camera.t - other.world_from_camera.t).norm() < options.min_different_m;
    };
    for (const PlaceMatch& match : index.query(one.scene.bag, 5, near_by)) {
      const auto j = static_cast<std::size_t>(match.entry);
      if (scenes[j].world == one.world && shared_features(scenes, i, j) > options.max_shared) continue;
      pairs.push_back({i, j, before, false});
      break;
    }
  }
  return pairs;
}

CrfGraphModel train_graph(const std::vector<TrainingScene>& scenes, const std::vector<TrainingPair>& pairs,
                          SceneGraph graph, const MatchingTrainingOptions& options, std::ostream& report) {
  std::vector<LabelledProblem> data;
  std::int64_t vertices = 0, matched = 0;
  for (const TrainingPair& pair : pairs) {
    data.push_back(labelled(scenes, pair, graph));
    vertices += data.back().problem.size();
    for (const std::int32_t state : data.back().state) matched += state > 0 ? 1 : 0;
  }
  CrfGraphModel model;
  model.weight = train_crf_weights(data, options.training);
  std::vector<CrfEvidence> evidence;
  std::array<int, 2> accepted{}, asked{};
  const auto match = [&](std::size_t from, std::size_t to) {
    return match_by_crf(scenes[from].of(graph), scenes[to].of(graph), graph, model);
  };
  for (const TrainingPair& pair : pairs) {
    if (!pair.before) continue;
    const CrfMatch before = match(pair.from, *pair.before);
    const auto explained = static_cast<int>(before.pairs.size());
    if (explained < kLeastExplained) continue;
    evidence.push_back({pair.same_place, explained, missing_features(match(pair.from, pair.to), before)});
  }
  model.explained = choose_explained(evidence, options.beta, options.refusal_weight);
  const double ratio = std::log1p(-model.explained) / std::log(model.explained);
  for (const CrfEvidence& one : evidence) {
    const bool good = one.explained_before + one.missing * (ratio - 1) <= options.beta * one.explained_before;
    ++asked[one.same_place ? 1 : 0];
    accepted[one.same_place ? 1 : 0] += good ? 1 : 0;
  }
  report << (graph == SceneGraph::near ? "near: " : "far: ") << vertices << " features, " << matched
         << " matched; accepted " << accepted[1] << " of " << asked[1] << " pairs of one place, " << accepted[0]
         << " of " << asked[0] << " of others\n";
  return model;
}

}  // namespace

void MatchingTrainingOptions::validate() const {
  if (!(every_s > 0)) throw InputError("matching weights: every_s: expected more than 0");
  if (!(max_distance_m > 0 && max_distance_m < min_different_m))
    throw InputError("matching weights: max_distance_m: expected more than 0 and less than min_different_m");
  if (!(max_angle_deg > 0)) throw InputError("matching weights: max_angle_deg: expected more than 0");
  if (!(refusal_weight > 0)) throw InputError("matching weights: refusal_weight: expected more than 0");
  if (!(beta > 0)) throw InputError("matching weights: beta: expected more than 0");
  scene.validate();
  training.validate();
}

CrfModel train_matching(const std::vector<std::string>& sources, const std::shared_ptr<const Vocabulary>& vocabulary,
                        const MatchingTrainingOptions& options, std::ostream& report) {
  options.validate();
  std::vector<TrainingScene> scenes;
  int recording = 0;
  for (std::size_t world = 0; world < sources.size(); ++world) {
    for (std::size_t begin = 0; begin <= sources[world].size();) {
      const std::size_t end = std::min(sources[world].find('+', begin), sources[world].size());
      read_scenes(sources[world].substr(begin, end - begin), static_cast<int>(world), recording++, *vocabulary, options,
                  &scenes);
      begin = end + 1;
    }
  }
  const std::vector<TrainingPair> pairs = choose_pairs(scenes, options);
  const auto same = std::count_if(pairs.begin(), pairs.end(), [](const auto& p) { return p.same_place && p.before; });
  const auto different = std::count_if(pairs.begin(), pairs.end(), [](const auto& p) { return !p.same_place; });
  report << scenes.size() << " scenes of " << recording << " recordings; " << same << " pairs of one place, "
         << different << " of others\n";
  if (same == 0 || different == 0)
    throw InputError("matching weights: found " + std::to_string(same) + " pairs of one place and " +
                     std::to_string(different) + " of others, expected some of both");
  CrfModel model;
  for (const SceneGraph graph : {SceneGraph::near, SceneGraph::far})
    model.of(graph) = train_graph(scenes, pairs, graph, options, report);
  return model;
}

}  // namespace parallax
