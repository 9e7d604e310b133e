#include "mapper/normal_estimation.h"

namespace parallax {

int estimate_normals(SharedMap* map, const CameraModel& camera, std::stop_token stop) {
  (void)map;
  (void)camera;
  (void)stop;
  return 0;
}

}  // namespace parallax
