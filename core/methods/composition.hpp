#pragma once

#include <array>
#include <span>

namespace diracstep {

/// The orders there are compositions of.
inline constexpr std::array<int, 5> composition_orders{2, 4, 6, 8, 10};

/// Fractions γ_1 … γ_s of the step size that raise a self-adjoint step to `order`; their sum is 1 and they
/// are palindromic.
///
///   order   s   source
///   2       1   the step itself
///   4       5   Suzuki, Phys. Lett. A 146 (1990)
///   6      11   Sofroniou and Spaletta, Optim. Methods Softw. 20 (2005), 597-613
///   8      17   Kahan and Li, Math. Comp. 66 (1997)
///   10     35   Sofroniou and Spaletta, the same
///
/// also in Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., V.3.  Derived for steps of order
/// 2, whose order conditions contain those of every self-adjoint step.  Measured: at order 6 the 9 stages of
/// Kahan and Li take up to a third more time for the same error; at order 8 the 21 stages of Sofroniou and
/// Spaletta take the same time.  Throws Misuse for any other order.
std::span<const double> composition_fractions(int order);

}  // namespace diracstep
