// What real things hide of the virtual ones (render/gl_occlusion): by a depth image of this frame, which may be coarser
// than the picture.
uniform bool has_occlusion_depth;
uniform sampler2D occlusion_depth;  // along the camera's z, metres, top row first; 0: nothing
uniform vec2 picture_size;

// 0 where the texel's real thing lies before `z`.
float seen_past_texel(ivec2 at, ivec2 size, float z) {
  float real = texelFetch(occlusion_depth, clamp(at, ivec2(0), size - 1), 0).r;
  return real > 0.0 && real < z ? 0.0 : 1.0;
}

// The share of this fragment that no real thing hides. Depths are compared first and the answers interpolated, so that
// outlines run smoothly between the texels; they are one pixel of the picture soft.
float seen_share(float z) {
  if (!has_occlusion_depth) return 1.0;
  ivec2 size = textureSize(occlusion_depth, 0);
  vec2 texels_a_pixel = vec2(size) / picture_size;
  vec2 at = vec2(gl_FragCoord.x, picture_size.y - gl_FragCoord.y) * texels_a_pixel - 0.5;
  ivec2 corner = ivec2(floor(at));
  vec2 part = at - vec2(corner);
  float above = mix(seen_past_texel(corner, size, z), seen_past_texel(corner + ivec2(1, 0), size, z), part.x);
  float below = mix(seen_past_texel(corner + ivec2(0, 1), size, z), seen_past_texel(corner + ivec2(1, 1), size, z), part.x);
  float pixels_a_texel = max(1.0 / max(texels_a_pixel.x, texels_a_pixel.y), 1.0);
  return clamp((mix(above, below, part.y) - 0.5) * pixels_a_texel + 0.5, 0.0, 1.0);
}
