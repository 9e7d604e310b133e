#include "sessions/map_attachment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "core/binary_descriptor.h"
#include "core/error.h"
#include "place/place_index.h"

namespace parallax {
namespace {

using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;

constexpr int kLeastPairs = 8;  // of a keyframe with a candidate, to be tried
constexpr int kRefinements = 15;
constexpr double kHuber_px = 1.5;

// A map point and the session's feature that it was matched with.
struct Pair {
  Eigen::Vector3d point;  // map's world
  Eigen::Vector3d pixel;  // (u_left, u_right, v) in the session's keyframe; u_right NaN: not seen there
  Eigen::Vector3d seen;   // the feature in the component's global frame; only where disparity is enough
  bool has_depth = false;
  double tolerance_px = 3;
  const StereoCamera* camera = nullptr;
  RigidTransform camera_from_global;
};

// A point that a keyframe of the map measures, as it looks there.
struct DescribedPoint {
  Eigen::Vector3d point;
  BinaryDescriptor descriptor;
};

std::vector<DescribedPoint> describe_points(const Map& map, const Keyframe& keyframe) {
  std::vector<DescribedPoint> out;
  std::array<GreyImage, kPyramidLevels> smooth;
  for (const Measurement& m : keyframe.measurements) {
    const MapPoint* point = map.points.find(m.point);
    if (!point) continue;
    const auto level = static_cast<std::size_t>(m.level);
    const GreyImage& image = keyframe.images->pyramid.level[level];
    if (smooth[level].empty()) smooth[level] = smooth_for_descriptors(image);
    const double scale = 1 << m.level;
    const int x = static_cast<int>(std::lround((m.pixel.x() + 0.5) / scale - 0.5)),
              y = static_cast<int>(std::lround((m.pixel.y() + 0.5) / scale - 0.5));
    DescribedPoint described;
    described.point = point->position;
    if (describe_corner(image, smooth[level], x, y, &described.descriptor)) out.push_back(described);
  }
  return out;
}

// Nearest descriptors, each way, clearly nearer than the second.
std::vector<std::pair<std::size_t, std::size_t>> match_descriptors(const std::vector<DescribedPoint>& points,
                                                                   const std::vector<PlaceFeature>& features,
                                                                   const MapAttachmentOptions& options) {
  std::vector<int> best_of_feature(features.size(), 257);
  std::vector<std::size_t> point_of_feature(features.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    int best = 257, second = 257;
    std::size_t at = 0;
    for (std::size_t k = 0; k < features.size(); ++k) {
      const int distance = hamming(points[i].descriptor, features[k].descriptor);
      if (distance < best) {
        second = best;
        best = distance;
        at = k;
      } else if (distance < second) {
        second = distance;
      }
    }
    if (best > options.max_distance || best > options.ratio * second || best >= best_of_feature[at]) continue;
    best_of_feature[at] = best;
    point_of_feature[at] = i;
  }
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t k = 0; k < features.size(); ++k)
    if (point_of_feature[k] < points.size()) out.emplace_back(point_of_feature[k], k);
  return out;
}

bool agrees(const Pair& pair, const SimilarityTransform& global_from_map) {
  Eigen::Vector3d pixel;
  if (!pair.camera->project(pair.camera_from_global * (global_from_map * pair.point), &pixel)) return false;
  const Eigen::Vector3d off = pixel - pair.pixel;
  if (std::hypot(off.x(), off.z()) > pair.tolerance_px) return false;
  return std::isnan(pair.pixel.y()) || std::abs(off.y()) <= pair.tolerance_px;
}

int count_agreeing(const std::vector<Pair>& pairs, const SimilarityTransform& global_from_map) {
  return static_cast<int>(
      std::count_if(pairs.begin(), pairs.end(), [&](const Pair& pair) { return agrees(pair, global_from_map); }));
}

// The similarity that most pairs agree with; how many.
int find_similarity(const std::vector<Pair>& pairs, const MapAttachmentOptions& options, std::mt19937_64* rng,
                    SimilarityTransform* global_from_map) {
  std::vector<std::size_t> deep;
  for (std::size_t i = 0; i < pairs.size(); ++i)
    if (pairs[i].has_depth) deep.push_back(i);
  if (deep.size() < 3) return 0;
  int best = 0;
  for (int round = 0; round < options.rounds; ++round) {
    std::size_t pick[3];
    for (std::size_t& p : pick) p = deep[(*rng)() % deep.size()];
    if (pick[0] == pick[1] || pick[1] == pick[2] || pick[0] == pick[2]) continue;
    Eigen::Matrix3Xd from(3, 3), to(3, 3);
    for (int c = 0; c < 3; ++c) {
      from.col(c) = pairs[pick[c]].point;
      to.col(c) = pairs[pick[c]].seen;
    }
    SimilarityTransform hypothesis;
    if (!align_points(from, to, true, &hypothesis) || !(hypothesis.s > 1e-6)) continue;
    const int agreeing = count_agreeing(pairs, hypothesis);
    if (agreeing <= best) continue;
    best = agreeing;
    *global_from_map = hypothesis;
  }
  return best;
}

// Least squares on the reprojection in both images, Huber's kernel; w = S p, dw = v + omega x w + lambda w.
double refine_similarity(const std::vector<Pair>& pairs, SimilarityTransform* global_from_map) {
  double squares = 0;
  int rows = 0;
  for (int iteration = 0; iteration < kRefinements; ++iteration) {
    Matrix7 H = Matrix7::Zero();
    Vector7 g = Vector7::Zero();
    squares = 0;
    rows = 0;
    for (const Pair& pair : pairs) {
      if (!agrees(pair, *global_from_map)) continue;
      const Eigen::Vector3d w = *global_from_map * pair.point, y = pair.camera_from_global * w;
      Eigen::Vector3d pixel;
      if (!pair.camera->project(y, &pixel)) continue;
      const StereoCamera& c = *pair.camera;
      const double iz = 1 / y.z();
      Eigen::Matrix3d d_pixel;
      d_pixel << c.focal_px.x() * iz, 0, -c.focal_px.x() * y.x() * iz * iz,            //
          c.focal_px.x() * iz, 0, -c.focal_px.x() * (y.x() - c.baseline_m) * iz * iz,  //
          0, c.focal_px.y() * iz, -c.focal_px.y() * y.y() * iz * iz;
      Eigen::Matrix<double, 3, 7> d_w;
      d_w << Eigen::Matrix3d::Identity(), -hat(w), w;
      Eigen::Matrix<double, 3, 7> J = d_pixel * pair.camera_from_global.R * d_w;
      Eigen::Vector3d r = pixel - pair.pixel;
      if (std::isnan(pair.pixel.y())) {
        J.row(1).setZero();
        r.y() = 0;
      }
      const double length = r.norm(), weight = length <= kHuber_px ? 1 : kHuber_px / length;
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
      squares += r.squaredNorm();
      rows += 2;
    }
    if (rows < 8) return 0;
    const Vector7 d = -H.ldlt().solve(g);
    if (!d.allFinite()) break;
    const double s = std::exp(d[6]);
    const Eigen::Matrix3d R = exp_so3(d.segment<3>(3));
    *global_from_map = SimilarityTransform(s, R, d.head<3>()) * *global_from_map;
    if (d.norm() < 1e-10) break;
  }
  return std::sqrt(squares / rows);
}

// What of the sessions is asked.
struct SessionPlaces {
  std::vector<SessionPose> poses;
  std::vector<RigidTransform> global_from_camera;
  std::vector<int> component;
  std::map<int, StereoCamera> cameras;
  PlaceIndex index;
};

SessionPlaces gather_places(SessionDatabase* database, const Vocabulary& vocabulary) {
  SessionPlaces out;
  const SessionDocument document = database->read();
  std::map<int, const SessionState*> states;
  for (const SessionState& state : document.sessions) {
    states[state.id] = &state;
    out.cameras[state.id] = state.start.camera;
  }
  for (const SessionPose& pose : document.poses) {
    const SessionState& state = *states.at(pose.key.session);
    out.index.add(static_cast<int>(out.poses.size()),
                  vocabulary.bag_of(descriptors_of(database->features(pose.key).features)));
    out.poses.push_back(pose);
    out.global_from_camera.push_back(state.global_from_session * pose.session_from_camera);
    out.component.push_back(state.component);
  }
  return out;
}

std::vector<Pair> pair_with(const SessionPlaces& places, std::size_t entry, const StereoScene& scene,
                            const std::vector<DescribedPoint>& points, const MapAttachmentOptions& options) {
  std::vector<Pair> out;
  const RigidTransform& global_from_camera = places.global_from_camera[entry];
  const StereoCamera& camera = places.cameras.at(places.poses[entry].key.session);
  for (const auto& [i, k] : match_descriptors(points, scene.features, options)) {
    const PlaceFeature& feature = scene.features[k];
    Pair pair;
    pair.point = points[i].point;
    pair.pixel = {feature.pixel.x(), scene.right_px[k], feature.pixel.y()};
    pair.camera = &camera;
    pair.camera_from_global = global_from_camera.inverse();
    pair.tolerance_px = options.tolerance_px * (1 << feature.level);
    pair.has_depth = pair.pixel.x() - pair.pixel.y() >= options.least_disparity_px;
    if (pair.has_depth) pair.seen = global_from_camera * camera.triangulate(pair.pixel).hnormalized();
    out.push_back(pair);
  }
  return out;
}

}  // namespace

