// How a camera goes about in the synthetic building. A way is a chain of straight pieces that is smoothed with a bump
// of compact support: its convolution with the chain has a closed form, three times differentiable, so that any moment
// has its exact pose at any length of the way.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <vector>

#include "render/synthetic_building.h"
#include "render/synthetic_hand.h"

namespace parallax {

using Eigen::Vector3d;

namespace {

// The bump 15/16 (1 - u^2)^2 on [-1, 1], integrated once (a smooth step) and twice (a smooth ramp).
double bump_step(double u) {
  if (u <= -1) return 0;
  if (u >= 1) return 1;
  return 0.9375 * u * (1 - u * u * (2.0 / 3 - u * u / 5)) + 0.5;
}

double bump_ramp(double u) {
  if (u <= -1) return 0;
  if (u >= 1) return u;
  const double q = u * u;
  return 0.9375 * q * (0.5 - q * (1.0 / 6 - q / 30)) + 0.5 * u + 0.15625;
}

double walk_phase(std::uint64_t seed, std::uint64_t salt) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15u + salt * 0xbf58476d1ce4e5b9u + 0x2545f4914f6cdd1du;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return 2 * std::numbers::pi * static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

struct WayPoint {
  Vector3d floor;
  double speed;  // from here on, metres a second
};

class BuildingWay {
 public:
  // Corners are rounded within `reach` of them, and the heading turns within `turn_reach`, metres along the chain.
  BuildingWay(const std::vector<WayPoint>& points, bool closed, double reach, double turn_reach)
      : closed_(closed), reach_(reach), turn_reach_(turn_reach) {
    const std::size_t n = points.size(), pieces = closed ? n : n - 1;
    for (std::size_t i = 0; i < pieces; ++i) {
      const Vector3d step = points[(i + 1) % n].floor - points[i].floor;
      Piece piece{points[i].floor, step.normalized(), length_, std::atan2(step.y(), step.x())};
      if (!pieces_.empty())
        piece.heading =
            pieces_.back().heading + std::remainder(piece.heading - pieces_.back().heading, 2 * std::numbers::pi);
      pieces_.push_back(piece);
      length_ += step.norm();
    }
    if (closed) {
      const double last = pieces_.back().heading, first = pieces_.front().heading;
      round_ = last + std::remainder(first - last, 2 * std::numbers::pi) - first;
    }
  }

  double length() const { return length_; }

  struct Place {
    Vector3d floor;
    double heading;
  };
  Place at(double s) const {
    const double round = closed_ ? std::floor(s / length_) : 0;
    const double rest = s - round * length_;
    std::size_t i = 0;
    while (i + 1 < pieces_.size() && pieces_[i + 1].start <= rest) ++i;
    const int here = static_cast<int>(i);
    Place place{pieces_[i].from + (rest - pieces_[i].start) * pieces_[i].direction,
                pieces_[i].heading + round * round_};
    // Corner k is the beginning of piece k.
    for (int k = here + 1; add_corner(k, rest, &place); ++k) {
    }
    for (int k = here; add_corner(k, rest, &place); --k) {
    }
    return place;
  }

 private:
  struct Piece {
    Vector3d from, direction;
    double start, heading;
  };
  // False: beyond the end of the way, or too far for this and all further corners.
  bool add_corner(int k, double s, Place* place) const {
    const int n = static_cast<int>(pieces_.size());
    if (!closed_ && (k <= 0 || k >= n)) return false;
    const auto wrapped = [n](int i) { return static_cast<std::size_t>(((i % n) + n) % n); };
    const Piece &before = pieces_[wrapped(k - 1)], &after = pieces_[wrapped(k)];
    const double laps = std::floor(static_cast<double>(k) / n);
    const double apart = after.start + laps * length_ - s;
    if (std::abs(apart) >= std::max(reach_, turn_reach_)) return false;
    place->floor += reach_ * bump_ramp(-std::abs(apart) / reach_) * (after.direction - before.direction);
    const double turn = std::remainder(after.heading - before.heading, 2 * std::numbers::pi);
    const double part = turn * bump_step(-std::abs(apart) / turn_reach_);
    place->heading += apart > 0 ? part : -part;
    return true;
  }

