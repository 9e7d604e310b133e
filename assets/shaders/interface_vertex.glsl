layout(location = 0) in vec2 position;
layout(location = 1) in vec2 uv;
layout(location = 2) in vec4 colour;

uniform vec2 display_origin, display_size;

out vec2 v_uv;
out vec4 v_colour;

void main() {
  vec2 p = 2.0 * (position - display_origin) / display_size - 1.0;
  gl_Position = vec4(p.x, -p.y, 0.0, 1.0);
  v_uv = uv;
  v_colour = colour;
}
