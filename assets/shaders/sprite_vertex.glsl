layout(location = 0) in vec3 position;  // camera frame
layout(location = 1) in vec2 corner;    // -1 .. 1
layout(location = 2) in vec4 colour;    // linear, straight alpha
layout(location = 3) in float additive;

out vec2 v_corner;
out vec4 v_colour;
out float v_additive;
out float v_outside;
out float v_camera_z;

void main() {
  gl_Position = lens_clip(position, v_outside);
  v_corner = corner;
  v_colour = colour;
  v_additive = additive;
  v_camera_z = position.z;
}
