#include "place/crf_model.h"

#include <charconv>
#include <set>
#include <vector>

#include "core/error.h"
#include "core/file_io.h"
#include "core/parse_text.h"

namespace parallax {
namespace {

constexpr char kCrfFirstLine[] = "parallax matching weights 1";
constexpr char kExplained[] = "explained";

// The shortest decimal that reads back to the same double.
std::string shortest(double value) {
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

double* value_of(CrfModel* model, std::string_view graph, std::string_view name) {
  if (graph != "near" && graph != "far") return nullptr;
  CrfGraphModel& of = model->of(graph == "near" ? SceneGraph::near : SceneGraph::far);
  if (name == kExplained) return &of.explained;
  for (std::size_t i = 0; i < kCrfWeightNames.size(); ++i)
    if (name == kCrfWeightNames[i]) return &of.weight[i];
  return nullptr;
}

}  // namespace

std::string CrfModel::text() const {
  std::string out = std::string(kCrfFirstLine) + "\n";
  for (const SceneGraph graph : {SceneGraph::near, SceneGraph::far}) {
    const std::string name = graph == SceneGraph::near ? "near " : "far ";
    const CrfGraphModel& model = of(graph);
    for (std::size_t i = 0; i < kCrfWeightNames.size(); ++i)
      out += name + kCrfWeightNames[i] + " " + shortest(model.weight[i]) + "\n";
    out += name + kExplained + " " + shortest(model.explained) + "\n";
  }
  return out;
}

void CrfModel::save(const std::string& path) const {
  write_file_atomically(path, [&](std::ostream& out) { out << text(); });
}

CrfModel CrfModel::load(const std::string& path) { return parse(read_text_file(path), path); }

CrfModel CrfModel::parse(std::string_view text, const std::string& name) {
  LineReader lines(text);
  std::string_view line;
  const auto fail = [&](const std::string& found, const std::string& expected) -> InputError {
    return InputError(name + ": line " + std::to_string(lines.number()) + ": found " + found + ", expected " +
                      expected);
  };
  if (!lines.next(&line) || line != kCrfFirstLine)
    throw InputError(name + ": line 1: found " + in_quotes(line) + ", expected '" + kCrfFirstLine + "'");
  CrfModel model;
  std::set<const double*> read;
  std::vector<std::string_view> fields;
  while (lines.next(&line)) {
    if (line.empty() || line.front() == '#') continue;
    split_blanks(line, &fields);
    double* value = fields.size() == 3 ? value_of(&model, fields[0], fields[1]) : nullptr;
    if (value == nullptr) throw fail(in_quotes(line), "near or far, the name of a weight, and a number");
    double number = 0;
    if (!parse_number(fields[2], &number)) throw fail(in_quotes(fields[2]), "a number");
    if (fields[1] == kExplained && !(number > 0.5 && number < 1))
      throw fail(in_quotes(fields[2]), "more than 0.5 and less than 1");
    if (!read.insert(value).second) throw fail(in_quotes(line), "each weight once");
    *value = number;
  }
  constexpr std::size_t kValues = 2 * (kCrfWeightNames.size() + 1);
  if (read.size() != kValues)
    throw InputError(name + ": found " + std::to_string(read.size()) + " weights, expected " + std::to_string(kValues));
  return model;
}

}  // namespace parallax
