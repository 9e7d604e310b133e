// Hemisphere light and one soft directional light from above, in linear light, tinted by the estimate of the scene's own.
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_colour;
in float v_outside;
in float v_camera_z;

uniform sampler2D surface;
uniform vec4 tint;  // linear
uniform vec3 light;
uniform vec3 up, towards_light;
uniform float emission;

out vec4 fragment;

void main() {
  if (v_outside > 0.0) discard;
  vec4 albedo = texture(surface, v_uv) * v_colour * tint;
  albedo.a *= seen_share(v_camera_z);
  if (albedo.a < 0.002) discard;
  float length2 = dot(v_normal, v_normal);
  vec3 n = length2 > 1e-20 ? v_normal * inversesqrt(length2) : up;
  if (!gl_FrontFacing) n = -n;
  float sky = 0.5 + 0.5 * dot(n, up);
  float direct = max(dot(n, towards_light), 0.0);
  vec3 lit = light * (mix(0.22, 0.55, sky) + 0.45 * direct);
  fragment = vec4(albedo.rgb * (lit * max(1.0 - emission, 0.0) + emission) * albedo.a, albedo.a);
}
