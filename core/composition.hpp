#pragma once

#include <span>

namespace diracstep {

/// Fractions γ_1 … γ_s of the step size that raise a self-adjoint step of order 2 to `order`; their sum is 1
/// and they are palindromic.  Order 2 is the single step; 4 is Suzuki's (5 stages); 6 and 8 are those of
/// Kahan and Li (9 and 17), as in Hairer, Lubich, Wanner, Geometric Numerical Integration, V.3. Throws Misuse
/// for any other order.
std::span<const double> composition_fractions(int order);

}  // namespace diracstep
