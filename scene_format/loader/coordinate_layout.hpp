#pragma once

#include <array>
#include <diracstep/scene_format/compiler/evaluator.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// Where the coordinates of each family stand in q.  Families repeated over the same range that follow each
/// other in the file are interleaved, so that the coordinates of one body are neighbours: x_1 y_1 x_2 y_2 …
class CoordinateLayout {
 public:
  /// More coordinates than SizeLimits::coordinates throw SceneError.  Without `named` names() stays empty,
  /// which is what takes memory.
  CoordinateLayout(const scene_compiler::SceneProgram& program,
                   const scene_compiler::ParameterValues& parameters, bool named = true);

  int dimension() const { return dimension_; }
  const std::vector<std::string>& names() const { return names_; }

  /// Number of elements of a family, and the loop values of each in turn.
  long count(int family) const;
  std::array<long, 2> element(int family, long number) const;

  /// The place of an element in q; -1 where it is out of range.
  int position(int family, std::array<long, 2> index) const;
  std::string name(int family, std::array<long, 2> index) const;

 private:
  struct Family {
    std::string name;
    std::size_t loops = 0;
    bool cyclic = false;
    std::array<long, 2> first{0, 0}, count{1, 1};
    long base = 0, stride = 1;
  };
  const Family& family(int number) const { return families_[static_cast<std::size_t>(number)]; }
  void place_group(std::size_t begin, std::size_t end);
  void place_names();

  int dimension_ = 0;
  std::vector<Family> families_;
  std::vector<std::string> names_;
};

}  // namespace diracstep
