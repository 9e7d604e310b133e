#include <string>

#include "core/check.h"
#include "sessions/session_database_parts.h"

namespace parallax {

void SessionDatabase::truncate_session(int session, int keyframes) {
  Implementation& self = *implementation_;
  self.in_transaction([&](Implementation::Index* index) {
    PARALLAX_CHECK(index->sessions.count(session) > 0 && keyframes >= 0, "a session of the database is cut");
    const std::string of = " WHERE session = " + std::to_string(session), from = std::to_string(keyframes);
    for (const char* table : {"keyframe", "pose", "feature", "image", "attached_map"})
      self.database.run("DELETE FROM " + std::string(table) + of + " AND keyframe >= " + from);
    self.database.run("DELETE FROM edge" + of + " AND second >= " + from);
    self.database.run("DELETE FROM point" + of + " AND last >= " + from);
    const auto end_of = [&](const char* end) {
      return "(" + std::string(end) + "_session = " + std::to_string(session) + " AND " + end + "_keyframe >= " + from +
             ")";
    };
    const std::string lost = " FROM encounter WHERE " + end_of("found") + " OR " + end_of("query");
    SqliteStatement ids(&self.database, "SELECT id" + lost);
    while (ids.next()) index->encounters.erase(ids.take_integer());
    self.database.run("DELETE" + lost);
    index->keyframes.erase(index->keyframes.lower_bound({session, keyframes}),
                           index->keyframes.lower_bound({session + 1, 0}));
    self.recount(index);
  });
}

}  // namespace parallax
