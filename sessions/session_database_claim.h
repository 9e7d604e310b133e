// Who writes to a session database: a lock that the system gives back when its owner ends, however it ends. Internal to
// session_database*.cpp.
//
// The lock is on a file beside the database, PATH.writer, which goes with its owner; one that a killed program left
// behind is taken over.
#pragma once

#include <string>

namespace parallax {

class SessionDatabaseClaim {
 public:
  // Throws InputError when another has it (another program, or another part of this one), RunError when the file
  // beside cannot be made.
  explicit SessionDatabaseClaim(const std::string& database_path);
  ~SessionDatabaseClaim();
  SessionDatabaseClaim(const SessionDatabaseClaim&) = delete;
  SessionDatabaseClaim& operator=(const SessionDatabaseClaim&) = delete;

 private:
  std::string path_;  // of the lock
  int file_ = -1;
};

}  // namespace parallax