  bool closed_;
  double reach_, turn_reach_, length_ = 0, round_ = 0;
  std::vector<Piece> pieces_;
};

// Distance over time from speeds that change smoothly.
class BuildingPace {
 public:
  static constexpr double kChange_s = 0.9;
  void change(double time, double speed) {
    changes_.push_back({time, speed - last_});
    last_ = speed;
  }
  double distance(double t) const {
    double s = 0;
    for (const auto& [time, change] : changes_) s += change * kChange_s * bump_ramp((t - time) / kChange_s);
    return s;
  }
  double speed(double t) const {
    double v = 0;
    for (const auto& [time, change] : changes_) v += change * bump_step((t - time) / kChange_s);
    return v;
  }

 private:
  struct Change {
    double time, by;
  };
  double last_ = 0;
  std::vector<Change> changes_;
};

constexpr double kStart_s = 1.5, kWheelSpeed = 0.66, kWalkSpeed = 0.9, kClimbSpeed = 0.45;

std::vector<WayPoint> upstairs(double speed) {
  constexpr double kLane = 0.575, kHalf = kUpperFloor / 2, kBack = kStairsTurn - 0.62;
  return {{{kStairsFoot + 1.1, -kLane, 0}, speed * 0.8},
          {{kStairsFoot + kStairsTread, -kLane, 0}, kClimbSpeed},
          {{kStairsTurn, -kLane, kHalf}, kClimbSpeed},
          {{kBack, -kLane, kHalf}, kClimbSpeed},
          {{kBack, kLane, kHalf}, kClimbSpeed},
          {{kStairsTurn - kStairsTread, kLane, kHalf}, kClimbSpeed},
          {{kStairsFoot, kLane, kUpperFloor}, speed * 0.8},
          {{kStairsFoot + 1.0, kLane, kUpperFloor}, speed},
          {{0.6, 0, kUpperFloor}, speed},
          {{kUpperEnd - 2.2, 0, kUpperFloor}, 0}};
}

// All there is to know about a walk but the seed.
struct BuildingWalk {
  std::vector<WayPoint> points;
  bool closed = false;
  double reach = 1.5, turn_reach = 1.5;
  double from = 0;    // where on a closed way it starts, metres
  double rounds = 0;  // of a closed way, until the walk's own end
  double height = 1.1;
  bool hand_held = false;
};

BuildingWalk building_walk(int walk) {
  constexpr double kX = kBuildingLength, kY = kBuildingWidth;
  BuildingWalk out;
  const std::vector<WayPoint> loop = {
      {{0, 0, 0}, kWheelSpeed}, {{kX, 0, 0}, kWheelSpeed}, {{kX, kY, 0}, kWheelSpeed}, {{0, kY, 0}, kWheelSpeed}};
  if (walk <= 2) {
    out.points = loop;
    out.closed = true;
    if (walk == 2) std::reverse(out.points.begin(), out.points.end());
    out.from = walk == 0 ? 4 : walk == 1 ? kX + kY + 10 : 2.0 * kX - 26;
    out.rounds = walk == 0 ? 1.1 : walk == 1 ? 0.9 : 0.8;
    return out;
  }
  out.hand_held = true;
  out.height = 1.45;
  if (walk == 3) {
    out.turn_reach = 1.4;
    out.points = {{{0, 9, 0}, kWalkSpeed},
                  {{0, 0, 0}, kWalkSpeed},
                  {{kX, 0, 0}, kWalkSpeed},
                  {{kX, kY, 0}, kWalkSpeed},
                  {{kX - 6, kY, 0}, 0}};
    return out;
  }
  out.reach = 0.5;
  out.turn_reach = 0.9;
  if (walk == 4)
    out.points = {{{12, kY, 0}, kWalkSpeed},      {{1.4, kY, 0}, 0.7}, {{0.35, kY - 0.35, 0}, 0.7},
                  {{0, kY - 1.4, 0}, kWalkSpeed}, {{0, 1.3, 0}, 0.6},  {{-0.35, 0.1, 0}, 0.6}};
  else
    out.points = {{{12, 0, 0}, kWalkSpeed}, {{0.6, 0, 0}, kWalkSpeed}};
  const auto up = upstairs(kWalkSpeed);
  out.points.insert(out.points.end(), up.begin(), up.end());
  return out;
}

double walk_seconds(const BuildingWalk& walk, BuildingPace* pace) {
  double time = kStart_s;
  if (walk.closed) {
    pace->change(time, walk.points.front().speed);
    const double length = BuildingWay(walk.points, true, walk.reach, walk.turn_reach).length();
    return time + walk.rounds * length / walk.points.front().speed;
  }
  for (std::size_t i = 0; i < walk.points.size(); ++i) {
    pace->change(time, walk.points[i].speed);
    if (i + 1 < walk.points.size())
      time += (walk.points[i + 1].floor - walk.points[i].floor).norm() / walk.points[i].speed;
  }
  return time + 1.5;
}

class BuildingPath {
 public:
  BuildingPath(const BuildingWalk& walk, std::uint64_t seed)
      : walk_(walk), way_(walk.points, walk.closed, walk.reach, walk.turn_reach), tremor_(seed) {
    walk_seconds(walk, &pace_);
    for (std::size_t i = 0; i < phase_.size(); ++i) phase_[i] = walk_phase(seed, i);
  }

