// A soft round spot. Light that only adds covers nothing: its alpha is 0 in the premultiplied picture.
in vec2 v_corner;
in vec4 v_colour;
in float v_additive;
in float v_outside;
in float v_camera_z;

out vec4 fragment;

void main() {
  if (v_outside > 0.0) discard;
  float inside = max(1.0 - dot(v_corner, v_corner), 0.0);
  float alpha = v_colour.a * inside * inside;
  if (alpha < 0.0005) discard;
  alpha *= seen_share(v_camera_z);
  fragment = vec4(v_colour.rgb * alpha, alpha * (1.0 - v_additive));
}
