// CamProj (PTAM Eq. 2-5) for the lenses of core/camera_model: camera frame to clip coordinates. Near clipping and
// perspective-correct interpolation go by w: for a pinhole the depth, as usual; for a lens that bends, whose field of view
// may reach the image plane and beyond, the distance. Nothing is too far: z / w = 1 - 2 near / w.
uniform int lens_kind;  // 0 pinhole, 1 radial-tangential, 2 Kannala-Brandt, 3 field of view
uniform vec2 lens_focal, lens_centre, lens_size;
uniform float lens_d[8];
uniform float lens_limit;  // largest squared radius at z = 1; Kannala-Brandt: largest angle
uniform float near_plane;

// `outside` becomes 1 for a point that the lens has no pixel for; its triangles are not drawn.
vec4 lens_clip(vec3 p, out float outside) {
  vec2 distorted;  // times w
  float w = lens_kind == 0 ? p.z : length(p);
  outside = 0.0;
  if (lens_kind == 0) {
    distorted = p.xy;
  } else if (lens_kind == 2) {
    float rho = length(p.xy);
    float angle = atan(rho, p.z);
    if (!(angle <= lens_limit)) outside = 1.0;
    float s = angle * angle;
    float radius = angle * (1.0 + s * (lens_d[0] + s * (lens_d[1] + s * (lens_d[2] + s * lens_d[3]))));
    distorted = rho > 1e-7 * w ? p.xy * (radius / rho * w) : p.xy;
  } else {
    vec2 x = p.xy / p.z;
    float s = dot(x, x);
    if (!(p.z > 0.0) || !(s <= lens_limit)) outside = 1.0;
    if (lens_kind == 1) {
      float radial = (1.0 + s * (lens_d[0] + s * (lens_d[1] + s * lens_d[4]))) /
                     (1.0 + s * (lens_d[5] + s * (lens_d[6] + s * lens_d[7])));
      vec2 p1p2 = vec2(lens_d[2], lens_d[3]);
      vec2 tangential = 2.0 * x.x * x.y * p1p2 + p1p2.yx * (s + 2.0 * x * x);
      x = x * radial + tangential;
    } else {
      float omega = max(lens_d[0], 1e-6), factor = 2.0 * tan(omega / 2.0), r = sqrt(s);
      x *= r > 1e-6 ? atan(factor * r) / (omega * r) : factor / omega;
    }
    distorted = x * w;
  }
  if (outside > 0.0) return vec4(0.0, 0.0, -2.0, 1.0);
  // The centre of the top-left pixel is (0, 0): the image begins half a pixel to the left of it.
  vec2 image = (lens_focal * distorted + (lens_centre + 0.5) * w) / lens_size;
  return vec4(2.0 * image.x - w, w - 2.0 * image.y, w - 2.0 * near_plane, w);
}
