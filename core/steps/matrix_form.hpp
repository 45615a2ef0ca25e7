#pragma once

#include <diracstep/core/system/scene.hpp>
#include <string>

namespace diracstep {

/// Stands for a limit of unknowns: full or sparse matrices as measured, see matrix_form().
inline constexpr int as_measured = -1;

/// A scene of more unknowns n + m is large, and default_method() looks for an explicit step: the limit given
/// for full matrices, or 40.
constexpr int large_from(int limit) { return limit >= 0 ? limit : 40; }

/// Whether the systems of a scene take full matrices or sparse ones, and why.
struct MatrixForm {
  bool full;
  std::string reason;
};

/// With a limit of 0 or more: full matrices up to so many unknowns n + m.  As measured: full ones for fewer
/// than 12 unknowns; from there on for as long as the triangular factors of the saddle-point matrix
/// (∂²L, Aᵀ; A, 0) would fill more than half of a full one, up to 2000 unknowns.  On bands, arrows, dense
/// blocks and random matrices of 8 to 192 unknowns KLU and plain elimination take the same time where the
/// factors fill 0.5 to 0.65, whatever the size (bench/dense_or_sparse); the systems of s stages are as full.
MatrixForm matrix_form(const Scene& scene, int limit);

}  // namespace diracstep
