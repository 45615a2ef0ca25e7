#pragma once

namespace diracstep {

/// y_i = base_i + Σ_k weights[s i + k] x_k for i, k < s, where x and y are s columns of n numbers; base_i
/// stands i · stride numbers behind base, so that a stride of 0 adds the same column to each sum.  y may be
/// the base.
using StageSum = void (*)(const double* x, const double* weights, const double* base, int stride, double* y);

/// The function for columns of n numbers and s stages, its loops unrolled for these sizes; null above n = 8
/// or s = 6.
StageSum stage_sum(int n, int s);

}  // namespace diracstep
