#include "core/file_io.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <locale>
#include <streambuf>
#include <system_error>

#include "core/error.h"

namespace parallax {
namespace {

std::string reason_of(int error) { return std::generic_category().message(error); }

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd) : fd_(fd) {}
  ~FileDescriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }
  // 0, or the errno of a close that lost data.
  int close() {
    const int result = ::close(fd_);
    fd_ = -1;
    return result == 0 ? 0 : errno;
  }

 private:
  int fd_;
};

// A stream buffer over a file descriptor that remembers why a write failed.
class DescriptorBuffer : public std::streambuf {
 public:
  explicit DescriptorBuffer(int fd) : fd_(fd) { setp(buffer_.data(), buffer_.data() + buffer_.size()); }
  int error() const { return error_; }

 protected:
  int_type overflow(int_type c) override {
    if (!drain()) return traits_type::eof();
    if (!traits_type::eq_int_type(c, traits_type::eof())) {
      *pptr() = traits_type::to_char_type(c);
      pbump(1);
    }
    return traits_type::not_eof(c);
  }
  int sync() override { return drain() ? 0 : -1; }

 private:
  bool drain() {
    if (error_ != 0) return false;
    const char* from = pbase();
    while (from < pptr()) {
      const ssize_t written = ::write(fd_, from, static_cast<std::size_t>(pptr() - from));
      if (written < 0) {
        if (errno == EINTR) continue;
        error_ = errno;
        return false;
      }
      from += written;
    }
    setp(buffer_.data(), buffer_.data() + buffer_.size());
    return true;
  }

  int fd_;
  int error_ = 0;
  std::array<char, 1 << 16> buffer_;
};

RunError write_error(const std::string& path, const std::string& reason) {
  return RunError(path + ": cannot be written: " + reason);
}

// Runs `write` on the descriptor and closes it; throws RunError in the name of `path`.
void write_and_close(FileDescriptor& file, bool regular, const std::string& path,
                     const std::function<void(std::ostream&)>& write) {
  DescriptorBuffer buffer(file.get());
  std::ostream out(&buffer);
  out.imbue(std::locale::classic());
  write(out);
  out.flush();
  if (buffer.error() != 0) throw write_error(path, reason_of(buffer.error()));
  if (!out) throw write_error(path, "the text could not be formed");
  // Disks that are full, or far away, may say so only here.
  if (regular && ::fsync(file.get()) != 0 && errno != EINVAL && errno != ENOTSUP) {
    throw write_error(path, reason_of(errno));
  }
  if (const int error = file.close()) throw write_error(path, reason_of(error));
}

// A new file beside `target`, with the permissions any new file gets.
int create_beside(const std::string& target, std::string* name) {
  static std::atomic<unsigned> counter{0};
  const std::filesystem::path path(target);
  for (int attempt = 0; attempt < 100; ++attempt) {
    // Hidden, and short even when the target's name is as long as names may be.
    const std::string leaf = "." + path.filename().string().substr(0, 200) + "." + std::to_string(::getpid()) + "." +
                             std::to_string(counter.fetch_add(1)) + ".partial";
    *name = (path.parent_path() / leaf).string();
    const int fd = ::open(name->c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
  return -1;
}

// What a name stands for that is to be written to.
struct Output {
  struct stat status {};
  bool exists = false;

  bool is_regular() const { return S_ISREG(status.st_mode); }
  // Behind a symbolic link it is the file that is replaced, not the link.
  std::string target(const std::string& path) const {
    if (!exists) return path;
    std::error_code error;
    const std::filesystem::path real = std::filesystem::canonical(path, error);
    return error ? path : real.string();
  }
};

// Throws for what can never be written.
Output look_at(const std::string& path) {
  if (path.empty()) throw write_error("''", "the name is empty");
  Output out;
  out.exists = ::stat(path.c_str(), &out.status) == 0;
  if (out.exists && S_ISDIR(out.status.st_mode)) throw write_error(path, "it is a folder, expected a file");
  // A file that may not be written is not to be replaced by one that may.
  if (out.exists && out.is_regular() && ::access(path.c_str(), W_OK) != 0) throw write_error(path, reason_of(errno));
  return out;
}

}  // namespace

std::string read_text_file(const std::string& path) {
  const auto fail = [&](const std::string& reason) { return InputError(path + ": cannot be read: " + reason); };
  FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) throw fail(reason_of(errno));
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) throw fail(reason_of(errno));
  if (S_ISDIR(status.st_mode)) throw fail("it is a folder, expected a file");
  std::string text;
  // One more than the size, so that the end is seen without growing.
  std::size_t room =
      S_ISREG(status.st_mode) && status.st_size > 0 ? static_cast<std::size_t>(status.st_size) + 1 : 4096;
  std::size_t size = 0;
  for (;;) {
    try {
      text.resize(room);
    } catch (const std::exception&) {
      throw fail("too large (" + std::to_string(room) + " bytes)");
    }
    const ssize_t got = ::read(file.get(), text.data() + size, room - size);
    if (got < 0) {
      if (errno == EINTR) continue;
      throw fail(reason_of(errno));
    }
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
    if (size == room) room *= 2;
  }
  text.resize(size);
  return text;
}

void write_file_atomically(const std::string& path, const std::function<void(std::ostream&)>& write) {
  const Output output = look_at(path);
  if (output.exists && !output.is_regular()) {
    FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
    if (file.get() < 0) throw write_error(path, reason_of(errno));
    write_and_close(file, false, path, write);
    return;
  }
  const std::string target = output.target(path);
  std::string beside;
  FileDescriptor file(create_beside(target, &beside));
  if (file.get() < 0) throw write_error(path, reason_of(errno));
  try {
    if (output.exists) (void)!::fchmod(file.get(), output.status.st_mode & 07777);
    write_and_close(file, true, path, write);
    if (std::rename(beside.c_str(), target.c_str()) != 0) throw write_error(path, reason_of(errno));
  } catch (...) {
    ::unlink(beside.c_str());
    throw;
  }
}

void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes) {
  write_file_atomically(path, [&](std::ostream& file) {
    file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  });
}

void check_can_be_written(const std::string& path) {
  const Output output = look_at(path);
  if (output.exists && !output.is_regular()) return;
  std::string beside;
  const FileDescriptor file(create_beside(output.target(path), &beside));
  if (file.get() < 0) throw write_error(path, reason_of(errno));
  ::unlink(beside.c_str());
}

}  // namespace parallax