  RigidTransform operator()(double t) const { return walk_.hand_held ? by_hand(t) : on_wheels(t); }

 private:
  double wave(std::size_t i, double rate, double x) const { return std::sin(rate * x + phase_[i]); }

  static RigidTransform pose(const Vector3d& eye, double heading, double pitch, double roll) {
    return look_at(
        eye, eye + Vector3d(std::cos(heading) * std::cos(pitch), std::sin(heading) * std::cos(pitch), std::sin(pitch)),
        roll);
  }

  RigidTransform on_wheels(double t) const {
    // Speed varies by a tenth; the robot does not keep quite to the middle, and never twice to the same line.
    const double under_way = pace_.speed(t) / kWheelSpeed;
    const double s = pace_.distance(t) + 0.15 * (wave(0, 0.37, t) - std::sin(phase_[0]));
    const auto place = way_.at(walk_.from + s);
    const double k1 = 0.68, k2 = 1.26;
    const double lane = 0.09 * wave(1, k1, s) + 0.03 * wave(2, k2, s);
    const double slope = 0.09 * k1 * std::cos(k1 * s + phase_[1]) + 0.03 * k2 * std::cos(k2 * s + phase_[2]);
    const Vector3d left(-std::sin(place.heading), std::cos(place.heading), 0);
    const double shake = 0.3 + 0.7 * under_way;
    const Vector3d eye = place.floor + lane * left +
                         Vector3d(0, 0, walk_.height + shake * (0.0005 * wave(3, 61, t) + 0.0003 * wave(4, 87, t)));
    return pose(eye, place.heading + std::atan(slope) + shake * 0.0003 * wave(5, 71, t),
                -0.045 + shake * (0.0009 * wave(6, 43, t) + 0.0004 * wave(7, 79, t)),
                shake * (0.0008 * wave(8, 39, t) + 0.0004 * wave(9, 67, t)));
  }

  RigidTransform by_hand(double t) const {
    const auto place = way_.at(pace_.distance(t));
    const double under_way = pace_.speed(t) / kWalkSpeed, steps = 2 * std::numbers::pi * 1.75 * t;
    const Vector3d left(-std::sin(place.heading), std::cos(place.heading), 0);
    // Up and down with every step, to the side with every other one.
    const Vector3d eye = place.floor + (0.016 * under_way * std::sin(0.5 * steps + phase_[0])) * left +
                         Vector3d(0, 0, walk_.height + 0.02 * under_way * std::sin(steps) + 0.01 * wave(1, 0.6, t));
    const double heading = place.heading + 0.09 * wave(2, 0.53, t) + 0.05 * wave(3, 1.17, t);
    const double pitch = -0.09 + 0.06 * wave(4, 0.47, t) + 0.007 * under_way * std::sin(steps + phase_[5]);
    const double roll = 0.02 * wave(6, 0.71, t) + 0.012 * under_way * std::sin(0.5 * steps + phase_[7]);
    return pose(eye, heading, pitch, roll) * tremor_.at(t);
  }

  BuildingWalk walk_;
  BuildingWay way_;
  BuildingPace pace_;
  HandTremor tremor_;
  std::array<double, 10> phase_{};
};

}  // namespace

int building_walk_frames(int walk) {
  BuildingPace pace;
  return static_cast<int>(std::ceil(walk_seconds(building_walk(walk), &pace) * kBuildingFps));
}

SyntheticMotion building_motion(int walk, std::uint64_t seed) {
  const auto path = std::make_shared<const BuildingPath>(building_walk(walk), seed);
  SyntheticMotion motion;
  motion.world_from_camera = [path](int frame, double offset_s) { return (*path)(frame / kBuildingFps + offset_s); };
  motion.label = [](int) { return FrameLabel{}; };
  motion.gain = [phase = walk_phase(seed, 100)](int frame) {
    return 1.0 + 0.03 * std::sin(0.31 * frame / kBuildingFps + phase);
  };
  motion.cover = [](int) { return 0.0; };
  return motion;
}

}  // namespace parallax
