#include "core/graph_file.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>
#include <unordered_set>

#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

enum class Kind { none, planar, spatial };

// One line's fields, numbers of which are asked for one by one.
class GraphLine {
 public:
  GraphLine(const std::string& name, int number, const std::vector<std::string_view>& fields)
      : name_(name), number_(number), fields_(fields) {}

  [[noreturn]] void refuse(const std::string& found, const std::string& expected) const {
    throw InputError(name_ + ": line " + std::to_string(number_) + ": found " + found + ", expected " + expected);
  }
  void expect(std::size_t numbers, const std::string& what) const {
    if (fields_.size() != numbers + 1)
      refuse(std::to_string(fields_.size() - 1) + " numbers", std::to_string(numbers) + ": " + what);
  }
  std::int64_t id() {
    std::int64_t value = 0;
    if (!parse_number(fields_[next_], &value) || value < 0) refuse(in_quotes(fields_[next_]), "the number of a vertex");
    ++next_;
    return value;
  }
  double number() {
    double value = 0;
    // Squares of what is read have to be numbers, too.
    constexpr double kLargest = 1e100;
    if (!parse_number(fields_[next_], &value) || std::abs(value) > kLargest)
      refuse(in_quotes(fields_[next_]), "a number");
    ++next_;
    return value;
  }
  RigidTransform planar() {
    const double x = number(), y = number(), angle = number();
    return {exp_so3(Eigen::Vector3d(0, 0, std::remainder(angle, 2 * std::numbers::pi))), Eigen::Vector3d(x, y, 0)};
  }
  RigidTransform spatial() {
    const double x = number(), y = number(), z = number();
    const double qx = number(), qy = number(), qz = number(), qw = number();
    const Eigen::Quaterniond q(qw, qx, qy, qz);
    if (!(q.norm() > 1e-6) || q.norm() > 1e6)
      refuse("a quaternion of length " + std::to_string(q.norm()), "one of length 1");
    return {q, Eigen::Vector3d(x, y, z)};
  }
  // The upper triangle by rows; rows (and columns) of the result it is for.
  Matrix6d information(std::span<const int> rows) {
    const int n = static_cast<int>(rows.size());
    Eigen::MatrixXd m(n, n);
    for (int i = 0; i < n; ++i)
      for (int j = i; j < n; ++j) m(i, j) = m(j, i) = number();
    if (Eigen::LLT<Eigen::MatrixXd>(m).info() != Eigen::Success)
      refuse("an information matrix that is not positive definite", "a positive definite one");
    Matrix6d all = Matrix6d::Zero();
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) all(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]) = m(i, j);
    return all;
  }

 private:
  const std::string& name_;
  int number_;
  const std::vector<std::string_view>& fields_;
  std::size_t next_ = 1;
};

constexpr std::array<int, 3> kPlanarRows{0, 1, 5};
constexpr std::array<int, 6> kSpatialRows{0, 1, 2, 3, 4, 5};

void add(std::string* out, double value) {
  char text[40];
  std::snprintf(text, sizeof text, " %.17g", value);
  *out += text;
}

void add(std::string* out, const RigidTransform& T, bool planar) {
  add(out, T.t.x());
  add(out, T.t.y());
  if (planar) {
    add(out, std::atan2(T.R(1, 0), T.R(0, 0)));
    return;
  }
  add(out, T.t.z());
  const Eigen::Quaterniond q = T.quaternion();
  for (int k = 0; k < 4; ++k) add(out, q.coeffs()[k]);
}

}  // namespace

