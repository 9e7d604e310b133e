#include "games/burning_glass_info.h"

#include "games/burning_glass_material.h"

namespace parallax::burning {

const GameInfo& burning_glass_info() {
  static const GameInfo info = [] {
    GameInfo out;
    out.name = "burning_glass";
    out.title = "Burning glass";
    out.explanation = {
        "Your camera holds a lens under a virtual sun.",  "Aim at the table and raise or lower the camera",
        "until the light shrinks to a bright dot: there", "it burns. Move to draw; lift to stop.",
        "The dot lies where the sunlight through the",    "lens's middle falls. Best: the sun right behind",
        "you, so that its beam runs along your view.",    "Cover the lens to move without burning.",
        "Undo takes back one stroke at a time.",
    };
    out.fire_does = "cover the lens";
    out.act_does = "undo a stroke";
    out.move_does = "turn and raise the sun";
    out.dial_does = "focal length";
    out.settings = {
        {"focal_length", "Focal length", "field radii", kLeastFocalLength, kMostFocalLength, kUsualFocalLength, {}},
        {"lens_diameter", "Lens diameter", "field radii", kLeastDiameter, kMostDiameter, kUsualDiameter, {}},
        {"sun_elevation", "Sun's elevation", "deg", kLeastElevation_deg, kMostElevation_deg, 60, {}},
        {"sun_azimuth", "Sun's azimuth", "deg", -180, 180, -90, {}},
        {"material", "Material", "", 0, static_cast<double>(materials().size() - 1), 0, material_names()},
        {"lens_shape", "Lens", "", 0, 1, 0, {"corrected", "simple glass"}},
    };
    return out;
  }();
  return info;
}

}  // namespace parallax::burning
