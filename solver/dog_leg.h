// Powell's dog-leg (Powell 1970; Rosen, Kaess and Leonard 2012) in scalars: which blend of the steepest descent and the
// Gauss-Newton step to take inside a trust region, what the quadratic model promises of it, and how the radius follows
// the gain. The steps themselves stay with the solver; lengths are in whatever norm it measures them.
#pragma once

#include <algorithm>
#include <cmath>

namespace parallax {

// d: the direction of steepest descent in the norm, h: the Gauss-Newton step (H h = -g). g: gradient, H: the model's
// Hessian; model(s) = cost + g s + 1/2 s H s.
struct DogLegInner {
  double dd = 0, dh = 0, hh = 0;  // inner products in the norm
  double gd = 0, gh = 0;          // of the gradient with both: negative
  double d_h_d = 0;               // d^T H d
};

struct DogLegStep {
  double along_d = 0, along_h = 1;  // step = along_d d + along_h h
  double length = 0;                // in the norm
  double gain = 0;                  // model(0) - model(step)
};

inline DogLegStep dog_leg_blend(const DogLegInner& in, double along_d, double along_h) {
  DogLegStep step;
  step.along_d = along_d;
  step.along_h = along_h;
  step.length =
      std::sqrt(std::max(0.0, along_d * along_d * in.dd + 2 * along_d * along_h * in.dh + along_h * along_h * in.hh));
  // h^T H h = -g h and d^T H h = -g d.
  step.gain = -(along_d * in.gd + along_h * in.gh) -
              0.5 * (along_d * along_d * in.d_h_d - 2 * along_d * along_h * in.gd - along_h * along_h * in.gh);
  return step;
}

// The point at distance `radius` on the way from the origin to the Cauchy point to the Gauss-Newton point; the latter
// when it lies inside.
inline DogLegStep dog_leg_step(const DogLegInner& in, double radius) {
  if (in.hh <= radius * radius) return dog_leg_blend(in, 0, 1);
  const double cauchy = in.d_h_d > 0 ? -in.gd / in.d_h_d : 0;
  if (cauchy * cauchy * in.dd >= radius * radius) return dog_leg_blend(in, radius / std::sqrt(in.dd), 0);
  // |c + t (h - c)| = radius, c = cauchy d: a t^2 + 2 b t - r = 0 with r > 0.
  const double cc = cauchy * cauchy * in.dd, ch = cauchy * in.dh;
  const double a = in.hh - 2 * ch + cc, b = ch - cc, r = radius * radius - cc;
  const double root = std::sqrt(b * b + a * r);
  const double t = std::clamp(b > 0 ? r / (b + root) : (root - b) / a, 0.0, 1.0);
  return dog_leg_blend(in, cauchy * (1 - t), t);
}

// The radius for the next step, from the gain ratio (what the cost fell by over what the model promised).
inline double dog_leg_radius(double radius, double step_length, double gain_ratio) {
  if (!(gain_ratio >= 0.25)) return 0.5 * std::min(radius, step_length);
  return gain_ratio > 0.75 ? std::max(radius, 3 * step_length) : radius;
}

}  // namespace parallax
