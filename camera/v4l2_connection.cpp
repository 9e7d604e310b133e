#include "camera/v4l2_connection.h"

#include <algorithm>

#include "camera/image_file.h"

namespace parallax {
namespace {

// Device nodes in the order in which they are tried. Cameras of the identity looked for come first, whatever their
// node.
std::vector<std::string> candidates(const std::shared_ptr<V4l2System>& system, const std::string& path,
                                    const std::string& identity) {
  std::vector<std::string> same, others;
  for (const auto& node : system->device_paths()) {
    bool is_same = false;
    try {
      is_same = V4l2Device(system, node).identity() == identity;
    } catch (const NotACaptureDevice&) {
      continue;
    } catch (const InputError&) {
      // Tried all the same: opening it says what is wrong.
    }
    if (is_same) {
      same.push_back(node);
    } else if (path.empty() || node == path) {
      others.push_back(node);
    }
  }
  same.insert(same.end(), others.begin(), others.end());
  return same;
}

}  // namespace

std::shared_ptr<V4l2Connection> reconnect_v4l2(const std::shared_ptr<V4l2System>& system, const std::string& path,
                                               const std::string& identity, const LiveCameraOptions& options,
                                               std::string* problem) {
  problem->clear();
  for (const auto& node : candidates(system, path, identity)) {
    try {
      auto connection = std::make_shared<V4l2Connection>(system, node, options);
      if (connection->mode.width == options.width && connection->mode.height == options.height) return connection;
      *problem = connection->device->source() + " offers no pictures of " +
                 to_string(ImageSize{options.width, options.height}) + ", as the camera before it";
    } catch (const InputError& error) {
      *problem = error.what();
    }
  }
  return nullptr;
}

std::shared_ptr<V4l2Connection> connect_first_v4l2(const std::shared_ptr<V4l2System>& system,
                                                   const LiveCameraOptions& options) {
  std::string problem;
  for (const auto& node : system->device_paths()) {
    try {
      return std::make_shared<V4l2Connection>(system, node, options);
    } catch (const NotACaptureDevice&) {
      continue;
    } catch (const InputError& error) {
      if (problem.empty()) problem = error.what();
    }
  }
  throw InputError(problem.empty() ? "v4l2: no camera found: plug one in, or use synthetic:desk" : problem);
}

}  // namespace parallax
