#pragma once

#include <array>

namespace diracstep {

/// When an iteration x ← x − P⁻¹F(x) ends.
struct ContractionLimits {
  double tolerance;    ///< F is zero below it, entries in units of the scales of their blocks
  int max_iterations;  ///< given up where its rate promises more
};

/// How it ended.
struct Contraction {
  bool solved = false;
  bool nearer = false;  ///< F is not larger than at the guess
  int iterations = 0;
  std::array<double, 4> residual_norms{};  ///< of each block, unscaled
};

}  // namespace diracstep
