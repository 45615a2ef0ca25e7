#include <fmt/format.h>

#include <diracstep/scene_format/compiler/size_limits.hpp>
#include <diracstep/scene_format/loader/coordinate_layout.hpp>

namespace diracstep {

using scene_compiler::Evaluator;
using scene_compiler::Node;
using scene_compiler::SceneError;

CoordinateLayout::CoordinateLayout(const scene_compiler::SceneProgram& program,
                                   const scene_compiler::ParameterValues& parameters, bool named) {
  const long max_coordinates = static_cast<long>(scene_compiler::size_limits().coordinates);
  long total = 0;
  for (std::size_t f = 0; f < program.symbols.families.size(); ++f) {
    const auto& symbol = program.symbols.families[f];
    Family family{symbol.name, symbol.loops.size(), symbol.cyclic};
    long elements = 1;
    for (std::size_t k = 0; k < symbol.loops.size(); ++k) {
      const auto& loop = program.symbols.loops[static_cast<std::size_t>(symbol.loops[k])];
      Evaluator bounds(program, parameters, {loop.first, loop.last});
      bounds.evaluate();
      family.first[k] = bounds.whole(0);
      family.count[k] = bounds.whole(1) - bounds.whole(0) + 1;
      const auto& place = program.document.coordinates[f].place;
      if (family.count[k] < 1)
        throw SceneError(
            program.document.file, place,
            fmt::format("the range {}..{} of '{}' is empty", bounds.whole(0), bounds.whole(1), symbol.name));
      if (family.count[k] > max_coordinates || (elements *= family.count[k]) + total > max_coordinates)
        throw SceneError(program.document.file, place,
                         fmt::format("more than {} coordinates, the limit", max_coordinates));
    }
    total += elements;
    families_.push_back(std::move(family));
  }
  dimension_ = static_cast<int>(total);
  std::size_t begin = 0;
  for (std::size_t end = 1; end <= families_.size(); ++end) {
    const bool same = end < families_.size() && families_[end].loops > 0 &&
                      families_[end].loops == families_[begin].loops &&
                      families_[end].first == families_[begin].first &&
                      families_[end].count == families_[begin].count;
    if (same) continue;
    place_group(begin, end);
    begin = end;
  }
  if (named) place_names();
}

void CoordinateLayout::place_names() {
  names_.resize(static_cast<std::size_t>(dimension_));
  for (std::size_t f = 0; f < families_.size(); ++f)
    for (long i = 0; i < count(static_cast<int>(f)); ++i) {
      const auto index = element(static_cast<int>(f), i);
      names_[static_cast<std::size_t>(position(static_cast<int>(f), index))] =
          name(static_cast<int>(f), index);
    }
}

void CoordinateLayout::place_group(std::size_t begin, std::size_t end) {
  const long base = begin == 0 ? 0
                               : families_[begin - 1].base - (families_[begin - 1].stride - 1) +
                                     families_[begin - 1].stride * families_[begin - 1].count[0] *
                                         families_[begin - 1].count[1];
  for (std::size_t f = begin; f < end; ++f) {
    families_[f].base = base + static_cast<long>(f - begin);
    families_[f].stride = static_cast<long>(end - begin);
  }
}

long CoordinateLayout::count(int number) const { return family(number).count[0] * family(number).count[1]; }

std::array<long, 2> CoordinateLayout::element(int number, long i) const {
  const Family& f = family(number);
  return {f.first[0] + i / f.count[1], f.first[1] + i % f.count[1]};
}

int CoordinateLayout::position(int number, std::array<long, 2> index) const {
  const Family& f = family(number);
  long place = 0;
  for (std::size_t k = 0; k < f.loops; ++k) {
    long i = index[k] - f.first[k];
    if (f.cyclic) i = (i % f.count[k] + f.count[k]) % f.count[k];
    if (i < 0 || i >= f.count[k]) return -1;
    place = place * f.count[k] + i;
  }
  return static_cast<int>(f.base + f.stride * place);
}

std::string CoordinateLayout::name(int number, std::array<long, 2> index) const {
  const Family& f = family(number);
  std::string name = f.name;
  for (std::size_t k = 0; k < f.loops; ++k) name += fmt::format("_{}", index[k]);
  return name;
}

}  // namespace diracstep
