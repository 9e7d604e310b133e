// What maps of a library were merged from, so that it can be undone: both maps lie in the trash as they were right
// before, and a note beside them says which they are. Undone within MapLibrary::kTrashDays, the two are back byte for
// byte, the merged one is in the trash, and the two are not merged by themselves again.
//
// Stateless, as MapLibrary. Safe from any thread. What the disk refuses is a RunError; what cannot be undone is an
// InputError that names it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/map_library.h"

namespace parallax {

// Paths, in the trash or not: the map that was gone on with, and the one that was met.
struct MergedPair {
  std::string base, other;
};

// Moves the two to the trash and notes that `merged` was made of them. Both are in no other program's use; `other` is
// locked (app/map_lock) by the caller.
void note_merge(const MapLibrary& library, const std::string& merged, const MergedPair& pair);
// Where the two lie: in the trash, or still beside the merged map when the program ended between; nothing when it
// cannot be undone (any more).
std::optional<MergedPair> merged_pair(const std::string& merged);

struct UndoneMerge {
  MergedPair pair;      // where they are again
  std::string trashed;  // the merged map
};
// `own`: the merged map is in this program's use.
UndoneMerge undo_merge(const MapLibrary& library, const std::string& merged, bool own = false);

// Whether the user has undone the merge of the two.
bool are_kept_apart(const MapLibrary& library, const MergedPair& pair);

// What MapDocument::merged_from says of a map that is merged: what it was merged from itself, or a line about the file.
std::vector<std::string> merge_origin(const std::string& path, const MapDocument& document);

}  // namespace parallax
