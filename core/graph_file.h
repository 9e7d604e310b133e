// Pose graphs in g2o's text form: VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, a line each; blank
// lines and lines that start with # are passed over. A file is of 2D poses or of 3D poses, not both. Plain values;
// throws InputError that names the file and the line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/se3.h"

namespace parallax {

struct GraphVertex {
  std::int64_t id = 0;
  RigidTransform frame_from_vertex;
};

struct GraphEdge {
  std::int64_t from = 0, to = 0;
  RigidTransform from_from_to;
  // Of a right increment of from_from_to (translation, rotation), as the file has it. g2o takes the rotation's part for
  // twice the vector of a quaternion or for the vector itself, by who wrote the file; it is not interpreted here. A 2D
  // edge has its numbers in rows 0, 1 and 5 (x, y, angle) and zeros in the others.
  Matrix6d information = Matrix6d::Zero();
};

struct GraphFile {
  bool planar = false;                // 2D: poses turn about z and stay at z = 0
  std::vector<GraphVertex> vertices;  // in the order of the file; may be none, or not all that edges name
  std::vector<GraphEdge> edges;       // between different vertices, information positive definite
  std::vector<std::int64_t> fixed;
};

GraphFile parse_graph(std::string_view text, const std::string& name);
std::string format_graph(const GraphFile& graph);

GraphFile read_graph_file(const std::string& path);
void write_graph_file(const std::string& path, const GraphFile& graph);

}  // namespace parallax
