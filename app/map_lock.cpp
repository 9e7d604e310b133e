#include "app/map_lock.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <utility>

namespace parallax {
namespace {

std::string lock_path(const std::string& map_path) {
  const std::filesystem::path map(map_path);
  return (map.parent_path() / ".locks" / (map.filename().string() + ".lock")).string();
}

// The whole file, for one owner alone. Of the open file: two parts of one program keep each other out as two programs
// do.
struct flock whole_file() {
  struct flock out {};
  out.l_type = F_WRLCK;
  out.l_whence = SEEK_SET;
  return out;
}

}  // namespace

std::unique_ptr<MapLock> MapLock::try_take(const std::string& map_path) {
  const std::string path = lock_path(map_path);
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  for (;;) {
    const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (file < 0) return nullptr;
    struct flock lock = whole_file();
    if (fcntl(file, F_OFD_SETLK, &lock) != 0) {
      close(file);
      return nullptr;
    }
    // Whoever had it may have removed the file between our two calls: then it is another one's name now.
    struct stat opened {
    }, named{};
    if (fstat(file, &opened) == 0 && stat(path.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
        opened.st_dev == named.st_dev)
      return std::unique_ptr<MapLock>(new MapLock(file, path));  // its constructor is private
    close(file);
  }
}

bool MapLock::is_taken(const std::string& map_path) {
  const int file = open(lock_path(map_path).c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  // Asked, not taken: whoever wants it at this moment gets it.
  struct flock lock = whole_file();
  const bool taken = fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
  close(file);
  return taken;
}

MapLock::~MapLock() {
  unlink(path_.c_str());
  close(file_);
}

}  // namespace parallax
