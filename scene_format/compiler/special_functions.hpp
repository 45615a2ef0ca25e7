#pragma once

namespace diracstep::scene_compiler {

/// E − e sin E = t, reduced to one turn; NaN unless 0 ≤ e < 1.
long double kepler_anomaly(long double t, long double e);

/// The Jacobi elliptic functions of modulus k, by the arithmetic-geometric mean; NaN unless 0 ≤ k < 1.
struct JacobiElliptic {
  long double sn, cn, dn;
};
JacobiElliptic jacobi_elliptic(long double u, long double k);

}  // namespace diracstep::scene_compiler
