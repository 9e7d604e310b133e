#include "core/graph_file.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "core/error.h"

namespace parallax {
namespace {

const char* kPlanar =
    "# two poses\nVERTEX_SE2 0 0 0 0\r\nVERTEX_SE2 7 1.5 -2 0.25\n\nFIX 0\n"
    "EDGE_SE2 0 7 1.5 -2 0.25 10 1 2 20 3 30\n";
const char* kSpatial =
    "VERTEX_SE3:QUAT 3 1 2 3 0 0 0 2\n"
    "EDGE_SE3:QUAT 3 4 1 2 3 0.5 0.5 0.5 0.5 10 1 0 0 0 0 11 0 0 0 0 12 0 0 2 13 0 0 14 0 15\n";

std::string message_of(const std::string& text) {
  try {
    parse_graph(text, "bad.g2o");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(GraphFile, ReadsPlanarGraphs) {
  const GraphFile g = parse_graph(kPlanar, "small");
  EXPECT_TRUE(g.planar);
  ASSERT_EQ(g.vertices.size(), 2u);
  EXPECT_EQ(g.vertices[1].id, 7);
  EXPECT_EQ(g.vertices[1].frame_from_vertex.t, Eigen::Vector3d(1.5, -2, 0));
  EXPECT_NEAR(log_so3(g.vertices[1].frame_from_vertex.R).z(), 0.25, 1e-15);
  ASSERT_EQ(g.fixed, std::vector<std::int64_t>{0});
  ASSERT_EQ(g.edges.size(), 1u);
  EXPECT_EQ(g.edges[0].from, 0);
  EXPECT_EQ(g.edges[0].to, 7);
  const Matrix6d& m = g.edges[0].information;
  EXPECT_EQ(m(0, 0), 10);
  EXPECT_EQ(m(0, 1), 1);
  EXPECT_EQ(m(5, 0), 2);
  EXPECT_EQ(m(1, 5), 3);
  EXPECT_EQ(m(5, 5), 30);
  EXPECT_EQ(m.block(2, 0, 3, 6).norm(), 0);
}

TEST(GraphFile, ReadsSpatialGraphs) {
  const GraphFile g = parse_graph(kSpatial, "small");
  EXPECT_FALSE(g.planar);
  EXPECT_TRUE(g.vertices[0].frame_from_vertex.R.isIdentity(1e-15));  // quaternions are made unit
  // A third of a turn about (1, 1, 1): x goes to y.
  EXPECT_LT((g.edges[0].from_from_to.R * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  EXPECT_EQ(g.edges[0].information(0, 1), 1);
  EXPECT_EQ(g.edges[0].information(2, 5), 2);
  EXPECT_EQ(g.edges[0].information(5, 2), 2);
  EXPECT_EQ(g.edges[0].information.diagonal(), (Vector6d() << 10, 11, 12, 13, 14, 15).finished());
}

TEST(GraphFile, WritesWhatItReads) {
  for (const char* text : {kPlanar, kSpatial}) {
    const GraphFile g = parse_graph(text, "small"), again = parse_graph(format_graph(g), "again");
    EXPECT_EQ(again.planar, g.planar);
    EXPECT_EQ(again.fixed, g.fixed);
    ASSERT_EQ(again.vertices.size(), g.vertices.size());
    for (std::size_t i = 0; i < g.vertices.size(); ++i) {
      EXPECT_EQ(again.vertices[i].id, g.vertices[i].id);
      EXPECT_TRUE(again.vertices[i].frame_from_vertex.R.isApprox(g.vertices[i].frame_from_vertex.R, 1e-14));
      EXPECT_EQ(again.vertices[i].frame_from_vertex.t, g.vertices[i].frame_from_vertex.t);
    }
    ASSERT_EQ(again.edges.size(), 1u);
    EXPECT_EQ(again.edges[0].information, g.edges[0].information);
    EXPECT_TRUE(again.edges[0].from_from_to.R.isApprox(g.edges[0].from_from_to.R, 1e-14));
  }
  const std::string path = (std::filesystem::temp_directory_path() / "parallax_graph_file_test.g2o").string();
  write_graph_file(path, parse_graph(kSpatial, "small"));
  EXPECT_EQ(read_graph_file(path).edges.size(), 1u);
  std::filesystem::remove(path);
  EXPECT_THROW(read_graph_file(path), InputError);
}

TEST(GraphFile, NamesTheLineOfWhatIsWrong) {
  const auto says = [](const std::string& text, const std::string& expected) {
    const std::string message = message_of(text);
    EXPECT_NE(message.find(expected), std::string::npos) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  };
  says("\nVERTEX_SE4 1", "bad.g2o: line 2: found");
  says("VERTEX_SE2 0 0 0", "line 1: found 3 numbers, expected 4");
  says("VERTEX_SE2 0 0 0 nan", "expected a number");
  says("VERTEX_SE2 -1 0 0 0", "expected the number of a vertex");
  says("VERTEX_SE2 1 0 0 0\nVERTEX_SE2 1 0 0 0", "line 2: found vertex 1 a second time");
  says("VERTEX_SE2 1 0 0 0\nVERTEX_SE3:QUAT 2 0 0 0 0 0 0 1", "not of both");
  says("VERTEX_SE3:QUAT 2 0 0 0 0 0 0 0", "quaternion of length");
  says("EDGE_SE2 1 1 0 0 0 1 0 0 1 0 1", "to itself");
  says("EDGE_SE2 1 2 0 0 0 1 2 0 1 0 1", "positive definite");
  says("EDGE_SE2 1 2 0 0 0 1 0 0 1 0 -1", "positive definite");
  says("FIX 3", "line 1: found vertex 3");
  says("FIX", "expected 1");
  // Every truncation of an edge's line.
  const std::string text = std::string(kSpatial).substr(std::string(kSpatial).find("EDGE"));
  for (std::size_t n = 1; n + 3 < text.size(); ++n) EXPECT_FALSE(message_of(text.substr(0, n)).empty()) << n;
}

}  // namespace
}  // namespace parallax