void MapAttachmentOptions::validate() const {
  const auto require = [](bool ok, const char* key, double found, const char* expected) {
    if (!ok)
      throw InputError("attachment option " + std::string(key) + ": found " + std::to_string(found) + ", expected " +
                       expected);
  };
  require(candidates >= 1, "candidates", candidates, "1 or more");
  require(max_keyframes >= 1, "max_keyframes", max_keyframes, "1 or more");
  require(ratio > 0 && ratio <= 1, "ratio", ratio, "above 0 and at most 1");
  require(tolerance_px > 0, "tolerance_px", tolerance_px, "above 0");
  require(least_disparity_px > 0, "least_disparity_px", least_disparity_px, "above 0");
  require(rounds >= 1, "rounds", rounds, "1 or more");
  require(least_inliers >= 6, "least_inliers", least_inliers, "6 or more");
  require(least_keyframes >= 1, "least_keyframes", least_keyframes, "1 or more");
}

MapAttachment attach_map(const Map& map, SessionDatabase* database, const Vocabulary& vocabulary,
                         const MapAttachmentOptions& options) {
  options.validate();
  MapAttachment out;
  const SessionPlaces places = gather_places(database, vocabulary);
  std::vector<const Keyframe*> keyframes;
  for (const Keyframe& keyframe : map.keyframes)
    if (keyframe.images) keyframes.push_back(&keyframe);
  if (places.poses.empty() || keyframes.empty()) {
    out.reason = places.poses.empty() ? "the database has no keyframes" : "the map has no keyframes";
    return out;
  }
  std::mt19937_64 rng(options.seed);
  struct Hypothesis {
    SimilarityTransform global_from_map;
    int component = 0, inliers = 0;
    std::size_t entry = 0;
  };
  std::vector<Hypothesis> hypotheses;
  std::vector<std::pair<int, std::vector<Pair>>> asked;  // component and pairs, a keyframe and candidate each
  std::vector<std::size_t> keyframe_of;
  const std::size_t step = (keyframes.size() + static_cast<std::size_t>(options.max_keyframes) - 1) /
                           static_cast<std::size_t>(options.max_keyframes);
  for (std::size_t n = 0; n < keyframes.size(); n += step) {
    const Keyframe& keyframe = *keyframes[n];
    ++out.asked;
    const std::vector<DescribedPoint> points = describe_points(map, keyframe);
    const WordBag bag = vocabulary.bag_of(descriptors_of(extract_place_features(keyframe.images->pyramid)));
    for (const PlaceMatch& match : places.index.query(bag, options.candidates)) {
      const auto entry = static_cast<std::size_t>(match.entry);
      SessionFeatures kept = database->features(places.poses[entry].key);
      StereoScene scene;
      scene.features = std::move(kept.features);
      scene.right_px = std::move(kept.right_px);
      std::vector<Pair> pairs = pair_with(places, entry, scene, points, options);
      if (static_cast<int>(pairs.size()) < kLeastPairs) continue;
      Hypothesis hypothesis;
      hypothesis.component = places.component[entry];
      hypothesis.entry = entry;
      hypothesis.inliers = find_similarity(pairs, options, &rng, &hypothesis.global_from_map);
      if (hypothesis.inliers >= options.least_inliers) {
        refine_similarity(pairs, &hypothesis.global_from_map);
        hypothesis.inliers = count_agreeing(pairs, hypothesis.global_from_map);
        hypotheses.push_back(hypothesis);
      }
      asked.emplace_back(places.component[entry], std::move(pairs));
      keyframe_of.push_back(n);
    }
  }
  // The hypothesis that the most keyframes of the map support.
  const auto support = [&](const Hypothesis& h, std::vector<Pair>* all) {
    std::map<std::size_t, int> supporting;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      if (asked[i].first != h.component) continue;
      const int agreeing = count_agreeing(asked[i].second, h.global_from_map);
      if (agreeing < options.least_inliers / 2 + 1) continue;
      supporting[keyframe_of[i]] = std::max(supporting[keyframe_of[i]], agreeing);
      if (all) all->insert(all->end(), asked[i].second.begin(), asked[i].second.end());
    }
    int keyframes_with_enough = 0;
    for (const auto& [n, agreeing] : supporting) keyframes_with_enough += agreeing >= options.least_inliers;
    return keyframes_with_enough;
  };
  const Hypothesis* best = nullptr;
  int most = 0;
  for (const Hypothesis& h : hypotheses) {
    const int supporting = support(h, nullptr);
    if (supporting < most || (supporting == most && best && h.inliers <= best->inliers)) continue;
    best = &h;
    most = supporting;
  }
  out.agreeing = most;
  if (!best || most < options.least_keyframes) {
    out.reason = "no place of the sessions was recognised by enough of the map's keyframes (" + std::to_string(most) +
                 " of " + std::to_string(out.asked) + "): map what both have seen, from alike viewpoints";
    return out;
  }
  Hypothesis joint = *best;
  std::vector<Pair> all;
  support(joint, &all);
  out.rms_px = refine_similarity(all, &joint.global_from_map);
  out.agreeing = support(joint, nullptr);
  out.inliers = count_agreeing(all, joint.global_from_map);
  out.ok = true;
  out.map.agreements = out.agreeing;
  out.map.session = places.poses[best->entry].key.session;
  out.map.keyframe = places.poses[best->entry].key.keyframe;
  out.map.keyframe_from_map =
      SimilarityTransform(places.global_from_camera[best->entry].inverse()) * joint.global_from_map;
  return out;
}

}  // namespace parallax
