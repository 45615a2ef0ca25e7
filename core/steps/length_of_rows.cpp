#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/steps/length_of_rows.hpp>

namespace diracstep {

double length_of_rows(const Scene& scene) {
  double largest = 0.0;
  if (scene.start.q.size() != scene.storage_size()) return largest;
  for (const auto& rows : scene.constraints) {
    if (!rows->holonomic() || rows->constant()) continue;
    Vector a(rows->pattern().nonzeros()), b(rows->rows()), curvature(rows->curvature_pattern().nonzeros());
    rows->coefficients(scene.start.time, scene.start.q, a, b);
    rows->annihilator_derivative(scene.start.time, scene.start.q, Vector::Ones(rows->rows()), curvature);
    const double length = max_norm(a) / max_norm(curvature);
    if (std::isfinite(length)) largest = std::max(largest, length);
  }
  return largest;
}

}  // namespace diracstep
