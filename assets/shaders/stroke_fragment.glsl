// Analytic coverage of lines, discs and rings: one pixel of slope at the edges.
in vec4 v_extent;
in vec4 v_colour;
flat in float v_shape;

out vec4 fragment;

void main() {
  float half_width = v_extent.w, coverage;
  if (v_shape < 0.5) {
    coverage = clamp(half_width + 0.5 - abs(v_extent.x), 0.0, min(1.0, 2.0 * half_width));
    coverage *= clamp(min(v_extent.y, v_extent.z) + 0.5, 0.0, 1.0);
  } else {
    float r = length(v_extent.xy);
    coverage = clamp(half_width + 0.5 - r, 0.0, 1.0);
    if (v_shape > 1.5) coverage *= clamp(r - (half_width - v_extent.z) + 0.5, 0.0, 1.0);
  }
  float alpha = v_colour.a * coverage;
  if (alpha <= 0.0) discard;
  fragment = vec4(v_colour.rgb * alpha, alpha);
}
