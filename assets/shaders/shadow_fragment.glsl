// A contact shadow: how much of the sky the thing above hides, as a dimming of the camera's image in linear light.
in vec2 v_uv;
in float v_outside;
in float v_camera_z;
in vec3 v_normal;
in vec4 v_colour;

uniform sampler2D surface;

out vec4 fragment;

void main() {
  if (v_outside > 0.0) discard;
  fragment = vec4(0.0, 0.0, 0.0, texture(surface, v_uv).r * v_colour.a * seen_share(v_camera_z));
}
