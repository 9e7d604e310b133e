// Depth only.
in float v_outside;

void main() {
  if (v_outside > 0.0) discard;
}
