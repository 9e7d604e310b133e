// Relocalisation on a frozen map: how often the camera is found from views that the map was not made from, how long a
// try takes, and how often a wrong pose is accepted.
//
//   bench_relocalisation_recall [probes of each kind=100] [seeds=3]
//
// A map is made of synthetic:desk (lockstep, 400 frames), and frozen. Probes are rendered: a keyframe's true view,
// changed in one way or in all: distance to what it looks at by up to 30 percent, turned in the image by up to 40
// degrees, seen from up to 25 degrees beside. One call of Relocaliser::recover a probe, with no idea of where the
// camera is, after all points have been described. A probe counts when it shares at least a third of its view with one
// keyframe. Probes of another desk must never be accepted. An accepted pose is wrong beyond 25 cm or 2 degrees.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <random>

#include "map/shared_map.h"
#include "mapper/mapper.h"
#include "render/synthetic_source.h"
#include "tracker/frame_features.h"
#include "tracker/relocaliser.h"
#include "tracker/tracker.h"

using namespace parallax;

namespace {

constexpr int kFrames = 400;
constexpr double kDegree = std::numbers::pi / 180;
constexpr double kShare = 1.0 / 3.0;

double cpu_ms() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

struct FrozenMap {
  std::unique_ptr<SyntheticSource> source;
  std::shared_ptr<const TrackingSnapshot> map;
  std::vector<int> frames;  // of the keyframes
  std::vector<cv::Mat1f> depths;
  SimilarityTransform truth_from_map;
};

FrozenMap make_map(int seed) {
  FrozenMap out;
  out.source =
      open_synthetic_source("synthetic:desk?seed=" + std::to_string(seed) + "&frames=" + std::to_string(kFrames));
  const CameraModel camera = *out.source->calibration();
  SharedMap map;
  MapperInbox inbox(32);
  Mapper mapper(camera, MapperOptions{}, &map, &inbox);
  Tracker tracker(camera, TrackerOptions{}, true, &map, &inbox);
  while (const auto frame = out.source->next()) {
    tracker.track(*frame);
    while (mapper.step()) {
    }
  }
  out.map = map.snapshot();
  out.frames = map.read([](const Map& m) {
    std::vector<int> frames;
    for (const Keyframe& kf : m.keyframes) frames.push_back(kf.frame);
    return frames;
  });
  Eigen::Matrix3Xd from(3, static_cast<Eigen::Index>(out.frames.size())), to(from);
  for (std::size_t i = 0; i < out.frames.size(); ++i) {
    from.col(static_cast<Eigen::Index>(i)) = out.map->keyframes[i].centre;
    to.col(static_cast<Eigen::Index>(i)) = out.source->world_from_camera(out.frames[i]).t;
    out.depths.push_back(out.source->depth(out.frames[i]));
  }
  align_points(from, to, true, &out.truth_from_map);
  return out;
}

// The largest part of the probe's view that one keyframe sees too.
double shared_view(const FrozenMap& map, const CameraModel& camera, const cv::Mat1f& depth,
                   const RigidTransform& world_from_probe) {
  constexpr int kStep = 20;
  double most = 0;
  for (std::size_t i = 0; i < map.frames.size(); ++i) {
    const RigidTransform keyframe_from_probe =
        map.source->world_from_camera(map.frames[i]).inverse() * world_from_probe;
    int seen = 0, all = 0;
    for (int y = kStep / 2; y < depth.rows; y += kStep) {
      for (int x = kStep / 2; x < depth.cols; x += kStep) {
        ++all;
        Eigen::Vector3d ray;
        if (depth(y, x) <= 0 || !camera.unproject(Eigen::Vector2d(x, y), &ray)) continue;
        const Eigen::Vector3d p = keyframe_from_probe * (ray * (depth(y, x) / ray.z()));
        Eigen::Vector2d pixel;
        if (!camera.project(p, &pixel) || !camera.in_image(pixel, 0.0)) continue;
        const float there =
            map.depths[i](static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x())));
        seen += std::abs(there - p.z()) < 0.03 * p.z() ? 1 : 0;
      }
    }
    most = std::max(most, static_cast<double>(seen) / all);
  }
  return most;
}

struct Change {
  const char* name;
  double distance, roll_deg, beside_deg;  // at most
};

struct Tally {
  int probes = 0, shared = 0, found_close = 0, found_near = 0, wrong = 0;
  std::vector<double> ms;
};

SyntheticSource probes_of(const SyntheticSource& like, std::vector<RigidTransform> poses, std::uint64_t scene) {
  SyntheticOptions options = like.options();
  options.frames = static_cast<int>(poses.size());
  options.seed = scene;
  options.exposure_s = 0;
  SyntheticMotion motion = desk_motion(scene);
  motion.world_from_camera = [poses = std::move(poses)](int frame, double) {
    return poses[static_cast<std::size_t>(frame)];
  };
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [](int) { return 1.0; };
  motion.cover = [](int) { return 0.0; };
  return SyntheticSource("probes", options, std::move(motion));
}

