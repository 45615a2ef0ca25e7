#include <fmt/format.h>

#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/loader/turns.hpp>

namespace diracstep {

using namespace scene_compiler;

Turns::Turns(const SceneProgram& program, const ParameterValues& parameters, std::vector<int> loops,
             std::size_t counting)
    : program_(program),
      loops_(std::move(loops)),
      counting_(counting),
      values_(loops_.size()),
      most_(static_cast<long>(size_limits().repeated)) {
  for (const int id : loops_) {
    const Loop& loop = program.symbols.loops[static_cast<std::size_t>(id)];
    bounds_.emplace_back(program, parameters, std::vector<Node>{loop.first, loop.last});
  }
}

void Turns::set(Evaluator& formula) const {
  for (std::size_t k = 0; k < loops_.size(); ++k) formula.set_loop(loops_[k], values_[k]);
}

std::string Turns::text() const {
  std::string text;
  for (std::size_t k = 0; k < loops_.size(); ++k)
    text += fmt::format("{}{} = {}", k == 0 ? ", at " : ", ",
                        program_.symbols.loops[static_cast<std::size_t>(loops_[k])].variable, values_[k]);
  return text;
}

void Turns::refuse() const {
  throw SceneError(program_.document.file, {},
                   fmt::format("more than {} repeated elements, the limit", most_));
}

void Turns::descend(std::size_t depth, const std::function<void(long)>& visit) {
  if (++turns_ > most_ + 1) refuse();  // the first one is that of the whole
  if (depth == loops_.size()) {
    visit(rows_);
  } else {
    for (std::size_t k = 0; k < depth; ++k) bounds_[depth].set_loop(loops_[k], values_[k]);
    bounds_[depth].evaluate();
    const long first = bounds_[depth].whole(0), last = bounds_[depth].whole(1);
    if (last - first >= most_ - turns_ + 1) refuse();
    for (values_[depth] = first; values_[depth] <= last; ++values_[depth]) descend(depth + 1, visit);
  }
  if (depth == counting_) ++rows_;
}

}  // namespace diracstep
