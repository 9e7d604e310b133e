#include "app/live_maps.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <utility>

#include "app/map_merge_record.h"
#include "core/error.h"

namespace parallax {
namespace {

// The list is read again so often while it is open: the session and other programs save.
constexpr std::chrono::seconds kListReread{3};
constexpr int kCardPicture_px = 240;

std::vector<MapCard> read_cards(const MapLibrary& library, const CameraModel& lens, const std::string& current) {
  std::vector<MapCard> cards;
  for (LibraryMap& map : library.list()) {
    MapCard card;
    card.current = map.path == current;
    card.fits = map.fits(lens);
    card.merged = map.info.merged_from.size() > 1 && merged_pair(map.path).has_value();
    try {
      if (map.problem.empty()) card.picture = read_map_picture(map.path, kCardPicture_px);
    } catch (const std::exception&) {
      // Shown without one.
    }
    card.map = std::move(map);
    cards.push_back(std::move(card));
  }
  return cards;
}

}  // namespace

void LiveMaps::toggle(const LiveEngine& engine) {
  if (panel_.is_open()) return panel_.close();
  panel_.open();
  refresh(engine);
}

void LiveMaps::refresh(const LiveEngine& engine) {
  if (!engine.library() || engine.session() == nullptr) return;
  if (reading_.valid()) {
    stale_ = true;
    return;
  }
  stale_ = false;
  reading_ = std::async(std::launch::async, [library = engine.library(), lens = engine.lens(),
                                             current = engine.saver() ? engine.saver()->path() : std::string()] {
    return read_cards(*library, lens, current);
  });
}

bool LiveMaps::takes(int key, int modifiers, LiveEngine* engine, LiveState* state) {
  if (!panel_.is_open()) return false;
  static constexpr std::pair<int, MapsKey> kKeys[] = {
      {GLFW_KEY_LEFT, MapsKey::left}, {GLFW_KEY_RIGHT, MapsKey::right}, {GLFW_KEY_UP, MapsKey::up},
      {GLFW_KEY_DOWN, MapsKey::down}, {GLFW_KEY_ENTER, MapsKey::go},    {GLFW_KEY_KP_ENTER, MapsKey::go},
      {GLFW_KEY_N, MapsKey::rename},  {GLFW_KEY_K, MapsKey::lock},      {GLFW_KEY_DELETE, MapsKey::remove},
      {GLFW_KEY_U, MapsKey::undo},    {GLFW_KEY_S, MapsKey::separate},  {GLFW_KEY_ESCAPE, MapsKey::close}};
  if (modifiers != 0) return false;
  for (const auto& [code, meaning] : kKeys) {
    if (code != key) continue;
    carry_out(panel_.press(meaning), engine, state);
    return true;
  }
  return false;
}

void LiveMaps::draw(const MakeMapPicture& picture, LiveEngine* engine, LiveState* state) {
  if (!panel_.is_open()) return;
  if (reading_.valid() && reading_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    panel_.set_cards(reading_.get());
    read_ = SteadyClock::now();
    if (stale_) refresh(*engine);
  } else if (!reading_.valid() && SteadyClock::now() - read_ > kListReread) {
    refresh(*engine);
  }
  panel_.set_undos(trashed_.size());
  std::string note;
  if (!engine->library()) note = "Maps are not kept by themselves: --map or the settings say so.";
  carry_out(draw_maps_panel(picture, note, &panel_), engine, state);
}

void LiveMaps::carry_out(const MapsChoice& choice, LiveEngine* engine, LiveState* state) {
  using Kind = MapsChoice::Kind;
  if (choice.kind == Kind::none || choice.kind == Kind::close || !engine->library()) return;
  const MapLibrary& library = *engine->library();
  try {
    if (choice.kind == Kind::undo) {
      const std::string trashed = trashed_.back();
      trashed_.pop_back();
      library.restore(trashed);
      return refresh(*engine);
    }
    const MapCard& card = panel_.cards()[choice.card];
    const bool current = engine->saver() != nullptr && card.map.path == engine->saver()->path();
    if (choice.kind == Kind::rename) {
      renaming_ = card.map.path;
      state->task = Task::name_map;
      state->text.fill(0);
      card.map.name.copy(state->text.data(), state->text.size() - 1);
      state->focus_text = true;
      return;
    }
    if (current || choice.kind == Kind::go) {
      if (engine->maps() == nullptr) throw RunError("while a session is recorded its map stays as it is");
      if (choice.kind == Kind::go) {
        engine->maps()->go_to(card.map.path);
        panel_.close();
      }
      if (choice.kind == Kind::remove) engine->maps()->forget_map();
      if (choice.kind == Kind::separate) engine->maps()->separate(card.map.path);
      if (choice.kind == Kind::lock || choice.kind == Kind::unlock)
        engine->maps()->set_locked(choice.kind == Kind::lock);
    } else {
      if (choice.kind == Kind::remove) trashed_.push_back(library.remove(card.map.path));
      if (choice.kind == Kind::separate) undo_merge(library, card.map.path);
      if (choice.kind == Kind::lock || choice.kind == Kind::unlock)
        MapLibrary::set_locked(card.map.path, choice.kind == Kind::lock);
    }
  } catch (const std::exception& e) {
    state->toasts.add(e.what(), true);
  }
  refresh(*engine);
}

void LiveMaps::rename(const std::string& name, LiveEngine* engine, LiveState* state) {
  const std::string path = std::exchange(renaming_, {});
  if (path.empty() || !engine->library()) return;
  try {
    if (engine->saver() != nullptr && path == engine->saver()->path()) {
      engine->saver()->set_name(clean_map_name(name));
      engine->saver()->save_soon();
    } else {
      engine->library()->rename(path, name);
    }
  } catch (const std::exception& e) {
    state->toasts.add(e.what(), true);
  }
  read_ = SteadyClock::now() - kListReread + std::chrono::milliseconds(500);  // once it is saved
}

}  // namespace parallax
