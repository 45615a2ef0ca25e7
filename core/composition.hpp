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
///   8      21   the same
///   10     35   the same; also Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., V.3
///
/// Derived for steps of order 2, whose order conditions contain those of every self-adjoint step.  At orders
/// 6 and 8 the usual 9 and 17 stages of Kahan and Li take more work for the same error: with s the stages and
/// E the 2-norm of the coefficients of the first terms that are wrong, s E^{1/order} is 3.9 here against 5.2,
/// and 5.8 against 7.3.  Throws Misuse for any other order.
std::span<const double> composition_fractions(int order);

}  // namespace diracstep
