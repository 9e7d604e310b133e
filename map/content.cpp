#include "map/content.h"

#include <algorithm>
#include <utility>

#include "core/check.h"

namespace parallax {
namespace {

// Closer to parallel than this (sine of the angle) a direction says nothing about the turn about the normal.
constexpr double kParallel = 1e-3;

}  // namespace

RigidTransform frame_on_surface(const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                                const Eigen::Vector3d& forward) {
  PARALLAX_CHECK(position.allFinite() && normal.allFinite() && normal.norm() > 0, "a surface needs a normal");
  const Eigen::Vector3d z = normal.normalized();
  Eigen::Vector3d x = forward - z * z.dot(forward);
  if (!(x.norm() > kParallel * forward.norm())) {
    const Eigen::Vector3d other = std::abs(z.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    x = other - z * z.dot(other);
  }
  x.normalize();
  RigidTransform out;
  out.R.col(0) = x;
  out.R.col(1) = z.cross(x);
  out.R.col(2) = z;
  out.t = position;
  return out;
}

void Content::follow(const TrackingSnapshot& map) { follow(map.map_version, map.world()); }

void Content::follow(std::uint64_t map_version, const WorldState& world) {
  world_ = world;
  if (map_version != map_version_) {
    std::vector<Anchored> all = std::move(parked_);
    all.insert(all.end(), std::make_move_iterator(anchored_.begin()), std::make_move_iterator(anchored_.end()));
    std::sort(all.begin(), all.end(), [](const Anchored& a, const Anchored& b) { return a.item.id < b.item.id; });
    anchored_.clear();
    parked_.clear();
    for (Anchored& a : all) (a.map_version == map_version ? anchored_ : parked_).push_back(std::move(a));
    map_version_ = map_version;
    seen_from_ = KeyframeId();
  }
  items_.clear();
  for (Anchored& a : anchored_) {
    for (; a.warps < world_.warps.size(); ++a.warps)
      a.first_from_item = world_.warps[a.warps]->at(a.first_from_item.t, a.item.seen_from) * a.first_from_item;
    a.item.world_from_item = world_.world_from_first * a.first_from_item;
    items_.push_back(a.item);
  }
}

int Content::add(ContentItem item) {
  PARALLAX_CHECK(item.world_from_item.t.allFinite() && item.world_from_item.R.allFinite() &&
                     item.end_in_item.allFinite() && item.size_m > 0,
                 "content is placed somewhere and has a size");
  item.id = next_id_++;
  anchored_.push_back(
      {map_version_, item, world_.world_from_first.inverse() * item.world_from_item, world_.warps.size()});
  items_.push_back(std::move(item));
  return items_.back().id;
}

int Content::add_label(std::string text, const Eigen::Vector3d& position, const Eigen::Vector3d& normal) {
  ContentItem item;
  item.kind = ContentKind::label;
  item.text = std::move(text);
  item.world_from_item = SimilarityTransform(frame_on_surface(position, normal));
  item.seen_from = seen_from_;
  return add(std::move(item));
}

int Content::add_model(std::string name, const RigidTransform& world_from_item, double size_m) {
  ContentItem item;
  item.kind = ContentKind::model;
  item.text = std::move(name);
  item.world_from_item = SimilarityTransform(world_from_item);
  item.size_m = size_m;
  item.seen_from = seen_from_;
  return add(std::move(item));
}

int Content::add_line(const Eigen::Vector3d& from, const Eigen::Vector3d& to, std::string text) {
  ContentItem item;
  item.kind = ContentKind::line;
  item.text = std::move(text);
  item.world_from_item.t = from;
  item.end_in_item = to - from;
  item.seen_from = seen_from_;
  return add(std::move(item));
}

void Content::restore(const std::vector<ContentItem>& saved) {
  for (const ContentItem& item : saved) {
    const bool taken = item.id < next_id_;
    if (!taken) next_id_ = item.id;
    add(item);
  }
}

Content::Anchored* Content::anchored(int id) {
  const auto it = std::find_if(anchored_.begin(), anchored_.end(), [id](const Anchored& a) { return a.item.id == id; });
  return it == anchored_.end() ? nullptr : &*it;
}

void Content::place(Anchored* entry) {
  PARALLAX_CHECK(entry->item.world_from_item.t.allFinite() && entry->item.world_from_item.R.allFinite(),
                 "content is placed somewhere");
  entry->first_from_item = world_.world_from_first.inverse() * entry->item.world_from_item;
  entry->warps = world_.warps.size();
  items_[static_cast<std::size_t>(entry - anchored_.data())] = entry->item;
}

bool Content::move(int id, const RigidTransform& world_from_item) {
  Anchored* entry = anchored(id);
  if (entry == nullptr) return false;
  entry->item.world_from_item.R = world_from_item.R;
  entry->item.world_from_item.t = world_from_item.t;
  entry->item.seen_from = seen_from_;
  place(entry);
  return true;
}

bool Content::move(int id, const Eigen::Vector3d& position) {
  Anchored* entry = anchored(id);
  if (entry == nullptr) return false;
  entry->item.world_from_item.t = position;
  entry->item.seen_from = seen_from_;
  place(entry);
  return true;
}

bool Content::resize(int id, double size_m) {
  PARALLAX_CHECK(size_m > 0, "a model has a size");
  Anchored* entry = anchored(id);
  if (entry == nullptr || entry->item.kind != ContentKind::model) return false;
  entry->item.size_m = size_m;
  place(entry);
  return true;
}

bool Content::rename(int id, std::string text) {
  Anchored* entry = anchored(id);
  if (entry == nullptr) return false;
  entry->item.text = std::move(text);
  place(entry);
  return true;
}

bool Content::erase(int id) {
  Anchored* entry = anchored(id);
  if (entry == nullptr) return false;
  const auto row = entry - anchored_.data();
  anchored_.erase(anchored_.begin() + row);
  items_.erase(items_.begin() + row);
  return true;
}

void Content::clear() {
  anchored_.clear();
  items_.clear();
}

void Content::clear_parked() { parked_.clear(); }

const ContentItem* Content::find(int id) const {
  const auto it = std::find_if(items_.begin(), items_.end(), [id](const ContentItem& item) { return item.id == id; });
  return it == items_.end() ? nullptr : &*it;
}

}  // namespace parallax
