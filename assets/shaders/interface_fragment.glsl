// Dear ImGui blends in sRGB-encoded colours, as its themes are made for.
in vec2 v_uv;
in vec4 v_colour;

uniform sampler2D surface;

out vec4 fragment;

void main() { fragment = v_colour * texture(surface, v_uv); }