void probe(const FrozenMap& map, SyntheticSource* probes, bool mapped, Relocaliser* relocaliser, Tally* tally) {
  const CameraModel camera = *probes->calibration();
  TwoStageTracker tracker(camera, TrackerOptions{});
  FrameFeatures features(camera.width(), camera.height(), TrackerOptions{});
  RigidTransform nowhere;
  nowhere.t.z() = 1e3;
  for (int i = 0; i < probes->frame_count(); ++i) {
    const Frame frame = probes->frame(i);
    std::shared_ptr<const FrameImages> images;
    for (int k = 0; k < 12; ++k) images = features.compute(frame.grey);  // thresholds settle as in a running tracker
    const RigidTransform truth = probes->world_from_camera(i);
    ++tally->probes;
    const bool counts = mapped && shared_view(map, camera, probes->depth(i), truth) >= kShare;
    tally->shared += counts ? 1 : 0;
    tracker.clear_cache();
    relocaliser->reset();
    TwoStageResult result;
    const double start = cpu_ms();
    const bool accepted = relocaliser->recover(*map.map, *images, nowhere, &tracker, &result);
    tally->ms.push_back(cpu_ms() - start);
    if (!accepted) continue;
    const RigidTransform found = map.truth_from_map.rebase(result.camera_from_world).inverse();
    const double distance = (found.t - truth.t).norm(), angle = (found.inverse() * truth).angle() / kDegree;
    if (!mapped || distance > 0.25 || angle > 2) {
      ++tally->wrong;
    } else if (counts) {
      ++tally->found_near;
      tally->found_close += distance <= 0.10 && angle <= 1 ? 1 : 0;
    }
  }
}

void print(const char* name, Tally* tally) {
  std::sort(tally->ms.begin(), tally->ms.end());
  const double all = std::max(1, tally->shared);
  std::printf("| %s | %d | %d | %.3f | %.3f | %d | %.1f | %.1f |\n", name, tally->probes, tally->shared,
              tally->found_close / all, tally->found_near / all, tally->wrong, tally->ms[tally->ms.size() / 2],
              tally->ms[tally->ms.size() * 99 / 100]);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 100, seeds = argc > 2 ? std::atoi(argv[2]) : 3;
  const Change changes[] = {{"as the keyframe", 0, 0, 0},
                            {"30 % nearer or farther", 0.3, 0, 0},
                            {"turned by up to 40 degrees", 0, 40, 0},
                            {"up to 25 degrees beside", 0, 0, 25},
                            {"all three", 0.3, 40, 25}};
  std::vector<Tally> tallies(std::size(changes) + 1);
  for (int seed = 1; seed <= seeds; ++seed) {
    const FrozenMap map = make_map(seed);
    const CameraModel camera = *map.source->calibration();
    std::fprintf(stderr, "seed %d: %zu keyframes, %d points\n", seed, map.map->keyframes.size(), map.map->size());
    Relocaliser relocaliser(camera, TrackerOptions{});
    std::mt19937_64 rng(static_cast<std::uint64_t>(seed));
    std::uniform_real_distribution<double> unit(-1, 1);
    // All points are described before the first probe.
    {
      auto blank = std::make_shared<FrameImages>();
      FrameFeatures features(camera.width(), camera.height(), TrackerOptions{});
      const auto images = features.compute(GreyImage(camera.height(), camera.width(), std::uint8_t{90}));
      TwoStageTracker tracker(camera, TrackerOptions{});
      TwoStageResult result;
      for (std::size_t i = 0; i < map.frames.size(); ++i)
        relocaliser.recover(*map.map, *images, RigidTransform(Eigen::Matrix3d::Identity(), {0, 0, 1e3}), &tracker,
                            &result);
    }
    for (std::size_t c = 0; c < std::size(changes); ++c) {
      std::vector<RigidTransform> poses;
      for (int i = 0; i < count; ++i) {
        const std::size_t k = rng() % map.frames.size();
        const RigidTransform keyframe = map.source->world_from_camera(map.frames[k]);
        const double depth = map.depths[k](camera.height() / 2, camera.width() / 2);
        const Eigen::Vector3d target = keyframe * Eigen::Vector3d(0, 0, depth);
        const double around = std::numbers::pi * unit(rng);
        const Eigen::Vector3d axis = keyframe.R * Eigen::Vector3d(std::cos(around), std::sin(around), 0);
        const Eigen::Matrix3d beside = exp_so3(axis * changes[c].beside_deg * kDegree * unit(rng));
        const double distance = std::pow(1 + changes[c].distance, unit(rng));
        const Eigen::Matrix3d roll = exp_so3(Eigen::Vector3d(0, 0, changes[c].roll_deg * kDegree * unit(rng)));
        poses.emplace_back(Eigen::Matrix3d(beside * keyframe.R * roll),
                           target + distance * (beside * (keyframe.t - target)));
      }
      SyntheticSource probes = probes_of(*map.source, std::move(poses), map.source->options().seed);
      probe(map, &probes, true, &relocaliser, &tallies[c]);
    }
    // Another desk, seen as this one was.
    std::vector<RigidTransform> poses;
    for (int i = 0; i < count; ++i) poses.push_back(map.source->world_from_camera(static_cast<int>(rng() % kFrames)));
    SyntheticSource probes = probes_of(*map.source, std::move(poses), static_cast<std::uint64_t>(1000 + seed));
    probe(map, &probes, false, &relocaliser, &tallies.back());
  }
  std::printf(
      "| probe | probes | sharing a third | recall 10 cm, 1 deg | recall 25 cm, 2 deg | wrong accepts | ms a try, "
      "median | p99 |\n"
      "|---|---|---|---|---|---|---|---|\n");
  for (std::size_t c = 0; c < std::size(changes); ++c) print(changes[c].name, &tallies[c]);
  print("another desk", &tallies.back());
}
