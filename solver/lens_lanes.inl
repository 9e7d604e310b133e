// The camera models in lanes: pixel and 2x3 Jacobian of a lane of points in the camera frame. The formulas are those of
// core/camera_model.h; a test holds the two against each other. Included inside an instruction set's namespace.

// atan of q in [0, 1], to 1e-16 (Cephes' rational approximation, one reduction about tan(pi/8)).
PARALLAX_INLINE Vec arc_tangent_unit(Vec q) {
  const Mask upper = q > splat(0.41421356237309503);
  const Vec x = select(upper, (q - 1.0) / (q + 1.0), q);
  const Vec z = x * x;
  Vec p = splat(-8.750608600031904122785e-1);
  p = fma(p, z, splat(-1.615753718733365076637e1));
  p = fma(p, z, splat(-7.500855792314704667340e1));
  p = fma(p, z, splat(-1.228866684490136173410e2));
  p = fma(p, z, splat(-6.485021904942025371773e1));
  Vec d = z + 2.485846490142306297962e1;
  d = fma(d, z, splat(1.650270098316988542046e2));
  d = fma(d, z, splat(4.328810604912902668951e2));
  d = fma(d, z, splat(4.853903996359136964868e2));
  d = fma(d, z, splat(1.945506571482613964425e2));
  const Vec t = fma(x * z, p / d, x);
  return select(upper, t + 0.78539816339744830962, t);
}

// atan2(r, z) for r >= 0.
PARALLAX_INLINE Vec arc_tangent(Vec r, Vec z) {
  const Vec az = select(z < 0.0, -z, z);
  const Mask steep = r > az;
  const Vec t = arc_tangent_unit(minimum(r, az) / maximum(maximum(r, az), splat(1e-300)));
  const Vec first = select(steep, 1.57079632679489661923 - t, t);
  return select(z < 0.0, 3.14159265358979323846 - first, first);
}

// One lane of projections. `valid` is all ones in the lens's domain; u, v and j are finite wherever it is.
struct Projection {
  Vec u, v;
  Vec j[6];      // d(u, v) / d(x, y, z), by rows
  Vec extra[6];  // bal: d(u, v) / d(f, k1, k2), by rows
  Mask valid;
};

// From the 2x2 Jacobian [a b; b2 d] of the distorted ray by x / z and y / z to that by the point.
PARALLAX_INLINE void chain_perspective(Vec x, Vec y, Vec iz, Vec a, Vec b, Vec b2, Vec d, Projection* o) {
  o->j[0] = a * iz;
  o->j[1] = b * iz;
  o->j[2] = -fma(x, o->j[0], y * o->j[1]);
  o->j[3] = b2 * iz;
  o->j[4] = d * iz;
  o->j[5] = -fma(x, o->j[3], y * o->j[4]);
}

template <Lens kLens>
struct LensLanes;

template <>
struct LensLanes<Lens::pinhole> {
  static constexpr int kCamera = 6;
  PARALLAX_INLINE static void project(const LensParameters& k, Vec X, Vec Y, Vec Z, const Vec*, Projection* o) {
    o->valid = Z > 0.0;
    const Vec iz = 1.0 / Z, x = X * iz, y = Y * iz;
    o->u = fma(splat(k.fx), x, splat(k.cx));
    o->v = fma(splat(k.fy), y, splat(k.cy));
    o->j[0] = k.fx * iz;
    o->j[1] = Vec{};
    o->j[2] = -o->j[0] * x;
    o->j[3] = Vec{};
    o->j[4] = k.fy * iz;
    o->j[5] = -o->j[4] * y;
  }
};

template <>
struct LensLanes<Lens::radtan> {
  static constexpr int kCamera = 6;
  PARALLAX_INLINE static void project(const LensParameters& k, Vec X, Vec Y, Vec Z, const Vec*, Projection* o) {
    const double k1 = k.d[0], k2 = k.d[1], p1 = k.d[2], p2 = k.d[3], k3 = k.d[4], k4 = k.d[5], k5 = k.d[6], k6 = k.d[7];
    const Vec iz = 1.0 / Z, x = X * iz, y = Y * iz, x2 = x * x, y2 = y * y, xy = x * y, r2 = x2 + y2;
    o->valid = (Z > 0.0) & (r2 < k.domain);
    const Vec numerator = fma(fma(fma(splat(k3), r2, splat(k2)), r2, splat(k1)), r2, splat(1.0));
    const Vec denominator = fma(fma(fma(splat(k6), r2, splat(k5)), r2, splat(k4)), r2, splat(1.0));
    const Vec radial = numerator / denominator;
    const Vec slope = (fma(fma(splat(3 * k3), r2, splat(2 * k2)), r2, splat(k1)) -
                       radial * fma(fma(splat(3 * k6), r2, splat(2 * k5)), r2, splat(k4))) /
                      denominator;
    const Vec xd = x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * x2);
    const Vec yd = y * radial + p1 * (r2 + 2.0 * y2) + 2.0 * p2 * xy;
    o->u = fma(splat(k.fx), xd, splat(k.cx));
    o->v = fma(splat(k.fy), yd, splat(k.cy));
    const Vec off = 2.0 * xy * slope + 2.0 * p1 * x + 2.0 * p2 * y;
    chain_perspective(x, y, iz, k.fx * (radial + 2.0 * x2 * slope + 2.0 * p1 * y + 6.0 * p2 * x), k.fx * off,
                      k.fy * off, k.fy * (radial + 2.0 * y2 * slope + 6.0 * p1 * y + 2.0 * p2 * x), o);
  }
};

