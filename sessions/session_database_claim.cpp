#include "sessions/session_database_claim.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "core/error.h"

namespace parallax {
namespace {

// The same file under another name has the same lock.
std::string lock_path(const std::string& database_path) {
  std::error_code error;
  const std::filesystem::path whole = std::filesystem::weakly_canonical(database_path, error);
  return (error ? database_path : whole.string()) + ".writer";
}

}  // namespace

SessionDatabaseClaim::SessionDatabaseClaim(const std::string& database_path) : path_(lock_path(database_path)) {
  for (;;) {
    const int file = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (file < 0) throw RunError(database_path + ": cannot be written: " + path_ + ": " + std::strerror(errno));
    if (flock(file, LOCK_EX | LOCK_NB) != 0) {
      close(file);
      throw InputError(database_path + ": found another program that writes to it, expected to be the only one");
    }
    // Whoever had it may have removed the file between our two calls: then it is another one's name now.
    struct stat opened {
    }, named{};
    if (fstat(file, &opened) == 0 && stat(path_.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
        opened.st_dev == named.st_dev) {
      file_ = file;
      return;
    }
    close(file);
  }
}

SessionDatabaseClaim::~SessionDatabaseClaim() {
  unlink(path_.c_str());
  close(file_);
}

}  // namespace parallax
