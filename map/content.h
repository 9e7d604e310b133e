// What the user has placed in the scene: labels, models and measured lines, each anchored to the map. The map's world
// is moved now and then (re-scaled, re-aligned); what is placed follows without a jump, scale included. When the map is
// reset, what was placed on it is parked: it is not shown, and comes back only with the map it belongs to.
//
// A value type of the window's thread; not thread-safe. Frames: world of the map that was last followed, metres of that
// world. An item's own frame has z up, away from the surface it stands on.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/se3.h"
#include "map/tracking_snapshot.h"

namespace parallax {

enum class ContentKind { label, model, line };

struct ContentItem {
  int id = 0;  // never reused
  ContentKind kind = ContentKind::label;
  std::string text;  // label: what it says; model: the name of its shape; line: a remark, may be empty
  // World metres a unit of the item's frame: 1 when it was placed. A model's size is in the item's frame, so it keeps
  // its size on the screen when the scale of the world is changed.
  SimilarityTransform world_from_item;
  double size_m = 0.05;                                   // of a model: its longest side, in the item's frame
  Eigen::Vector3d end_in_item = Eigen::Vector3d::Zero();  // of a line that begins at the item's origin
  // The keyframe that saw the place it was put on: what it follows when a loop is closed. Not known of what was saved.
  KeyframeId seen_from;

  Eigen::Vector3d position() const { return world_from_item.t; }
  Eigen::Vector3d line_end() const { return world_from_item * end_in_item; }
  // Length of a line as the world is scaled now, metres.
  double length_m() const { return world_from_item.s * end_in_item.norm(); }
};

// A frame that stands on a surface: z along the normal, x as near to `forward` as that allows (any direction when
// `forward` is parallel to the normal). The normal need not be a unit vector, but must not be zero.
RigidTransform frame_on_surface(const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                                const Eigen::Vector3d& forward = Eigen::Vector3d::UnitX());

class Content {
 public:
  // Takes everything to the world of this snapshot; call it before anything else with each new snapshot.
  void follow(const TrackingSnapshot& map);
  void follow(std::uint64_t map_version, const WorldState& world);
  void follow(std::uint64_t map_version, const SimilarityTransform& world_from_first) {
    follow(map_version, WorldState{world_from_first, {}});
  }
  // The keyframe that what is placed from now on is seen from (TrackingResult::seen_from).
  void set_seen_from(KeyframeId keyframe) { seen_from_ = keyframe; }

  // Each returns the new item's identifier. Positions are in the world that was last followed; CHECKed to be finite.
  int add_label(std::string text, const Eigen::Vector3d& position, const Eigen::Vector3d& normal);
  int add_model(std::string name, const RigidTransform& world_from_item, double size_m);
  int add_line(const Eigen::Vector3d& from, const Eigen::Vector3d& to, std::string text = {});

  // Puts saved items on the present map, in the world that was last followed. Identifiers are kept where they are free.
  void restore(const std::vector<ContentItem>& saved);

  // Each is false when there is no such item on the present map.
  bool move(int id, const RigidTransform& world_from_item);  // scale is kept
  bool move(int id, const Eigen::Vector3d& position);        // direction is kept
  bool resize(int id, double size_m);                        // of a model; CHECKed positive
  bool rename(int id, std::string text);
  bool erase(int id);
  void clear();         // everything on the present map
  void clear_parked();  // everything on other maps

  // On the present map, in order of age.
  const std::vector<ContentItem>& items() const { return items_; }
  const ContentItem* find(int id) const;
  int parked() const { return static_cast<int>(parked_.size()); }

 private:
  // Stored in the first world of its map, which never moves but for loops that are closed: nothing accumulates.
  struct Anchored {
    std::uint64_t map_version = 0;
    ContentItem item;
    SimilarityTransform first_from_item;
    std::size_t warps = 0;  // closed loops that are in it
  };
  int add(ContentItem item);
  Anchored* anchored(int id);
  void place(Anchored* entry);

  int next_id_ = 1;
  std::uint64_t map_version_ = 0;
  WorldState world_;
  KeyframeId seen_from_;
  std::vector<Anchored> anchored_;  // of the present map, rows as in items_
  std::vector<Anchored> parked_;
  std::vector<ContentItem> items_;
};

}  // namespace parallax
