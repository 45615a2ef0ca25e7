#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <diracstep/scene_format/compiler/operations.hpp>

namespace diracstep::scene_compiler {

namespace {

constexpr long double largest_index = 1e9L;

Place written_at(const SceneProgram& program, Node node) {
  const auto found = program.symbols.places.find(node);
  return found == program.symbols.places.end() ? Place{} : found->second;
}

}  // namespace

Evaluator::Evaluator(const SceneProgram& program, const ParameterValues& parameters, std::vector<Node> roots)
    : program_(program),
      parameters_(parameters),
      nodes_(program.graph.reachable(roots, true)),
      values_(nodes_.size()),
      loops_(program.symbols.loops.size()) {
  for (const Node root : roots) roots_.push_back(at(root));
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (program.graph.known(nodes_[i]) != Known::once) changing_.push_back(i);
}

std::size_t Evaluator::at(Node node) const {
  return static_cast<std::size_t>(std::ranges::lower_bound(nodes_, node) - nodes_.begin());
}

long Evaluator::index(Node node) const {
  const long double value = values_[at(node)];
  if (!(std::abs(value) <= largest_index) || value != std::floor(value))
    throw SceneError(program_.document.file, written_at(program_, node),
                     fmt::format("an index or bound is {:g}; expected a whole number up to {:g}",
                                 static_cast<double>(value), static_cast<double>(largest_index)));
  return static_cast<long>(value);
}

long Evaluator::whole(std::size_t root) const { return index(nodes_[roots_[root]]); }

void Evaluator::compute(std::size_t place) {
  const NodeData& data = program_.graph[nodes_[place]];
  long double& value = values_[place];
  switch (data.op) {
    case Op::number:
      value = data.value;
      return;
    case Op::parameter:
      value = parameters_[static_cast<std::size_t>(data.a)][0];
      return;
    case Op::loop_index:
      value = static_cast<long double>(loops_[static_cast<std::size_t>(data.a)]);
      return;
    case Op::time:
      value = time_;
      return;
    case Op::element: {
      const auto& array = parameters_[static_cast<std::size_t>(data.a)];
      const long i = index(data.b);
      if (i < 1 || i > static_cast<long>(array.size()))
        throw SceneError(
            program_.document.file, written_at(program_, nodes_[place]),
            fmt::format("{}[{}] is outside 1..{}",
                        program_.symbols.parameters[static_cast<std::size_t>(data.a)].name, i, array.size()));
      value = array[static_cast<std::size_t>(i - 1)];
      return;
    }
    case Op::coordinate:
      value = leaf_ ? leaf_(data) : 0.0L;
      return;
    case Op::list:
    case Op::sum:
    case Op::scale:
    case Op::multiplier:
      value = 0.0L;
      return;
    default:
      break;
  }
  if (data.op == Op::table) {
    const LookupTable& table = program_.graph.tables()[static_cast<std::size_t>(data.c / LookupTable::width)];
    value = table.value(static_cast<double>(values_[at(data.a)]), data.c % LookupTable::width);
    return;
  }
  const long double b = arity(data.op) == 2 ? values_[at(data.b)] : 0.0L;
  value = computed(data, values_[at(data.a)], b);
}

void Evaluator::evaluate() {
  if (started_) {
    for (const std::size_t place : changing_) compute(place);
    return;
  }
  for (std::size_t i = 0; i < nodes_.size(); ++i) compute(i);
  started_ = true;
}

Node Evaluator::undefined() const {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (std::isfinite(static_cast<double>(values_[i]))) continue;
    return nodes_[i];  // ascending, so its arguments are finite
  }
  return none;
}

std::string Evaluator::arguments_of(Node node) const {
  const NodeData& data = program_.graph[node];
  std::string text;
  if (arity(data.op) >= 1) text = fmt::format("{:g}", static_cast<double>(values_[at(data.a)]));
  if (arity(data.op) == 2) text += fmt::format(" and {:g}", static_cast<double>(values_[at(data.b)]));
  return text;
}

}  // namespace diracstep::scene_compiler
