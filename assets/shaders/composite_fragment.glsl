// Puts the virtual content (linear, alpha premultiplied) over the camera's image. Where there is none, the image passes
// through untouched.
in vec2 v_uv;

uniform sampler2D image;
uniform sampler2D content;
uniform bool has_image;
uniform bool has_content;
uniform vec3 colour;  // instead of an image
uniform ivec2 origin;

out vec4 fragment;

vec3 to_linear(vec3 c) { return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c)); }
vec3 to_srgb(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));
}

void main() {
  vec3 behind = has_image ? texture(image, v_uv).rgb : colour;
  vec4 over = has_content ? texelFetch(content, ivec2(gl_FragCoord.xy) - origin, 0) : vec4(0.0);
  if (over.a > 0.0 || over.r > 0.0 || over.g > 0.0 || over.b > 0.0)
    behind = to_srgb(over.rgb + (1.0 - clamp(over.a, 0.0, 1.0)) * to_linear(behind));
  fragment = vec4(behind, 1.0);
}
