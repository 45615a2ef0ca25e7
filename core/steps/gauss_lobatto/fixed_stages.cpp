#include <diracstep/core/steps/gauss_lobatto/fixed_stages.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_matrices.hpp>
#include <diracstep/core/steps/gauss_lobatto/stages_of_size.hpp>

namespace diracstep {

namespace {

using detail::Stages;

template <int n, int m>
std::unique_ptr<FixedStages> of_stages(const StageArrays& arrays) {
  switch (arrays.points->gauss.cols()) {
    case 1:
      return std::make_unique<Stages<n, m, 1>>(arrays);
    case 2:
      return std::make_unique<Stages<n, m, 2>>(arrays);
    case 3:
      return std::make_unique<Stages<n, m, 3>>(arrays);
    case 4:
      return std::make_unique<Stages<n, m, 4>>(arrays);
    case 5:
      return std::make_unique<Stages<n, m, 5>>(arrays);
    case 6:
      return std::make_unique<Stages<n, m, 6>>(arrays);
    default:
      return nullptr;
  }
}

}  // namespace

std::unique_ptr<FixedStages> fixed_stages(const StageArrays& arrays) {
  const int n = arrays.lagrangian->dimension(), m = arrays.rows == nullptr ? 0 : arrays.rows->rows();
  switch (10 * n + m) {
    case 10:
      return of_stages<1, 0>(arrays);
    case 20:
      return of_stages<2, 0>(arrays);
    case 21:
      return of_stages<2, 1>(arrays);
    case 30:
      return of_stages<3, 0>(arrays);
    case 31:
      return of_stages<3, 1>(arrays);
    case 32:
      return of_stages<3, 2>(arrays);
    case 40:
      return of_stages<4, 0>(arrays);
    case 41:
      return of_stages<4, 1>(arrays);
    case 42:
      return of_stages<4, 2>(arrays);
    default:
      return nullptr;
  }
}

}  // namespace diracstep
