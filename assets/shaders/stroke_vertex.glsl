// Lines and points, already projected: pixels of the viewport from its top left corner, and the depth for the depth test.
layout(location = 0) in vec3 place;   // x, y, depth
layout(location = 1) in vec4 extent;  // lines: across, from the start, from the end, half the width; points: x, y, -, radius
layout(location = 2) in float shape;  // 0 line, 1 disc, 2 ring
layout(location = 3) in vec4 colour;  // linear, straight alpha

uniform vec2 viewport_size;
uniform float near_plane;

out vec4 v_extent;
out vec4 v_colour;
flat out float v_shape;

void main() {
  vec2 p = 2.0 * place.xy / viewport_size - 1.0;
  gl_Position = vec4(p.x, -p.y, 1.0 - 2.0 * near_plane / place.z, 1.0);
  v_extent = extent;
  v_colour = colour;
  v_shape = shape;
}
