// Identifiers of what a map holds. They order by age and are never reused within one map; after a reset they start
// again from 0, which is what TrackingSnapshot::map_version tells apart.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>

namespace parallax {

template <class Tag>
struct Identifier {
  std::int32_t session = 0;
  std::int32_t index = -1;
  auto operator<=>(const Identifier&) const = default;
  bool valid() const { return index >= 0; }
};

using KeyframeId = Identifier<struct KeyframeTag>;
using PointId = Identifier<struct PointTag>;

}  // namespace parallax
