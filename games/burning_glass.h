// The burning glass (PTAM section 7.5): a convex lens at the camera's centre, its axis the optical axis, under a sun
// that the player moves. Its rays are traced onto the table (burning_glass_optics), heat the sheet there, and char it
// where it gets hot enough (burning_glass_sheet). What is burnt is a picture: it can be undone stroke by stroke, taken
// as an image, and is saved with the rest of the state.
//
// Plane frame. Lengths of the settings are in field radii, since the map's scale may be a guess. The sheet is a square
// about the plane's origin, as wide as the field was when the game began, and keeps its place and size in metres when
// the field changes. One thread at a time.
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "games/burning_glass_optics.h"
#include "games/burning_glass_particles.h"
#include "games/burning_glass_picture.h"
#include "games/burning_glass_sheet.h"
#include "games/burning_glass_strokes.h"
#include "games/game.h"

namespace parallax {

class BurningGlass : public Game {
 public:
  BurningGlass();

  const GameInfo& info() const override;
  void start(const PlayingField& field, const GameOptions& options) override;
  void change_field(const PlayingField& field) override;
  void set(const std::string& setting, double value) override;
  void step(const GameInput& input) override;
  GameInput scripted_input(const std::optional<RigidTransform>& camera_from_plane) const override;
  bool is_over() const override { return false; }
  GameHud hud() const override;
  std::vector<GameSound> take_sounds() override;
  void draw(const ModelSet& models, DrawList* out) const override;
  std::optional<GameLandmark> landmark() const override;
  std::string save() const override;
  void restore(const std::string& text, const PlayingField& field) override;
  std::uint64_t state_hash() const override;

  // What was burnt, without light and glow: RGBA (red first), sRGB, straight alpha, the side of the highest y on top.
  // It covers the square of half_extent_m() about the plane's origin.
  cv::Mat4b export_picture() const;
  cv::Mat4b picture() const override;
  double half_extent_m() const { return grid_.half_extent_m; }
  // Takes the last stroke back, and all heat with it; false when there is none. The lens stays covered for a moment.
  bool undo();
  std::size_t stroke_count() const { return strokes_.count(); }
  const burning::Sheet& sheet() const { return sheet_; }
  const burning::SheetGrid& grid() const { return grid_; }
  Eigen::Vector3d towards_sun() const { return burning::sun_direction(controls_.azimuth_rad, controls_.elevation_rad); }
  double focal_length_m() const { return controls_.focal_length * grid_.half_extent_m; }

 private:
  // What the player has set. Lengths in field radii.
  struct Controls {
    double azimuth_rad = 0, elevation_rad = 1;
    double focal_length = 1.5, lens_diameter = 0.5;
    int material = 0, lens_shape = 0;
    bool sun_placed = false;  // until it is, it stands behind whoever holds the camera
  };

  // The map's metres have become `new_per_old` of what they were; burns stay where they are on the table.
  void rescale(double new_per_old);
  void move_controls(const GameInput& input);
  void place_sun(const RigidTransform& camera_from_plane);
  burning::Lens lens_of(const RigidTransform& camera_from_plane) const;
  const burning::Material& material() const;
  void gather_light(bool lit);
  void make_sounds(int new_sparks);
  void make_sound(const std::string& name, double volume, double pitch, int cell);
  void forget_moment();  // all that does not belong to the state
  void forget_light();
  void forget_pictures();
  std::string advice() const;
  void draw_sheet(DrawList* out) const;
  void draw_sun(const ModelSet& models, DrawList* out) const;
  void draw_rim(DrawList* out) const;

  // State that has an effect on what comes.
  burning::SheetGrid grid_;
  Controls controls_;
  burning::Sheet sheet_;
  burning::Strokes strokes_;
  std::uint64_t tick_ = 0, seed_ = 1;
  int covered_ticks_ = 0;  // the lens stays covered so much longer
  bool act_held_ = false, seated_ = false;
  GameDifficulty difficulty_ = GameDifficulty::normal;

  // What follows from it, and what is only seen or heard.
  PlayingField field_;
  bool colour_blind_safe_ = true;
  burning::RayBundle bundle_;
  burning::LightOnSheet light_;
  burning::Particles particles_;
  std::vector<GameSound> sounds_;
  std::optional<RigidTransform> camera_from_plane_;
  bool covered_ = false;
  int first_burn_ = -1;                  // the cell that charred first, of those that are still charred
  std::vector<float> gathered_, shown_;  // light of the last ticks, and its mean as it is drawn
  burning::SheetBox gathered_box_, shown_box_;
  std::uint64_t shown_version_ = 0;

  // Pictures are made when they are drawn, at most at the rate of shown_version_.
  struct Pictures {
    burning::BurnPicture burn;
    burning::SheetBox stale;  // cells of it that are out of date
    std::uint64_t version = 0;
    std::shared_ptr<const Mesh> burn_mesh, light_mesh;
  };
  mutable Pictures pictures_;
};

}  // namespace parallax