GraphFile parse_graph(std::string_view text, const std::string& name) {
  GraphFile graph;
  Kind kind = Kind::none;
  std::unordered_set<std::int64_t> known, named;
  std::vector<std::pair<std::int64_t, int>> fixed;  // with the line
  LineReader reader(text);
  std::string_view line;
  std::vector<std::string_view> fields;
  while (reader.next(&line)) {
    if (line.empty() || line.front() == '#') continue;
    split_blanks(line, &fields);
    GraphLine l(name, reader.number(), fields);
    const auto is = [&](Kind k) {
      if (kind != Kind::none && kind != k) l.refuse(in_quotes(fields[0]), "a graph of 2D or of 3D poses, not of both");
      kind = k;
    };
    const auto add_vertex = [&](const GraphVertex& v) {
      if (!known.insert(v.id).second) l.refuse("vertex " + std::to_string(v.id) + " a second time", "each vertex once");
      graph.vertices.push_back(v);
    };
    const auto add_edge = [&](const GraphEdge& e) {
      if (e.from == e.to) l.refuse("an edge from vertex " + std::to_string(e.from) + " to itself", "two vertices");
      named.insert(e.from);
      named.insert(e.to);
      graph.edges.push_back(e);
    };
    if (fields[0] == "VERTEX_SE2") {
      is(Kind::planar);
      l.expect(4, "id x y angle");
      const std::int64_t id = l.id();
      add_vertex({id, l.planar()});
    } else if (fields[0] == "VERTEX_SE3:QUAT") {
      is(Kind::spatial);
      l.expect(8, "id x y z qx qy qz qw");
      const std::int64_t id = l.id();
      add_vertex({id, l.spatial()});
    } else if (fields[0] == "EDGE_SE2") {
      is(Kind::planar);
      l.expect(11, "two ids, x y angle, and the upper triangle of a 3x3 matrix");
      GraphEdge e;
      e.from = l.id();
      e.to = l.id();
      e.from_from_to = l.planar();
      e.information = l.information(kPlanarRows);
      add_edge(e);
    } else if (fields[0] == "EDGE_SE3:QUAT") {
      is(Kind::spatial);
      l.expect(30, "two ids, x y z qx qy qz qw, and the upper triangle of a 6x6 matrix");
      GraphEdge e;
      e.from = l.id();
      e.to = l.id();
      e.from_from_to = l.spatial();
      e.information = l.information(kSpatialRows);
      add_edge(e);
    } else if (fields[0] == "FIX") {
      if (fields.size() < 2) l.expect(1, "the number of a vertex");
      for (std::size_t i = 1; i < fields.size(); ++i) fixed.emplace_back(l.id(), reader.number());
    } else {
      l.refuse(in_quotes(fields[0]), "VERTEX_SE2, EDGE_SE2, VERTEX_SE3:QUAT, EDGE_SE3:QUAT or FIX");
    }
  }
  for (const auto& [id, number] : fixed) {
    if (known.count(id) == 0 && named.count(id) == 0)
      throw InputError(name + ": line " + std::to_string(number) + ": found vertex " + std::to_string(id) +
                       ", expected one that the file has");
    graph.fixed.push_back(id);
  }
  graph.planar = kind == Kind::planar;
  return graph;
}

std::string format_graph(const GraphFile& graph) {
  std::string out;
  const bool planar = graph.planar;
  for (const GraphVertex& v : graph.vertices) {
    out += (planar ? "VERTEX_SE2 " : "VERTEX_SE3:QUAT ") + std::to_string(v.id);
    add(&out, v.frame_from_vertex, planar);
    out += '\n';
  }
  for (const std::int64_t id : graph.fixed) out += "FIX " + std::to_string(id) + "\n";
  const std::span<const int> rows = planar ? std::span<const int>(kPlanarRows) : std::span<const int>(kSpatialRows);
  for (const GraphEdge& e : graph.edges) {
    out += (planar ? "EDGE_SE2 " : "EDGE_SE3:QUAT ") + std::to_string(e.from) + " " + std::to_string(e.to);
    add(&out, e.from_from_to, planar);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t j = i; j < rows.size(); ++j) add(&out, e.information(rows[i], rows[j]));
    out += '\n';
  }
  return out;
}

GraphFile read_graph_file(const std::string& path) { return parse_graph(read_text_file(path), path); }

void write_graph_file(const std::string& path, const GraphFile& graph) {
  const std::string text = format_graph(graph);
  write_file_atomically(path, [&](std::ostream& out) { out << text; });
}

}  // namespace parallax
