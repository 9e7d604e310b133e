layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec4 colour;  // linear, straight alpha

uniform mat4 camera_from_model;
uniform mat3 world_normal_from_model;

out vec3 v_normal;
out vec2 v_uv;
out vec4 v_colour;
out float v_outside;
out float v_camera_z;

void main() {
  vec3 in_camera = (camera_from_model * vec4(position, 1.0)).xyz;
  gl_Position = lens_clip(in_camera, v_outside);
  v_camera_z = in_camera.z;
  v_normal = world_normal_from_model * normal;
  v_uv = uv;
  v_colour = colour;
}