template <>
struct LensLanes<Lens::fov> {
  static constexpr int kCamera = 6;
  PARALLAX_INLINE static void project(const LensParameters& k, Vec X, Vec Y, Vec Z, const Vec*, Projection* o) {
    const double omega = k.d[0], t = k.d[1];
    const Vec iz = 1.0 / Z, x = X * iz, y = Y * iz;
    const Vec r2 = maximum(fma(x, x, y * y), splat(1e-20));
    o->valid = (Z > 0.0) & (r2 < k.domain);
    const Vec r = square_root(r2);
    const Vec s = arc_tangent(t * r, splat(1.0)) / (omega * r);
    const Vec slope = (t / (omega * fma(splat(t * t), r2, splat(1.0))) - s) / r2;  // twice d s / d r^2
    o->u = fma(k.fx * s, x, splat(k.cx));
    o->v = fma(k.fy * s, y, splat(k.cy));
    const Vec off = slope * x * y;
    chain_perspective(x, y, iz, k.fx * fma(slope * x, x, s), k.fx * off, k.fy * off, k.fy * fma(slope * y, y, s), o);
  }
};

template <>
struct LensLanes<Lens::kannala_brandt> {
  static constexpr int kCamera = 6;
  PARALLAX_INLINE static void project(const LensParameters& k, Vec X, Vec Y, Vec Z, const Vec*, Projection* o) {
    const Vec r2 = maximum(fma(X, X, Y * Y), 1e-24 * Z * Z + 1e-300);
    const Vec r = square_root(r2), angle = arc_tangent(r, Z), a2 = angle * angle;
    o->valid = angle < k.domain;
    const double k1 = k.d[0], k2 = k.d[1], k3 = k.d[2], k4 = k.d[3];
    const Vec factor = fma(fma(fma(fma(splat(k4), a2, splat(k3)), a2, splat(k2)), a2, splat(k1)), a2, splat(1.0));
    const Vec slope =
        fma(fma(fma(fma(splat(9 * k4), a2, splat(7 * k3)), a2, splat(5 * k2)), a2, splat(3 * k1)), a2, splat(1.0));
    const Vec s = angle * factor / r, bent = slope / fma(Z, Z, r2);  // bent: d angle' / d angle over the squared range
    const Vec q = (bent * Z - s) / r2;
    o->u = fma(k.fx * s, X, splat(k.cx));
    o->v = fma(k.fy * s, Y, splat(k.cy));
    const Vec off = q * X * Y;
    o->j[0] = k.fx * fma(q * X, X, s);
    o->j[1] = k.fx * off;
    o->j[2] = -k.fx * bent * X;
    o->j[3] = k.fy * off;
    o->j[4] = k.fy * fma(q * Y, Y, s);
    o->j[5] = -k.fy * bent * Y;
  }
};

template <>
struct LensLanes<Lens::bal> {
  static constexpr int kCamera = 9;
  PARALLAX_INLINE static void project(const LensParameters&, Vec X, Vec Y, Vec Z, const Vec* intrinsics,
                                      Projection* o) {
    const Vec f = intrinsics[0], k1 = intrinsics[1], k2 = intrinsics[2];
    o->valid = (Z > 0.0) | (Z < 0.0);
    const Vec iz = 1.0 / Z, x = X * iz, y = Y * iz, r2 = fma(x, x, y * y);
    const Vec radial = fma(fma(k2, r2, k1), r2, splat(1.0)), slope = 2.0 * fma(2.0 * k2, r2, k1);
    o->u = -f * radial * x;
    o->v = -f * radial * y;
    const Vec off = -f * slope * x * y;
    chain_perspective(x, y, iz, -f * fma(slope * x, x, radial), off, off, -f * fma(slope * y, y, radial), o);
    o->extra[0] = -radial * x;
    o->extra[1] = -f * r2 * x;
    o->extra[2] = o->extra[1] * r2;
    o->extra[3] = -radial * y;
    o->extra[4] = -f * r2 * y;
    o->extra[5] = o->extra[4] * r2;
  }
};
