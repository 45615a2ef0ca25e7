#pragma once

#include <cmath>
#include <diracstep/core/types.hpp>

namespace diracstep {

/// Largest absolute entry; 0 where there is none.
inline double max_norm(ConstColumnsRef x) { return x.size() == 0 ? 0.0 : x.lpNorm<Eigen::Infinity>(); }

/// A size of terms to measure residuals by: positive and finite, 1 where none is known.
inline double usable_scale(double scale) { return scale > 0.0 && std::isfinite(scale) ? scale : 1.0; }

}  // namespace diracstep
