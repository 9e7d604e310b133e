#include "camera/v4l2_system.h"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "core/error.h"

namespace parallax {
namespace {

class KernelSystem final : public V4l2System {
 public:
  int open(const std::string& path) override {
    const int fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    return fd < 0 ? -errno : fd;
  }

  void close(int fd) override { ::close(fd); }

  int ioctl(int fd, unsigned long request, void* argument) override {
    int result = 0;
    do {
      result = ::ioctl(fd, request, argument);
    } while (result < 0 && errno == EINTR);
    return result < 0 ? -errno : result;
  }

  const void* map(int fd, std::size_t length, off_t offset) override {
    const void* memory = ::mmap(nullptr, length, PROT_READ, MAP_SHARED, fd, offset);
    return memory == MAP_FAILED ? nullptr : memory;
  }

  void unmap(const void* memory, std::size_t length) override { ::munmap(const_cast<void*>(memory), length); }

  int poll(std::span<pollfd> descriptors, std::chrono::milliseconds timeout) override {
    const int result =
        ::poll(descriptors.data(), static_cast<nfds_t>(descriptors.size()), static_cast<int>(timeout.count()));
    if (result >= 0) return result;
    for (auto& descriptor : descriptors) descriptor.revents = 0;
    return errno == EINTR ? 0 : -errno;
  }

  Timestamp now() const override { return SteadyClock::now().time_since_epoch(); }

  std::vector<std::string> device_paths() const override {
    std::vector<std::pair<int, std::string>> found;
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator("/dev", ignored)) {
      const std::string name = entry.path().filename();
      constexpr std::size_t prefix = 5;  // "video"
      if (name.rfind("video", 0) != 0 || name.size() == prefix || name.size() > prefix + 4) continue;
      if (!std::all_of(name.begin() + prefix, name.end(), [](unsigned char c) { return std::isdigit(c) != 0; })) {
        continue;
      }
      found.emplace_back(std::stoi(name.substr(prefix)), entry.path());
    }
    std::sort(found.begin(), found.end());
    std::vector<std::string> paths;
    for (const auto& [number, path] : found) paths.push_back(path);
    return paths;
  }
};

}  // namespace

std::shared_ptr<V4l2System> kernel_v4l2_system() { return std::make_shared<KernelSystem>(); }

WakeEvent::WakeEvent() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (fd_ < 0) throw RunError(std::string("no event descriptor: ") + std::strerror(errno));
}

WakeEvent::~WakeEvent() { ::close(fd_); }

void WakeEvent::signal() {
  const std::uint64_t one = 1;
  // Fails only when it is signalled already.
  if (::write(fd_, &one, sizeof one) < 0) return;
}

}  // namespace parallax
